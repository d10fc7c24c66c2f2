"""The objectives of a search: ride metrics, metrics of any channel, smooth ones, functions of metrics, targets."""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._display import plus_minus
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric, MetricValues, current_name
from jaxdamp.tune.limits import Ends, Limits
from jaxdamp.tune.smooth import exact_counterpart
from jaxdamp.vehicles import AbstractVehicle, is_stationary


Function: TypeAlias = Callable[[Mapping[str, Scalar]], Scalar]


class Objective(NamedTuple):
    """The objectives of a search and the metrics that they need."""

    names: tuple[str, ...]  # of the objectives, each a metric or a function; one for `minimise`, several for `pareto`
    functions: tuple[tuple[str, Function], ...]  # of the metrics, for those objectives that are no metrics
    metrics: tuple[Metric, ...]  # all metrics of the search, those for information included
    beside: tuple[Metric, ...] = ()  # the true peaks and settling times that are shown beside smooth ones

    @property
    def name(self) -> str:
        """The name of the first objective."""
        return self.names[0]

    @property
    def function(self) -> Function | None:
        """The function of the first objective; None if it is a metric."""
        return dict(self.functions).get(self.name)

    def of(self, values: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """The metrics, and the values of the functions."""
        metrics = MetricValues(values)
        return {**values, **{name: function(metrics) for name, function in self.functions}}

    def of_each(self, values: Mapping[str, Array]) -> dict[str, Array]:
        """The same of several vehicles or scenarios, along the first axis of each value."""
        return jax.vmap(self.of)(dict(values))

    def units(self, vehicle: AbstractVehicle) -> dict[str, str]:
        """Unit of each metric; that of a function is unknown."""
        return {m.name: m.unit(vehicle.units) for m in self.metrics} | {name: "" for name, _ in self.functions}


@final
class _NameRecorder(Mapping[str, Scalar]):
    """Metrics with the value one, which record the names that a function uses."""

    def __init__(self, names: Sequence[str]) -> None:
        self.values_of, self.names = MetricValues(dict.fromkeys(names, jnp.ones(()))), dict[str, None]()

    def __getitem__(self, name: str) -> Scalar:
        value = self.values_of[name]
        self.names[current_name(name, self.values_of.keys())] = None
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_of)

    def __len__(self) -> int:
        return len(self.values_of)


def objective_of(
    wanted: Sequence[str | Metric | Function],
    vehicle: AbstractVehicle,
    more: Sequence[str | Metric],
    limited: Sequence[str],
    *,
    white: bool,
    argument: str = "metric",
) -> Objective:
    """The objectives of a search on a road."""
    extra = vehicle.chosen_metrics(list(more), "metrics", white=white) if more else []
    given = [one for one in wanted if isinstance(one, Metric)]
    extra += vehicle.chosen_metrics(given, argument) if given else []
    true_peaks = tuple(exact for exact in map(exact_counterpart, extra) if exact is not None)
    extra += true_peaks
    available = _available(vehicle, extra, white=white)
    names, functions, used = [], {}, []
    for one in wanted:
        if isinstance(one, str | Metric):
            names.append(current_name(one, available) if isinstance(one, str) else one.name)
            used.append(names[-1])
            continue
        names.append(_name(one))
        functions[names[-1]] = one
        used += _metrics_used_by(one, list(available), argument)
    _refuse_same_names(names, functions, available, argument)
    _refuse_unusable(available, {argument: used, "limits": limited, "metrics": [m.name for m in extra]})
    used += [m.name for m in extra]
    # Further metrics for information: those without weightings, counts and means, which may be negative.
    chosen = [m for m in available.values() if m.name in (*used, *limited) or _for_information(m)]
    return Objective(tuple(names), tuple(functions.items()), tuple(chosen), true_peaks)


def _available(vehicle: AbstractVehicle, extra: Sequence[Metric], *, white: bool) -> dict[str, Metric]:
    """All metrics by name; on a white road those that follow from an RMS."""
    every = (*vehicle.ride_metrics, *extra)
    return {m.name: m for m in every if not white or is_stationary(m, vehicle.layout.by_name)}


def _refuse_same_names(
    names: Sequence[str], functions: Mapping[str, Function], available: Mapping[str, Metric], argument: str
) -> None:
    """Refuse two objectives of one name, and functions with the name of a metric."""
    for name in functions:
        if name in available:
            remedy = "Give the function another name."
            _checks.refuse(argument, "have a name that no metric has", repr(name), remedy)
    if len(set(names)) < len(names):
        remedy = "Functions need different names: use `def` instead of `lambda`."
        _checks.refuse(argument, "have different names", names, remedy)


def _refuse_unusable(available: Mapping[str, Metric], names_by_argument: Mapping[str, Sequence[str]]) -> None:
    """Refuse metrics that are unknown, or have no derivative."""
    for argument, names in names_by_argument.items():
        for name in names:
            _checks.one_of(argument, name, available)
            if not available[name].statistic.differentiable:
                limit = "limit `Metric('relative_tyre_load', 'minimum')` to (-0.95, None)."
                remedy = f"Tune on the dynamic load coefficient; {limit}"
                if argument == "metrics":
                    remedy = "Leave it out; `Ride` and `simulate` give it for `result.start` and `result.vehicle`."
                _checks.refuse(argument, "have a slope", f"{name!r}, a count", remedy)


def goal_objective(
    one: str | Metric | Function,
    vehicle: AbstractVehicle,
    *,
    white: bool,
    argument: str = "metric",
    metrics: Sequence[str] = (),
) -> str | Metric | Function:
    """An objective with "comfort", "travel" and "grip" spelled out: the metric, or the mean of several."""
    if not isinstance(one, str) or one in metrics:
        return one
    names = metrics_of(argument, one, vehicle, white=white)
    return names[0] if len(names) == 1 else _mean_of(one, tuple(names))


@functools.cache  # the same function for the same names, so that programs are compiled once
def _mean_of(word: str, names: tuple[str, ...]) -> Function:
    """The mean of several metrics, under a short name."""

    def mean_of_all(m: Mapping[str, Scalar]) -> Scalar:
        return sum((m[name] for name in names), jnp.zeros(())) / len(names)

    mean_of_all.__name__ = word
    return mean_of_all


def goal_limits(
    limits: Limits | None,
    vehicle: AbstractVehicle,
    *,
    white: bool,
    metrics: Sequence[str] = (),
    argument: str = "limits",
) -> Limits | None:
    """Limits with "comfort", "travel" and "grip" spelled out: each metric of a goal gets its limit.

    Arguments:
        limits: by metric or goal; anything else is given back.
        vehicle: whose metrics are meant.
        white: for stationary rides on a white road.
        metrics: names that are no metrics of the vehicle.
        argument: name of `limits` in messages.

    Raises:
        ValueError: an unknown name, or two limits of one metric.
    """
    if not isinstance(limits, Mapping):
        return limits
    spelled: dict[str | Metric, Ends] = {}
    given: dict[str | Metric, str | Metric] = {}
    for one, span in limits.items():
        names = (
            metrics_of(argument, one, vehicle, white=white) if isinstance(one, str) and one not in metrics else [one]
        )
        for name in names:
            if name in given:
                both = f"{given[name]!r} and {one!r}, which both limit {name}"
                _checks.refuse(argument, "limit each metric once", both, "Write the names of all metrics.")
            spelled[name], given[name] = span, one
    return spelled


def metrics_of(argument: str, one: str, vehicle: AbstractVehicle, *, white: bool) -> list[str]:
    """The metrics of a name, which may be a short one; an unknown name is refused."""
    current = current_name(one, vehicle.metric_words)
    _checks.one_of(argument, current, vehicle.metric_words)
    return vehicle.goal_metrics(current, white=white)


def check_objective(argument: str, one: object, remedy: str) -> None:
    """Refuse what is no objective."""
    if not isinstance(one, str | Metric) and not callable(one):
        must = "be the name of a ride metric, a Metric, or a function of the metrics"
        _checks.refuse(argument, must, _checks.described(one), remedy)


def _for_information(metric: Metric) -> bool:
    return metric.weighting is None and metric.statistic.differentiable and not metric.statistic.signed


def _name(function: object) -> str:
    name = getattr(function, "__name__", "")
    return name if name.isidentifier() else "objective"


def _metrics_used_by(function: Function, names: Sequence[str], argument: str) -> list[str]:
    """The metrics that a function uses, after a check that it returns one number."""
    used = _NameRecorder(names)
    value = function(used)
    if np.shape(value) != () or not np.issubdtype(jnp.result_type(value), np.floating):
        _checks.refuse(argument, "give one number", f"{_checks.described(value)} from {_name(function)!r}")
    return list(used.names)


@final
class Targets:
    """The mean square distance of metrics from their targets, in tolerances: an objective for `minimise`.

    It is at most 1 if all targets are met within their tolerances on average, and 0 if all are met exactly.

    Arguments:
        targets: `{metric: (value, tolerance)}` in the unit of the metric.

    Raises:
        ValueError: no target, or one that is no pair of finite numbers with a positive tolerance.

    >>> import jax.numpy as jnp
    >>> targets = Targets({"rms_sprung_acceleration": (0.9, 0.05), "rms_dynamic_tyre_load": (1450.0, 100.0)})
    >>> values = {"rms_sprung_acceleration": jnp.asarray(1.0), "rms_dynamic_tyre_load": jnp.asarray(1450.0)}
    >>> round(float(targets(values)), 6)
    2.0
    """

    __name__ = "targets"

    def __init__(self, targets: Mapping[str | Metric, tuple[float, float]]) -> None:
        if not isinstance(targets, Mapping) or not targets:
            must = "be a mapping of one or more metrics to a value and a tolerance"
            remedy = "Write `{'rms_sprung_acceleration': (0.9, 0.05)}`."
            _checks.refuse("targets", must, _checks.described(targets), remedy)
        self.metrics = [metric for metric in targets if isinstance(metric, Metric)]
        self.values = {m.name if isinstance(m, Metric) else m: _pair(m, pair) for m, pair in targets.items()}

    def __eq__(self, other: object) -> bool:
        """Whether the same targets are given: programs of equal ones are compiled once."""
        return isinstance(other, Targets) and (self.metrics, self.values) == (other.metrics, other.values)

    def __hash__(self) -> int:
        return hash((tuple(self.metrics), *self.values.items()))

    def __repr__(self) -> str:
        return f"Targets({', '.join(f'{name} {v:g} ± {tol:g}' for name, (v, tol) in self.values.items())})"

    def __call__(self, metrics: Mapping[str, Scalar]) -> Scalar:
        """The mean square distance from the targets, in tolerances."""
        squares = [((metrics[name] - value) / tolerance) ** 2 for name, (value, tolerance) in self.values.items()]
        return sum(squares[1:], squares[0]) / len(squares)

    def note(self, name: str, value: float) -> str:
        """Whether a metric meets its target, in words; empty for one that has none."""
        if name not in self.values:
            return ""
        target, tolerance = self.values[name]
        off = (value - target) / tolerance
        met = "met" if abs(off) <= 1.0 else f"missed by {abs(off):.1f} tolerances"
        return f"target {plus_minus(target, tolerance)}, {met}"


def _pair(metric: str | Metric, pair: tuple[float, float]) -> tuple[float, float]:
    label = f"targets[{metric.name if isinstance(metric, Metric) else metric!r}]"
    numbers = np.shape(pair) == (2,) and np.asarray(pair).dtype.kind in "iuf"
    if not numbers or not np.all(np.isfinite(pair)) or not pair[1] > 0:
        _checks.refuse(label, "be a value and a positive tolerance", pair, "Write (1.2, 0.05).")
    return float(pair[0]), float(pair[1])

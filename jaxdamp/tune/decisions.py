"""`compare_dampers`: the difference between dampers in ride metrics, with its uncertainty."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol, Unpack, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._display import plus_minus
from jaxdamp._field_types import check_module
from jaxdamp._jacobian import with_jacobian
from jaxdamp._progress import Progress
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column, Contents, Table, plain, typeset_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp.dampers import AbstractDamper
from jaxdamp.metrics import Metric
from jaxdamp.parameters import FreeParameters, free_parameters
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Ride
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.scenarios import Road, Scenarios, check_roads
from jaxdamp.tune.settings import RUN, Run
from jaxdamp.tune.task import outside_ranges
from jaxdamp.vehicles import AbstractVehicle


NO_EFFECT = 1e-6  # change of a metric per 100 % of a parameter, relative to its size, that counts as none


@runtime_checkable
class _Estimate(Protocol):
    """What is read of an estimate."""

    @property
    def name(self) -> str: ...
    @property
    def tied(self) -> Sequence[str]: ...


@runtime_checkable
class FittedLaw(Protocol):
    """A law with uncertain parameters, as `identify.fit` gives it."""

    @property
    def law(self) -> AbstractDamper:
        """The law."""
        ...

    @property
    def parameters(self) -> Sequence[_Estimate]:
        """The estimates, each with its `name` and the names of the numbers `tied` to it."""
        ...

    @property
    def covariance(self) -> Float[np.ndarray, "free free"]:
        """Of the estimates, in their units and order; infinite for those that the records do not determine."""
        ...


class Difference(NamedTuple):
    """The change of a metric from the first damper to another one, relative to the first."""

    damper: str  # name of the other damper
    metric: str  # name of the metric
    change: float  # mean over the roads [%]
    from_parameters: float  # standard error due to the fitted parameters [%]
    from_roads: float  # standard error due to the choice of roads, the same for both dampers [%]
    margin: float  # half the width of the 95 % interval from both sources [%]

    @property
    def significant(self) -> bool:
        """Whether the interval excludes zero."""
        return abs(self.change) > self.margin

    @property
    def sentence(self) -> str:
        """The difference in words."""
        parts = f"± {self.from_parameters:.2g} % from the fitted parameters, ± {self.from_roads:.2g} % from the roads"
        less = "less" if self.change < 0 else "more"
        size = f"{plus_minus(abs(self.change), self.margin)} % {less} {self.metric}"
        verdict = "" if self.significant else ", which may be none"
        return f"{self.damper} has {size}{verdict} (95 %; standard errors {parts})."


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class DamperComparison(AbstractResult):
    """Ride metrics of several dampers on the same roads, with their uncertainties.

    Attributes:
        values: each metric of each damper on each road, by damper and metric.
        parameter_errors: standard error of the mean of each metric due to the fitted parameters, likewise.
        road_errors: standard error of the mean of each metric due to the choice of roads, likewise.
        differences: from the first damper to each other one.
        units: of the metrics.
        warnings: parameters that no record determines but that matter here, and laws used outside their records.
    """

    values: dict[str, dict[str, Float[np.ndarray, " roads"]]]
    parameter_errors: dict[str, dict[str, float]]
    road_errors: dict[str, dict[str, float]]
    differences: tuple[Difference, ...]
    units: dict[str, str]
    warnings: tuple[str, ...]

    @property
    def summary(self) -> str:
        """The differences of the first metric in words."""
        first = next(iter(self.units))
        return " ".join(d.sentence for d in self.differences if d.metric == first)

    def difference(self, metric: str, damper: str | None = None) -> Difference:
        """The difference in a metric; of the second damper, if none is named."""
        _checks.one_of("metric", metric, self.units)
        damper = list(self.values)[1] if damper is None else damper
        _checks.one_of("damper", damper, list(self.values)[1:])
        return next(d for d in self.differences if (d.metric, d.damper) == (metric, damper))

    def table(self) -> Table:
        """Each metric of each damper with both standard errors, and the change from the first one."""
        names = ["metric", "unit", "damper", "mean", "from parameters", "from roads"]
        columns = [*map(Column, names), Column("change", "%", "+.2f"), Column("95 %", "%", ".2f"), Column("note")]
        changes = {(d.damper, d.metric): d for d in self.differences}
        rows = []
        for metric, unit in self.units.items():
            for damper, values in self.values.items():
                errors = self.parameter_errors[damper][metric], self.road_errors[damper][metric]
                d = changes.get((damper, metric))
                more = (None, None, "") if d is None else (d.change, d.margin, "" if d.significant else "may be none")
                rows.append((metric, typeset_unit(unit, "–"), damper, float(values[metric].mean()), *errors, *more))
        return Table("Ride metrics with standard errors", tuple(columns), tuple(rows))

    def content(self) -> Contents:
        """All numbers with units and words, ready for JSON; numbers that are not finite are None."""
        differences = [plain(d) | {"significant": bool(d.significant)} for d in self.differences]
        return self._data("units", "values", "parameter_errors", "road_errors") | {"differences": differences}

    plot = drawn_by("damper_comparison", "The change of each metric with its interval, and the share of each source.")


class _DamperMetrics(NamedTuple):
    """Metrics of one damper on each road, and the variance of their means due to its parameters."""

    values: Float[np.ndarray, "roads metrics"]
    variance: Float[np.ndarray, " metrics"]


@of_known_numbers
@with_defaults(RUN)
def compare_dampers(
    dampers: Mapping[str, AbstractDamper | FittedLaw],
    vehicle: Callable[[AbstractDamper], AbstractVehicle],
    roads: Sequence[AbstractRoad] | WhiteRoad,
    *,
    metrics: Sequence[str | Metric] | None = None,
    **run: Unpack[Run],
) -> DamperComparison:
    """Compare dampers in ride metrics on the same roads, with standard errors and 95 % intervals of the differences.

    The uncertainty has two sources. The parameters of a fitted law are uncertain: their covariance is carried to each
    metric by exact derivatives (to first order). A random road is one of many: the scatter from road to road gives the
    standard error of a mean. All dampers drive over the same roads, so most of this scatter cancels in a difference.
    The errors of different fits are taken as independent. A white road has no scatter. Neither source includes a law of
    the wrong form: look at the residuals of the fits, and at `warnings` on the range of their records.

    Arguments:
        dampers: two or more by name, the first of which is the one to compare with: results of `identify.fit`, or laws,
            whose parameters then count as exact.
        vehicle: gives the vehicle for a law, such as `vehicles.presets.quarter_car_000`.
        roads: two or more roads, such as one class with several seeds; or `roads.white(...)`.
        metrics: as in `Ride`; all ride metrics if left out, but counts and means.
        run: `duration`, `dt` and `engine` of each run, as in `simulate` (see `Run`).

    Raises:
        ValueError: fewer than two dampers or roads; estimates that are no parameters of their law; what `Ride` refuses.

    >>> from jaxdamp import dampers, roads, vehicles
    >>> laws = {"A": dampers.Linear(2500.0), "B": dampers.Linear(4500.0)}
    >>> compared = compare_dampers(laws, vehicles.presets.quarter_car_000, roads.white("C", 20.0))
    >>> round(compared.difference("rms_sprung_acceleration").change, 2)
    -8.68
    """
    _check(dampers, vehicle, roads)
    listed = [roads] if isinstance(roads, WhiteRoad) else list(roads)
    by_damper, warnings, units, first = {}, [], {}, None
    with Progress("Comparing dampers") as shown:
        for number, (name, damper) in enumerate(dampers.items()):
            shown(f"{name}, {number + 1} of {len(dampers)}")
            car = vehicle(damper if isinstance(damper, AbstractDamper) else damper.law)
            check_module("vehicle", car, (AbstractVehicle,), "compare_dampers(dampers, vehicle, roads)")
            sampled = listed if first is None else listed[:1]  # the same roads for all dampers
            ride = Scenarios(sampled).ride(car, metrics=_chosen(car, listed, metrics), **run)
            first = ride if first is None else first
            ride = eqx.tree_at(lambda one: one.roads, ride, first.roads)
            units = {m.name: m.unit(car.units) for m in ride.metrics}
            by_damper[name], notes = _metrics_of(damper, vehicle, ride)
            beyond, _ = outside_ranges(car, [lambda one, ride=ride: Ride(one, listed[0], metrics=ride.metrics, **run)])
            warnings += [f"{name}: {note}" for note in (*notes, *(f"On the first road{text}" for text in beyond))]
    return _comparison(by_damper, units, warnings, len(listed))


def _comparison(
    by_damper: Mapping[str, "_DamperMetrics"], units: dict[str, str], warnings: Sequence[str], roads: int
) -> DamperComparison:
    """The metrics of all dampers, and the differences from the first to each other one."""
    order, (first, *others) = list(units), list(by_damper)
    by_metric = {name: dict(zip(order, one.values.T, strict=True)) for name, one in by_damper.items()}
    errors = {name: np.sqrt(one.variance).tolist() for name, one in by_damper.items()}
    return DamperComparison(
        values=by_metric,
        parameter_errors={n: dict(zip(order, one, strict=True)) for n, one in errors.items()},
        road_errors={n: {m: _standard_error(each[m]) for m in order} for n, each in by_metric.items()},
        differences=tuple(
            _difference(name, metric, by_damper[first], by_damper[name], i, roads)
            for name in others
            for i, metric in enumerate(order)
        ),
        units=units,
        warnings=tuple(warnings),
    )


def _check(dampers: object, vehicle: object, roads: object) -> None:
    call = "compare_dampers({'A': fit_a, 'B': fit_b}, vehicle, roads)"
    if not isinstance(dampers, Mapping) or len(dampers) < 2:
        _checks.refuse("dampers", "be two or more by name", _checks.described(dampers), f"The call is `{call}`.")
    for name, damper in dampers.items():
        must = "be a damper law or the result of a fit"
        remedy = "Write a law, such as `dampers.Linear(2500.0)`, or what `identify.fit` returns."
        _checks.instance(f"dampers[{name!r}]", damper, (AbstractDamper, FittedLaw), must, remedy)
    if isinstance(vehicle, AbstractVehicle) or not callable(vehicle):
        remedy = "Write `lambda law: QuarterCar(..., law)`."
        _checks.refuse("vehicle", "be a function from a law to a vehicle", _checks.described(vehicle), remedy)
    if not isinstance(roads, WhiteRoad) and (not isinstance(roads, Sequence) or len(roads) < 2):
        remedy = "Take a road class with several seeds: one road says nothing about the next one."
        _checks.refuse("roads", "be two or more roads, or a white one", _checks.described(roads), remedy)
    check_roads([] if isinstance(roads, WhiteRoad) else roads, call)


def _chosen(car: AbstractVehicle, roads: Sequence[Road], metrics: Sequence[str | Metric] | None) -> list[str | Metric]:
    """The metrics to compare: those asked for, or all that have a derivative and one sign."""
    if metrics is not None:
        return list(metrics)
    available = Ride(car, roads[0]).metrics if isinstance(roads[0], WhiteRoad) else car.ride_metrics
    return [m for m in available if m.statistic.differentiable and not m.statistic.signed]


def _metrics_of(
    damper: AbstractDamper | FittedLaw,
    vehicle: Callable[[AbstractDamper], AbstractVehicle],
    ride: ScenarioRide,
) -> tuple[_DamperMetrics, list[str]]:
    """The metrics of a damper on all roads side by side, with exact derivatives by its estimates."""
    law, estimates = (damper, []) if isinstance(damper, AbstractDamper) else (damper.law, damper.parameters)
    free = free_parameters(law)
    effects = _effects(estimates, free.names)
    order = [m.name for m in ride.metrics]
    values, slopes = _metrics_on_roads(ride, vehicle, free, jnp.asarray(effects), order)
    values, slopes = np.asarray(values, np.float64), np.asarray(slopes, np.float64).mean(axis=0)
    if isinstance(damper, AbstractDamper):
        return _DamperMetrics(values, np.zeros(len(order))), []
    covariance = np.array(damper.covariance, np.float64)
    unknown = ~np.isfinite(np.diag(covariance))
    size = np.abs(effects.T @ np.asarray(free.values, np.float64)) * np.abs(slopes)
    matters = (size > NO_EFFECT * np.abs(values.mean(axis=0))[:, None]) & unknown
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    variance = np.einsum("mi,ij,mj->m", slopes, covariance, slopes)
    variance[matters.any(axis=1)] = np.inf
    notes = [
        f"{e.name} is not determined by its records, and changes {', '.join(np.array(order)[column])}."
        for e, column in zip(estimates, matters.T, strict=True)
        if column.any()
    ]
    return _DamperMetrics(values, variance), notes


def _effects(estimates: Sequence[_Estimate], names: Sequence[str]) -> Float[np.ndarray, "numbers free"]:
    """Change of each number of a law per change of each estimate: one, or a share where the law has a mean."""
    of_wrapper = all(name in names or name.rpartition("[")[0] in names for name in (str(e.name) for e in estimates))
    prefix = "" if of_wrapper else "law."  # of a law on a machine, beside which `Lag(law, ...)` has such paths too
    plain_names = [str(e.name).removeprefix(prefix) for e in estimates]
    effects = np.zeros((len(names), len(estimates)))
    for i, (estimate, name) in enumerate(zip(estimates, plain_names, strict=True)):
        owner = name.rpartition("[")[0]
        by_record = name not in names and owner in names  # one value for each record, of which the law has the mean
        if by_record:
            effects[names.index(owner), i] = 1.0 / sum(other.startswith(f"{owner}[") for other in plain_names)
        elif name in names:
            effects[names.index(name), i] = 1.0
        elif not name.startswith("rig."):  # a test machine takes no part in a ride
            _checks.refuse("dampers", f"have estimates among {', '.join(names)}", repr(estimate.name))
        for tied in (str(other).removeprefix(prefix) for other in estimate.tied):
            if tied in names:
                effects[names.index(tied), i] = 1.0
    return effects


@eqx.filter_jit
def _metrics_on_roads(
    ride: ScenarioRide,
    vehicle: Callable[[AbstractDamper], AbstractVehicle],
    free: FreeParameters,
    effects: Array,
    order: list[str],
) -> tuple[Array, Array]:
    """The metrics on each road (roads, metrics), and their derivatives by the estimates (roads, metrics, estimates)."""

    def metrics(step: Array) -> Array:
        each = ride.of_vehicle(vehicle(free.build(free.values + effects @ step))).each()
        return jnp.stack([each[name] for name in order], axis=-1)

    if not effects.shape[1]:
        values = metrics(jnp.zeros(0))
        return values, jnp.zeros((*values.shape, 0))
    return with_jacobian(metrics)(jnp.zeros(effects.shape[1], free.values.dtype))


def _standard_error(values: Float[np.ndarray, " roads"]) -> float:
    """Of the mean over independent roads; zero for a single, white one."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0


def _difference(name: str, metric: str, first: _DamperMetrics, other: _DamperMetrics, i: int, roads: int) -> Difference:
    """The change of a metric in percent, with both errors to first order and the interval by Student's t."""
    from scipy.special import ndtri, stdtrit

    base, new = first.values[:, i], other.values[:, i]
    ratio = new.mean() / base.mean()
    share = 100.0 / abs(base.mean())
    from_roads = share * _standard_error(new - ratio * base)
    from_parameters = share * float(np.sqrt(other.variance[i] + ratio**2 * first.variance[i]))
    total = float(np.hypot(from_roads, from_parameters))
    # degrees of freedom after Welch and Satterthwaite: only the error from the roads is estimated from a few values
    freedom = (roads - 1) * (total / from_roads) ** 4 if from_roads > 0.0 else np.inf
    factor = float(stdtrit(freedom, 0.975)) if np.isfinite(freedom) else float(ndtri(0.975))
    numbers = 100.0 * (ratio - 1.0), from_parameters, from_roads, factor * total
    return Difference(name, metric, *map(float, numbers))

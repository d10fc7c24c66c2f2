"""`fit_targets`: parameters that meet a table of numbers, such as frequencies, damping ratios and ride metrics."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp import _checks
from jaxdamp._status import Status
from jaxdamp._tables import Column, Table, plain
from jaxdamp._traced import of_known_numbers
from jaxdamp.dampers import Reach, without_fitted_ranges
from jaxdamp.identify._blas import one_thread
from jaxdamp.identify.ends import at_ends
from jaxdamp.identify.estimates import Estimate, parameter_table
from jaxdamp.identify.noise import independent
from jaxdamp.identify.problem import AbstractResiduals, Problem
from jaxdamp.identify.search import SearchEnd, search
from jaxdamp.identify.uncertainty import uncertainty
from jaxdamp.parameters import FreeParameters, Parameter, free_parameters, interval, match_paths, name_patterns, real
from jaxdamp.simulation import Ride


if TYPE_CHECKING:
    import matplotlib.figure


ALIKE = 1e-2  # difference of sums of squares, in squared tolerances, of searches that count as equally good
APART = 0.01  # relative difference of a parameter between them that is named
NORMAL = 1.959964  # 97.5 % quantile of the normal distribution
Goal: TypeAlias = float | int | tuple[float | int, float | int]


class Met(NamedTuple):
    """A target, and what the fitted model has instead."""

    name: str
    target: float
    tolerance: float
    value: float

    @property
    def deviation(self) -> float:
        """Distance from the target in tolerances."""
        return (self.value - self.target) / self.tolerance

    @property
    def met(self) -> bool:
        """Whether it is within the tolerance."""
        return bool(abs(self.deviation) <= 1.0)


@dataclasses.dataclass(frozen=True, repr=False)
class TargetFit:
    """Parameters that meet targets as well as they can.

    Attributes:
        model: the module or the mapping with the fitted numbers.
        parameters: the free numbers; standard errors take the tolerances for standard deviations of the targets.
        targets: each target with the value of the model.
        warnings: targets that are missed, parameters at bounds, in words.
        status: how the search ended.
        steps: steps of the search.
    """

    model: Any
    parameters: tuple[Estimate, ...]
    targets: tuple[Met, ...]
    warnings: tuple[str, ...]
    status: Status
    steps: int

    @property
    def converged(self) -> bool:
        """Whether the search ended by its tolerance."""
        return self.status is Status.CONVERGED

    def __getitem__(self, name: str) -> float:
        """The fitted value of a parameter."""
        _checks.one_of("name", name, [e.name for e in self.parameters])
        return next(e.value for e in self.parameters if e.name == name)

    def table(self) -> Table:
        """The targets, the values reached and their deviations."""
        columns = [Column("target"), Column("wanted"), Column("tolerance", spec=".2g"), Column("reached")]
        columns += [Column("deviation", "%", "+.2f"), Column("in tolerances", spec="+.2f")]
        rows = [
            (t.name, t.target, t.tolerance, t.value, 100 * (t.value / t.target - 1) if t.target else None, t.deviation)
            for t in self.targets
        ]
        return Table("Targets", tuple(columns), tuple(rows))

    def plot(self) -> "matplotlib.figure.Figure":
        """The distance of each value from its target (`plots.targets`)."""
        from jaxdamp import plots

        return plots.targets(self)

    def parameters_table(self) -> Table:
        """The fitted numbers with units and standard errors."""
        return parameter_table("Parameters", self.parameters)

    def to_dict(self) -> dict[str, Any]:
        """The result as plain numbers and words, ready for JSON."""
        return {
            "status": self.status.name.lower(),
            "converged": self.converged,
            "warnings": list(self.warnings),
            "parameters": [plain(estimate._asdict()) for estimate in self.parameters],
            "targets": [plain({**t._asdict(), "met": t.met}) for t in self.targets],
        }

    def __repr__(self) -> str:
        return "\n".join(map(str, (self.parameters_table(), self.table(), *(f"warning: {w}" for w in self.warnings))))


@final
class TargetResiduals(AbstractResiduals):
    """Deviations from targets in tolerances; zeros behind them, so that there are more than free numbers."""

    numbers: Any
    wanted: Float[Array, " targets"]
    tolerance: Float[Array, " targets"]
    names: tuple[str, ...] = eqx.field(static=True)
    padding: int = eqx.field(static=True)

    def __call__(self, model: Any) -> Float[Array, " samples"]:
        """The deviations."""
        reached = self.numbers.of_vehicle(model)({}) if isinstance(self.numbers, Ride) else self.numbers(model)
        values = jnp.stack([jnp.asarray(reached[name], self.wanted.dtype) for name in self.names])
        return jnp.concatenate([(values - self.wanted) / self.tolerance, jnp.zeros(self.padding, values.dtype)])

    def used(self) -> Bool[np.ndarray, " samples"]:
        """The targets."""
        return np.arange(len(self.names) + self.padding) < len(self.names)

    def total_weight(self) -> Float[Array, ""]:
        """Sum of the squared weights."""
        return jnp.sum(1.0 / jnp.square(self.tolerance))


@of_known_numbers
@one_thread()
def fit_targets(
    numbers: Callable[[Any], Mapping[str, Any]] | Ride,
    start: Any,
    targets: Mapping[str, Goal],
    *,
    over: Sequence[str] | None = None,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    tolerance: float = 0.01,
    max_steps: int = 100,
    starts: int = 4,
    seed: int = 0,
) -> TargetFit:
    """Find the parameters with which a model has given numbers, by least squares in units of the tolerances.

    Arguments:
        numbers: function of the model that returns numbers by name, differentiable by forward derivatives; or a `Ride`,
            whose metrics are the numbers. `vehicles.oscillations` gives frequencies and damping ratios.
        start: the model to start from: a vehicle, a law, any module with parameters; or a mapping of names to numbers,
            which `numbers` then gets.
        targets: name to wanted value, or to `(value, tolerance)`.
        over: parameters to change, by path, last part or pattern; all if left out.
        freeze: parameters to hold.
        bounds: extra limits `{name: (lower, upper)}`.
        tie: parameters that take the values of others, as in `fit`.
        tolerance: of targets without one of their own, relative to their value.
        max_steps: largest number of steps.
        starts: number of searches, the first from `start`, the others from parameters up to twice and half of it. The
            first one counts unless another one meets the targets better.
        seed: of the other starts.

    Returns:
        The model, its parameters and the numbers reached. Targets outside their tolerance are named by a warning, and
        so are parameters that differ between searches that meet the targets equally well.

    Raises:
        ValueError: no targets; a target that `numbers` does not return; a target of zero without a tolerance; numbers
            or derivatives that are not finite.

    >>> from jaxdamp import vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> def body(car):
    ...     modes = vehicles.oscillations(car)
    ...     return {"frequency": modes.frequency[0], "damping ratio": modes.damping_ratio[0]}
    >>> result = fit_targets(body, car, {"frequency": 1.2, "damping ratio": 0.3}, over=["spring_rate", "rate"])
    >>> [(target.name, round(target.value, 4), target.met) for target in result.targets]
    [('frequency', 1.2, True), ('damping ratio', 0.3, True)]
    """
    goals = _goals(targets, tolerance)
    free = _free(start, over, freeze, bounds, tie)
    padding = max(free.values.size + 1 - len(goals), 0)
    wanted, allowed = (jnp.asarray(np.array(column, float)) for column in zip(*goals.values(), strict=True))
    residuals = TargetResiduals(numbers, wanted, allowed, tuple(goals), padding)
    _check_numbers(residuals, free.tree)
    owner, level = np.zeros(len(goals) + padding, int), float(jnp.linalg.norm(wanted / allowed)) or 1.0
    everywhere = Reach(np.inf, np.inf)
    if starts < 1:
        _checks.refuse("starts", "be 1 or more", starts)
    ends = []
    for values in _starts(free, starts, seed):
        begun = free if values is None else free.started_at(values)
        problem = Problem(begun, (residuals,), level, (), (1.0,), owner, everywhere, begun.tree, (), False)
        ends.append((problem, search(problem, max_steps)))
    squares = np.array([end.squares if end.finite else np.inf for _, end in ends])
    problem, end = ends[int(np.argmax(squares <= squares.min() + ALIKE * max(squares.min(), 1.0)))]
    if not end.finite:
        remedy = "Start nearer to the targets, or give `bounds`."
        _checks.refuse("numbers", "give finite numbers and derivatives", "one that does not", remedy)
    reached = np.asarray(wanted) + end.residual[: len(goals)] * np.asarray(allowed)
    met = tuple(Met(name, *goals[name], float(value)) for name, value in zip(goals, reached, strict=True))
    estimates = _estimates(problem, end)
    notes = [f"The search did not converge: {end.status.sentence}"] * (not end.converged)
    notes += [f"{e.name} = {e.value:.4g} is {e.note}." for e in estimates if e.note]
    notes += [
        f"{t.name} is missed: {t.value:.4g} instead of {t.target:.4g} ± {t.tolerance:.2g}." for t in met if not t.met
    ]
    notes += _disagreements(free, end, [other for _, other in ends if other.finite])
    model = free.started_at(end.values).tree
    return TargetFit(model, estimates, met, tuple(notes), end.status, end.steps)


def _starts(free: FreeParameters, count: int, seed: int) -> list[np.ndarray | None]:
    """None for the start itself, then other values: one factor between a half and two for each parameter."""
    random, (lower, upper) = np.random.default_rng(seed), free.limits()
    values = np.asarray(free.values, float)
    starts: list[np.ndarray | None] = [None]
    for _ in range(count - 1):
        factors = [np.full(p.value.size, 2.0 ** random.uniform(-1.0, 1.0)) for p in free.chosen]
        moved = values * np.concatenate(factors)
        starts.append(np.where((moved > lower) & (moved < upper), moved, values))
    return starts


def _disagreements(free: FreeParameters, best: SearchEnd, ends: Sequence[SearchEnd]) -> list[str]:
    """A sentence on searches that ended elsewhere: with the same deviations, or with larger ones."""
    if len(ends) < 2:
        return []
    alike = [end for end in ends if end.squares <= best.squares + ALIKE * max(best.squares, 1.0)]
    spread = np.ptp([end.values for end in alike], axis=0)
    apart = spread > APART * np.maximum(np.abs(best.values), np.finfo(float).tiny)
    notes = []
    if apart.any():
        found = [
            f"{name} {min(values):.4g} to {max(values):.4g}"
            for name, values, differs in zip(free.names, np.transpose([e.values for e in alike]), apart, strict=True)
            if differs
        ]
        notes.append(f"Several minima meet the targets alike, which do not determine {', '.join(found)}.")
    if len(alike) < len(ends):
        notes.append(f"{len(alike)} of {len(ends)} starts ended at the best minimum; the others in worse ones.")
    return notes


def _goals(targets: Mapping[str, Goal], tolerance: float) -> dict[str, tuple[float, float]]:
    """Each target with its tolerance."""
    _checks.positive("tolerance", tolerance)
    if not isinstance(targets, Mapping) or not targets:
        _checks.refuse("targets", "be numbers by name", _checks.described(targets), "Write {'frequency': 1.2}.")
    goals = {}
    for name, goal in targets.items():
        value, own = goal if isinstance(goal, tuple) else (goal, tolerance * abs(goal))
        _checks.finite(f"targets[{name!r}]", value)
        _checks.positive(f"tolerance of targets[{name!r}]", own, "Write `(value, tolerance)`.")
        goals[name] = float(value), float(own)
    return goals


def _free(
    start: Any,
    over: Sequence[str] | None,
    freeze: Sequence[str],
    bounds: Mapping[str, tuple[float, float]] | None,
    tie: Mapping[str, str] | None,
) -> FreeParameters:
    """The free numbers of a module or a mapping."""
    if not isinstance(start, Mapping):
        return free_parameters(without_fitted_ranges(start), over=over, freeze=freeze, bounds=bounds, tie=tie)
    known = [*start]
    for name in known:
        if "." in name:
            _checks.refuse("start", "have names without a point", repr(name))
    if tie:
        _checks.refuse("tie", "be left out for a mapping of numbers", tie, "Use one name in `numbers` twice.")
    limits = {name: pair for key, pair in (bounds or {}).items() for name in match_paths(known, [key])}
    chosen = match_paths(known, name_patterns("over", over)) if over is not None else known
    held = match_paths(known, name_patterns("freeze", freeze))
    tree = {name: jnp.asarray(value, float) for name, value in start.items()}
    domains = {name: interval(*map(float, limits[name])) if name in limits else real for name in known}
    free = tuple(Parameter(n, tree[n], "", n, domains[n], False) for n in chosen if n not in held)
    for p in free:
        if not p.domain.contains(np.asarray(p.value)):
            _checks.refuse(p.path, f"start {p.domain.name}", p.value, "Start inside the bounds or widen them.")
    if not free:
        _checks.refuse("freeze", "leave a number to change", "naming all")
    return FreeParameters(tree, free)


def _check_numbers(residuals: TargetResiduals, model: Any) -> None:
    """Whether the function returns the targets."""
    given = residuals.numbers.units if isinstance(residuals.numbers, Ride) else None
    if given is None:
        given = eqx.filter_eval_shape(residuals.numbers, model)
    for name in residuals.names:
        _checks.one_of("targets", name, given)


def _estimates(problem: Problem, end: SearchEnd) -> tuple[Estimate, ...]:
    """The numbers with the errors that the tolerances leave them."""
    free = problem.free
    exact = independent(np.ones(end.residual.size), np.ones(end.residual.size, bool), end.values.size)
    errors = np.sqrt(np.diag(uncertainty(end.jacobian, end.residual, exact).covariance))
    sides, (lower, upper) = at_ends(problem.coordinates, end.values), free.limits()
    rows = []
    for i, (name, p, tied) in enumerate(zip(free.names, free.owners, free.followers, strict=True)):
        value, error = float(end.values[i]), float(errors[i])
        note = "not identifiable" if not np.isfinite(error) else "at a bound" if sides[i] else ""
        reach = NORMAL * error
        limits = (max(value - reach, float(lower[i])), min(value + reach, float(upper[i])))
        rows.append(Estimate(name, value, p.unit, error, limits, p.meaning, note, tied=tied))
    return tuple(rows)

"""`fit_targets`: parameters that meet a table of numbers, such as frequencies, damping ratios and ride metrics."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias, Unpack, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxdamp import _checks
from jaxdamp._display import plus_minus
from jaxdamp._one_thread import one_thread
from jaxdamp._results import drawn_by
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column, Contents, Table, plain
from jaxdamp._traced import of_known_numbers
from jaxdamp.dampers import Reach, without_fitted_ranges
from jaxdamp.identify.criteria import criterion_in_words, priors_on, solve_by
from jaxdamp.identify.estimates import parameter_table
from jaxdamp.identify.estimating import estimate
from jaxdamp.identify.judging import MOST_WARNINGS, fields_of_fit, on_status
from jaxdamp.identify.losses import LOSSES
from jaxdamp.identify.noise import Noise, independent
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.identify.result import Fit
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.settings import TARGETS, Free, TargetSettings, check_keywords
from jaxdamp.identify.several import Solution, equally_good, search_scattered
from jaxdamp.parameters import (
    FreeParameters,
    Parameter,
    free_parameters,
    interval,
    limits_by_path,
    match_paths,
    name_patterns,
    real,
)
from jaxdamp.simulation import Ride


APART = 0.01  # relative difference of a parameter between them that is named
Numbers: TypeAlias = Callable[[PyTree], Mapping[str, PyTree]] | Ride  # that a model has
Goal: TypeAlias = float | int | Sequence[float | int]


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


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TargetFit(Fit):
    """Parameters that meet targets as well as they can: a `Fit` of numbers.

    Standard errors take the tolerances for standard deviations of the targets.

    Attributes:
        model: the module or the mapping with the fitted numbers.
        targets: each target with the value of the model.
    """

    model: PyTree
    targets: tuple[Met, ...]

    def __getitem__(self, name: str) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The fitted value of a parameter; `estimate(name)` has its standard error."""
        return self.estimate(name).value

    def table(self) -> Table:
        """The targets, the values reached and their deviations."""
        columns = [Column("target"), Column("wanted"), Column("tolerance", spec=".2g"), Column("reached")]
        columns += [Column("deviation", "%", "+.2f"), Column("in tolerances", spec="+.2f")]
        rows = [
            (t.name, t.target, t.tolerance, t.value, 100 * (t.value / t.target - 1) if t.target else None, t.deviation)
            for t in self.targets
        ]
        return Table("Targets", tuple(columns), tuple(rows))

    plot = drawn_by("targets", "The distance of each value from its target.")

    @property
    def summary(self) -> str:
        """How many targets are met."""
        return f"{sum(t.met for t in self.targets)} of {len(self.targets)} targets are met."

    def parameters_table(self) -> Table:
        """The fitted numbers with units, standard errors and meanings."""
        return parameter_table(f"Parameters of {type(self.model).__name__}", self.parameters)

    def tables(self) -> dict[str, Table]:
        """Targets, and parameters."""
        return {"targets": self.table(), "parameters": self.parameters_table()}

    def content(self) -> Contents:
        """Parameters and targets as plain data."""
        return super().content() | {"targets": [plain(t) | {"met": t.met} for t in self.targets]}

    def __repr__(self) -> str:
        return "\n".join(map(str, (*reversed(self.tables().values()), *(f"warning: {w}" for w in self.warnings))))


@final
class TargetResiduals(AbstractResiduals):
    """Deviations from targets in tolerances; zeros behind them, so that there are more than free numbers."""

    numbers: Numbers
    wanted: Float[Array, " targets"]
    tolerance: Float[Array, " targets"]
    names: tuple[str, ...] = eqx.field(static=True)
    padding: int = eqx.field(static=True)

    def __call__(self, model: PyTree) -> Float[Array, " samples"]:
        """The deviations."""
        reached = self.numbers.of_vehicle(model)({}) if isinstance(self.numbers, Ride) else self.numbers(model)
        values = jnp.stack([jnp.asarray(reached[name], self.wanted.dtype) for name in self.names])
        return jnp.concatenate([(values - self.wanted) / self.tolerance, jnp.zeros(self.padding, values.dtype)])

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "TargetResiduals":
        """The same with every weight times a factor."""
        return dataclasses.replace(self, tolerance=self.tolerance / jnp.asarray(factor[: len(self.names)]))

    def used(self) -> Bool[np.ndarray, " samples"]:
        """The targets."""
        return np.arange(len(self.names) + self.padding) < len(self.names)


@of_known_numbers
@one_thread()
@with_defaults(TARGETS, check=check_keywords)
def fit_targets(
    numbers: Numbers,
    start: PyTree,
    targets: Mapping[str, Goal],
    *,
    tolerance: float = 0.01,
    **settings: Unpack[TargetSettings],
) -> TargetFit:
    """Find the parameters with which a model has given numbers, by least squares in units of the tolerances.

    Arguments:
        numbers: function of the model that returns numbers by name, differentiable by forward derivatives; or a `Ride`,
            whose metrics are the numbers. `vehicles.oscillations` gives frequencies and damping ratios.
        start: the model to start from: a vehicle, a law, any module with parameters; or a mapping of names to numbers,
            which `numbers` then gets.
        targets: name to wanted value, or to `(value, tolerance)`.
        tolerance: of targets without one of their own, relative to their value.
        settings: keywords, all optional: `over`, `freeze`, `bounds`, `tie`, `priors` (see `Free`); `loss`, robust if
            some targets may be wrong, and `max_steps`, 100 if left out (see `Search`); `starts`, 4 if left out, `seed`
            and `solver` (see `TargetSettings`).

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
    loss, starts, priors = settings["loss"], settings["starts"], settings["priors"] or {}
    max_steps, solver = settings["max_steps"], settings["solver"]
    _checks.one_of("loss", loss, LOSSES)
    _checks.counts(starts=starts, max_steps=max_steps)
    free = _free(start, settings)
    expected = priors_on(free, priors)
    padding = max(free.values.size + 1 - len(goals), 0)
    wanted, allowed = (jnp.asarray(np.array(column, float)) for column in zip(*goals.values(), strict=True))
    residuals = TargetResiduals(numbers, wanted, allowed, tuple(goals), padding)
    _check_numbers(residuals, free.tree)
    level = float(jnp.linalg.norm(wanted / allowed)) or 1.0
    owner = np.zeros(len(goals) + padding + sum(part.size for part in expected), int)
    everywhere, parts = Reach(np.inf, np.inf), (residuals, *expected)
    problem = Problem(free, parts, level, (), (1.0,), owner, everywhere, free.tree, (), False)
    by_squares = functools.partial(search_scattered, seed=settings["seed"], max_steps=max_steps, solver=solver)
    problem, solution = solve_by(problem, by_squares, loss=loss, noise=_tolerances, starts=starts, spread=1.0)
    if not solution.best.finite:
        remedy = "Start nearer to the targets, or give `bounds`."
        _checks.refuse("numbers", "give finite numbers and derivatives", "one that does not", remedy)
    result = _judged(problem.started_at(solution.best.values), solution, goals, residuals)
    return dataclasses.replace(result, criterion=criterion_in_words(problem, loss, priors))


def _judged(
    problem: Problem, solution: Solution, goals: Mapping[str, tuple[float, float]], residuals: TargetResiduals
) -> TargetFit:
    """The result at the minimum."""
    free, end, noise = problem.free, solution.best, _tolerances(problem, solution.best)
    deviations = np.asarray(residuals(free.tree))[: len(goals)]
    reached = np.asarray(residuals.wanted) + deviations * np.asarray(residuals.tolerance)
    met = tuple(Met(name, *goals[name], float(value)) for name, value in zip(goals, reached, strict=True))
    estimates = estimate(problem, solution, noise)
    notes = [
        *on_status(end, estimates.unsettled),
        *(f"{e.name} = {e.value:.4g} is {e.note}." for e in estimates.estimates if e.note),
    ]
    notes += [
        f"{t.name} is missed: {t.value:.4g} instead of {plus_minus(t.target, t.tolerance)}." for t in met if not t.met
    ]
    if solution.starts == 1 and not all(t.met for t in met):
        notes.append("Only one start was searched: others may meet the targets. Leave `starts` out for four.")
    notes += _disagreements(free, solution)
    how, main = fields_of_fit(problem, solution, noise, estimates), tuple(notes[:MOST_WARNINGS])
    return TargetFit(model=free.tree, targets=met, warnings=tuple(notes), main_warnings=main, **how)


def _tolerances(problem: Problem, end: SearchEnd) -> Noise:
    """The tolerances as known, independent noise of the targets."""
    noise = independent(np.ones(end.residual.size), problem.used, end.values.size)
    return noise._replace(dof=np.inf)


def _disagreements(free: FreeParameters, solution: Solution) -> list[str]:
    """A sentence on searches that ended elsewhere: with the same deviations, or with larger ones."""
    best, ends = solution.best, solution.ends
    if len(ends) < 2:
        return []
    alike = [end for end in ends if end.squares <= best.squares + equally_good(best.squares)]
    spread = np.ptp([end.values for end in alike], axis=0)
    apart = spread > APART * np.maximum(np.abs(best.values), np.finfo(float).tiny)
    notes = []
    if apart.any():
        named = [
            f"{name} {min(values):.4g} to {max(values):.4g}"
            for name, values, differs in zip(free.names, np.transpose([e.values for e in alike]), apart, strict=True)
            if differs
        ]
        notes.append(f"Several minima meet the targets alike, which do not determine {', '.join(named)}.")
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
        if isinstance(goal, str) or np.shape(goal) not in ((), (2,)):
            _checks.refuse(f"targets[{name!r}]", "be a number, or it and its tolerance", goal, "Write `(1.2, 0.05)`.")
        value, allowed = goal if isinstance(goal, Sequence | np.ndarray) else (goal, tolerance * abs(goal))
        _checks.finite(f"targets[{name!r}]", value)
        _checks.positive(f"tolerance of targets[{name!r}]", allowed, "Write `(value, tolerance)`.")
        goals[name] = float(value), float(allowed)
    return goals


def _free(start: PyTree, asked: Free) -> FreeParameters:
    """The free numbers of a module or a mapping."""
    over, freeze, bounds, tie = asked["over"], asked["freeze"], asked["bounds"], asked["tie"]
    if isinstance(start, Mapping):
        if tie:
            _checks.refuse("tie", "be left out for a mapping of numbers", tie, "Use one name in `numbers` twice.")
        return _free_numbers(start, over, freeze, bounds or {})
    return free_parameters(without_fitted_ranges(start), over=over, freeze=freeze, bounds=bounds, tie=tie)


def _free_numbers(
    start: Mapping[str, PyTree],
    over: Sequence[str] | None,
    freeze: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
) -> FreeParameters:
    """The free numbers of a mapping."""
    names = [*start]
    if with_point := [name for name in names if "." in name]:
        _checks.refuse("start", "have names without a point", repr(with_point[0]))
    chosen = names if over is None else match_paths(names, name_patterns("over", over))
    held = match_paths(names, name_patterns("freeze", freeze))
    limits = limits_by_path(names, {*chosen} - {*held}, {}, bounds)
    tree = {name: jnp.asarray(value, float) for name, value in start.items()}
    domains = {name: interval(*limits[name]) if name in limits else real for name in names}
    free = tuple(Parameter(n, tree[n], "", n, domains[n], False) for n in chosen if n not in held)
    for p in free:
        if not p.domain.contains(np.asarray(p.value)):
            _checks.refuse(p.path, f"start {p.domain.name}", p.value, "Start inside the bounds or widen them.")
    if not free:
        _checks.refuse("freeze", "leave a number to change", "naming all")
    return FreeParameters(tree, free)


def _check_numbers(residuals: TargetResiduals, model: PyTree) -> None:
    """Whether the function returns the targets."""
    given = residuals.numbers.units if isinstance(residuals.numbers, Ride) else None
    if given is None:
        given = eqx.filter_eval_shape(residuals.numbers, model)
    for name in residuals.names:
        _checks.one_of("targets", name, given)

"""Standard errors, intervals and warnings for fitted parameters."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.special
from jaxtyping import Bool, Float

from jaxdamp.dampers import Reach
from jaxdamp.identify.ends import at_ends
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.profile import Profile, profile
from jaxdamp.identify.result import Estimate, Minimum
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.several import Solution, minima_of
from jaxdamp.identify.uncertainty import uncertainty, weak_directions
from jaxdamp.parameters import FreeParameters


WEAK = 0.5  # standard error, relative to the value or to the force, above which a parameter is not identifiable
BOUND_Z_SCORE = 3.0  # standard errors beyond an edge from which a parameter counts as limited by it
NEARLY = 9.0  # largest increase in chi-square of another minimum that is reported: three standard errors
APART = 3.0  # standard errors beyond which a parameter of another minimum counts as different


class Estimates(NamedTuple):
    """The uncertainty of fitted parameters."""

    estimates: tuple[Estimate, ...]
    covariance: Float[np.ndarray, "free free"]
    minima: tuple[Minimum, ...]
    notes: tuple[str, ...]


def estimate(problem: Problem, solution: Solution, noise: Float[np.ndarray, " samples"]) -> Estimates:
    """Standard errors, 95 % intervals by Student's t within the domain, and remarks.

    A parameter is "not identifiable" if its standard error is not finite or more than half of its value. A number that
    may have either sign is compared by its force instead: its standard error must not change the force by more than
    half its RMS. A parameter that ended at zero, the end of its domain, is "not identifiable" if it does not differ
    significantly from zero, and "at a bound" if the minimum is beyond. If a parameter is not identifiable or outside
    the records, or if another minimum is nearly as good, the errors of the other parameters are checked by `profile`.

    Arguments:
        problem: the problem that was minimised.
        solution: the ends of the searches.
        noise: standard deviation of each weighted residual.
    """
    free, found, used = problem.free, solution.best, problem.used
    uncertain, variance = uncertainty(found.jacobian, found.residual, noise), float(np.mean(noise[used] ** 2))
    large = large_changes(free, found.values, np.linalg.norm(found.jacobian, axis=0) / problem.level)
    sides, minima = at_ends(problem.coordinates, found.values), minima_of(solution, free.names, variance)
    errors = np.sqrt(np.diag(uncertain.covariance))
    numbers = ~problem.coordinates.ordered
    firm = numbers & (errors <= WEAK * large) & (sides == 0)
    spans = _spans(free, problem.reach)
    doubt = np.any((np.abs(found.values) > spans) | (numbers & ~firm)) or any(m.chi_square < NEARLY for m in minima[1:])
    far = WEAK * large
    moved = Profile(errors, np.zeros(errors.shape, bool))
    if not solution.closed_form and doubt and found.converged and not problem.is_rounding(found.squares):
        moved = profile(problem, found, errors, far, firm, variance)
    lower, upper = free.limits()
    pressed = ~(np.abs(uncertain.unconstrained_step) < BOUND_Z_SCORE)
    at_zero = numbers & (sides < 0) & (lower == 0) & np.isinf(upper) & ~pressed
    undetermined = ~(moved.errors <= far) | moved.open_ended
    weak = np.where(sides != 0, at_zero | ~np.isfinite(errors), undetermined)
    estimates = _estimates(problem, found, moved.errors, weak, sides != 0, int(np.count_nonzero(used)))
    notes = on_estimates(estimates, weak_directions(found.jacobian, float(np.sqrt(variance)), large, WEAK))
    notes += on_minima(minima, estimates) + on_reach(estimates, spans)
    return Estimates(estimates, uncertain.covariance, minima, tuple(notes))


def _estimates(
    problem: Problem,
    found: SearchEnd,
    errors: Float[np.ndarray, " free"],
    weak: Bool[np.ndarray, " free"],
    bound: Bool[np.ndarray, " free"],
    samples: int,
) -> tuple[Estimate, ...]:
    free = problem.free
    lower, upper = free.limits()
    reach = float(scipy.special.stdtrit(max(samples - found.values.size, 1), 0.975))  # quantile of Student's t
    rows = []
    for i, (name, p, tied) in enumerate(zip(free.names, free.owners, free.followers, strict=True)):
        value, error = float(found.values[i]), float(errors[i])
        interval = (max(value - reach * error, float(lower[i])), min(value + reach * error, float(upper[i])))
        note = "not identifiable" if weak[i] else "at a bound" if bound[i] else ""
        meaning = p.meaning
        if p.path in problem.per_record:
            meaning += f" in record {problem.runs[int(name.rpartition('[')[2][:-1])].name!r}"
        rows.append(Estimate(name, value, p.unit, error, interval, meaning, note, tied))
    return tuple(rows)


def large_changes(
    free: FreeParameters, values: Float[np.ndarray, " free"], sensitivity: Float[np.ndarray, " free"]
) -> Float[np.ndarray, " free"]:
    """A large change of each parameter: its value, or for parameters of either sign the change that moves F by its RMS.

    Arguments:
        free: the free parameters.
        values: their values.
        sensitivity: RMS of the change of force per unit of each, relative to the RMS of the measured force.
    """
    lower, upper = free.limits()
    tiny = np.finfo(float).tiny
    signed = (lower < 0) & (upper > 0)
    by_force = np.divide(1.0, sensitivity, out=np.full(sensitivity.shape, tiny), where=sensitivity > 0)
    return np.where(signed, by_force, np.maximum(np.abs(values), tiny))


def on_estimates(estimates: Sequence[Estimate], directions: Sequence[np.ndarray]) -> list[str]:
    """Sentences on parameters at bounds, and on parameters and groups that are not identifiable."""
    notes = []
    for e in estimates:
        unit = f" {e.unit}" if e.unit else ""
        if e.note == "at a bound":
            notes.append(f"{e.name} = {e.value:.4g}{unit} is at a bound: the best value is beyond it.")
        elif e.note == "not identifiable":
            notes.append(
                f"{e.name} is not identifiable from these records ({e.value:.3g} ± {e.standard_error:.2g}{unit}):"
                " freeze it or add records that excite it."
            )
    return notes + _together(estimates, directions)


def _together(estimates: Sequence[Estimate], directions: Sequence[np.ndarray]) -> list[str]:
    """Sentences on groups of parameters of which the records determine only a combination."""
    weak = np.array([e.note == "not identifiable" for e in estimates])
    groups: list[tuple[set[int], str]] = []
    for direction in directions:
        signs = np.sign(direction) * weak
        members = set(map(int, np.flatnonzero(signs)))
        if len(members) < 2:
            continue
        ways = (("raising", np.flatnonzero(signs > 0)), ("lowering", np.flatnonzero(signs < 0)))
        how = " while ".join(f"{way} {_listed([estimates[int(i)].name for i in who])}" for way, who in ways if who.size)
        joined = [group for group in groups if group[0] & members]
        groups = [group for group in groups if not group[0] & members]
        groups.append((members.union(*(group[0] for group in joined)), "" if joined else how))
    return [
        f"These records cannot distinguish {_listed([estimates[i].name for i in sorted(members)])}"
        + f": {how} hardly changes the force" * bool(how)
        + ". Freeze all but one of them, or add records."
        for members, how in groups
    ]


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _spans(free: FreeParameters, reach: Reach) -> Float[np.ndarray, " free"]:
    """Extent of the records in the unit of each number; infinite for units other than m/s and m."""
    spans = {"m/s": reach.velocity, "m": 2.0 * reach.stroke}
    return np.array([spans.get(p.unit, np.inf) for p in free.owners])


def on_reach(estimates: Sequence[Estimate], spans: Float[np.ndarray, " free"]) -> list[str]:
    """Sentences on velocities and strokes of the law that are outside the records."""
    names = {"m/s": "velocity", "m": "range of the stroke"}
    return [
        f"{e.name} = {e.value:.4g} {e.unit} is outside the records, whose largest {names[e.unit]} is {span:.3g}"
        f" {e.unit}: the force there was not measured. Add records beyond it, or freeze it."
        for e, span in zip(estimates, spans, strict=True)
        if abs(e.value) > span
    ]


def on_minima(minima: Sequence[Minimum], estimates: Sequence[Estimate]) -> list[str]:
    """A sentence on each other minimum that is nearly as good and has other parameters."""
    notes = []
    for minimum in minima[1:]:
        if minimum.chi_square >= NEARLY:
            continue
        other = [
            f"{e.name} = {minimum.values[e.name]:.4g} instead of {e.value:.4g} {e.unit}".rstrip()
            for e in estimates
            if abs(minimum.values[e.name] - e.value) > APART * e.standard_error
        ]
        if other:
            notes.append(
                f"Another minimum is nearly as good (chi-square {minimum.chi_square:.2g} higher): {', '.join(other)}."
                " The standard errors hold for the minimum given only; add records that tell them apart."
            )
    return notes


def on_correlation(inflation: float) -> list[str]:
    """A sentence on a residual with correlated noise."""
    if inflation == 1.0:
        return []
    return [
        "Neighbouring residuals are alike: the law misses something systematic. The standard errors count that as noise"
        f" with the correlation of the residual, which makes them {inflation:.3g} times those of independent noise."
    ]

"""Standard errors, intervals and warnings for fitted parameters."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
import scipy.special
from jaxtyping import Bool, Float

from jaxdamp._triangles import determined, orthonormal, triangle, unit_columns
from jaxdamp.dampers import Reach, laws_inside
from jaxdamp.identify.criteria import Priors
from jaxdamp.identify.estimates import WIDER, Estimate, Minimum
from jaxdamp.identify.identifiability import on_identifiability
from jaxdamp.identify.model import START_PATH
from jaxdamp.identify.noise import Noise, noise_of, spread_over_parts
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.profile import Profile, profile
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.several import Solution, minima_of
from jaxdamp.parameters import Coordinates, FreeParameters


WEAK = 0.5  # standard error, relative to the value or to the force, above which a parameter is not identifiable
BOUND_Z_SCORE = 3.0  # standard errors beyond an edge from which a parameter counts as limited by it
NEARLY = 9.0  # largest increase in chi-square of another minimum that is reported: three standard errors
OFF = 1.0  # standard errors from the minimum by the derivatives, beyond which a search has not ended there
GAIN = 0.1  # of the sum of squares by the derivatives, beyond which it has not, even if no number is determined
APART = 3.0  # standard errors beyond which a parameter of another minimum counts as different
TAKES_PART = 0.1  # force of a parameter in a direction, relative to the largest, above which it belongs to it
AT_LIMIT = 1e-4  # distance from a limit given by other parameters, relative to the start, that counts as zero


class Estimates(NamedTuple):
    """The uncertainty of fitted parameters."""

    estimates: tuple[Estimate, ...]
    covariance: Float[np.ndarray, "free free"]
    minima: tuple[Minimum, ...]
    notes: tuple[str, ...]
    summary: tuple[str, ...]  # of the notes, with groups of numbers named once
    unsettled: tuple[str, ...] = ()  # numbers that are not where the derivatives place the minimum


def estimate(problem: Problem, solution: Solution, noise: Noise) -> Estimates:
    """Standard errors, 95 % intervals by Student's t within the domain, and remarks.

    A parameter is "not identifiable" if its standard error is not finite or more than half of its value. A number that
    may have either sign is compared by its force instead: its standard error must not change the force by more than
    half its RMS. A parameter that ended at zero, the end of its domain, is "not identifiable" if it does not differ
    significantly from zero, and "at a bound" if the minimum is beyond. If a parameter is not identifiable or outside
    the records, or if another minimum is nearly as good, the errors of the other parameters are checked by `profile`.
    """
    free, minimum = problem.free, solution.best
    uncertain, variance = uncertainty(minimum.jacobian, minimum.residual, noise), noise.variance
    large = large_changes(problem, minimum)
    of_start, sizes = _weakly_known(problem)
    large = np.where(of_start, sizes, large)
    sides, minima = at_ends(problem.coordinates, minimum.values), minima_of(solution, free.names, variance)
    errors = np.sqrt(np.diag(uncertain.covariance))
    numbers = ~problem.coordinates.ordered
    firm = numbers & ~of_start & (errors <= WEAK * large) & (sides == 0)
    spans = _spans(free, problem.reach)
    doubt = np.any((np.abs(minimum.values) > spans) | (numbers & ~of_start & ~firm)) or any(
        m.chi_square < NEARLY for m in minima[1:]
    )
    far = WEAK * large
    moved = Profile(errors, np.zeros(errors.shape, bool))
    if not solution.closed_form and doubt and minimum.converged and not problem.is_rounding(minimum.squares):
        moved = profile(problem, minimum, errors, far, firm, variance)
    lower, upper = free.limits()
    pressed = ~(np.abs(uncertain.unconstrained_step) < BOUND_Z_SCORE)
    at_zero = numbers & (sides < 0) & (lower == 0) & np.isinf(upper) & ~pressed
    undetermined = ~(moved.errors <= far) | moved.open_ended
    weak = np.where(sides != 0, at_zero | ~np.isfinite(errors), undetermined)
    estimates = _estimates(problem, minimum, moved.errors, weak, sides != 0, noise.dof)
    if noise.systematic:
        spreads = spread_over_parts(problem, minimum)
        estimates = tuple(e._replace(spread=max(s, e.standard_error)) for e, s in zip(estimates, spreads, strict=True))
    directions = weak_directions(minimum.jacobian, float(np.sqrt(variance)), large, WEAK)
    estimates, notes = on_identifiability(problem, minimum, estimates, directions)
    further = on_minima(minima, estimates) + on_reach(estimates, spans)
    summary = (*in_groups(estimates), *further)
    sure = np.array([not e.note for e in estimates])
    ended = minimum.converged and not solution.closed_form and not problem.is_rounding(minimum.squares)
    off = _off(minimum, noise, sides == 0, sure) if ended else np.zeros_like(sure)
    unsettled = tuple(np.array(free.names)[off])
    return Estimates(estimates, uncertain.covariance, minima, (*notes, *further), summary, unsettled)


def _off(
    minimum: SearchEnd, noise: Noise, inside: Bool[np.ndarray, " free"], sure: Bool[np.ndarray, " free"]
) -> Bool[np.ndarray, " free"]:
    """Which sure numbers are far from where the derivatives place the minimum; all if none is, but the squares are.

    Those at ends of their ranges stay there.
    """
    off, jacobian = np.zeros(inside.size, bool), minimum.jacobian[:, inside]
    reachable = np.linalg.norm(orthonormal(jacobian).T @ minimum.residual)
    if reachable > OFF * np.sqrt(noise.variance):  # no number is farther off than all together
        off[inside] = np.abs(uncertainty(jacobian, minimum.residual, noise).unconstrained_step) > OFF
        off &= sure
        if not off.any() and reachable**2 > GAIN * minimum.squares:
            return inside
    return off


def undetermined(problem: Problem, minimum: SearchEnd) -> tuple[str, ...]:
    """The free numbers of the law that the records do not determine: all of them after a search without an end.

    As `estimate` judges it, but by the derivatives alone, without following a number to where the error rises.
    """
    free, of_law = problem.free, [not name.startswith(("rig.", "records.")) for name in problem.free.names]
    if not minimum.finite:
        return tuple(np.array(free.names)[of_law])
    covariance = uncertainty(minimum.jacobian, minimum.residual, noise_of(problem, minimum, None)).covariance
    large = large_changes(problem, minimum)
    weak = ~(np.sqrt(np.diag(covariance)) <= WEAK * large)
    return tuple(name for name, open_end in zip(free.names, weak & of_law, strict=True) if open_end)


def _weakly_known(problem: Problem) -> tuple[Bool[np.ndarray, " free"], Float[np.ndarray, " free"]]:
    """Which numbers are states at the beginning of a record, and the standard deviation expected of them."""
    sizes = {
        path: deviation
        for part in problem.residuals
        if isinstance(part, Priors) and part.weak
        for path, deviation in zip(part.paths, np.asarray(part.deviation), strict=True)
    }
    each = [np.ravel(sizes.get(p.path, np.full(p.value.shape, np.nan))) for p in problem.free.chosen]
    deviations = np.concatenate(each)
    return np.isfinite(deviations), deviations


def _estimates(
    problem: Problem,
    minimum: SearchEnd,
    errors: Float[np.ndarray, " free"],
    weak: Bool[np.ndarray, " free"],
    bound: Bool[np.ndarray, " free"],
    dof: float,
) -> tuple[Estimate, ...]:
    free = problem.free
    lower, upper = free.limits()
    reach = float(scipy.special.stdtrit(dof, 0.975))  # quantile of Student's t
    begins = {START_PATH.format(i): run for i, run in enumerate(problem.runs)}
    rows = []
    for i, (name, p, tied) in enumerate(zip(free.names, free.owners, free.followers, strict=True)):
        value, error = float(minimum.values[i]), float(errors[i])
        interval = (max(value - reach * error, float(lower[i])), min(value + reach * error, float(upper[i])))
        note = "not identifiable" if weak[i] else "at a bound" if bound[i] else ""
        meaning = p.meaning
        if p.path in problem.per_record:
            meaning += f" in record {problem.runs[int(name.rpartition('[')[2][:-1])].name!r}"
        elif p.path in begins:
            meaning += f" of record {begins[p.path].name!r}"
        rows.append(Estimate(name, value, p.unit, error, interval, meaning, note, tied=tied))
    return tuple(rows)


def large_changes(problem: Problem, minimum: SearchEnd) -> Float[np.ndarray, " free"]:
    """A large change of each parameter: its value, or for parameters of either sign the change that moves F by its RMS.

    A knot may move as far as its nearest neighbour, or the end of the records: where its place is not known better, the
    slopes on both sides of it are equal to within their errors, and a curve without it describes the records as well.
    """
    (lower, upper), tiny = problem.free.limits(), np.finfo(float).tiny
    sensitivity = np.linalg.norm(minimum.jacobian, axis=0) / problem.level  # of the force, relative to its RMS
    by_force = np.divide(1.0, sensitivity, out=np.full(sensitivity.shape, tiny), where=sensitivity > 0)
    by_size = np.maximum(np.abs(minimum.values), tiny)
    return np.where(
        problem.coordinates.ordered, _gaps(problem, minimum), np.where((lower < 0) & (upper > 0), by_force, by_size)
    )


def _gaps(problem: Problem, minimum: SearchEnd) -> Float[np.ndarray, " free"]:
    """Distance of each number of an ordered vector from its nearest neighbour, at most the extent of the records."""
    gaps, begin = _spans(problem.free, problem.reach), 0
    for p in problem.free.chosen:
        here = slice(begin, begin + p.value.size)
        steps = np.diff(minimum.values[here], prepend=-np.inf, append=np.inf)
        gaps[here], begin = np.minimum(gaps[here], np.minimum(steps[:-1], steps[1:])), here.stop
    return gaps


def _spans(free: FreeParameters, reach: Reach) -> Float[np.ndarray, " free"]:
    """Extent of the records in the unit of each number; infinite for units other than m/s and m."""
    spans = {"m/s": reach.velocity, "m": 2.0 * reach.stroke}
    return np.array([spans.get(p.unit, np.inf) for p in free.owners])


def in_groups(estimates: Sequence[Estimate]) -> list[str]:
    """How many numbers are not identifiable, and how many at bounds, vectors and their like named once."""
    kinds = {"not identifiable": "cannot be told from these records", "at a bound": "ended at a bound"}
    lines = []
    for note, words in kinds.items():
        names = [e.name.rpartition(".")[2].partition("[")[0] for e in estimates if e.note == note]
        if names:
            each = ", ".join(dict.fromkeys(names))
            lines.append(f"{len(names)} of {len(estimates)} numbers {words}: {each}.")
    return lines


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


def on_misfit(noise: Noise, estimates: Sequence[Estimate], explained: bool) -> list[str]:
    """For what the intervals hold where the residual is not noise; and that it is not, unless that is explained."""
    if not noise.systematic:
        return []
    factors = [
        (e.spread / e.standard_error, e.name)
        for e in estimates
        if e.spread is not None and 0 < e.standard_error < np.inf and not e.note
    ]
    factor, name = max(factors, default=(1.0, ""))
    wider = f"; with what the law misses, the error of {name} is {factor:.2g} times as large" * (factor > WIDER)
    lead = "The residual repeats from cycle to cycle: the law misses something systematic, or the machine is left out. "
    return [
        lead
        * (not explained)
        + f"The intervals hold for this law, not for the damper{wider}. The standard errors count the residual as noise"
        f" with its correlation, which makes them {noise.inflation:.3g} times those of independent noise."
    ]


class Uncertainty(NamedTuple):
    """The uncertainty of the parameters due to noise."""

    covariance: Float[np.ndarray, "free free"]
    unconstrained_step: Float[np.ndarray, " free"]  # step to the minimum without any bounds, in standard errors


def uncertainty(
    jacobian: Float[np.ndarray, "samples free"], residual: Float[np.ndarray, " samples"], noise: Noise
) -> Uncertainty:
    """Covariance at a minimum, (JᵀJ)⁻¹ Jᵀ Σ J (JᵀJ)⁻¹ with the covariance Σ of the noise, without edges of parameters.

    Of a robust loss, JᵀJ are its second derivatives: the rows of J have the factor `noise.root`.

    A parameter at an edge of its range thus counts as unknown in the errors of the others; if it were taken as fixed,
    their errors would be too small. A direction with a singular value below `RANK_TOLERANCE` of the largest does not
    change the force: its parameters get an infinite variance instead of a result of rounding errors.
    """
    scaled, scale = unit_columns(jacobian * np.reshape(noise.root, (-1, 1)))
    singular, directions = determined(scaled)
    inverse = (directions.T / singular**2) @ directions
    lost = np.sum(directions**2, axis=0) < 1.0 - 1e-3
    whole = inverse @ noise.covariance_of(scaled) @ inverse
    whole[lost, :] = whole[:, lost] = 0.0
    whole[lost, lost] = np.inf
    errors = np.sqrt(np.diag(whole))
    step = -inverse @ (scaled.T @ (residual / noise.root))
    steps = np.divide(step, errors, out=np.zeros_like(step), where=errors > 0)
    return Uncertainty(whole / np.outer(scale, scale), steps)


def weak_directions(
    jacobian: Float[np.ndarray, "samples free"],
    noise: float,
    large: Float[np.ndarray, " free"],
    weak: float,
) -> list[Float[np.ndarray, " free"]]:
    """Directions in which parameters change the force separately, but hardly if changed together.

    Arguments:
        jacobian: derivatives of the weighted residual by the parameters.
        noise: standard deviation of a weighted sample.
        large: a large change of each parameter.
        weak: standard error along a direction, relative to `large`, above which it counts as undetermined.

    Returns:
        For each direction, changes relative to `large`; zero for parameters with little force in this direction.
    """
    reduced = triangle(jacobian * large)
    _, singular, directions = np.linalg.svd(reduced)
    singular = np.concatenate([singular, np.zeros(len(directions) - singular.size)])
    undetermined = directions[singular * weak < noise]
    forces = np.abs(undetermined) * np.linalg.norm(reduced, axis=0)
    pairs = zip(undetermined, forces, strict=True)
    return [np.where(force > TAKES_PART * force.max(), row, 0.0) for row, force in pairs]


def at_ends(coordinates: Coordinates, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
    """−1 for a number at the lower end of its range, 1 at the upper, else 0.

    Neighbours of ordered numbers are ends too, and so are limits that depend on other parameters of a law.
    """
    sides = coordinates.at_ends(values)
    limited = np.isin(coordinates.free.names, list(_at_conditions(coordinates, values)))
    return np.where(limited & (sides == 0), -1.0, sides)


def _at_conditions(coordinates: Coordinates, values: Float[np.ndarray, " free"]) -> set[str]:
    """Parameters at a limit given by other parameters."""
    free = coordinates.free
    scales = {p.path: float(np.max(np.abs(np.asarray(p.value)))) or 1.0 for p in free.chosen}
    paths = set()
    for prefix, law in laws_inside(free.started_at(values).tree):
        if not law.has_conditions():
            continue
        plain = jax.tree.map(np.asarray, law)
        for condition in plain.conditions():
            path = prefix + condition.parameter
            margin = np.min(getattr(plain, condition.parameter) - condition.least)
            if path in scales and margin < AT_LIMIT * scales[path]:
                paths.add(path)
    return paths

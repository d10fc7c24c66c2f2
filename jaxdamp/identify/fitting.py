"""`fit`: weighted nonlinear least squares of a damper law over many bench records."""

import inspect
import warnings as python_warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize

from jaxdamp import _checks, dampers
from jaxdamp.bench import BenchRun, as_runs, contradictions, contradictions_in_words
from jaxdamp.dampers import (
    AbstractDamper,
    coverage,
    drives_motion,
    takes_command,
    with_fitted_range,
    without_fitted_ranges,
)
from jaxdamp.identify._tall import triangle
from jaxdamp.identify.coordinates import box, to_values
from jaxdamp.identify.covered import covered_range
from jaxdamp.identify.judgement import judge, on_correlation
from jaxdamp.identify.noise import noise_of
from jaxdamp.identify.result import FitResult, score
from jaxdamp.identify.search import Found, Problem, finite, linearised
from jaxdamp.identify.several import Several, reach_of, search_from
from jaxdamp.identify.traces import batches, is_memoryless, predict_runs
from jaxdamp.parameters import FreeParameters, free_parameters


Start = AbstractDamper | type[AbstractDamper] | Callable[..., AbstractDamper]

# What a law that does not suit the records raises. A wrong call (`TypeError` and the like) is no matter of one law.
NUMERICAL = (ValueError, ArithmeticError, eqx.EquinoxRuntimeError, jax.errors.JaxRuntimeError)


def fit(
    law: Start,
    runs: BenchRun | Iterable[BenchRun],
    *,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    weighting: str | Sequence[float] = "samples",
    force_noise: float | None = None,
    samples_per_cycle: int | None = 400,
    starts: int | None = None,
    max_steps: int = 200,
) -> FitResult:
    """Fit a damper law to bench records by least squares on the force.

    Minimises Σ ((F_law − F_measured)/σ)² over all samples of all records, with Levenberg-Marquardt inside the domains
    of the parameters, and Jacobians by forward-mode differentiation through the law and its states. Where the law is
    linear in everything free, the minimum is computed directly (bounded linear least squares).

    A sum of squares may have several minima. The search goes from several starts, the best end is kept, and `minima`
    tells of the others; nothing is random, the same records give the same result.

    Standard errors count every other free number as unknown. Where the residual is correlated from sample to sample,
    because the law misses something, they count as many samples as are independent (`inflation`).

    A law with states is led into every record by a copy of its first cycle, and the record's first half cycle is not
    compared; blocks of samples of slow records are averaged down to `samples_per_cycle`.

    Arguments:
        law: a law to start from; or a law class, or a function `(velocity, force) -> law`, which is given all samples
            and returns a start from the data. If it has arguments `stroke` or `time`, it is given those too, one
            record after the other.
        runs: one record or many.
        freeze: parameters to leave alone, by path, last part of a path, or pattern.
        bounds: extra limits `{name: (lower, upper)}` in the parameter's unit.
        weighting: `"samples"`, every sample counts the same; `"runs"`, every record counts the same, relative to its
            RMS force; or one standard deviation [N] for each record, of which only the ratios matter. `inf` leaves a
            record out of the fit; it is scored all the same.
        force_noise: standard deviation [N] of the measured force where it is known, as independent noise. Otherwise
            the residual gives it, with its correlation.
        samples_per_cycle: see above; `None` uses every sample.
        starts: search from at most so many starts: `law` first, then those that it and the laws inside it propose
            (`other_starts`), all of them if left out. 1 searches from `law` alone.
        max_steps: of each search.

    Returns:
        The law with the range of the fitted records (`law.fitted_to`), its parameters with standard errors, scores and
        warnings; a search that fails says so in `warnings`.

    Raises:
        ValueError: no records; names that fit no parameter; a start outside its bounds or without finite forces; a
            force that never varies.

    >>> from jaxdamp import bench, dampers
    >>> dyno = bench.VirtualDyno(dampers.Bilinear(2600.0, 1200.0), force_noise=5.0, seed=1)
    >>> runs = dyno.run([bench.SineTest(amplitude=0.02, frequency=2.0)])
    >>> result = fit(dampers.Bilinear, runs)
    >>> abs(result["rebound_rate"].value - 2600.0) < 4 * result["rebound_rate"].standard_error
    True
    """
    runs = as_runs(runs, call="fit(law, runs)")
    _check(runs, force_noise, max_steps, starts)
    sigma = weights(weighting, runs)
    fitted_to = [run for run, s in zip(runs, sigma, strict=True) if np.isfinite(s)]
    begin = started(law, fitted_to)
    free = free_parameters(begin, freeze=freeze, bounds=bounds)
    _checks.finite("law", free.values)
    made, places = batches(begin, runs, sigma, samples_per_cycle)
    level = float(np.sqrt(sum(np.sum(np.square(batch.force * batch.weight)) for batch in made)))
    problem = Problem(free, made, level)
    reach, linear = reach_of(fitted_to), is_linear(begin, free)
    several = _solve_linear(problem) if linear else search_from(problem, reach, starts=starts, max_steps=max_steps)
    found = several.best
    if not finite(found):
        must = "give finite forces and derivatives over the records"
        _checks.refuse("law", must, f"{begin}, which does not", coverage(begin) or "Start from another law.")

    noise, inflation = noise_of(problem, found, places, sigma, each=weighting == "runs", force_noise=force_noise)
    judged = judge(problem, several, noise, reach, searched=not linear)
    fitted = with_fitted_range(free.build(jnp.asarray(found.values)), covered_range(fitted_to))
    percent, rmse, scores = score(fitted, runs, np.isfinite(sigma))
    notes = [f"The search did not converge: {found.said} {_REMEDY}"] * (not found.converged)
    notes += _contradicting(begin, fitted_to)
    notes += _driving(fitted, fitted_to)
    notes += [*judged.notes, *on_correlation(inflation)]
    return FitResult(
        law=fitted,
        runs=runs,
        parameters=judged.estimates,
        covariance=judged.covariance,
        fit_percent=percent,
        rmse=rmse,
        scores=scores,
        warnings=tuple(notes),
        converged=found.converged,
        steps=found.steps,
        starts=several.starts,
        minima=judged.minima,
        inflation=inflation,
    )


def _contradicting(law: AbstractDamper, runs: Sequence[BenchRun]) -> list[str]:
    """A sentence on records with the same motion, and the same command if the law follows it, but other forces."""
    follows = takes_command(law) and all(run.command is not None for run in runs)
    groups: dict[float | None, list[BenchRun]] = {}
    for run in runs:
        groups.setdefault(run.command if follows else None, []).append(run)
    return contradictions_in_words([pair for group in groups.values() for pair in contradictions(group)])


def _driving(law: AbstractDamper, runs: Sequence[BenchRun]) -> list[str]:
    """A sentence on a fitted curve that drives the motion at some of the velocities of the records."""
    if not is_memoryless(law):
        return []
    velocity = np.concatenate([run.velocity for run in runs])
    order = np.argsort(velocity, kind="stable")
    velocity, force = velocity[order], np.concatenate(predict_runs(law, runs))[order]
    at = velocity[drives_motion(velocity, force)]
    if not at.size:
        return []
    return [
        f"The fitted curve drives the motion instead of damping it at velocities from {at[0]:.3g} to {at[-1]:.3g} m/s. "
        "Check the sign of the force, or take a law that cannot, such as `Bilinear` or `PiecewiseLinear`."
    ]


_REMEDY = "Try another start, bounds, or fewer free parameters."


def _check(runs: Sequence[BenchRun], force_noise: float | None, max_steps: int, starts: int | None) -> None:
    if not runs:
        _checks.refuse("runs", "hold at least one record", "empty", "Read some with `bench.read`.")
    if force_noise is not None:
        _checks.positive("force_noise", force_noise)
    for name, count in (("max_steps", max_steps), ("starts", starts)):
        if count is not None and count < 1:
            _checks.refuse(name, "be 1 or more", count)
    if not any(np.ptp(run.force) > 0 for run in runs):
        _checks.refuse("runs", "hold a force that varies", "records of a constant force", "Check the force channel.")


def check_start(argument: str, law: Any) -> None:
    """Refuse anything that no fit can start from."""
    if isinstance(law, AbstractDamper) or (isinstance(law, type) and issubclass(law, AbstractDamper)):
        return
    if isinstance(law, str):
        laws = [name for name in dampers.__all__ if isinstance(getattr(dampers, name), type(AbstractDamper))]
        known = next((name for name in laws if name.lower() == law.lower().replace("_", "")), None)
        remedy = f"Write `dampers.{known}`." if known else f"Write `default_ladder(runs, [{law!r}])[{law!r}]`."
    elif callable(law) and not isinstance(law, type | BenchRun | eqx.Module):
        return
    else:
        remedy = (
            "The calls are `fit(law, runs)` and `compare(laws, runs)`, with `dampers.Besinger` for instance as law."
        )
    must = "be a law, a class of laws, or a function that makes a law of velocities and forces"
    _checks.refuse(argument, must, _checks.described(law), remedy)


def check_starts(laws: Any, call: str) -> None:
    """Refuse anything that is not laws by name."""
    example = "{'linear': dampers.Linear, 'besinger': dampers.Besinger}"
    if not isinstance(laws, Mapping):
        names = isinstance(laws, list | tuple) and all(isinstance(name, str) for name in laws)
        ladder = f"`default_ladder(runs, {list(laws)})`" if names and laws else "`default_ladder(runs)`"
        remedy = f"The call is `{call}`; write {ladder} or {example}."
        _checks.refuse("laws", "be laws by name", _checks.described(laws), remedy)
    if not laws:
        _checks.refuse("laws", "hold at least one law", "empty", f"Take `default_ladder(runs)` or {example}.")
    for name, law in laws.items():
        check_start(f"laws[{name!r}]", law)


def started(law: Start, runs: Sequence[BenchRun]) -> AbstractDamper:
    """An instance to start from, without the ranges of earlier fits."""
    check_start("law", law)
    if isinstance(law, AbstractDamper):
        return without_fitted_ranges(law)
    guess = getattr(law, "guess", None) if isinstance(law, type) else law
    if guess is None:
        name = getattr(law, "__name__", law)
        remedy = f"Pass an instance, `{name}(...)`, as the start."
        _checks.refuse("law", "know how to start from data", f"the class {name} without `guess`", remedy)
    asked = [name for name in ("stroke", "time") if name in inspect.signature(guess).parameters]
    channels = {name: np.concatenate([getattr(run, name) for run in runs]) for name in ("velocity", "force", *asked)}
    with python_warnings.catch_warnings():
        python_warnings.simplefilter("ignore", np.exceptions.RankWarning)
        return without_fitted_ranges(guess(channels.pop("velocity"), channels.pop("force"), **channels))


def weights(weighting: str | Sequence[float], runs: Sequence[BenchRun]) -> list[float]:
    """Standard deviation [N] by which each record's residuals are divided; infinite for a record to be left out."""
    if isinstance(weighting, str):
        _checks.one_of("weighting", weighting, ["samples", "runs"])
        if weighting == "samples":
            return [1.0] * len(runs)
        sigma = [float(np.sqrt(np.mean(run.force**2) * len(run))) for run in runs]
        _checks.positive("runs", np.array(sigma), "A record without force has no RMS force to be weighted by.")
        return sigma
    sigma = [float(s) for s in weighting]
    if len(sigma) != len(runs):
        _checks.refuse("weighting", f"give one number for each of {len(runs)} records", f"{len(sigma)} numbers")
    kept = np.array([s for s in sigma if s != np.inf])
    _checks.positive("weighting", kept)
    if not kept.size:
        _checks.refuse("weighting", "leave at least one record", "infinite for all")
    return sigma


def is_linear(law: AbstractDamper, free: FreeParameters) -> bool:
    """Whether the force is linear in all that is free, so that the least squares have a closed form."""
    return law.traits().linear_in_parameters and all(p.linear and p.domain.steps is None for p in free.chosen)


def _solve_linear(problem: Problem) -> Several:
    """Minimum of a linear least-squares problem within the domains."""
    free = problem.free
    begin = np.asarray(free.values)
    residual, jacobian = (np.asarray(a) for a in linearised(free, free.values, problem.made))
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    lower, upper = (np.asarray(to_values(free, jnp.asarray(y))) for y in box(free))
    target = jacobian @ begin - residual
    whole = triangle(np.concatenate([jacobian / scale, target[:, None]], axis=1))
    r, target = whole[: begin.size, : begin.size], whole[: begin.size, begin.size]
    values = np.linalg.lstsq(r, target, rcond=None)[0] / scale
    solved, said = True, ""
    if np.any((values < lower) | (values > upper)):
        answer = scipy.optimize.lsq_linear(r, target, (lower * scale, upper * scale), method="bvls")
        values = np.clip(answer.x / scale, lower, upper)
        solved, said = bool(answer.success), str(answer.message)
    found = Found(values, residual + jacobian @ (values - begin), jacobian, solved, 0, said)
    return Several(found, (found,), 1)

"""`judge`: from the minimum of a problem to a result with errors, scores, warnings, and the bias by input noise."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._status import Status
from jaxdamp._triangles import unit_columns
from jaxdamp.bench import BenchRun, contradictions_in_words
from jaxdamp.dampers import (
    AbstractDamper,
    StandardError,
    coverage,
    drives_motion,
    laws_inside,
    takes_command,
    with_standard_errors,
)
from jaxdamp.identify.blending import off_span
from jaxdamp.identify.contradicting import contradicting
from jaxdamp.identify.covered import covered_range
from jaxdamp.identify.criteria import against_priors
from jaxdamp.identify.estimates import Estimate
from jaxdamp.identify.estimating import GAIN, Estimates, estimate, on_misfit
from jaxdamp.identify.identifiability import gas_in_words
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.left_out import LeftOut, left_out
from jaxdamp.identify.model import (
    Model,
    count_states,
    is_memoryless,
    law_of,
    of_record,
    on_rig,
    rig_of,
    starts_in,
    with_means,
    with_range,
)
from jaxdamp.identify.noise import Noise, noise_of
from jaxdamp.identify.predicting import predict_runs, score
from jaxdamp.identify.problem import Problem, linearised
from jaxdamp.identify.propagation import Evidence
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.several import Solution
from jaxdamp.identify.stated import start_paths, stated_values
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import get, modules_inside, parameters, with_values


MOST_WARNINGS = 5  # that are shown at a terminal
_REMEDY = "Try another start, bounds, or fewer free parameters."
ALIKE = 0.1  # of their mean, by which values of records may differ to count as one
UNLIKE = 1.5  # times the stated noise, or a part of it, from which the error of a fit is another one
DRAWS = 6  # perturbations, each with both signs


class NotFiniteError(_checks.ArgumentError):
    """A law without finite forces and derivatives over its records."""

    def __init__(self, law: AbstractDamper) -> None:
        must, remedy = "give finite forces and derivatives over the records", coverage(law) or "Start from another law."
        super().__init__(f"Argument `law` must {must}, but is {law}, which does not. {remedy}", argument="law")


@one_thread()
def judge(problem: Problem, solution: Solution, *, force_noise: float | None = None) -> FitResult:
    """The third step of `fit`: the result at the minimum, with standard errors and warnings.

    Arguments:
        problem: result of `prepare`.
        solution: result of `solve`.
        force_noise: standard deviation [N] of the measured force if it is known, as in `fit`.

    Raises:
        ValueError: forces or derivatives that are not finite at the minimum.
    """
    best, problem = solution.best, problem.at_noise(solution.noise)
    if not best.finite:
        raise NotFiniteError(problem.law)
    noise = noise_of(problem, best, force_noise)
    estimates = estimate(problem, solution, noise)
    models, model = fitted_models(problem, best.values)
    law, rig = law_of(model), rig_of(model)
    fitted = np.isfinite(problem.sigma)
    percent, rmse, scores = score(models or model, problem.runs, fitted, problem.initial_state)
    against = against_priors(problem.free, problem.residuals, best.values)
    notes = on_status(best, estimates.unsettled, _REMEDY) + [
        f"The records {words}. Check the prior, or give it a wider one." for words in against
    ]
    notes += [] if problem.robust is not None else _against_stated(rmse, force_noise)
    pooled = all(p.startswith("rig.") for p in problem.per_record) and not stated_values(model, problem.runs)
    on_records = (
        *notes_on(model, problem.fitted_to, pooled=pooled),
        *off_span(model, problem.fitted_to, problem.initial_state),
    )
    commands = not_followed(law, problem.fitted_to, pooled=pooled)
    missed = LeftOut(()) if commands else left_out(problem, best)  # which would be taken for what the commands do
    on_rest = on_misfit(noise, estimates.estimates, bool(missed.sentences))
    on_records += _averaged(problem, best)
    gas = gas_in_words(model, problem.fitted_to, estimates.estimates, estimates.covariance)
    main = (*notes, *on_records, *missed.sentences, *gas, *estimates.summary, *on_rest)
    notes += [*on_records, *gas, *estimates.notes, *on_rest, *missed.sentences]
    return FitResult(
        law=with_standard_errors(law, _errors_of_law(model, estimates)),
        runs=problem.runs,
        fit_percent=percent,
        rmse=rmse,
        scores=scores,
        warnings=tuple(notes),
        main_warnings=main[:MOST_WARNINGS],
        record_laws=tuple(map(law_of, models)),
        rig=rig,
        initial_state=problem.initial_state,
        record_rigs=tuple(rig for rig in map(rig_of, models) if rig is not None),
        record_starts=starts_in(model),
        left_out=missed,
        **fields_of_fit(problem, solution, noise, estimates),
    )


def _errors_of_law(model: Model, estimates: Estimates) -> list[StandardError]:
    """The standard errors of the numbers of the law, named as in the law without its machine."""
    inside = "" if isinstance(model, AbstractDamper) else "law."
    return [
        StandardError(e.name.removeprefix(inside), e.standard_error, e.unit, e.note != "not identifiable" and settled)
        for e in estimates.estimates
        if e.name.startswith(inside)
        for settled in [e.name not in estimates.unsettled]
    ]


def fields_of_fit(problem: Problem, solution: Solution, noise: Noise, estimates: Estimates) -> dict[str, Any]:
    """What every `Fit` holds of its minimum, whatever was fitted."""
    best = solution.best
    return {
        "parameters": estimates.estimates,
        "covariance": estimates.covariance,
        "minima": estimates.minima,
        "status": Status.NO_BETTER_STEP if estimates.unsettled else best.status,
        "steps": best.steps,
        "starts": solution.starts,
        "inflation": noise.inflation,
        "evidence": Evidence(problem, best, noise, estimates.covariance),
    }


def on_status(best: SearchEnd, unsettled: Sequence[str], remedy: str = "") -> list[str]:
    """A sentence on a search that did not converge.

    `unsettled` are numbers that are not where the derivatives place the minimum, though no better step was found.
    """
    if best.converged and not unsettled:
        return []
    if not unsettled:
        more = {
            Status.STEP_LIMIT: "Allow more steps. ",
            Status.NO_STEP: "With a `solver` of your own this happens where a number is near an end of its range: "
            "start farther inside, or leave `solver` out. ",
        }.get(best.status, "")
        return [f"The search did not converge: {best.status.sentence} {more}{remedy}".rstrip()]
    differ = "differs" if len(unsettled) == 1 else "differ"
    who = ", ".join(unsettled[:3]) + f" and {len(unsettled) - 3} others" * (len(unsettled) > 3)
    return [
        f"The search did not converge: it ended where {who} {differ} by more than a standard error, or the sum of "
        f"squares by more than {100 * GAIN:.0f} %, from the minimum that the derivatives show: at a kink of the sum of "
        "squares, such as a knot at a sample, by a loose tolerance, or where no step went on. Other values fit as well "
        "or better. Start elsewhere, freeze the numbers that place kinks, such as knots, or take a law with fewer."
    ]


def fitted_models(problem: Problem, values: np.ndarray) -> tuple[list[Model], Model]:
    """The fitted model of each record, where they differ, and the one with the mean of what differs."""
    built = problem.free.started_at(values).tree
    if starts := starts_in(built):
        fitted = [s if np.isfinite(sigma) else None for s, sigma in zip(starts, problem.sigma, strict=True)]
        built = on_rig(law_of(built), rig_of(built), fitted)
    by_record = {path: get(built, path) for path in problem.per_record}
    models = [
        of_record(with_values(built, {path: v[i] for path, v in by_record.items()}), i)
        for i in range(len(problem.runs) if by_record else 0)
    ]
    fitted = [model for model, sigma in zip(models, problem.sigma, strict=False) if np.isfinite(sigma)]
    covered = covered_range(problem.fitted_to, fitted or built)
    joint = with_means(built, problem.per_record) if by_record else built
    return [with_range(model, covered) for model in models], with_range(joint, covered)


def _against_stated(rmse: float, force_noise: float | None) -> list[str]:
    """A sentence where the error of the fit [N] is not the stated noise [N], if there is one."""
    if force_noise is None or 1.0 / UNLIKE < rmse / force_noise < UNLIKE:
        return []
    cause = "Is it too small, or does the law miss something?" if rmse > force_noise else "Is it too large?"
    return [
        f"The error of {rmse:.3g} N is {rmse / force_noise:.2g} times the stated noise of {force_noise:.3g} N, which"
        f" alone the standard errors count. {cause} Without `force_noise`, the residual counts."
    ]


def _averaged(problem: Problem, best: SearchEnd) -> tuple[str, ...]:
    """A sentence on each number of the law of which records have values that differ by more than `ALIKE`."""
    tree, said = problem.free.started_at(best.values).tree, []
    units = {p.path: p.unit for p in parameters(tree)}
    left_out = ("rig.", *start_paths(tree))
    for path in problem.per_record:
        values = np.asarray(get(tree, path))
        if not path.startswith(left_out) and np.ptp(values) > ALIKE * abs(np.mean(values)):
            spread = f"{values.min():.4g} to {values.max():.4g} {units[path]}".rstrip()
            said.append(
                f"{path} of the law is the mean over the records, {np.mean(values):.4g}, whose values are {spread}: "
                "`record_laws` has the law of each."
            )
    return tuple(said)


def notes_on(model: Model, runs: Sequence[BenchRun], *, pooled: bool = True) -> list[str]:
    """Sentences on commands and numbers left out, records that contradict, strokes without place, energy added."""
    law, apart = law_of(model), contradictions_in_words(contradicting(model, runs))
    commands = not_followed(law, runs, pooled=pooled)
    return commands + _undeclared(law) + apart + _without_place(law, runs) + _driving(law, runs)


def not_followed(law: AbstractDamper, runs: Sequence[BenchRun], *, pooled: bool = True) -> list[str]:
    """A sentence on commands without effect on the law, in a record or, if all are pooled, from one to another."""
    varying = [run for run in runs if run.command_channel is not None]
    held = {run.command for run in runs if pooled and run.command is not None}
    if takes_command(law) or (not varying and len(held) < 2):
        return []
    begin, end = "", "fit a law with settings (`dampers.Scheduled`, `fit_scheduled`)."
    if varying:
        ends = np.concatenate([run.command_channel for run in varying if run.command_channel is not None])
        values = f"{ends.min():g} to {ends.max():g} {varying[0].command_unit}".rstrip()
        begin = f"The command of {', '.join(run.name for run in varying[:3])} varies ({values})"
        end = f"Cut the part in which it is held, `process(between=(start, stop))`, or {end}"
    else:
        begin = f"The records have several commands ({min(held):g} to {max(held):g})"
        end = f"Fit the records of one command, or {end}"
    return [f"{begin}, which this law does not follow: its numbers lie between those at one command and another. {end}"]


def _undeclared(law: AbstractDamper) -> list[str]:
    """A sentence on numbers of a law that are neither parameters nor settings, such as a network of equinox."""
    owners = [prefix for prefix, _ in laws_inside(law)]
    counts: dict[str, int] = {}
    for prefix, module in modules_inside(law):
        owner = max((path for path in owners if prefix.startswith(path)), key=len)
        for field in dataclasses.fields(module):
            value = getattr(module, field.name)
            if eqx.is_inexact_array(value) and not {"parameter", "setting"} & set(field.metadata):
                name = owner + f"{prefix}{field.name}"[len(owner) :].split(".")[0]
                counts[name] = counts.get(name, 0) + value.size
    held = ", ".join(f"`{name}` ({count} numbers)" for name, count in counts.items())
    if not held:
        return []
    return [
        f"The fit left {held} as it was: only numbers that are declared by `parameter` are fitted. Train a network by "
        "optax before the fit, or use `NeuralHysteresis`."
    ]


def _without_place(law: AbstractDamper, runs: Sequence[BenchRun]) -> list[str]:
    """A sentence on a law that depends on the place of the stroke, which integrated strokes do not have."""
    traits = law.traits()
    depends = traits.stroke_dependent_at_rest or (traits.stroke_dependent and not count_states(law))
    integrated = [run.name for run in runs if run.stroke_is_integrated]
    if not (depends and integrated):
        return []
    return [
        f"The force of this law depends on the place of the stroke, but that of {', '.join(integrated[:3])} was "
        "integrated from the velocity: its zero is the middle of the motion, and so is that of the parameters. "
        "Record the stroke, or take a law of the velocity."
    ]


def _driving(law: AbstractDamper, runs: Sequence[BenchRun]) -> list[str]:
    """A sentence on a fitted curve that adds energy at some of the velocities of the records."""
    if not is_memoryless(law):
        return []
    velocity = np.concatenate([run.velocity for run in runs])
    order = np.argsort(velocity, kind="stable")
    still = [dataclasses.replace(run, velocity=np.zeros(len(run))) for run in runs]  # springs and gas are no damping
    forces = np.concatenate(predict_runs(law, runs)) - np.concatenate(predict_runs(law, still))
    velocity, force = velocity[order], forces[order]
    at = velocity[drives_motion(velocity, force)]
    if not at.size:
        return []
    return [
        f"The fitted curve adds energy to the motion at velocities from {at[0]:.3g} to {at[-1]:.3g} m/s. "
        "Check the sign of the force, or take a law that cannot, such as `Bilinear` or `PiecewiseLinear`."
    ]


def input_noise_bias(problem: Problem, best: SearchEnd, input_noise: tuple[float, float]) -> Float[np.ndarray, " free"]:
    """Estimated bias of each free number, in its unit, by independent noise of the records.

    The noise has standard deviations of the stroke [m] and the velocity [m/s].
    """
    if np.shape(input_noise) != (2,):
        must = "be the standard deviations of stroke [m] and velocity [m/s]"
        _checks.refuse("input_noise", must, input_noise, "Write (1e-5, 0.002).")
    _checks.nonnegative("input_noise", np.array(input_noise, float))
    rng, values = np.random.default_rng(0), jnp.asarray(best.values)
    blocks = np.array([step * run.sampling_rate for step, run in zip(problem.sample_steps, problem.runs, strict=True)])
    deviations = [deviation / np.sqrt(blocks)[problem.owner] for deviation in input_noise]
    slope = np.zeros(best.values.size)
    for _ in range(DRAWS):
        noise = [deviation * rng.standard_normal(deviation.size) for deviation in deviations]
        for sign in (1.0, -1.0):
            residuals = _perturbed(problem, [sign * values for values in noise])
            residual, jacobian = linearised(problem.free, values, residuals)
            slope += np.asarray(jacobian).T @ np.asarray(residual)
    slope = slope / (2 * DRAWS) - best.jacobian.T @ best.residual
    scaled, scale = unit_columns(best.jacobian)
    return -np.linalg.lstsq(scaled.T @ scaled, slope / scale, rcond=1e-12)[0] / scale


def _perturbed(problem: Problem, noise: Sequence[np.ndarray]) -> tuple[AbstractResiduals, ...]:
    """The residuals with noise added to stroke and velocity."""
    parts = []
    for (part, stroke), (_, velocity) in zip(*map(problem.by_part, noise), strict=True):
        if isinstance(part, Batch):
            x, v = (jnp.asarray(values.reshape(part.stroke.shape)) for values in (stroke, velocity))
            part = dataclasses.replace(part, stroke=part.stroke + x, velocity=part.velocity + v)
        parts.append(part)
    return tuple(parts)


def on_bias(estimates: Sequence[Estimate]) -> list[str]:
    """A sentence on each parameter that the noise of stroke and velocity biases by more than its standard error."""
    return [
        f"Noise of stroke and velocity biases {e.name} by about {e.bias:+.2g} {e.unit}".rstrip()
        + f", {abs(e.bias) / e.standard_error:.2g} standard errors: filter the records, or average more cycles."
        for e in estimates
        if e.bias is not None and abs(e.bias) > e.standard_error
    ]

"""`fit`: weighted nonlinear least squares of a damper law over many bench records."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ParamSpec, Protocol, cast, overload, runtime_checkable

import equinox as eqx
import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp._triangles import triangle
from jaxdamp.bench import BenchRun, RideRecord, as_runs, usable
from jaxdamp.identify.contradicting import contradicting, refuse_contradicting
from jaxdamp.identify.criteria import LOSSES, criterion_in_words, solve_by
from jaxdamp.identify.judging import MOST_WARNINGS, input_noise_bias, judge, on_bias
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.machine import Machine, holds_static_force, static_force_in_words, with_static_force_on_machine
from jaxdamp.identify.many import fit_many
from jaxdamp.identify.many_result import ManyFits
from jaxdamp.identify.model import rig_of
from jaxdamp.identify.noise import noise_of
from jaxdamp.identify.preparing import prepare, records_in_words
from jaxdamp.identify.printed import evaluator
from jaxdamp.identify.problem import Problem, linearised
from jaxdamp.identify.search import SearchEnd, Solver
from jaxdamp.identify.several import Solution, search_from
from jaxdamp.identify.starting import Start
from jaxdamp.identify.targets import TargetFit, fit_targets
from jaxdamp.identify.vehicle_fitting import fit_vehicle
from jaxdamp.identify.vehicle_result import VehicleFit
from jaxdamp.parameters import matched_in_words, parameters
from jaxdamp.vehicles import AbstractVehicle


P = ParamSpec("P")
UNSEEN = 1e-12  # of the largest derivative, up to which one is a rounding error
# Errors due to a law that does not suit the records, as opposed to a wrong call (`TypeError` and so on).
NUMERICAL = (ValueError, ArithmeticError, eqx.EquinoxRuntimeError, jax.errors.JaxRuntimeError)


@runtime_checkable
class FitCall(Protocol[P]):
    """`fit` by what is fitted: a law, a vehicle, one law to many dampers, a model to numbers."""

    @overload
    def __call__(self, law: AbstractVehicle, runs: RideRecord | Iterable[RideRecord], **options: Any) -> VehicleFit: ...
    @overload
    def __call__(
        self, law: Any, runs: Mapping[str, float | tuple[float, float]], *, numbers: Any, **options: Any
    ) -> TargetFit: ...
    @overload
    def __call__(self, law: Start, runs: Mapping[str, BenchRun | Iterable[BenchRun]], **options: Any) -> ManyFits: ...
    @overload
    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> FitResult: ...


def of_any_records(fit: Callable[P, FitResult]) -> FitCall[P]:
    """The same function, which hands other records than those of one damper to the fit that explains them."""

    @functools.wraps(fit)
    def by_kind(*args: Any, **options: Any) -> Any:
        given: dict[str, Any] = dict(zip(("law", "runs"), args, strict=False)) | options
        model = given.pop("law") if "law" in given else given.pop("vehicle", None)
        records = given.pop("runs") if "runs" in given else given.pop("records", None)
        if "numbers" in given:
            return fit_targets(given.pop("numbers"), model, cast(Any, records), **given)
        if isinstance(model, AbstractVehicle):
            return fit_vehicle(model, cast(Any, records), **given)
        if isinstance(records, Mapping):
            return fit_many(cast(Any, model), records, **given)
        if given.pop("scheduled", False):
            from jaxdamp.identify.scheduling import fit_scheduled  # which is made of fits of a law

            return fit_scheduled(cast(Any, model), cast(Any, records), **given)
        return fit(*args, **options)

    return cast(FitCall[P], by_kind)


@of_any_records
@of_known_numbers
def fit(
    law: Start,
    runs: BenchRun | Iterable[BenchRun],
    *,
    rig: Machine = None,
    over: Sequence[str] | None = None,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    per_record: Sequence[str] = (),
    weighting: str | Sequence[float] = "samples",
    loss: str = "squares",
    priors: Mapping[str, tuple[float, float]] | None = None,
    force_noise: float | None = None,
    input_noise: tuple[float, float] | None = None,
    initial_state: str = "warm_up",
    samples_per_cycle: int | None = 400,
    starts: int | None = None,
    max_steps: int = 200,
    bad_records: str = "refuse",
    solver: Solver | None = None,
) -> FitResult:
    """Fit a damper law to bench records by least squares on the force, or another model to what was measured of it.

    `fit(law, runs)` is described here. `fit(vehicle, records)` is `fit_vehicle`, `fit(law, {"A": runs, "B": runs})` of
    many dampers is `fit_many`, `fit(model, {"frequency": 1.2}, numbers=function)` is `fit_targets`, and
    `fit(law, runs, scheduled=True)` of records at several settings is `fit_scheduled`.

    Minimises Σ ((F_law − F_measured)/σ)² over all samples of all records, with Levenberg-Marquardt inside the domains
    of the parameters, and Jacobians by forward-mode differentiation through the law and its states. Where the law is
    linear in everything free, the minimum is computed directly (bounded linear least squares).

    A sum of squares can have several minima. The search uses several starts; the best end is the result, and `minima`
    describes the others. Nothing is random: the same records give the same result.

    Standard errors take all other free parameters as unknown. If the residual is correlated from sample to sample,
    because the law does not describe everything, only the number of independent samples counts (`inflation`).

    The states of a law start at rest in records that begin at rest. Records that begin in motion are preceded by a copy
    of their first cycle, and their first half cycle is not compared, unless `initial_state` says otherwise. Rest before
    and after the motion is left out for laws without states: it shows no more than a friction that holds any force, or
    the zero error of the load cell. Slow records are averaged in blocks down to `samples_per_cycle`.

    Arguments:
        law: the start: a law; a law class, which estimates its starting values; or a function that returns a law,
            either from the records, if its argument is called `runs`, or from all samples `(velocity, force)`, with
            `stroke` and `time` if it has arguments of these names.
        runs: one or more records. A setting that is named like a parameter of the law, with its unit, is the value of
            this record, such as a gas pressure; one named `temperature` is how warm it begins.
        rig: the test machine, if it adds to the force of the damper; the load cell of measured records nearly always
            has a zero error, `rig="offset"`, which `compare` fits if nothing is said. Its parameters that differ from
            their defaults are free, with these values as start, beside those of the law: `rig=Rig(gas_force=-100.0,
            force_delay=1e-3)` estimates a gas force and a delay. `freeze` the known ones (`"rig.moving_mass"`). Names
            of effects get their starts from the records: `rig=["gas", "friction", "delay"]`, out of offset, gas,
            gas_stiffness, friction, mass, delay, lag, command_lag, stroke_offset, heat. An offset or gas force named so
            is the whole static force: a constant force of the law is held at zero, or zero at rest in a table, unless
            the call gives it a value; it is left out beside a law with a static force of its own meaning, such as a gas
            charge. All paths of parameters then begin with `law.` or `rig.`; their last parts stay the same.
        over: parameters of the law to fit, by path, last part of a path, or pattern; all if left out.
        freeze: parameters to hold at their start, named in the same way.
        bounds: extra limits `{name: (lower, upper)}` in the parameter's unit.
        tie: parameters that take the values of others, such as `{"terms.1.**": "terms.0.**"}`: one free value for each
            group (see `jaxdamp.parameters.free_parameters`).
        per_record: parameters with one value for each record, such as a friction that depends on the temperature; names
            as in `freeze`. All other parameters are common to the records. A record that was not fitted is predicted
            with their means, and begins as warm (`initial_rise`) as its first three cycles show, which are not scored.
        weighting: `"samples"`, equal weight of every sample; `"runs"`, equal weight of every record relative to its RMS
            force; or one standard deviation [N] for each record, of which only the ratios matter. `inf` leaves a record
            out of the fit; it is still scored.
        loss: `"squares"`; or `"huber"`, `"soft_l1"` or `"student_t"`, which spikes and dropouts hardly move: samples
            far from the law get less weight. Their share stands in `criterion`.
        priors: what is known of parameters beforehand, `{name: (mean, standard deviation)}` in the parameter's unit.
        force_noise: standard deviation [N] of the measured force if it is known, as independent noise. Otherwise it is
            estimated from the residual, including its correlation.
        input_noise: standard deviations of stroke [m] and velocity [m/s] as they stand in the records. Least squares of
            the force takes both as exact; the bias that this causes is estimated and stands beside each parameter.
        initial_state: of a law with states at the first sample of a record: `"warm_up"`, as above; `"rest"`, the law's
            own, for records that begin with the first motion; or `"periodic"`, for records cut out of a motion that had
            lasted long: in those whose stroke repeats from cycle to cycle the law has settled, however slow it is, and
            all samples are compared. Other records start as with `"warm_up"`. Or `"estimated"`: free numbers of each
            record, fitted with the law (`initial_states` of the result; paths then begin with `law.`, `rig.` or
            `records.`). A record that was not fitted is predicted from its mean force in the first second of rest,
            which is not scored, or after a warm-up cycle. How each starts stands in `criterion`.
        samples_per_cycle: see above; `None` uses every sample.
        starts: largest number of starts: `law` first, then those that its laws propose (`other_starts`); all of them if
            left out. With 1, the search starts from `law` only.
        max_steps: largest number of steps of each search.
        bad_records: what is done with records in which the preflight finds an error, such as a clipped or lost force:
            "refuse" the fit, "leave_out" these records, or "keep" them. Spikes are no error for a robust `loss`.
            Records of the same motion with different forces, such as those of two settings, are refused too unless
            "keep" pools them, or each record has numbers of its own.
        solver: any least-squares solver or minimiser of optimistix, such as `optimistix.Dogleg(rtol=1e-8, atol=1e-8)`,
            in place of `jaxdamp.solve.BoundedLevenbergMarquardt()`. It searches in coordinates without bounds, in which
            an edge of a domain is approached only slowly; a violated condition between parameters is an infinite
            residual. The standard errors and the checks are the same.

    Returns:
        The law with the range of the fitted records (`law.fitted_to`), its parameters with standard errors, scores and
        warnings; `status` and `warnings` report a search that failed.

    Raises:
        ValueError: no records; a record with an error; records that contradict each other; names that fit no
            parameter; a start outside its bounds or without finite forces; a constant force.

    >>> from jaxdamp import bench, dampers
    >>> dyno = bench.VirtualDyno(dampers.Bilinear(2600.0, 1200.0), force_noise=5.0, seed=1)
    >>> runs = dyno.run([bench.SineTest(amplitude=0.02, frequency=2.0)])
    >>> result = fit(dampers.Bilinear, runs)
    >>> abs(result["rebound_rate"].value - 2600.0) < 4 * result["rebound_rate"].standard_error
    True
    """
    _checks.one_of("loss", loss, LOSSES)
    if force_noise is not None:
        _checks.positive("force_noise", force_noise)
    runs = usable(as_runs(runs, call="fit(law, runs)"), bad_records, robust=loss != "squares")
    problem = prepare(
        law,
        runs,
        rig=rig,
        over=over,
        freeze=freeze,
        bounds=bounds,
        tie=tie,
        per_record=per_record,
        weighting=weighting,
        priors=priors,
        initial_state=initial_state,
        samples_per_cycle=samples_per_cycle,
    )
    if bad_records != "keep" and not per_record and initial_state != "estimated":
        refuse_contradicting(contradicting(problem.free.tree, problem.fitted_to))

    def by_squares(problem: Problem, starts: int | None) -> Solution:
        return solve(problem, starts=starts, max_steps=max_steps, solver=solver)

    noise = functools.partial(noise_of, force_noise=force_noise)
    problem, solution = solve_by(problem, by_squares, loss=loss, noise=noise, starts=starts)
    on_machine = holds_static_force(rig)
    if on_machine:
        problem, solution = with_static_force_on_machine(problem, solution)
    known = [p.path for p in parameters(problem.free.tree)]
    named = matched_in_words(known, over=over or (), freeze=freeze, bounds=bounds or {}, per_record=per_record)
    result = dataclasses.replace(judge(problem, solution, force_noise=force_noise), patterns=named)
    if on_machine:
        said = static_force_in_words(result, problem.runs)
        result = dataclasses.replace(result, warnings=(*result.warnings, *said))
    words = (criterion_in_words(problem, loss, priors or {}), records_in_words(problem))
    criterion = "; ".join(filter(None, words))
    if input_noise is None:
        return dataclasses.replace(result, criterion=criterion)
    biases = map(float, input_noise_bias(problem, solution.best, input_noise))
    estimates = tuple(e._replace(bias=bias) for e, bias in zip(result.parameters, biases, strict=True))
    biased = on_bias(estimates)
    return dataclasses.replace(
        result,
        criterion=criterion,
        parameters=estimates,
        warnings=(*result.warnings, *biased),
        main_warnings=(*result.main_warnings, *biased)[:MOST_WARNINGS],
    )


@one_thread()
def solve(
    problem: Problem, *, starts: int | None = None, max_steps: int = 200, solver: Solver | None = None
) -> Solution:
    """The second step of `fit`: minimise the sum of squares of a problem.

    Arguments:
        problem: result of `prepare`.
        starts: largest number of starts; all that the laws propose if left out.
        max_steps: largest number of steps of each search.
        solver: as in `fit`; one that is given also solves what could be computed directly.

    Raises:
        ValueError: counts below one; a solver of another kind.
    """
    _checks.counts(max_steps=max_steps, starts=starts)
    if solver is not None and not isinstance(solver, Solver):
        remedy = "For example `optimistix.Dogleg(rtol=1e-8, atol=1e-8)`."
        _checks.refuse("solver", "be a least-squares solver or minimiser of optimistix", solver, remedy)
    rig, free = rig_of(problem.free.tree), problem.free
    linear = problem.law.traits().linear_in_parameters and all(p.linear and not p.domain.ordered for p in free.chosen)
    if solver is None and linear and not (rig and "heat" in rig.effects()):  # which has a closed form
        return _solve_linear(problem)
    return search_from(problem, starts=starts, max_steps=max_steps, solver=solver)


def _solve_linear(problem: Problem) -> Solution:
    """Minimum of a linear least-squares problem within the domains."""
    free, coordinates = problem.free, problem.coordinates
    begin = np.asarray(free.values)
    printed = evaluator(free, problem.residuals) if begin.dtype == np.float64 else None
    if printed is None:
        residual, jacobian = map(np.asarray, linearised(free, free.values, problem.residuals))
        whole = np.concatenate([jacobian, residual[:, None]], axis=1)
    else:
        whole = printed(begin)
    whole = np.concatenate([whole, problem.anchor_rows(begin)])
    residual, jacobian = whole[:, -1], whole[:, :-1]
    norms = np.linalg.norm(jacobian, axis=0)
    unseen = norms <= UNSEEN * norms.max()  # no sample shows these numbers: they keep their start
    scale, jacobian = np.where(unseen, 1.0, norms), np.where(unseen, 0.0, jacobian)
    lower, upper = (coordinates.to_physical(np.asarray(y)) for y in coordinates.bounds())
    target = jacobian @ begin - residual
    whole = triangle(np.concatenate([jacobian / scale, target[:, None]], axis=1))
    r, target = whole[: begin.size, : begin.size], whole[: begin.size, begin.size]
    values = np.where(unseen, begin, np.linalg.lstsq(r, target, rcond=None)[0] / scale)
    status = Status.CONVERGED
    if np.any((values < lower) | (values > upper)):
        from scipy.optimize import lsq_linear  # few fits need it

        answer = lsq_linear(r, target, (lower * scale, upper * scale), method="bvls")
        values = np.where(unseen, begin, np.clip(answer.x / scale, lower, upper))
        status = Status.CONVERGED if answer.success else Status.STEP_LIMIT
    end = SearchEnd(values, residual + jacobian @ (values - begin), jacobian, status, 0)
    return Solution(end, (end,), 1, closed_form=True)

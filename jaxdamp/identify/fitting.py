"""`fit`: weighted nonlinear least squares of a damper law over many bench records."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, Protocol, Unpack, cast, overload, runtime_checkable

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._settings import part, with_defaults
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp._triangles import triangle
from jaxdamp.bench import BenchRun, as_runs, usable
from jaxdamp.identify.contradicting import refuse_several_laws
from jaxdamp.identify.criteria import criterion_in_words, solve_by
from jaxdamp.identify.judging import MOST_WARNINGS, input_noise_bias, judge, on_bias
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.losses import LOSSES
from jaxdamp.identify.machine import Machine, holds_static_force, static_force_in_words, with_static_force_on_machine
from jaxdamp.identify.many import fit_many
from jaxdamp.identify.many_result import ManyFits
from jaxdamp.identify.model import effects_of
from jaxdamp.identify.noise import noise_of
from jaxdamp.identify.preparing import prepare, records_in_words, weighting_of
from jaxdamp.identify.printed import evaluator
from jaxdamp.identify.problem import Problem, linearised
from jaxdamp.identify.search import SearchEnd, Solver
from jaxdamp.identify.settings import FIT, PROBLEM, FitSettings, ScheduledSettings, TargetSettings, check_keywords
from jaxdamp.identify.several import Solution, search_from
from jaxdamp.identify.starting import Start
from jaxdamp.identify.targets import Goal, Numbers, TargetFit, fit_targets
from jaxdamp.identify.vehicle_fitting import fit_vehicle
from jaxdamp.identify.vehicle_result import VehicleFit
from jaxdamp.parameters import matched_in_words, parameters
from jaxdamp.vehicles import AbstractVehicle


if TYPE_CHECKING:
    from jaxdamp.identify.scheduling import ScheduledFit  # which is made of fits of a law


P = ParamSpec("P")  # arguments of `fit`
V = ParamSpec("V")  # of `fit_vehicle`
M = ParamSpec("M")  # of `fit_many`
UNSEEN = 1e-12  # of the largest derivative, up to which one is a rounding error
# Errors due to a law that does not suit the records, as opposed to a wrong call (`TypeError` and so on).
NUMERICAL = (ValueError, ArithmeticError, eqx.EquinoxRuntimeError, jax.errors.JaxRuntimeError)


@runtime_checkable
class FitCall(Protocol[P, V, M]):
    """`fit` by what is fitted: a law, a vehicle, one law to many dampers or settings, a model to numbers."""

    @overload
    def __call__(self, *args: V.args, **settings: V.kwargs) -> VehicleFit: ...
    @overload
    def __call__(
        self, law: PyTree, runs: Mapping[str, Goal], *, numbers: Numbers, **settings: Unpack[TargetSettings]
    ) -> TargetFit: ...
    @overload
    def __call__(
        self,
        law: Start,
        runs: Iterable[BenchRun],
        *,
        scheduled: Literal[True],
        rig: Machine = ...,
        **settings: Unpack[ScheduledSettings],
    ) -> "ScheduledFit": ...
    @overload
    def __call__(self, *args: P.args, **settings: P.kwargs) -> FitResult: ...
    @overload
    def __call__(self, *args: M.args, **settings: M.kwargs) -> ManyFits: ...


def of_any_records(
    vehicle: Callable[V, VehicleFit], many: Callable[M, ManyFits]
) -> Callable[[Callable[P, FitResult]], FitCall[P, V, M]]:
    """A function of the records of one damper that hands other records to the fit that explains them."""

    def dispatched(fit: Callable[P, FitResult]) -> FitCall[P, V, M]:
        @functools.wraps(fit)
        def by_kind(*args: Any, **settings: Any) -> Any:
            given: dict[str, Any] = dict(zip(("law", "runs"), args, strict=False)) | settings
            model = given.pop("law") if "law" in given else given.pop("vehicle", None)
            records = given.pop("runs") if "runs" in given else given.pop("records", None)
            if "numbers" in given:
                return fit_targets(given.pop("numbers"), model, cast(Any, records), **given)
            if isinstance(model, AbstractVehicle):
                return cast(Any, vehicle)(model, records, **given)
            if isinstance(records, Mapping):
                return cast(Any, many)(model, records, **given)
            if settings.pop("scheduled", False):
                del given["scheduled"]
                from jaxdamp.identify.scheduling import fit_scheduled  # which is made of fits of a law

                return fit_scheduled(cast(Any, model), cast(Any, records), **given)
            return fit(*args, **settings)

        return cast(FitCall[P, V, M], by_kind)

    return dispatched


@of_any_records(fit_vehicle, fit_many)
@of_known_numbers
@with_defaults(FIT, check=check_keywords)
def fit(
    law: Start, runs: BenchRun | Iterable[BenchRun], *, rig: Machine = None, **settings: Unpack[FitSettings]
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
        settings: keywords, all optional: `over`, `freeze`, `bounds`, `tie`, `priors` say what may change and what is
            known of it (see `Free`); `initial_state`, `samples_per_cycle` how records are taken (see `Records`); `loss`
            and `max_steps` how is searched (see `Search`); `per_record` and `weighting` (see `ProblemSettings`),
            `force_noise`, `input_noise`, `starts`, `bad_records`, `solver` are described in `FitSettings`, as are all
            defaults.

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
    loss, force_noise, starts = settings["loss"], settings["force_noise"], settings["starts"]
    _checks.one_of("loss", loss, LOSSES)
    if force_noise is not None:
        _checks.positive("force_noise", force_noise)
    records = as_runs(runs, call="fit(law, runs)")
    runs = usable(records, settings["bad_records"], robust=loss != "squares")
    settings = {**settings, "weighting": weighting_of(runs, records, settings["weighting"])}
    problem = prepare(law, runs, rig=rig, **part(settings, PROBLEM))
    refuse_several_laws(problem.free.tree, problem.fitted_to, settings)
    by_squares = functools.partial(_least_squares, max_steps=settings["max_steps"], solver=settings["solver"])
    noise = functools.partial(noise_of, force_noise=force_noise)
    problem, solution = solve_by(problem, by_squares, loss=loss, noise=noise, starts=starts)
    on_machine = holds_static_force(rig)
    if on_machine:
        problem, solution = with_static_force_on_machine(problem, solution)
    named = matched_in_words(
        [p.path for p in parameters(problem.free.tree)],
        **{name: settings[name] for name in ("over", "freeze", "bounds", "per_record")},
    )
    result = judge(problem, solution, force_noise=force_noise)
    words = (criterion_in_words(problem, loss, settings["priors"] or {}), records_in_words(problem))
    said, estimates = static_force_in_words(result, problem.runs) if on_machine else [], result.parameters
    if settings["input_noise"] is not None:
        biases = map(float, input_noise_bias(problem, solution.best, settings["input_noise"]))
        estimates = tuple(e._replace(bias=bias) for e, bias in zip(estimates, biases, strict=True))
    biased = on_bias(estimates)
    return dataclasses.replace(
        result,
        criterion="; ".join(filter(None, words)),
        patterns=named,
        parameters=estimates,
        warnings=(*result.warnings, *said, *biased),
        main_warnings=(*result.main_warnings, *biased)[:MOST_WARNINGS],
    )


def solve(
    problem: Problem, *, starts: int | None = None, max_steps: int = 200, solver: Solver | None = None
) -> Solution:
    """The second step of `fit`: minimise the sum of squares of a problem.

    Priors count relative to the noise of the records, which is estimated between rounds, as in `fit`.

    Arguments:
        problem: result of `prepare`.
        starts: largest number of starts; all that the laws propose if left out.
        max_steps: largest number of steps of each search.
        solver: as in `fit`; one that is given also solves what could be computed directly.

    Raises:
        ValueError: counts below one; a solver of another kind.
    """
    by_squares = functools.partial(_least_squares, max_steps=max_steps, solver=solver)
    if problem.noise_known:
        return by_squares(problem, starts)
    noise = functools.partial(noise_of, force_noise=None)
    return solve_by(problem, by_squares, loss="squares", noise=noise, starts=starts)[1]


@one_thread()
def _least_squares(problem: Problem, starts: int | None, max_steps: int, solver: Solver | None) -> Solution:
    """The minimum of the sum of squares of a problem as it is."""
    _checks.counts(max_steps=max_steps, starts=starts)
    if solver is not None and not isinstance(solver, Solver):
        remedy = "For example `optimistix.Dogleg(rtol=1e-8, atol=1e-8)`."
        _checks.refuse("solver", "be a least-squares solver or minimiser of optimistix", solver, remedy)
    free = problem.free
    linear = problem.law.traits().linear_in_parameters and all(p.linear and not p.domain.ordered for p in free.chosen)
    if solver is None and linear and "heat" not in effects_of(free.tree):  # which has a closed form
        return _solve_linear(problem)
    return search_from(problem, starts=starts, max_steps=max_steps, solver=solver)


def _solve_linear(problem: Problem) -> Solution:
    """Minimum of a linear least-squares problem within the domains."""
    free, coordinates = problem.free, problem.coordinates
    begin = np.asarray(free.values)
    printed = evaluator(free, problem.residuals)
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

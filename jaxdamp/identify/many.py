"""`fit_many`: one law fitted to many dampers, clicks or temperatures in one call."""

import dataclasses
import functools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Unpack, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._settings import with_defaults
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun
from jaxdamp.blocks import Cluster
from jaxdamp.dampers import AbstractDamper, Reach
from jaxdamp.identify.contradicting import refuse_several_laws
from jaxdamp.identify.criteria import Priors
from jaxdamp.identify.dependence import OWN, Dependence, Products, dependence
from jaxdamp.identify.initial_states import INITIAL_STATES
from jaxdamp.identify.judging import NotFiniteError
from jaxdamp.identify.lanes import Lanes, by_rounds, judged
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.losses import LOSSES
from jaxdamp.identify.machine import Machine
from jaxdamp.identify.many_blocks import fit_into_store
from jaxdamp.identify.many_records import (
    AllRecords,
    Options,
    begun_on,
    by_name,
    fitted_records,
    left_out_in_words,
    warn_of_left_out,
)
from jaxdamp.identify.many_result import ManyFits
from jaxdamp.identify.model import initial_state_for, own_names, rig_of
from jaxdamp.identify.preparing import Beginning, weights
from jaxdamp.identify.settings import FIT, FitSettings, check_keywords
from jaxdamp.identify.several import other_starts
from jaxdamp.identify.starting import Start
from jaxdamp.parameters import FreeParameters, name_patterns
from jaxdamp.solve import BoundedLevenbergMarquardt, Linearisation, SearchLanes, least_squares_on_host


NOT_FINITE = "its law has no finite forces and derivatives over its records: start from another law"
STARTED_FROM = 12  # dampers whose records give the start of a law class


@of_known_numbers
@one_thread()
@with_defaults(FIT, check=check_keywords, starts=1)
def fit_many(
    law: Start,
    dampers: Mapping[str, BenchRun | Iterable[BenchRun]] | Iterable[BenchRun | Iterable[BenchRun]],
    *,
    rig: Machine = None,
    shared: Mapping[str, int] | Sequence[str] = (),
    settings: Sequence[float | int] | None = None,
    file: str | os.PathLike[str] | None = None,
    cluster: Cluster = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[FitSettings],
) -> ManyFits:
    """Fit one law to many dampers at once: the same least squares as `fit`, for all of them side by side.

    All records are computed in one compiled call for each step, and each damper ends by itself. Standard errors are
    those of the linearised problem, increased where the residual is correlated; `many.fit(name)` is the fit of one
    damper with the further checks (other minima, profiles, groups of undetermined parameters).

    With `shared`, parameters are common to all dampers or polynomials of a setting, such as the clicks of an adjuster
    or the temperature. All dampers are then one problem, in which each counts relative to the level of its force, and
    `law_at(setting)` is the law at settings that were not measured.

    Arguments:
        law: the start of all dampers, as in `fit`; a law class starts from the records of some of them together.
        dampers: the records of each damper, by name or in order.
        rig: the test machine, as in `fit`; its numbers differ from damper to damper unless they are `shared`.
        shared: parameters common to all dampers, `["blow_off_rate"]`, or the degree of their polynomials in the
            setting, `{"blow_off_rate": 0, "rebound_rate": 2}`.
        settings: one number for each damper.
        file: a Zarr store (`.zarr`, a folder) for the fits, which are computed in blocks of 64 dampers. The records of
            `bench.DamperRecords` are read block by block; a damper that cannot be read or fitted does not stop the
            others, and its remark says why. The same call goes on after an interruption, and fits only dampers that
            are new or whose records changed. A law class starts from the first damper, so that a store can grow.
        cluster: who computes the blocks, as in `jaxdamp.sweep`: a Dask `Client`, an executor, or a part such as "3/16".
        progress: of the blocks, called with the number of rows done and of all rows, 64 in a block.
        options: all keywords of `fit` (see `FitSettings`), for each damper; `starts` is 1 if left out, and `weighting`
            "samples" or "runs". A prior is the same for every damper, and counts once for all of a shared parameter.
            With `initial_state="estimated"`, `per_record`, `input_noise` or `solver` the dampers are fitted one after
            the other and cannot share parameters; of numbers of single records the result has the mean over the records
            of a damper.

    Returns:
        The laws with their parameters, standard errors, scores and a status each; dampers that differ from the others
        by their error or their parameters are named in `remarks`, and so are those left out because the law has no
        finite force over their records.

    Raises:
        ValueError: no dampers; a record with an error; records of one damper that contradict each other; names
            that fit no parameter; settings or degrees that do not suit the dampers.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear
    >>> laws = {f"{clicks} clicks": Bilinear(2000.0 + 100.0 * clicks, 1200.0) for clicks in range(4)}
    >>> test = bench.SineTest(0.02, 2.0)
    >>> records = {name: bench.VirtualDyno(law, force_noise=5.0).run(test) for name, law in laws.items()}
    >>> many = fit_many(Bilinear, records, shared={"rebound_rate": 1, "compression_rate": 0}, settings=range(4))
    >>> round(float(many.law_at(1.5).rebound_rate), -1)
    2150.0
    """
    how: Options = {"rig": rig, **options}
    _checks.one_of("weighting", cast(str, how["weighting"]), ["samples", "runs"])
    _checks.one_of("loss", how["loss"], LOSSES)
    _checks.one_of("initial_state", how["initial_state"], INITIAL_STATES)
    _checks.counts(max_steps=how["max_steps"], starts=how["starts"])
    if how["force_noise"] is not None:
        _checks.positive("force_noise", how["force_noise"])
    stated = None if settings is None else tuple(map(float, settings))
    by_names = by_name(dampers)
    if file is not None or cluster is not None:
        return fit_into_store(law, by_names, stated, file, cluster, progress, shared=bool(shared), options=how)
    given = dict(by_names)  # which reads them, once
    records = {name: fitted_records(name, runs, how) for name, runs in given.items()}
    some = list(records.values())[:: -(-len(records) // STARTED_FROM)]
    begin = begun_on(law, [run for runs in some for run in runs], how, shared)
    for name, runs in records.items():
        refuse_several_laws(begin.model, runs, how, f"dampers[{name!r}]")
    lacking = [[run.name for run in runs if run not in records[name]] for name, runs in given.items()]
    many = fitted_together(begin, records, how, shared, stated)
    return _with_reasons(many, begin.law, [left_out_in_words(names) for names in lacking], together=bool(shared))


def _with_reasons(many: ManyFits, law: AbstractDamper, lacking: Sequence[str], *, together: bool) -> ManyFits:
    """The same with why dampers or records are left out; refused where no damper can be fitted without one of them."""
    left = [name for name, reason in zip(many.names, many.reasons, strict=False) if reason]
    if left and (together or len(left) == len(many)):
        must = "give finite forces and derivatives over the records of all dampers"
        _checks.refuse("law", must, f"{law}, which does not for {', '.join(left)}", "Start from another law.")
    warn_of_left_out(left, len(many))
    earlier = many.reasons or ("",) * len(many)
    return dataclasses.replace(many, reasons=tuple(a or b for a, b in zip(earlier, lacking, strict=True)))


@one_thread()
def fitted_together(
    begin: Beginning,
    dampers: AllRecords,
    options: Options,
    shared: Mapping[str, int] | Sequence[str] = (),
    settings: tuple[float, ...] | None = None,
) -> ManyFits:
    """The fits of dampers from a start that is resolved."""
    free, records = begin.free, tuple(dampers.values())
    degrees = shared if isinstance(shared, Mapping) else dict.fromkeys(name_patterns("shared", shared), 0)
    depends = dependence(free, own_names(begin.model).find_keys("shared", degrees), settings, len(dampers))
    how: Options = {**options, "bad_records": "keep"}
    many = functools.partial(ManyFits, tuple(dampers), records, settings, free=free, options=how)
    initial_state = initial_state_for(begin.model, options["initial_state"])
    estimated = {"initial_state": "estimated"} if initial_state == "estimated" else {}
    others: dict[str, object] = {name: options[name] for name in ("per_record", "input_noise", "solver")}
    alone = estimated | {name: value for name, value in others.items() if value is not None and value != ()}
    if alone:
        if depends is not None:
            name, value = next(iter(alone.items()))
            _checks.refuse("shared", f"be left out with `{name}`: such dampers are fitted by themselves", repr(value))
        return many(**_one_by_one(records, begin.law, free, how, "law." if estimated and not rig_of(free.tree) else ""))
    start = begin._replace(initial_state=initial_state, priors=_once(begin.priors, free, depends))
    sigma, by_runs = [weights(options["weighting"], runs) for runs in records], options["weighting"] == "runs"
    problems = start.problems(records, sigma, options["samples_per_cycle"], each=by_runs)
    how_far = options["loss"], options["starts"], options["max_steps"]
    lanes = Lanes.of(problems, options["force_noise"])
    return many(dependence=depends, **_side_by_side(lanes, records, depends, *how_far))


def _side_by_side(
    lanes: Lanes,
    records: Sequence[Sequence[BenchRun]],
    depends: Dependence | None,
    loss: str,
    starts: int | None,
    max_steps: int,
) -> dict[str, Any]:
    """What the searches of all dampers end with: fields of the result."""
    everyone = lanes.damper
    lanes, begin = _with_other_starts(lanes, records, starts)
    if depends is not None and starts != 1:  # each alone first, from where all together begin
        alone, best, _ = _solved(lanes, begin, None, max_steps)
        lanes, begin = lanes._replace(damper=everyone), alone.y[best]
    end, best, vector = _solved(lanes, begin, depends, max_steps)
    lanes, end = by_rounds(
        lanes._replace(damper=everyone),
        end.of(best),
        loss,
        lambda some, y: _solved(some, y, depends, max_steps)[0],
        depends,
    )
    if depends is not None:
        vector = depends.start(end.y)
    ends = judged(lanes, end, depends)
    without = np.isnan(ends["rmse"])
    return ends | {
        "status": tuple(Status.LEFT_OUT if no else one for no, one in zip(without, end.status, strict=True)),
        "reasons": tuple(NOT_FINITE * bool(no) for no in without),
        "steps": end.steps,
        "vector": vector,
        "share_left_out": np.array([problem.share_left_out for problem in lanes.problems]),
    }


def _one_by_one(
    records: Sequence[tuple[BenchRun, ...]], law: AbstractDamper, free: FreeParameters, how: Options, prefix: str
) -> dict[str, Any]:
    """Each damper by a fit of its own; the paths of its law begin with the prefix."""
    results = [_alone(law, runs, how) for runs in records]

    def each(read: Callable[[FitResult], object], size: int | tuple[int, ...] = ()) -> np.ndarray:
        return np.array([np.full(size, np.nan) if result is None else read(result) for result in results])

    names = [prefix + name for name in free.names]
    numbers = each(lambda result: [_mean_over_records(result, name) for name in names], (len(names), 3))
    return {
        "values": numbers[..., 0],
        "standard_errors": numbers[..., 1],
        "bias": numbers[..., 2] if how["input_noise"] else None,
        "fit_percent": each(lambda result: result.fit_percent),
        "rmse": each(lambda result: result.rmse),
        "status": tuple(Status.LEFT_OUT if result is None else result.status for result in results),
        "reasons": tuple(NOT_FINITE * (result is None) for result in results),
        "steps": np.array([0 if result is None else result.steps for result in results]),
        "record_rmse": tuple(map(_record_errors, results, records)),
        "share_left_out": each(lambda result: result.evidence.problem.share_left_out if result.evidence else 0.0),
    }


def _alone(law: AbstractDamper, runs: tuple[BenchRun, ...], how: Options) -> FitResult | None:
    """The fit of one damper; None where its law has no finite force."""
    from jaxdamp.identify.fitting import fit  # which hands many dampers to this file

    try:
        return fit(law, runs, **how)
    except NotFiniteError:
        return None


def _record_errors(result: FitResult | None, runs: Sequence[BenchRun]) -> Float[np.ndarray, " records"]:
    """The RMSE [N] of each record, NaN without a fit."""
    return np.full(len(runs), np.nan) if result is None else np.array([score.rmse for score in result.scores])


def _mean_over_records(result: FitResult, path: str) -> tuple[float, float, float]:
    """Value, standard error and bias of a number, zero if it was not asked for; the mean if each record has its own."""
    names = [e.name for e in result.parameters]
    indices = [i for i, name in enumerate(names) if name == path or name.startswith(f"{path}[")]
    chosen = [result.parameters[i] for i in indices]
    error = (
        np.sqrt(np.mean(result.covariance[np.ix_(indices, indices)])) if len(indices) > 1 else chosen[0].standard_error
    )
    return (
        float(np.mean([e.value for e in chosen])),
        float(error),
        float(np.mean([e.bias or 0.0 for e in chosen])),
    )


def _once(priors: Sequence[Priors], free: FreeParameters, depends: Dependence | None) -> tuple[Priors, ...]:
    """Priors that count once for all dampers together where a parameter is shared."""
    if depends is None:
        return tuple(priors)
    shared = {p.path for p, degree in zip(free.owners, depends.degree, strict=True) if degree != OWN}
    counts = [np.array([len(depends.column) if path in shared else 1 for path in one.paths]) for one in priors]
    return tuple(
        dataclasses.replace(one, deviation=one.deviation * jnp.asarray(np.sqrt(count)))
        for one, count in zip(priors, counts, strict=True)
    )


def _with_other_starts(
    lanes: Lanes, records: Sequence[Sequence[BenchRun]], starts: int | None
) -> tuple[Lanes, Float[np.ndarray, "lanes free"]]:
    """A lane for every start of every damper, and the coordinates to start from."""
    free, together = lanes.searches[0].coordinates.free, [run for runs in records for run in runs]
    begin = [np.asarray(free.values)]
    if starts != 1:
        reach = Reach(0.5 * max(float(np.ptp(r.stroke)) for r in together), max(r.peak_velocity for r in together))
        begin += other_starts(free, reach)[: None if starts is None else starts - 1]
    coordinates = np.array([lanes.searches[0].coordinates.from_physical(values) for values in begin], np.float64)
    dampers = np.arange(len(records))
    return lanes._replace(damper=dampers.repeat(len(begin))), np.tile(coordinates, (len(records), 1))


def _solved(
    lanes: Lanes, begin: Float[np.ndarray, "lanes free"], depends: Dependence | None, max_steps: int
) -> tuple[SearchLanes, np.ndarray, np.ndarray | None]:
    """The ends of all lanes, the best lane of each damper, and the vector of shared parameters."""
    bounds, precision = lanes.searches[0].coordinates.bounds(), lanes.searches[0].precision
    if depends is None:
        dampers = np.unique(lanes.damper)
        solver = BoundedLevenbergMarquardt(lower=bounds.lower, upper=bounds.upper, precision=precision)
        end = least_squares_on_host(lanes.linearise, solver, begin, max_steps)
        squares = [s if np.isfinite(s) else np.inf for s in end.aux[:, -1, -1]]
        best = [min(np.flatnonzero(lanes.damper == i), key=lambda lane: squares[lane]) for i in dampers]
        return end, np.array(best), None
    everyone = np.arange(len(begin))

    def linearise(vector: np.ndarray, _: np.ndarray) -> tuple[Linearisation, Products]:
        y = depends.at_dampers(vector[0])
        inside = np.all((y >= bounds.lower) & (y <= bounds.upper))
        return depends.gathered(*lanes.linearise(y, everyone), bool(inside))

    inner = depends.bounds(bounds)
    solver = BoundedLevenbergMarquardt(lower=inner.lower, upper=inner.upper, precision=precision)
    end = least_squares_on_host(linearise, solver, depends.start(begin)[None], max_steps)
    y, count = depends.at_dampers(end.y[0]), len(begin)
    products = np.broadcast_to(end.aux, (count, *end.aux.shape[1:]))
    together = SearchLanes(y, products, end.status * count, end.steps.repeat(count))
    return together, everyone, end.y[0]

"""`compare`: several laws on the same records, judged on motion that they were not fitted to."""

import dataclasses
import functools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp

from jaxdamp._progress import Progress
from jaxdamp._results import AbstractResult, plotted
from jaxdamp._status import Status
from jaxdamp._tables import Table, with_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.bench import BenchRun, as_runs, usable
from jaxdamp.identify.fitting import NUMERICAL, fit
from jaxdamp.identify.held_out import HeldOut, on_records, without_parts
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.machine import OFFSET, Machine
from jaxdamp.identify.rungs import Failure, Recommendation, Rung, ladder_table, recommendation, verdict
from jaxdamp.identify.scheduling import fit_scheduled, settings_stated
from jaxdamp.identify.starting import AbstractTrainedStart, Start, check_starts


MOST_THREADS = 4  # fits side by side: more of them wait for Python's lock


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(AbstractResult):
    """Laws fitted to the same records, in the order given.

    Attributes:
        rungs: the laws that were fitted, with their errors.
        held_out: the records scored on, not fitted; empty if parts of the fitted ones were held out.
        failed: the laws without a fit, and why.
    """

    rungs: tuple[Rung, ...]
    held_out: tuple[BenchRun, ...]
    failed: tuple[Failure, ...] = ()

    @classmethod
    def of(cls, outcomes: Iterable[Rung | Failure], held_out: Iterable[BenchRun] = ()) -> "Comparison":
        """The comparison of the outcomes of `fit_each`.

        Raises:
            ValueError: no law could be fitted.
        """
        outcomes = tuple(outcomes)
        rungs = tuple(outcome for outcome in outcomes if isinstance(outcome, Rung))
        failed = tuple(outcome for outcome in outcomes if isinstance(outcome, Failure))
        if not rungs:
            reasons = list(dict.fromkeys(failure.reason for failure in failed))
            texts = reasons if len(reasons) == 1 else [f"{failure.name}: {failure.reason}" for failure in failed]
            raise ValueError(f"None of {len(failed)} laws could be fitted. {' '.join(texts)}")
        return cls(rungs, tuple(held_out), failed)

    @functools.cached_property
    def recommendation(self) -> Recommendation:
        """The recommended law, those that predict as well, and those left aside."""
        return recommendation(self.rungs)

    @property
    def best(self) -> Rung:
        """The recommended law: the simplest that predicts motion held out as well as any, within the noise.

        It is no law with numbers at bounds or not identifiable, or whose search did not converge, where another is as
        good (`recommendation`).
        """
        return self.recommendation.rung

    @property
    def best_fit(self) -> Rung:
        """The law with the smallest error on the fitted records, however many numbers it needs."""
        return min(self.rungs, key=lambda rung: rung.rmse)

    @property
    def status(self) -> Status:
        """How the search of the recommended law ended."""
        return self.best.result.status

    @property
    def summary(self) -> str:
        """The recommended law and its errors: the first sentence of the verdict."""
        return self.verdict[0]

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of all fits, which concern the records and not a law, such as contradicting records."""
        first, *others = (rung.result.warnings for rung in self.rungs)
        return tuple(warning for warning in first if all(warning in warnings for warnings in others))

    def __getitem__(self, name: str) -> FitResult:
        """The fit of the law of that name."""
        for rung in self.rungs:
            if rung.name == name:
                return rung.result
        why = "".join(f" {failure.name} failed: {failure.reason}" for failure in self.failed if failure.name == name)
        raise KeyError(f"No law is named {name!r}; there are {', '.join(r.name for r in self.rungs)}.{why}")

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences on the recommended law, why it is this one, and the shares of the errors."""
        between = self.best.by_setting.between if self.best.by_setting else ()
        return (
            *verdict(self.recommendation, self.rungs, self.held_out),
            *(left.sentence(self.best.name) for left in between),
        )

    def table(self) -> Table:
        """Each law with its number of free parameters, its errors, their shares, and remarks."""
        return ladder_table(self.rungs, self.failed, self.best.name)

    def content(self) -> dict[str, Any]:
        """All fits as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        laws = {
            rung.name: {
                **rung.result.to_dict(),
                "held_out_fit": with_unit(rung.held_out_fit_percent, "%"),
                "held_out_rmse": with_unit(rung.held_out_rmse, "N"),
            }
            for rung in self.rungs
        }
        return {
            "best": self.best.name,
            "best_fit": self.best_fit.name,
            "verdict": list(self.verdict),
            "held_out": [run.name for run in self.held_out],
            "laws": laws,
            "failed": {failure.name: failure.reason for failure in self.failed},
        }

    def plot(self, kind: str = "ladder", **options: Any) -> Figure:
        """The errors of the laws side by side (`plots.ladder`), or the sheet of the recommended law.

        Arguments:
            kind: "ladder", or "sheet" for one A4 page (`plots.damper_sheet`).
            options: of that function.
        """
        from jaxdamp.plots import damper_sheet, ladder

        return plotted(kind, {"ladder": ladder, "sheet": damper_sheet}, self, **options)

    def __repr__(self) -> str:
        judged = any(rung.judged_on for rung in self.rungs)
        head = f"{'law':<24}{'free':>5}{'fit %':>8}{'RMSE N':>9}" + f"{'held-out %':>12}{'RMSE N':>9}" * judged
        lines = [head]
        for r in self.rungs:
            line = f"{r.name:<24}{r.parameters:>5}{r.fit_percent:>8.1f}{r.rmse:>9.1f}"
            if r.held_out_rmse is not None:
                line += f"{r.held_out_fit_percent:>12.1f}{r.held_out_rmse:>9.1f}"
            lines.append(line)
        lines += [f"{failure.name:<24} failed: {failure.reason}" for failure in self.failed]
        about_records = [f"warning: {warning}" for warning in self.warnings if len(self.rungs) > 1]
        answer = " ".join(self.verdict[: 2 if len(self.rungs) > 1 else 1])
        return "\n".join([*lines, *about_records, answer, f"best: {self.best.name}"])


@of_known_numbers
def compare(
    laws: Mapping[str, Start],
    runs: Iterable[BenchRun],
    *,
    held_out: Iterable[BenchRun] = (),
    rig: Machine = OFFSET,
    scheduled: bool = False,
    progress: Callable[[str], None] | None = None,
    bad_records: str = "refuse",
    **options: Any,
) -> Comparison:
    """Fit several laws to the same records, judge them on motion held out, and recommend one (`.best`).

    Without `held_out`, parts of the records are left out in turn and predicted by fits to the rest, which start at the
    fit of all records: whole records in up to four groups where there are three motions or more, otherwise the quarters
    of the records in time. A law trained before the fit (`LearntStart`) has seen all records and is judged only on
    `held_out`.

    A law that cannot be fitted or scored does not stop the comparison: it is listed in `failed` with the reason.

    Arguments:
        laws: starts by name, such as `default_ladder(runs)`.
        runs: records to fit.
        held_out: records to judge on, which are not fitted, instead of parts of `runs`.
        rig: the test machine of all fits, as in `fit`; a zero error of the load cell if left out, since a law that must
            explain it comes out wrong. `None` is a machine that adds nothing.
        scheduled: whether the parameters of each law are functions of the records' command, as in `fit_scheduled`;
            starts are carried over from neighbouring settings, and the best law is also scored between settings.
        progress: called with each name before its fit; a line in the terminal if it is left out.
        bad_records: "refuse", "leave_out" or "keep" records with an error, as in `fit`; those held out are checked too.
        options: passed on to `fit`.

    Raises:
        ValueError: no laws, or none that could be fitted; a record with an error; with `scheduled`, records of one
            command only.

    >>> from jaxdamp import bench, dampers
    >>> runs = bench.VirtualDyno(dampers.Bilinear(2600.0, 1200.0), force_noise=5.0).run(
    ...     [bench.SineTest(amplitude=0.02, frequency=2.0)]
    ... )
    >>> compare({"linear": dampers.Linear, "bilinear": dampers.Bilinear}, runs).best.name
    'bilinear'
    """
    call = "compare(laws, runs)"
    check_starts(laws, call)
    robust = options.get("loss", "squares") != "squares"
    runs = usable(as_runs(runs, call=call), bad_records, robust=robust)
    held_out = usable(as_runs(held_out, "held_out"), bad_records, robust=robust, argument="held_out")
    with Progress("Fitting") as shown:
        number = 0

        def counted(name: str) -> None:
            nonlocal number
            number += 1
            shown(f"{name}, {number} of {len(laws)}")

        how = {"rig": rig, "scheduled": scheduled, "progress": progress or counted, "bad_records": bad_records}
        comparison = Comparison.of(fit_each(laws, runs, held_out, **how, **options), held_out)
    _ = comparison.verdict  # which leaves out settings if there are any: that is part of this work
    return comparison


def fit_each(
    laws: Mapping[str, Start],
    runs: Sequence[BenchRun],
    held_out: Sequence[BenchRun] = (),
    *,
    rig: Machine = OFFSET,
    scheduled: bool = False,
    progress: Callable[[str], None] = lambda name: None,
    **options: Any,
) -> Iterator[Rung | Failure]:
    """Fit the laws of a comparison; yields each result or failure in their order, as soon as it is available.

    Most of the time is needed for compiling, so several laws are fitted at the same time, each in its own thread.

    Arguments:
        laws: starts by name.
        runs: records to fit.
        held_out: records to judge on, as in `compare`.
        rig: the test machine of all fits, as in `compare`.
        scheduled: whether the parameters are functions of the command, as in `compare`.
        progress: called with each name before its result is waited for.
        options: passed on to `fit`.

    Raises:
        ValueError: with `scheduled`, records without a command or of one command only.
    """
    if scheduled:
        runs = settings_stated(runs)
    # A thread begins with the precision of the process, not with that of its caller.
    double = jnp.result_type(float) == jnp.float64

    def fitted(name: str, start: Start) -> Rung | Failure:
        try:
            with jax.enable_x64(double):
                by_setting = fit_scheduled(start, runs, rig=rig, progress=_silent, **options) if scheduled else None
                result = by_setting.result if by_setting else fit(start, runs, rig=rig, **options)
                judged = _judged(start, result, held_out, scheduled)
        except NUMERICAL as error:
            return Failure(name, str(error))
        own = (name, len(result.parameters), result.fit_percent, result.rmse)
        if judged is None:
            return Rung(*own, None, None, result, result.scores, by_setting)
        return Rung(*own, judged.fit_percent, judged.rmse, result, judged.scores, by_setting, judged.words)

    pool = ThreadPoolExecutor(max_workers=min(os.cpu_count() or 1, MOST_THREADS))
    try:
        waiting = {name: pool.submit(fitted, name, start) for name, start in laws.items()}
        for name, outcome in waiting.items():
            progress(name)
            yield outcome.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _judged(start: Start, result: FitResult, held_out: Sequence[BenchRun], scheduled: bool) -> HeldOut | None:
    """The errors of a fit on records held out, or on parts of its own."""
    if held_out:
        return on_records(result, held_out)
    return None if isinstance(start, AbstractTrainedStart) else without_parts(result, in_time=scheduled)


def _silent(text: str) -> None:
    """Shows nothing: laws are fitted side by side, each in its thread."""
    del text

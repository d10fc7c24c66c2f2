"""A page on the whole chain, and on any result: records, laws, rides on the best law, a tuning."""

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Unpack

from jaxdamp import plots
from jaxdamp._display import Display, display, shown_in
from jaxdamp._results import AbstractResult
from jaxdamp._second_process import elsewhere
from jaxdamp._settings import part, with_defaults
from jaxdamp.bench import BenchRun, Evaluation, Preflight
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Comparison, VehicleComparison, VehicleFit
from jaxdamp.report.benches import add_evaluation, add_records, bench_report, bench_verdict
from jaxdamp.report.fits import FIT_PAGE, FitPage, add_fits, add_other_fits, fit_report, fit_verdict
from jaxdamp.report.page import PAGE, Attempts, Report
from jaxdamp.report.rides import add_rides, notes_of, ride_report, ride_verdict
from jaxdamp.report.tunings import add_tuning, tuning_report
from jaxdamp.report.vehicle_fits import vehicle_comparison_report, vehicle_fit_report
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


@with_defaults(FIT_PAGE, title="From bench records to a better damper")
def chain_report(
    comparison: Comparison,
    rides: Mapping[str, Mapping[str, Response]],
    tuned: TuneResult | None = None,
    *,
    sentences: Sequence[str] = (),
    sheets: bool = True,
    evaluation: Evaluation | None = None,
    laws: Callable[[], Report] | None = None,
    **page: Unpack[FitPage],
) -> Report:
    """A page on records, the laws fitted to them, rides on these laws, and a tuning.

    Arguments:
        comparison: the fits, of `identify.compare`.
        rides: for each road, by its title, the responses by name; the first is compared with the others.
        tuned: of `tune.minimise`.
        sentences: what else its verdict says.
        sheets: one A4 page of the damper and one of the ride at the top.
        evaluation: of `bench.evaluate`.
        laws: its part on records and laws, drawn by `FitPart.begun` with the same arguments; drawn now if left out.
        page: `title`, `folder`, `attempts`, `runs`, `remarks`, `preflight`, `baseline`, all optional (see `FitPage`).

    >>> from jaxdamp import bench, identify, report, roads, simulate, tune, vehicles
    >>> from jaxdamp.dampers import Bilinear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.05, 4.0))
    >>> comparison = identify.compare({"bilinear": Bilinear}, runs)
    >>> car = vehicles.presets.quarter_car_000(comparison.best.result.law)
    >>> ride = simulate(car, roads.cosine_bump(0.05, start=0.2, duration=0.25), duration=1.0)
    >>> tuned = tune.minimise("rms_dynamic_tyre_load", car, roads.white("C", 20.0), over=["damper.**"])
    >>> page = report.chain_report(comparison, {"a bump": {"bilinear": ride}}, tuned)  # page.write("chain.html")
    >>> "tyre load variation, RMS" in page.to_html()
    True
    """
    report, preflight, baseline = Report(**part(page, PAGE)), page["preflight"], page["baseline"]
    best, *others = fit_verdict(report, comparison, baseline)
    report.verdict(
        *([tuned.verdict.sentence] if tuned else []),
        best,
        *sentences,
        *(f"{road}: {sentence}" for road, ride in rides.items() for sentence in ride_verdict(ride)),
        more=[
            *([tuned.ending] if tuned else []),
            *others,
            *(bench_verdict(evaluation, preflight) if evaluation else []),
        ],
    )
    fits = FitPart(comparison, page["runs"], sheets, evaluation, preflight, page["remarks"], baseline)
    report.include(fits.drawn(report.attempts, None if page["folder"] is None else {}) if laws is None else laws())
    if sheets and tuned is not None:
        report.sheet(lambda: tuned.plot("sheet"), tuned.verdict.sentence, "ride_sheet")
    elif sheets and rides:
        road, ride = next(iter(rides.items()))
        report.sheet(lambda: plots.ride_sheet(ride, name=road), ride_verdict(ride)[-1], "ride_sheet")
    for number, (road, ride) in enumerate(rides.items(), 1):
        report.heading(f"Ride: {road}")
        report.points(notes_of(ride))
        add_rides(report, ride, road, f"ride_{number}_")
    if tuned is not None:
        report.heading(tuned.verdict.outcome.value)
        add_tuning(report, tuned)
    add_other_fits(report, comparison)
    return report


class FitPart(NamedTuple):
    """What `chain_report` says of records and laws.

    Arguments:
        comparison: the fits, of `identify.compare`.
        sheets, evaluation: as in `chain_report`.
        runs, preflight, remarks, baseline: as in `FitPage`.
    """

    comparison: Comparison
    runs: Sequence[BenchRun] | None = None
    sheets: bool = True
    evaluation: Evaluation | None = None
    preflight: Preflight | None = None
    remarks: Sequence[str] = ()
    baseline: AbstractDamper | None = None

    def drawn(self, attempts: Attempts | None = None, files: dict[str, bytes] | None = None) -> Report:
        """Its sheet and sections.

        Arguments:
            attempts: collects parts that fail.
            files: takes the pictures as files, for a page with a folder.
        """
        part, comparison, baseline = Report("", files, attempts), self.comparison, self.baseline
        if self.sheets:
            part.sheet(lambda: comparison.plot("sheet", baseline=baseline), comparison.verdict[0], "damper_sheet")
        records = (*comparison.best.result.runs, *comparison.held_out) if self.runs is None else tuple(self.runs)
        add_records(part, records, comparison.held_out, self.remarks, self.preflight)
        if self.evaluation is not None:
            add_evaluation(part, self.evaluation)
        add_fits(part, comparison, baseline=baseline, others=False)
        return part

    def begun(self, attempts: Attempts | None = None) -> Callable[[], Report]:
        """The same with files, drawn by another process from now on; where there is none, when it is asked for.

        Arguments:
            attempts: as in `drawn`, one that can be pickled.
        """
        compute = functools.partial(_shown, display(), self, attempts)
        return elsewhere(compute) or compute


def _shown(shown: Display, part: FitPart, attempts: Attempts | None) -> Report:
    with shown_in(shown):
        return part.drawn(attempts, {})


_PAGES: dict[type, Callable[..., Report]] = {
    Comparison: fit_report,
    Evaluation: bench_report,
    Response: ride_report,
    TuneResult: tuning_report,
    VehicleComparison: vehicle_comparison_report,
    VehicleFit: vehicle_fit_report,
}


def result_report(
    result: AbstractResult, title: str = "", *, folder: Path | None = None, attempts: Attempts | None = None
) -> Report:
    """A page on a result, as `result.report(path)` writes it.

    Arguments:
        result: of a fit, a tuning or a study.
        title: of the page; that of its kind if left out.
        folder: where its pictures are written as files too.
        attempts: parts that may fail by themselves.

    >>> from jaxdamp import report, vehicles
    >>> page = report.result_report(vehicles.modes(vehicles.presets.quarter_car_000()))
    >>> "damping ratio" in page.to_html()
    True
    """
    page_of = next((page for kind, page in _PAGES.items() if isinstance(result, kind)), None)
    if page_of is not None:
        named = {"title": title} if title else {}
        return page_of(result, folder=folder, attempts=attempts, **named)
    page = Report(title or result.table().title, folder, attempts)
    page.verdict(result.summary)
    if result.warnings:
        page.heading("Warnings")
        page.points(result.warnings)
    page.heading("Results")
    for table in result.tables().values():
        page.table(table)
    page.picture(result.plot, result.summary, "result.png")
    return page

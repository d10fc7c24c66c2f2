"""`compare`: several laws on the same records, judged on motion that they were not fitted to."""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, ParamSpec, Protocol, TypeAlias, Unpack, cast, overload, runtime_checkable

from jaxdamp import _checks
from jaxdamp._pieces import piece
from jaxdamp._progress import Progress
from jaxdamp._results import plotted
from jaxdamp._second_process import anywhere, elsewhere
from jaxdamp._settings import part, with_defaults
from jaxdamp._tables import Column
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.bench import BenchRun, RideRecord, as_runs, usable
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.comparison import NAMED, AbstractComparison, naming_only, side_by_side
from jaxdamp.identify.fitting import NUMERICAL, fit
from jaxdamp.identify.held_out import on_records, too_few_points, without_parts
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.machine import OFFSET, Machine, absent_paths, started_machine
from jaxdamp.identify.model import Model, on_rig, rig_of
from jaxdamp.identify.reducing import reduced
from jaxdamp.identify.rungs import Failure, Rung, verdict
from jaxdamp.identify.scheduling import fit_scheduled, settings_stated
from jaxdamp.identify.settings import COMPARISON, FIT, ComparisonSettings, check_keywords
from jaxdamp.identify.starting import LearntStart, Start, check_starts, frozen_by, started
from jaxdamp.identify.stated import start_paths
from jaxdamp.identify.vehicle_comparing import VehicleComparison, compare_vehicles
from jaxdamp.parameters import matching, name_patterns, parameters
from jaxdamp.rig import PrintedLaw, WithPrinted, remember
from jaxdamp.vehicles import AbstractVehicle


P = ParamSpec("P")
Computed: TypeAlias = tuple[Rung | Failure, list[PrintedLaw]]


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Comparison(AbstractComparison[Rung, BenchRun]):
    """Laws fitted to the same records, in the order given."""

    kind: ClassVar[str] = "law"
    _title: ClassVar[str] = "Laws (shape, hysteresis and rest are shares of the squared error)"
    _error: ClassVar[Column] = Column("RMSE", "N", ".1f")

    def __getitem__(self, name: str) -> FitResult:
        """The fit of the law of that name."""
        return self.rung(name).result

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences on the recommended law, why it is this one, and the shares of the errors."""
        between = self.best.by_setting.between if self.best.by_setting else ()
        return (
            *verdict(self.recommendation, self.rungs, self.held_out),
            *(left.sentence(self.best.name) for left in between),
        )

    def _shares(self, rung: Rung) -> dict[str, float]:
        return {name: 100 * share for name, share in rung.result.error_shares._asdict().items()}

    def plot(self, kind: str = "ladder", **options: Any) -> Figure:
        """The errors of the laws side by side (`plots.ladder`), their loops, or the sheet of the recommended law.

        Arguments:
            kind: "ladder", "loops" for the same record in a panel for each law (`plots.loops_by_law`), or "sheet" for
                one A4 page (`plots.damper_sheet`).
            options: of that function.
        """
        from jaxdamp.plots import damper_sheet, ladder, loops_by_law

        return plotted(kind, {"ladder": ladder, "loops": loops_by_law, "sheet": damper_sheet}, self, **options)

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


@runtime_checkable
class CompareCall(Protocol[P]):
    """`compare` by what is compared: laws on bench records, or vehicles on records of their motion."""

    @overload
    def __call__(
        self, laws: Mapping[str, AbstractVehicle], runs: RideRecord | Iterable[RideRecord], **options: Any
    ) -> VehicleComparison: ...
    @overload
    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Comparison: ...


def of_any_kind(compare: Callable[P, Comparison]) -> CompareCall[P]:
    """The same function, which hands vehicles to the comparison of vehicles."""

    @functools.wraps(compare)
    def by_kind(*args: P.args, **options: P.kwargs) -> Comparison | VehicleComparison:
        laws = args[0] if args else options.get("laws")
        if isinstance(laws, Mapping) and any(isinstance(law, AbstractVehicle) for law in laws.values()):
            given = dict(zip(("laws", "runs"), args, strict=False)) | options
            named = {{"laws": "vehicles", "runs": "records"}.get(name, name): value for name, value in given.items()}
            return compare_vehicles(**cast(dict[str, Any], named))
        return compare(*args, **options)

    return cast(CompareCall[P], by_kind)


@of_any_kind
@of_known_numbers
@with_defaults(COMPARISON, check=check_keywords)
def compare(
    laws: Mapping[str, Start],
    runs: Iterable[BenchRun],
    *,
    held_out: Iterable[BenchRun] = (),
    rig: Machine = OFFSET,
    scheduled: bool = False,
    progress: Callable[[str], None] | None = None,
    **settings: Unpack[ComparisonSettings],
) -> Comparison:
    """Fit several laws to the same records, judge them on motion held out, and recommend one (`.best`).

    Without `held_out`, parts of the records are left out in turn and predicted by fits to the rest, which start at the
    fit of all records: whole records in up to four groups where there are three motions or more, otherwise the quarters
    of the records in time. These are left out too, for all laws, where one of them has a number for each record
    (`per_record`) that is more than how warm it begins. A law trained before the fit (`LearntStart`) has seen all
    records and is judged only on `held_out`.

    A law that cannot be fitted or scored does not stop the comparison: it is listed in `failed` with the reason.

    Vehicles are compared on records of their motion in the same way: `compare(friction_ladder(car), drives)` gives a
    `VehicleComparison`. Each of two drives or more is left out in turn, one drive is divided in time; errors of all
    channels are taken together. `settings` are then those of `fit` for vehicles.

    Arguments:
        laws: starts by name, such as `default_ladder(runs)`; or vehicles, such as `friction_ladder(car)`.
        runs: records to fit.
        held_out: records to judge on, which are not fitted even if they are among `runs`, instead of parts of `runs`.
        rig: the test machine of all fits, as in `fit`; a zero error of the load cell if left out, since a law that must
            explain it comes out wrong. `None` is a machine that adds nothing.
        scheduled: whether the parameters of each law are functions of the records' command, as in `fit_scheduled`;
            starts are carried over from neighbouring settings, and the best law is also scored between settings.
        progress: called with each name before its fit; a line in the terminal if it is left out.
        settings: keywords of `fit`, all optional (see `FitSettings`), for all laws; with `scheduled`, `common` and
            `blend` too. Names of parameters that only some of the laws have count for these laws. `bad_records`
            concerns those held out too.

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
    robust, bad_records = settings["loss"] != "squares", settings["bad_records"]
    runs = usable(as_runs(runs, call=call), bad_records, robust=robust)
    held_out = usable(as_runs(held_out, "held_out"), bad_records, robust=robust, argument="held_out")
    judged_on = {run.fingerprint for run in held_out}
    runs = tuple(run for run in runs if run.fingerprint not in judged_on)
    if not runs:
        _checks.refuse("held_out", "leave records to fit", f"all {len(held_out)} of them")
    with Progress("Fitting") as shown:
        numbers = itertools.count(1)

        def counted(name: str) -> None:
            number = next(numbers)
            shown(f"{name}, {number} of {len(laws)}" if number <= len(laws) else f"{name}, made simpler")

        fits = fit_each(laws, runs, held_out, rig=rig, scheduled=scheduled, progress=progress or counted, **settings)
        comparison = Comparison.of(fits, held_out)
    _ = comparison.verdict  # which leaves out settings if there are any: that is part of this work
    return comparison


@with_defaults(COMPARISON, check=check_keywords)
def fit_each(
    laws: Mapping[str, Start],
    runs: Sequence[BenchRun],
    held_out: Sequence[BenchRun] = (),
    *,
    rig: Machine = OFFSET,
    scheduled: bool = False,
    progress: Callable[[str], None] = lambda name: None,
    **settings: Unpack[ComparisonSettings],
) -> Iterator[Rung | Failure]:
    """Fit the laws of a comparison; yields each result or failure in their order, as soon as it is available.

    Most of the time is needed for compiling, so several laws are fitted at the same time, each in its own thread. Where
    the laws that predict best hold numbers in doubt, a simpler one made from them follows (`reduced`), unless they are
    functions of the command.

    Arguments:
        laws: starts by name.
        runs: records to fit.
        held_out: records to judge on, as in `compare`.
        rig: the test machine of all fits, as in `compare`.
        scheduled: whether the parameters are functions of the command, as in `compare`.
        progress: called with each name before its result is waited for.
        settings: of the fits, as in `compare`.

    Raises:
        ValueError: with `scheduled`, records without a command or of one command only; without it, `common` or `blend`.
    """
    if scheduled:
        runs = settings_stated(runs)
    elif settings["common"] or settings["blend"]:
        remedy = "These keywords are about fits of several settings: give `scheduled=True`, or leave them out."
        _checks.refuse("scheduled", "be True with `common` or `blend`", scheduled, remedy)
    of_fits = settings if scheduled else part(settings, FIT)
    named = {**of_fits, "freeze": name_patterns("freeze", settings["freeze"])}
    naming = any(named.get(option) for option in NAMED)
    begun = [_begun(law, runs, rig) for law in laws.values()] if naming else []
    paths, in_time = list(map(_paths, begun)), scheduled or _differ_by_record(begun, settings["per_record"])

    sent = (*runs, *held_out)

    def given(name: str, start: Start, held: tuple[str, ...] = ()) -> tuple[object, ...]:
        options = naming_only(named, _paths(_begun(start, runs, rig)), paths) if paths else named
        options = {**options, "rig": rig, "freeze": (*options["freeze"], *frozen_by(laws[name]), *held)}
        return name, start, tuple(runs), tuple(held_out), scheduled, in_time, len(laws) > 1, options

    def kept(inputs: tuple[object, ...], compute: Callable[[], Computed]) -> Rung | Failure:
        def outcome() -> Rung | Failure:
            result, printed = compute()
            remember(printed)
            return result

        return piece(("law", *inputs), outcome)

    def fitted(name: str, start: Start, held: tuple[str, ...] = ()) -> Rung | Failure:
        inputs = given(name, start, held)
        return kept(inputs, lambda: anywhere(WithPrinted(_outcome), *inputs, shared=sent))

    def ahead(source: Rung, law: AbstractDamper, held: tuple[str, ...]) -> Callable[[], Rung | Failure] | None:
        inputs = given(source.name, law, held)
        waiting = elsewhere(WithPrinted(_outcome), *inputs, shared=sent)
        return None if waiting is None else lambda: kept(inputs, waiting)

    rungs = list[Rung]()
    for one in side_by_side(fitted, laws, progress):
        rungs += [one] if isinstance(one, Rung) else []
        yield one
    if rungs and not scheduled:
        yield from reduced(rungs, lambda source, law, held: fitted(source.name, law, held), progress, ahead)


def _outcome(
    name: str,
    start: Start,
    runs: Sequence[BenchRun],
    held_out: Sequence[BenchRun],
    scheduled: bool,
    in_time: bool,
    several: bool,
    how: dict[str, Any],
) -> Rung | Failure:
    """The fit of one law of a comparison, judged."""
    try:
        by_setting = fit_scheduled(start, runs, progress=lambda text: None, **how) if scheduled else None
        result = by_setting.result if by_setting else fit(start, runs, **how)
        if held_out:
            judged = on_records(result, held_out)
        else:
            judged = None if isinstance(start, LearntStart) else without_parts(result, in_time=in_time)
        if judged is None and several and all(run.of_points for run in runs):
            return Failure(name, too_few_points(runs, len(result.parameters)))
        _ = result.error_shares  # which the table needs, computed here beside those of other laws
    except NUMERICAL as error:
        return Failure(name, str(error))
    scored = (name, len(result.parameters), result.fit_percent, result.rmse)
    if judged is None:
        return Rung(*scored, None, None, result, result.scores, by_setting)
    return Rung(*scored, judged.fit_percent, judged.rmse, result, judged.scores, by_setting, judged.words)


def _begun(law: Start, runs: Sequence[BenchRun], rig: Machine) -> Model | None:
    """A law on its machine; None where it cannot be started, which its fit then says."""
    try:
        begin = law.untrained(runs) if isinstance(law, LearntStart) else started(law, runs)
        return on_rig(begin, started_machine(rig, runs))
    except NUMERICAL:
        return None


def _paths(model: Model | None) -> list[str]:
    """Paths of the parameters of a law on its machine."""
    if model is None:
        return []
    left_out = absent_paths(rig_of(model))
    return [p.path for p in parameters(model) if p.path not in left_out]


def _differ_by_record(models: Sequence[Model | None], names: Sequence[str]) -> bool:
    """Whether, in any of these models, such a name is that of a parameter that says more than how warm a record begins.

    Then all are judged on parts in time, since errors on different parts cannot be compared.
    """
    patterns = name_patterns("per_record", names)
    by_record = [(model, {path for name in patterns for path in matching(_paths(model), name)}) for model in models]
    return any(model is not None and not paths <= set(start_paths(model)) for model, paths in by_record)

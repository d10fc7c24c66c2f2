"""`jaxdamp fit` of a force-velocity table, and of every damper of a production line, with control charts."""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from jaxdamp import _checks, bench, dampers, export, identify
from jaxdamp._checks import ArgumentError
from jaxdamp.bench import BenchSet, DamperRecords, ForceVelocityTable
from jaxdamp.blocks import command_of, import_zarr, note_command
from jaxdamp.cli.console import Screen
from jaxdamp.cli.jobs import Output, job, write_tables
from jaxdamp.cli.limits import bounds_in_si
from jaxdamp.cli.records import Reading, law_names, names_of
from jaxdamp.cli.words import words
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import ControlCharts, ManyFits
from jaxdamp.report import result_report, table_report
from jaxdamp.rig import Rig


THROUGH_POINTS = {"table": dampers.Table, "spline_table": dampers.SplineTable}


def through_points(law: Sequence[str]) -> type[dampers.Table] | type[dampers.SplineTable] | None:
    """The law that goes through the points of a table, if it is asked for; None for laws to be fitted."""
    asked = words("law", law)
    if not asked:
        return dampers.Table
    if len(asked) == 1 and asked[0] in THROUGH_POINTS:
        return THROUGH_POINTS[asked[0]]
    for name in asked:
        _checks.one_of("law", name, ("all", *THROUGH_POINTS, *identify.NAMED_LAWS))
        if name not in ("all", *names_of(points=True)):
            what = "one alone" if name in THROUGH_POINTS else "a law without hysteresis, which a table cannot show"
            _checks.refuse("law", f"be {what}", repr(name), 'See "jaxdamp laws".')
    return None


def fit_table(
    screen: Screen,
    table: ForceVelocityTable,
    kind: type[dampers.Table] | type[dampers.SplineTable],
    output: Output,
    report: Path | None,
    refused: Sequence[str],
) -> None:
    """Write the laws through the points of a table: of each setting, and of all as one law of the setting."""
    for option in refused:
        _checks.refuse(option, "be left out with a force-velocity table", "given", "Or fit laws with --law.")
    with job(screen, "fit", output, report) as work:
        screen.table(table.table())
        screen.points(table.notes)
        with work.saving("Laws and tables") as draft:
            best = _write_laws(draft, table, kind)
            write_tables(draft / "tables", {"forces": table.table()})
            with work.attempts.part("sheet.pdf"):
                table.plot("sheet").savefig(draft / "sheet.pdf")
        screen.say(best, style="bold")
        work.page(table_report, table)


def _write_laws(folder: Path, table: ForceVelocityTable, kind: type[dampers.Table] | type[dampers.SplineTable]) -> str:
    """The files of the laws, and a sentence on what best_law.json is."""
    (folder / "laws").mkdir()
    for curve in table.curves:
        law, name = table.law(curve.setting, kind), _file_name(curve.setting or table.name)
        export.to_json(law, folder / "laws" / f"{name}.json")
        at = f"_{name}" if len(table.curves) > 1 else ""
        export.to_csv(law, folder / f"best_law_force_velocity{at}.csv", curve.velocity)
    if len(table.curves) > 1 and not table.is_family:
        return f"The laws of {len(table.curves)} settings are in laws: without numbers they are not one law."
    export.to_json(table.law(kind=kind), folder / "best_law.json")
    if not table.is_family:
        return f"best_law.json goes through the points of {table.name}."
    ends = f"{table.settings[0]} to {table.settings[-1]}"
    return f"best_law.json holds settings {ends} as its command: jaxdamp tune --law finds the best one."


def _file_name(setting: str) -> str:
    return "".join(c if c.isalnum() or c in "._+-" else "_" for c in setting)


def records_of(screen: Screen, table: ForceVelocityTable) -> BenchSet:
    """The records that stand for a table in a fit, said at the terminal."""
    screen.table(table.table())
    return table.runs()


_TAKEN = ("freeze", "bounds", "tie", "weighting", "loss", "priors", "initial_state", "samples_per_cycle", "starts")
_TAKEN += ("max_steps",)  # of the options of a fit


def fit_line(
    screen: Screen,
    files: Sequence[Path],
    each: str,
    law: Sequence[str],
    rig: Sequence[str],
    reading: Reading,
    options: Mapping[str, object],
    output: Output,
    *,
    in_control: int | None,
    refused: Sequence[str],
) -> None:
    """Fit one law to every damper of a line that is new since the last call, and chart its numbers."""
    name = _checked(files, law, [*refused, *(option for option in options if option not in _TAKEN)])
    dampers = bench.read_dampers(files[0], each=each, **reading.read.arguments()).process(**reading.processing())
    if in_control is not None:
        _charts({"place": range(len(dampers))}, in_control)  # refuses too few or too many before anything is fitted
    with job(screen, "fit", output) as work:
        store = output.store("fit")
        asked = {"law": name, "rig": list(rig), "reading": str(reading)}
        with screen.stage("Reading the first damper"):
            start = _stored_start(store, asked) or _start(dampers, name, rig)
        note = json.dumps({**asked, "start": export.to_json(start)})
        bounds = options.get("bounds")
        stated = bounds_in_si(bounds if isinstance(bounds, dict) else {}, [{"law": start, "rig": Rig()}])
        how = {**options, "bounds": stated, "rig": rig}
        skips = "leave_out" if reading.read.given.get("skip_bad") else "refuse"
        how["bad_records"] = "keep" if reading.keep_bad else skips
        title = f"Fitting {name} to {len(dampers)} dampers"
        with screen.stage(title) as advance, warnings.catch_warnings(action="ignore"):  # of dampers, which are remarks

            def tell(done: int, total: int) -> None:
                note_command(store, note)
                advance(f"{done} of {total}", done)

            fitting: Callable[..., ManyFits] = identify.fit_many
            many = fitting(start, dampers, file=store, progress=tell, **how)
        results = [many] if in_control is None else [many, _charts(many, in_control)]
        screen.answer(*(f"{result.summary}." for result in results))
        screen.remarks([text for result in results for text in result.warnings], style="yellow")
        screen.details(many.table())
        with work.saving("Tables") as draft:
            more = results[-1].tables() if in_control is not None else {}
            write_tables(draft / "tables", {"fits": many.table(), **more})
        work.page(result_report, results[-1])


def _checked(files: Sequence[Path], law: Sequence[str], refused: Sequence[str]) -> str:
    """The name of the law; what a line does not take is refused."""
    for option in refused:
        _checks.refuse(option, "be left out where each damper is fitted", "given", "Leave out one of them.")
    names = law_names(law)
    if len(names) != 1:
        _checks.refuse("law", "be one law for all dampers", ", ".join(names) or "left out", 'See "jaxdamp laws".')
    if len(files) != 1:
        _checks.refuse("each", "be given with one folder or one table of files", f"given with {len(files)}")
    import_zarr()  # before anything is read
    return names[0]


def _charts(numbers: ManyFits | Mapping[str, Sequence[float]], in_control: int) -> ControlCharts:
    """The control charts of a line, whose limits come from so many dampers."""
    try:
        return identify.control_charts(numbers, baseline=in_control)
    except ArgumentError as error:  # --baseline is another law
        raise ArgumentError(str(error).replace("`baseline`", "`in_control`"), argument="in_control") from error


def _stored_start(store: Path, asked: Mapping[str, object]) -> AbstractDamper | None:
    """The law that the fits in a store began with, if the same was asked for: another damper may be the first now."""
    noted = json.loads(command_of(store) or "{}")
    start = noted.pop("start", None)
    return export.from_json(start) if start is not None and noted == asked else None


def _start(dampers: DamperRecords, name: str, rig: Sequence[str]) -> AbstractDamper:
    """The law of a name as the first damper whose records can be read gives it."""
    why = ""
    for damper in dampers:
        try:
            runs = dampers[damper]
        except (ValueError, OSError) as error:
            why = why or f"{damper}: {error}"
            continue
        law = identify.default_ladder(runs, [name], rig=rig)[name]
        if not isinstance(law, AbstractDamper):
            _checks.refuse("law", f"be one that starts from the records of {damper}", name, 'See "jaxdamp laws".')
        return law
    raise ValueError(f"No damper has records that can be read. {why}")

"""`jaxdamp fit` of a force-velocity table: laws through its points, or what it gives to fits."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jaxdamp import _checks, dampers, export, identify
from jaxdamp.bench import BenchSet, ForceVelocityTable
from jaxdamp.cli.console import Screen
from jaxdamp.cli.jobs import Output, job, write_tables
from jaxdamp.cli.words import words
from jaxdamp.report import table_report


THROUGH_POINTS = {"all": dampers.Table, "table": dampers.Table, "spline_table": dampers.SplineTable}


class Refused(NamedTuple):
    """An option that says nothing of a table whose laws go through its points."""

    name: str
    given: bool


def through_points(law: Sequence[str]) -> type[dampers.Table] | type[dampers.SplineTable] | None:
    """The law that goes through the points of a table, if it is asked for; None for laws to be fitted."""
    asked = words("law", law)
    if not asked:
        return dampers.Table
    if len(asked) == 1 and asked[0] in THROUGH_POINTS:
        return THROUGH_POINTS[asked[0]]
    for name in asked:
        _checks.one_of("law", name, (*THROUGH_POINTS, *identify.NAMED_LAWS))
        if name not in identify.NAMED_LAWS or identify.NAMED_LAWS[name].hysteresis:
            what = "one alone" if name in THROUGH_POINTS else "a law without hysteresis, which a table cannot show"
            _checks.refuse("law", f"be {what}", repr(name), 'See "jaxdamp laws".')
    return None


def fit_table(
    screen: Screen,
    table: ForceVelocityTable,
    kind: type[dampers.Table] | type[dampers.SplineTable],
    output: Output,
    refused: Sequence[Refused],
) -> None:
    """Write the laws through the points of a table: of each setting, and of all as one law of the setting."""
    for option in refused:
        if option.given:
            _checks.refuse(option.name, "be left out with a force-velocity table", "given", "Or fit laws with --law.")
    with job(screen, "fit", output) as work:
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
    return f"best_law.json holds settings {ends} as its command: jaxdamp tune --start finds the best one."


def _file_name(setting: str) -> str:
    return "".join(c if c.isalnum() or c in "._+-" else "_" for c in setting)


def records_of(screen: Screen, table: ForceVelocityTable) -> BenchSet:
    """The records that stand for a table in a fit, said at the terminal."""
    screen.table(table.table())
    return table.runs()

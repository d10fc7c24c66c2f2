"""The table "paper against jaxdamp": what the four papers state, what jaxdamp computes, and a verdict.

Each number of jaxdamp is stored beside what computes it: a function here, which `tests/test_papers.py` calls, or the
notebook of the paper, whose last cell hands its numbers to `table` and fails where one has changed.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import _paper_000
import _paper_001
import _paper_002
import _paper_003
from _statement import NOT_TREATED, VERDICTS, Statement


class Paper(NamedTuple):
    """A paper: its title on the page, its notebook, its statements."""

    title: str
    notebook: str
    statements: tuple[Statement, ...]


PAPERS = {
    "000": Paper("Paper 000: shock absorber of a Mazda CX-7", "cx7_shock_absorber", _paper_000.STATEMENTS),
    "001": Paper("Paper 001: damper of a heavy vehicle", "heavy_vehicle_besinger", _paper_001.STATEMENTS),
    "002": Paper("Paper 002: half car with a hybrid damper", "half_car_hybrid", _paper_002.STATEMENTS),
    "003": Paper("Paper 003: shock absorber of the M113", "m113_tracked_vehicle", _paper_003.STATEMENTS),
}
HEADINGS = ("place", "statement", "paper", "jaxdamp", "verdict", "comment", "computed in")


class Table(NamedTuple):
    """Rows of a paper, shown by a notebook as a table."""

    text: str

    def _repr_markdown_(self) -> str:
        return self.text


def changed(name: str, stored: float | None, computed: float | None, repeat: float) -> list[str]:
    """A sentence where a number is no longer the stored one."""
    if stored is None and computed is None:
        return []
    if stored is not None and computed is not None and abs(computed - stored) <= repeat * abs(stored):
        return []
    return [f"{name} is {computed}, and the table of the paper says {stored}"]


def table(number: str, computed: Mapping[str, float | tuple[float, float]]) -> Table:
    """The table of a paper at the end of its notebook.

    Arguments:
        number: of the paper, such as "000".
        computed: what the notebook has computed, by the names in `Statement.by`; a pair where the row has a spread.

    Raises:
        ValueError: a name of the table that is not computed or the reverse, a number that is not the stored one.
    """
    paper = PAPERS[number]
    wanted = {s.by: s for s in paper.statements if isinstance(s.by, str)}
    if wanted.keys() != computed.keys():
        raise ValueError(f"Computed and stored numbers differ: {sorted(wanted.keys() ^ computed.keys())}.")
    differences = []
    for name, statement in wanted.items():
        values = computed[name]
        value, spread = values if isinstance(values, tuple) else (values, None)
        differences += changed(name, statement.ours, value, statement.repeat)
        differences += changed(f"spread of {name}", statement.spread, spread, 10 * statement.repeat)
    if differences:
        raise ValueError("Correct the table of the paper: " + "; ".join(differences) + ".")
    return Table("\n".join(_rows(paper, HEADINGS[:-1])))


def _rows(paper: Paper, headings: tuple[str, ...]) -> list[str]:
    """Lines of a table in markdown."""
    lines = ["| " + " | ".join(headings) + " |", "|---" * len(headings) + "|"]
    for s in paper.statements:
        cells = (s.place, s.statement, *s.numbers(), s.verdict, s.comment, s.source(paper.notebook))
        lines.append("| " + " | ".join(cells[: len(headings)]) + " |")
    return lines


def write_table(path: Path) -> None:
    """The page with one table for each paper."""
    lines = ["# The papers and jaxdamp", ""]
    lines += [
        "Every equation, table, figure and claim of the four papers that jaxdamp builds on. *Reproduced*: the numbers",
        "follow. *Corrected*: a slip of the paper. *Contradicted*: a conclusion that does not hold where it can be",
        "computed. *Consistent on a twin*: the records are unpublished, and a virtual damper that was made to show it",
        "shows it, which proves nothing of the real one. *Not treated*: the paper does not say enough; a number beside",
        "it says what can be computed. The last column names what computes the number of jaxdamp; the tests compare it",
        "with the one that stands here.",
        "",
    ]
    for paper in PAPERS.values():
        counts = {verdict: sum(s.verdict == verdict for s in paper.statements) for verdict in VERDICTS}
        summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
        lines += [f"## {paper.title}", "", f"{summary}.", "", *_rows(paper, HEADINGS), ""]
    text = "\n".join(lines)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


__all__ = ["NOT_TREATED", "PAPERS", "Paper", "Table", "changed", "table", "write_table"]

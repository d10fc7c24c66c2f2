"""The table "paper against jaxdamp": what the four papers state, what jaxdamp computes, and a verdict.

Each number of jaxdamp is stored beside what computes it: a function here, which `tests/test_papers.py` calls, or the
notebook of the paper, whose last cell hands its numbers to `table` and fails where one has changed.
"""

import ast
import json
import re
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
ANY = ".*"
NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
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
    return Table("\n".join(_rows(paper)))


def computing_cells(paper: Paper) -> dict[str, int]:
    """Which cell of the notebook computes each number of the table, counted as the cells run.

    The last cell that makes one of the variables and functions from which the final cell takes the number.
    """
    notebook = json.loads((NOTEBOOKS / f"{paper.notebook}.ipynb").read_text())
    sources = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    trees = [ast.parse(source.replace("%matplotlib", "# %matplotlib")) for source in sources]
    made_in: dict[str, int] = {}
    for number, tree in enumerate(trees, 1):
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                made_in[node.name] = number
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                made_in[node.id] = number
    call = trees[-1].body[-1]
    assert isinstance(call, ast.Expr) and isinstance(call.value, ast.Call)
    parts = sorted(_parts(call.value.args[1]), key=lambda part: part[0] == ANY)  # a name before any name
    cells = {}
    for name in (s.by for s in paper.statements if isinstance(s.by, str)):
        used = next(used for pattern, used in parts if re.fullmatch(pattern, name))
        cells[name] = max(made_in[variable] for variable in used if variable in made_in)
    return cells


def _parts(computed: ast.expr) -> list[tuple[str, set[str]]]:
    """The variables behind the numbers of a dictionary, by patterns of their names."""
    if isinstance(computed, ast.BinOp):  # one | other
        return _parts(computed.left) + _parts(computed.right)
    if isinstance(computed, ast.Dict):
        pairs = zip(computed.keys, computed.values, strict=True)
        return [(re.escape(str(key.value)), _used(value)) for key, value in pairs if isinstance(key, ast.Constant)]
    if isinstance(computed, ast.DictComp) and isinstance(computed.key, ast.JoinedStr):
        pieces = [re.escape(str(p.value)) if isinstance(p, ast.Constant) else ANY for p in computed.key.values]
        return [("".join(pieces), _used(computed))]
    return [(ANY, _used(computed))]


def _used(expression: ast.expr) -> set[str]:
    """Names of variables that an expression takes from outside."""
    found = [node for node in ast.walk(expression) if isinstance(node, ast.Name)]
    return {node.id for node in found} - {node.id for node in found if isinstance(node.ctx, ast.Store)}


def _rows(paper: Paper) -> list[str]:
    """Lines of a table in markdown."""
    computed_in = computing_cells(paper)
    lines = ["| " + " | ".join(HEADINGS) + " |", "|---" * len(HEADINGS) + "|"]
    for s in paper.statements:
        cells = (s.place, s.statement, *s.numbers(), s.verdict, s.comment, s.source(paper.notebook, computed_in))
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def write_table(path: Path) -> None:
    """The page with one table for each paper."""
    lines = ["# The papers and jaxdamp", ""]
    lines += [
        "Every equation, table, figure and claim of the four papers that jaxdamp builds on. *Reproduced*: the numbers",
        "follow. *Corrected*: a slip of the paper. *Contradicted*: a conclusion that does not hold where it can be",
        "computed. *Consistent on a twin*: the records are unpublished, and a virtual damper that was made to show it",
        "shows it, which proves nothing of the real one. *Not treated*: the paper does not say enough; a number beside",
        "it says what can be computed. The last column names what computes the number of jaxdamp, a cell of a notebook",
        "or a file; the tests compare it with the one that stands here.",
        "",
    ]
    for paper in PAPERS.values():
        counts = {verdict: sum(s.verdict == verdict for s in paper.statements) for verdict in VERDICTS}
        summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
        lines += [f"## {paper.title}", "", f"{summary}.", "", *_rows(paper), ""]
    text = "\n".join(lines)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


__all__ = ["NOT_TREATED", "PAPERS", "Paper", "Table", "changed", "computing_cells", "table", "write_table"]

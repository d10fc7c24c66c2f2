"""The table "paper against jaxdamp": what the four papers state, what jaxdamp computes, and a verdict.

Numbers of jaxdamp are computed when the table is written; `tests/test_papers.py` compares them with the printed ones.
"""

from pathlib import Path

import _paper_000
import _paper_001
import _paper_002
import _paper_003
from _statement import VERDICTS


PAPERS = {
    "Paper 000: shock absorber of a Mazda CX-7": _paper_000.STATEMENTS,
    "Paper 001: damper of a heavy vehicle": _paper_001.STATEMENTS,
    "Paper 002: half car with a hybrid damper": _paper_002.STATEMENTS,
    "Paper 003: shock absorber of the M113": _paper_003.STATEMENTS,
}


def write_table(path: Path) -> None:
    """The page with one table for each paper."""
    lines = ["# The papers and jaxdamp", ""]
    lines += [
        "Every equation, table, figure and claim of the four papers that jaxdamp builds on. *Reproduced*: the numbers",
        "follow. *Corrected*: a slip of the paper. *Contradicted*: a conclusion that does not hold where it can be",
        "computed. *Consistent on a twin*: the records are unpublished, and a virtual damper that was made to show it",
        "shows it, which proves nothing of the real one. *Not treated*: the paper does not say enough. The numbers in",
        "the third column were computed when this page was built, the others in the notebooks that are named.",
        "",
    ]
    for title, statements in PAPERS.items():
        counts = {verdict: sum(s.verdict == verdict for s in statements) for verdict in VERDICTS}
        summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
        lines += [f"## {title}", "", f"{summary}.", ""]
        lines += ["| place | statement | computed | verdict | comment |", "|---|---|---|---|---|"]
        lines += [statement.row() for statement in statements] + [""]
    text = "\n".join(lines)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)

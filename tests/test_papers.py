"""The table "paper against jaxdamp" of the documentation: every statement has a verdict, and the numbers agree."""

import importlib
import sys
from pathlib import Path

import pytest


sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
papers = importlib.import_module("_papers")
STATEMENTS = [(title, statement) for title, statements in papers.PAPERS.items() for statement in statements]


@pytest.mark.parametrize(("title", "statement"), STATEMENTS, ids=lambda value: getattr(value, "statement", value)[:40])
def test_verdict(title, statement):
    assert statement.verdict in papers.VERDICTS and statement.comment, title
    if statement.computed is not None and statement.printed is not None:
        close = statement.computed() == pytest.approx(statement.printed, rel=statement.tolerance)
        assert close == (statement.verdict == "reproduced")
    if statement.verdict == "consistent on a twin":  # what was put in is no number of the paper that follows
        assert statement.printed is None and statement.computed is None


def test_a_verdict_without_a_number_names_where_it_is_shown():
    notebooks = {path.stem for path in (Path(__file__).parents[1] / "notebooks").glob("*.ipynb")}
    for _, statement in STATEMENTS:
        named = {name for name in notebooks if f"`{name}`" in statement.comment}
        if statement.verdict == "contradicted":
            assert named or statement.computed is not None, statement


def test_the_table_has_a_row_for_each_statement(tmp_path):
    papers.write_table(tmp_path / "papers.md")
    rows = [line for line in (tmp_path / "papers.md").read_text().splitlines() if line.startswith("| ")]
    assert len(rows) == len(STATEMENTS) + len(papers.PAPERS)  # and the headings

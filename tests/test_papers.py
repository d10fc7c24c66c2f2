"""The table "paper against jaxdamp" of the documentation: every statement has a verdict, and the numbers agree."""

import ast
import importlib
import sys
from pathlib import Path

import jax.numpy as jnp
import nbformat
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import dampers, roads, simulate, vehicles


sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
papers = importlib.import_module("_papers")
passive_bound = importlib.import_module("_passive_bound")
STATEMENTS = [(paper, statement) for paper in papers.PAPERS.values() for statement in paper.statements]
AGREE = ("reproduced", "consistent on a twin")


@pytest.mark.parametrize(("paper", "statement"), STATEMENTS, ids=lambda value: getattr(value, "statement", "")[:40])
def test_verdict(paper, statement):
    assert statement.verdict in papers.VERDICTS and statement.comment, paper.title
    if statement.ours is not None and statement.printed is not None and statement.verdict != "not treated":
        assert statement.agrees() == (statement.verdict in AGREE)


@pytest.mark.parametrize(("paper", "statement"), STATEMENTS, ids=lambda value: getattr(value, "statement", "")[:40])
def test_a_number_for_every_verdict(paper, statement):
    assert (statement.ours is None) == (statement.by is None), "a number is stored with what computes it"
    if statement.ours is None:
        assert statement.verdict == "not treated", paper.title
    elif callable(statement.by):
        assert statement.by() == pytest.approx(statement.ours, rel=statement.repeat)


@pytest.mark.parametrize("number", papers.PAPERS)
def test_the_notebook_ends_with_the_table_and_computes_its_numbers(number):
    paper = papers.PAPERS[number]
    path = Path(__file__).parents[1] / "notebooks" / f"{paper.notebook}.ipynb"
    last = ast.parse(nbformat.read(path, as_version=4).cells[-1].source).body[-1]
    assert isinstance(last, ast.Expr) and isinstance(last.value, ast.Call) and ast.unparse(last.value.func) == "table"
    assert ast.literal_eval(last.value.args[0]) == number


@pytest.mark.parametrize(
    ("number", "name", "line"),
    [
        ("000", "15 Hz", "errors[name] = ["),
        ("000", "trace of the linear law", "def apart("),
        ("001", "stiffness", "refitted = {"),  # from a dictionary that is made as the notebook runs
        ("001", "tyre load, front", "at_tyre,"),
        ("002", "rms pitch", "met = identify.fit_targets("),
        ("002", "least levels pitch", "bounds[measure.__name__"),
        ("003", "two absorbers", "decay = {"),
    ],
)
def test_the_table_names_the_cell_that_computes(number, name, line):
    paper = papers.PAPERS[number]
    path = Path(__file__).parents[1] / "notebooks" / f"{paper.notebook}.ipynb"
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    place = papers.computing_cells(paper)[name]
    assert line in cells[place - 1].source and cells[place - 1].execution_count == place


def test_a_number_that_changed_or_is_missing_is_refused():
    wanted = {s.by: s for s in papers.PAPERS["000"].statements if isinstance(s.by, str)}
    computed = {name: s.ours if s.spread is None else (s.ours, s.spread) for name, s in wanted.items()}
    assert "| place |" in papers.table("000", computed)._repr_markdown_()
    with pytest.raises(ValueError, match=r"15 Hz is .* and the table of the paper says"):
        papers.table("000", computed | {"15 Hz": 117.0})
    with pytest.raises(ValueError, match="differ"):
        papers.table("000", {name: value for name, value in computed.items() if name != "15 Hz"})


def test_the_table_has_a_row_for_each_statement(tmp_path):
    papers.write_table(tmp_path / "papers.md")
    rows = [line for line in (tmp_path / "papers.md").read_text().splitlines() if line.startswith("| ")]
    assert len(rows) == len(STATEMENTS) + len(papers.PAPERS)  # and the headings


def test_ride_of_the_bound_is_that_of_the_half_car():
    bump = roads.delayed(roads.cosine_bump(0.06, start=1.0, duration=0.25), delays=[0.0, 0.1])
    car = simulate(vehicles.presets.half_car_002(dampers.Linear(1560.0)), bump, duration=3.0)
    ride = passive_bound.ride(jnp.full((1, 2), 1560.0), 0.1, 3.0)
    for place, (channel, unit) in enumerate(zip(passive_bound.CHANNELS, (1.0, 1.0, 180 / np.pi), strict=True)):
        late = passive_bound.STEP / 2 if place == 0 else 0.0  # accelerations are means over the step
        expected = np.interp(np.asarray(ride.time) - late, car.time, unit * np.asarray(car[channel]))
        np.testing.assert_allclose(ride.body[:, place], expected, atol=6e-3 * np.abs(expected).max())


def test_ride_of_the_bound_follows_a_damping_that_changes():
    count, delay, motion = 60, 0.05, np.zeros(8)
    damping = np.geomspace(10.0, 5e4, 2 * count)[np.random.default_rng(0).permutation(2 * count)].reshape(count, 2)
    ends = []
    for k, rates in enumerate(damping):

        def derivative(time, values, rates=rates):
            force = -passive_bound.STIFFNESS @ values[:4]
            force -= passive_bound.STROKES.T @ (rates * (passive_bound.STROKES @ values[4:]))
            force[2:] += [passive_bound.TYRE * float(passive_bound.bump(t)) for t in (time, time - delay)]
            return np.concatenate([values[4:], force / passive_bound.MASSES])

        span = passive_bound.START + passive_bound.INTERVAL * np.array([k, k + 1.0])
        motion = solve_ivp(derivative, span, motion, method="Radau", rtol=1e-5, atol=1e-8).y[:, -1]
        ends.append(motion)
    every = round(passive_bound.INTERVAL / passive_bound.STEP)
    ride = passive_bound.ride(jnp.asarray(damping), delay, passive_bound.START + passive_bound.INTERVAL * count)
    expected, body = np.array(ends), np.asarray(ride.body)[every - 1 :: every]
    np.testing.assert_allclose(body[:, 1], expected[:, 0], atol=5e-3 * np.abs(expected[:, 0]).max())
    np.testing.assert_allclose(body[:, 2], np.rad2deg(expected[:, 1]), atol=5e-3 * np.abs(body[:, 2]).max())


def test_the_bound_is_below_every_law_and_its_damper_is_passive():
    bound = passive_bound.least(passive_bound.peaks, ["pitch"], 0.1, 1.3, starts=(6000.0,))
    laws = [passive_bound.ride(jnp.full((1, 2), rate), 0.1, 1.3) for rate in (100.0, 500.0, 1500.0, 5000.0, 50_000.0)]
    assert bound.values[2] < 0.8 * min(float(passive_bound.peaks(law.body)[2]) for law in laws)
    ride = passive_bound.ride(bound.damping, 0.1, 1.3)
    assert float(jnp.min(bound.damping)) >= 0.0 and float(jnp.min(ride.force * ride.velocity)) >= -1e-9

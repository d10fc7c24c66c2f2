"""The API reference: a page for each law, signatures with the types of the code, links that need no network."""

import importlib
import inspect
import sys
from pathlib import Path

import pytest

import jaxdamp
from jaxdamp import bench, dampers, plots


sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
laws, links = importlib.import_module("_laws"), importlib.import_module("_links")
examples = importlib.import_module("_examples")
NAMES = importlib.import_module("_reference").NAMES


def test_every_law_has_a_card_in_the_gallery_and_so_a_page():
    concrete = {
        name
        for name in dampers.__all__
        if inspect.isclass(kind := getattr(dampers, name))
        and issubclass(kind, dampers.AbstractDamper)
        and not name.startswith("Abstract")
    }
    start, cards = laws.cards()
    assert "from jaxdamp import dampers" in start and set(cards) == concrete
    assert all(card.formula and card.group and card.name in card.code for card in cards.values())


def test_hysteresis_is_what_the_loops_show():
    for law, word in (
        (dampers.Linear(2500.0), "no"),
        (dampers.Spring(2e4), "by the stroke"),
        (dampers.Lag(dampers.Linear(2500.0), 0.006), "yes"),
    ):
        assert laws._hysteresis(law, laws._loops(law)) == word


def test_signatures_name_the_types_of_the_code_in_full():
    arguments, returned = NAMES.signature(jaxdamp.simulate)
    assert "vehicle: ~jaxdamp.vehicles.AbstractVehicle" in arguments
    assert returned.startswith("~jaxdamp.simulation.Response")
    assert NAMES.signature(dampers.Besinger.opening_velocity) == ("()", "~jaxdamp._types.Scalar")
    assert NAMES.signature(plots.force_velocity)[1] == "~matplotlib.figure.Figure"  # imported late, a text in the code
    fields, _ = NAMES.signature(bench.BenchRun)
    assert "time: ~jaxtyping.Float[~numpy.ndarray, ' time']" in fields and "command: float | None = None" in fields
    assert "range_note" not in NAMES.signature(dampers.Linear)[0]


def test_types_of_one_name_are_told_apart():
    assert NAMES.full("Table", "jaxdamp.bench.evaluation") != NAMES.full("Table", "jaxdamp.dampers")


@pytest.mark.parametrize(
    ("name", "address"),
    [
        ("jax.Array", "https://docs.jax.dev/en/latest/_autosummary/jax.Array.html"),
        ("jaxtyping.Array", "https://docs.jax.dev/en/latest/_autosummary/jax.Array.html"),
        ("numpy.ndarray", "https://numpy.org/doc/stable/reference/generated/numpy.ndarray.html"),
        ("xarray.Dataset", "https://docs.xarray.dev/en/stable/generated/xarray.Dataset.html"),
        ("equinox.Module", "https://docs.kidger.site/equinox/api/module/module/#equinox.Module"),
        ("nothing.known", None),
    ],
)
def test_addresses_of_other_libraries(name, address):
    assert links.page(name) == address


def test_an_example_is_followed_by_what_it_printed() -> None:
    page = "```python\nprint(1)\n```\n\nText.\n\n```python\nx = 1\n```\n"
    shown = examples.with_outputs(page, {"print(1)": "1\n", "x = 2": "of an earlier text\n"})
    assert shown == page.replace("```\n\nText", "```\n\n```text\n1\n```\n\nText")
    long = examples.with_outputs(page, {"print(1)": "line\n" * 100})
    assert long.count("line") == examples.LINES and "\n...\n```" in long

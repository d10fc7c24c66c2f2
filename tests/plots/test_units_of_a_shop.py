"""Every picture in the units of a shop: labels name them, and ticks have the numbers of the library in them."""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
import xarray

from jaxdamp import plots
from jaxdamp._display import Display, shown_in
from jaxdamp._types import Figure
from jaxdamp.report.sweeps import best_points
from jaxdamp.tune import ParetoFront

from . import conftest
from .conftest import COMFORT, GRIP


TRAVEL = "working_space_rms"
UNIT = re.compile(r"\[([^\[\]]+)\]")


def axes_of(figure: Figure) -> list[tuple[str, float | None]]:
    """The label of each axis, and the number at its ticks for a step of one of what is drawn."""
    figure.canvas.draw()
    found: list[tuple[str, float | None]] = []
    for axes in figure.axes:
        for place, axis in enumerate((axes.xaxis, axes.yaxis)):
            ticks = [(tick.get_position()[place], tick.get_text().replace("−", "-")) for tick in axis.get_ticklabels()]
            numbers = np.array([(at, float(text)) for at, text in ticks if re.fullmatch(r"-?[\d.]+", text)])
            scale = float(np.polyfit(numbers[:, 0], numbers[:, 1], 1)[0]) if len(numbers) > 1 else None
            found.append((axis.get_label_text(), scale))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("shop", [Display("imperial", "compression-positive"), Display("kgf,mm/s")])
def test_labels_and_ticks_have_the_units_of_the_shop(shop: Display, figures: dict[str, Figure], request: Any) -> None:
    names = ("runs", "comparison", "responses", "tuned", "validation", "swept", "front")
    draw: Any = conftest.figures
    with shown_in(shop):
        again = draw.__wrapped__(*map(request.getfixturevalue, names))
        shown = {name: axes_of(figure) for name, figure in again.items()}
    compared = 0
    for name, figure in figures.items():
        for (plain, step), (label, scale) in zip(axes_of(figure), shown[name], strict=True):
            unit = UNIT.search(plain)
            wanted = shop.of(unit[1] if unit else "")
            assert not unit or f"[{wanted.unit}]" in label, (name, plain, label)
            if plain and step is not None and scale is not None:
                assert abs(scale / step) == pytest.approx(wanted.factor, rel=5e-3), (name, plain, label)
                assert scale > 0.0 or ("+ up" not in label and "more load" not in label), (name, label)
                compared += wanted.factor != 1.0
    assert compared > 20


def test_travel_is_in_mm_on_the_axes_of_sweeps_and_fronts(swept: xarray.Dataset, front: ParetoFront) -> None:
    travel = (1e-5 * swept[GRIP]).assign_attrs(units="m")
    data = swept.assign({TRAVEL: travel})
    renamed = dataclasses.replace(
        front,
        names=(COMFORT, TRAVEL),
        values={COMFORT: front.values[COMFORT], TRAVEL: 1e-5 * front.values[GRIP]},
        before={COMFORT: 1.15, TRAVEL: 0.0064},
        units={COMFORT: "m/s^2", TRAVEL: "m"},
        limits={TRAVEL: 0.0065},
    )
    pictures = (
        (plots.sweep(data, COMFORT, against=TRAVEL), 0),
        (plots.sweep(data, TRAVEL), 1),
        (plots.pareto(renamed), 0),
    )
    for figure, panel in pictures:
        axes = figure.axes[panel]
        figure.canvas.draw()
        assert axes.get_ylabel().split() == ["suspension", "travel,", "RMS", "[mm]"]
        first, *_, last = axes.get_yticklabels()
        at = [tick.get_position()[1] for tick in (first, last)]
        assert [float(tick.get_text()) for tick in (first, last)] == pytest.approx([1e3 * y for y in at])
    limits = [text.get_text() for text in pictures[-1][0].legends[0].get_texts()]
    assert "limit of suspension travel, RMS, 6.5 mm" in limits
    (best,) = best_points(data[[TRAVEL, "failed"]])
    assert best.startswith(
        "Smallest suspension travel, RMS: 4.42 mm at damper rate = 2000 N s/m, spring rate = 10 N/mm"
    )

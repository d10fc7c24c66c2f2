"""Every picture in the units of a shop: labels name them, and ticks have the numbers of the library in them."""

import re
from typing import Any

import numpy as np
import pytest

from jaxdamp._display import Display, shown_in
from jaxdamp._types import Figure

from . import conftest


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

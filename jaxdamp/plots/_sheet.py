"""What the sheets share: one A4 page with a sentence at the top, panels, tables of text, remarks."""

import re
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from jaxdamp._display import display
from jaxdamp._types import Axes, Figure
from jaxdamp.plots import _style


A4 = (8.27, 11.69)  # inch
SMALL = 7.5  # pt, of tables
_MOST = 3  # remarks
_TEXT: _style.Look = {"va": "top", "linespacing": 1.35}


def page() -> Figure:
    """An empty page with margins."""
    figure = _style.new_figure(*A4)
    figure.set_layout_engine("constrained", rect=(0.05, 0.03, 0.91, 0.94))
    return figure


@contextmanager
def lettering() -> Iterator[None]:
    """Letters of a printed page while a sheet is drawn."""
    from matplotlib import rc_context

    with rc_context(
        {
            **{"font.size": 8.5, "legend.fontsize": 7.5, "figure.titlesize": 8.5},
            **{"axes.titlesize": 8.5, "axes.labelsize": 8.0, "xtick.labelsize": 7.5, "ytick.labelsize": 7.5},
        }
    ):
        yield


def head(axes: Axes, name: str, sentence: str, facts: str, *, answer: str = "", colour: str = _style.BLACK) -> None:
    """The head of a sheet: its name, the sentence that says what to do, and what was measured or driven.

    In `colour` is the answer, or the sentence where there is none.
    """
    blank(axes)
    axes.text(0.0, 1.0, f"{_style.said(name)}   ·   {_style.said(facts)}"[:130], color=_style.GREY, **_TEXT)
    if answer:
        axes.text(0.0, 0.83, answer, fontsize=14.0, fontweight="bold", color=colour, **_TEXT)
        look, width, top = {"fontsize": 8.5}, 118, 0.52
    else:
        look, width, top = {"fontsize": 10.5, "fontweight": "bold", "color": colour}, 86, 0.76
    together = re.sub(r"(?<=\d) (?=[^\W\d]|%|±)|(?<=±) ", "\N{NO-BREAK SPACE}", _style.said(display().words(sentence)))
    lines = textwrap.wrap(together, width)
    lines = [*lines[:2], f"{lines[2].rstrip(' ,;.')} …"] if len(lines) > 3 else lines
    axes.text(0.0, top, "\n".join(lines), **look, **_TEXT)


def blank(axes: Axes) -> None:
    """Axes that only hold text."""
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)


def table(
    axes: Axes,
    title: str,
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    ends: Sequence[float],
    *,
    step: float,
    colours: Sequence[str] = (),
) -> None:
    """A table of text: the first column to the left, the others to the right at their ends.

    `ends` (of each column but the first) and `step` (of rows) are shares of the width and the height.
    """
    blank(axes)
    axes.text(0.0, 1.0, title, **_TEXT)
    for number, cells in enumerate([headings, *rows]):
        colour = _style.GREY if number == 0 else colours[number - 1] if colours else _style.BLACK
        y = 1.0 - step * (number + 1.5)
        for place, cell in zip((0.0, *ends), cells, strict=True):
            side = "left" if place == 0.0 else "right"
            axes.text(place, y, cell, fontsize=SMALL, color=colour, ha=side, va="center")


def remarks(axes: Axes, title: str, sentences: Sequence[str], *, width: int, none: str = "") -> None:
    """The first sentences under a title; the others are counted."""
    blank(axes)
    said = [_style.said(display().words(sentence)) for sentence in sentences[:_MOST]]
    shown = [textwrap.shorten(sentence, 3 * width, placeholder=" …") for sentence in said]
    lines = [line for s in shown or [none] for line in textwrap.wrap(s, width, subsequent_indent="   ")]
    lines += [f"and {len(sentences) - _MOST} more on the page"] * (len(sentences) > _MOST)
    axes.text(0.0, 1.0, title, **_TEXT)
    axes.text(0.0, 0.86, "\n".join(lines), fontsize=SMALL, **_TEXT)

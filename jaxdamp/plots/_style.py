"""House style of all pictures: what each colour means, names and digits for people, axes, legends, titles."""

import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Artist, Axes, Figure
from jaxdamp._words import (
    class_words as class_words,
    first_upper as first_upper,
    in_words as _all_words,
    metric_words as metric_words,
    path_words as path_words,
    said as said,
    typeset as typeset,
)
from jaxdamp.dampers import law_name as law_name
from jaxdamp.plots._axes import label_axis, wrap


if TYPE_CHECKING:
    import matplotlib.axis
    import matplotlib.lines
    import matplotlib.text


T = TypeVar("T")
_LONGEST, _END = 36, 16  # letters of a name that is drawn, and of its end
Look = dict[str, Any]  # keywords of a line, patch or text
# Every two of these, and black, differ for each kind of colour vision, and all stand out 3:1 from white paper.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#9933FF", "#663300", "#001A99")
DASHES = ("-", "--", "-.", ":")
BLACK = "#222222"
GREY = "#6B6B6B"
SHADE = "#F5EEDF"  # behind what is extrapolated
GOOD, BAD = "#00755A", "#B00020"  # of a verdict; what is beyond a limit is BAD
# What a line means, the same in every picture, on every page and in notebooks.
MEASURED: Look = {"color": GREY, "linestyle": "-"}
BEFORE: Look = {"color": BLACK, "linestyle": "--", "linewidth": 1.3, "zorder": 2.5}
AFTER: Look = {"color": COLOURS[0], "linestyle": "-", "linewidth": 2.0}
REFERENCE: Look = {"color": "#949494", "linestyle": "-", "linewidth": 3.5, "zorder": 1.5}
# Points: the design that there is, and the best one.
PRESENT: Look = {"marker": "o", "color": BLACK, "markersize": 8.0, "markeredgecolor": "white"}
BEST: Look = {"marker": "*", "color": COLOURS[0], "markersize": 14.0}
LIMIT: Look = {"color": BAD, "linestyle": "--", "linewidth": 1.2}
REBOUND, COMPRESSION = COLOURS[0], COLOURS[1]  # where both are on one axis
ROLES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "measured": MEASURED,
        "before": BEFORE,
        "after": AFTER,
        "reference": REFERENCE,
        "limit": LIMIT,
        "shade": {"color": SHADE, "linewidth": 0.0, "zorder": 0.0},
    }
)
"""What a line of your own figure is drawn with: `axes.plot(x, y, **plots.ROLES["after"])`. "shade" is for what is
extrapolated, or a range that is allowed."""
STYLE: Mapping[str, bool | str] = MappingProxyType(
    {
        "figure.constrained_layout.use": True,
        "axes.prop_cycle": f"cycler('color', {list(COLOURS)})",
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "0.9",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlelocation": "left",
        "axes.titlesize": "medium",
        "legend.frameon": False,
    }
)
"""The look of the library's pictures for figures of your own: `matplotlib.pyplot.style.use(plots.STYLE)`; "C0" to "C5"
are then its colours."""

VELOCITY = "velocity [m/s]   (+ rebound)"
STROKE = "stroke [mm]   (+ rebound)"
FORCE = "force [N]   (+ resists extension)"
SIMULATE = "Take what `jaxdamp.simulate(vehicle, road)` gives, or several by name: {'before': ..., 'after': ...}."


def new_figure(width: float, height: float) -> Figure:
    """An empty figure [inch] with automatic margins."""
    from jaxdamp.plots import _figure

    return _figure.Figure(figsize=(width, height), dpi=100, layout="constrained")


def line_style(index: int) -> Look:
    """Colour and dash of the curve of that number; the dash changes once the colours are used up."""
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index // len(COLOURS) % len(DASHES)]}


def brief(name: str) -> str:
    """A name that leaves room for the picture: without the middle of a long one, as files often differ at the end.

    >>> brief("front damper"), brief("front damper of the second prototype, cold, 2.5Hz")
    ('front damper', 'front damper of the…ype, cold, 2.5Hz')
    """
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - _END - 1].rstrip()}…{name[-_END:].lstrip()}"


def in_words(name: str) -> str:
    """The name of a law, a design, a parameter or a setting as pictures say it."""
    return brief(_all_words(name))


def design_styles(names: Sequence[str], before: str | None = None, reference: str | None = None) -> dict[str, Look]:
    """How to draw designs by name: the first is blue, the next have other colours; of many, other dashes too.

    `before`, to compare with, is black and dashed; `reference`, such as a measurement, is broad and grey beneath them.
    """
    others = [name for name in names if name not in (before, reference)]
    styles = {name: {"linewidth": 1.4, **line_style(i), **(AFTER if i == 0 else {})} for i, name in enumerate(others)}
    special = {before: BEFORE, reference: REFERENCE}
    return {name: dict(special[name]) if name in special else styles[name] for name in names}


def ride_styles(names: Sequence[str], reference: str | None = None) -> dict[str, Look]:
    """`design_styles` of rides: the first of several is what the last one, the result, is compared with."""
    before = names[0] if reference is None and len(names) > 1 else None
    styles = design_styles([*names][:: -1 if before is not None else 1], before, reference)
    return {name: styles[name] for name in names}


def graded(index: float, count: int = 2) -> tuple[float, float, float, float]:
    """One of so many colours in order, dark to light, for curves that have an order themselves."""
    from matplotlib import colormaps

    return colormaps["viridis"](0.66 * index / max(count - 1, 1))


def short(value: float) -> str:
    """Three figures, no power of ten from 0.001 to 99 999, a true minus, and none before zero.

    >>> short(-1032.4), short(0.0123456), short(8.818e-05), short(-0.0)
    ('−1032', '0.0123', '8.82·10⁻⁵', '0')
    """
    if not np.isfinite(value):
        return "–" if np.isnan(value) else f"{'−' * (value < 0)}∞"
    if value and not 1e-3 <= abs(value) < 1e5:
        digits, power = f"{value:.2e}".split("e")
        text = typeset(f"{float(digits):g}·10^{int(power)}")
    else:
        text = f"{value:.0f}" if abs(value) >= 1e3 else f"{value:.3g}"
    return "0" if value == 0.0 else text.replace("-", "−")


def quantity(value: float, unit: str, name: str = "") -> str:
    """A number with its unit for people, in the units that are shown: strokes in mm, rates of springs in N/mm.

    The name of a metric or a measured quantity, if given, decides whether the sign is that of the direction.

    >>> quantity(0.0745, "m"), quantity(60e3, "N/m"), quantity(1.25, "m/s^2"), quantity(3.0, "")
    ('74.5 mm', '60 N/mm', '1.25 m/s²', '3')
    """
    shown = display().read(unit, signed=display().signed(name))
    return f"{short(shown(value))} {typeset_unit(shown.unit)}".rstrip()


def labelled(words: str, unit: str) -> str:
    """The label of an axis: words with their unit, if there is one."""
    unit = typeset_unit(unit)
    return f"{words} [{unit}]" if unit else words


def percent(value: float, digits: int = 0) -> str:
    """A change with its sign: "−14 %"; zero has none."""
    text = f"{value:+.{digits}f}"
    return f"{text if float(text) else text[1:]} %".replace("-", "−")


def plain_log_axis(axis: "matplotlib.axis.Axis") -> None:
    """A logarithmic axis with ticks at 1, 2 and 5 of each decade, as there is room, in plain numbers."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    from jaxdamp.plots._ticks import LogTicks

    axis.set_major_locator(ticks := LogTicks())
    axis.set_major_formatter(FuncFormatter(ticks.text))
    axis.set_minor_formatter(NullFormatter())


def within_six_decades(axes: Axes) -> None:
    """The ordinate of spectra: far below their peak they show the window that they were estimated with."""
    if any(np.any(np.asarray(line.get_ydata(), dtype=float) > 0.0) for line in axes.get_lines()):
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, 1e-6 * high), high)
        return
    axes.set_yscale("linear")  # zero has no place on a logarithmic axis
    axes.set_yticks([])
    axes.text(0.5, 0.55, "no motion", transform=axes.transAxes, ha="center", color=GREY)


_GAP = 0.05  # of two labels of curves, as a share of the height of the axes


def label_ends(axes: Axes, lines: Sequence["matplotlib.lines.Line2D"], *, outside: bool = False) -> None:
    """The label of each line at its right end, in its colour, on axes with limits: no legend.

    Labels that would meet are moved apart. With `outside` they are beside the axes, also where a line ends before.
    """
    ends = []
    for line in lines:
        points = np.column_stack([np.asarray(values, dtype=float) for values in line.get_data()])
        points = points[np.isfinite(points).all(axis=1)]
        if len(points):
            shares = axes.transAxes.inverted().transform(axes.transData.transform(points))
            ends.append((*shares[np.argmax(shares[:, 0])], line))
    ends.sort(key=lambda end: end[1])
    place, places = 1.0 + _GAP, np.array([end[1] for end in ends])
    for i in reversed(range(len(ends))):  # down from the top, and up again from the bottom
        place = places[i] = min(places[i], place - _GAP)
    place = -_GAP
    for (x, _, line), y in zip(ends, places, strict=True):
        place = max(y, place + _GAP)
        look = {"color": line.get_color(), "fontsize": "small", "va": "center", "annotation_clip": False}
        to = (1.0 if outside else min(x, 1.0)) + 0.015, place
        axes.annotate(str(line.get_label()), to, xycoords="axes fraction", **look)


def dress(
    axes: Axes,
    x: str,
    y: str,
    title: str = "",
    *,
    turns: Literal["", "y", "xy"] = "",
    zero: Literal["", "x", "y", "xy"] = "",
) -> None:
    """Labels, a light grid, and no frame above and to the right; ticks in the units and the sign that are shown.

    The numbers drawn are those of the library: where the labels name a unit that is shown otherwise, the ticks are
    round numbers of the other unit, and an axis of the other sign runs the other way: one whose label has the sign, or
    that is among those that `turns` names. Lines are drawn where x or y is zero, if `zero` names it.
    """
    label_axis(axes, "x", x, turns="x" in turns)
    label_axis(axes, "y", y, turns="y" in turns)
    if title:
        wrap(axes.set_title(display().words(title), loc="left", fontsize="medium"), axes)
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    cross(axes, horizontal="y" in zero, vertical="x" in zero)


def cross(axes: Axes, horizontal: bool = True, vertical: bool = True) -> None:
    """Lines through zero."""
    if horizontal:
        axes.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    if vertical:
        axes.axvline(0.0, color="0.6", linewidth=0.8, zorder=1)


def legend_beside(
    figure: Figure, handles: Sequence[Artist], title: str = "", place: Literal["upper", "lower"] = "upper"
) -> None:
    """A legend to the right of all axes, never over data: two columns at most, what has no room there is counted."""
    from matplotlib.lines import Line2D

    rows = max(int((figure.get_figheight() - _HEAD) / _LINE), 2)
    if (more := len(handles) - 2 * rows) > 0:
        handles = [*handles[: 2 * rows - 1], Line2D([], [], linestyle="", label=f"and {more + 1} more")]
    _in_words(handles)
    look: Look = {"loc": f"outside right {place}", "frameon": False, "alignment": "left"}
    figure.legend(handles=list(handles), title=title or None, ncols=1 + (len(handles) > rows), **look)


_HEAD, _LINE = 0.6, 0.22  # inch, above the entries of a legend, and of each
_LETTERS = 9  # in an inch of a legend, with room for narrower figures


def legend_above(figure: Figure, handles: Sequence[Artist], columns: int = 3) -> None:
    """A legend above all axes, for pictures that need their width."""
    _in_words(handles)
    letters = max((len(line) for handle in handles for line in str(handle.get_label()).split("\n")), default=1)
    room = int(_LETTERS * figure.get_figwidth() / (letters + 8))  # of so many columns
    columns = max(min(columns, room, len(handles)), 1)
    figure.legend(handles=list(handles), loc="outside upper center", frameon=False, ncols=columns)


def _in_words(handles: Sequence[Artist]) -> None:
    """The labels of a legend in the units that are shown."""
    for handle in handles:
        handle.set_label(display().words(str(handle.get_label())))


def by_name(
    argument: str, given: T | Mapping[str, T], kind: type[T], words: str, remedy: str, alone: str = ""
) -> dict[str, T]:
    """One object to draw, or several by name, as a dictionary; `alone` names a single one.

    `words` are those of the class, such as "a damper law".
    """
    items = dict(given) if isinstance(given, Mapping) else {alone: given}
    if not items:
        _checks.refuse(argument, "hold at least one", "empty", remedy)
    for name, item in items.items():
        label = f"{argument}[{name!r}]" if isinstance(given, Mapping) else argument
        _checks.instance(label, item, kind, f"be {words}", remedy)
    return items


def note_below(figure: Figure, sentences: Sequence[str]) -> None:
    """Remarks in small print under all axes; nothing if there are none."""
    lines = [
        line
        for sentence in map(display().words, sentences)
        for line in textwrap.wrap(sentence, int(11 * figure.get_figwidth()))
    ]
    if lines:
        figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize="small", color="0.35")

"""Common style of all pictures: figure, colours, labels with unit and sign, legends."""

import textwrap
import zlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from jaxdamp import _checks, dampers
from jaxdamp.dampers import AbstractDamper, Sum


if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure


# Okabe and Ito: distinguishable with every kind of colour vision; without the pale yellow; black is for baselines.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = ("-", "--", "-.", ":")
FAMILIES = (  # of laws, by the number of their colour
    (dampers.Linear, dampers.Bilinear, dampers.PiecewiseLinear),  # straight pieces
    (dampers.Besinger, dampers.Degressive, dampers.DigressiveProgressive, dampers.Saturating),  # valves that open
    (dampers.PowerLaw, dampers.Polynomial, dampers.SegmentedPolynomial),  # powers of the velocity
    (dampers.BoucWen, dampers.ModifiedBoucWen, dampers.Dahl, dampers.LuGre, dampers.ViscoPlastic,
     dampers.CreepingViscoPlastic, dampers.Play, dampers.CoulombFriction, dampers.StribeckFriction,
     dampers.HyperbolicTangent, dampers.KaradayiMasada),  # friction
    (dampers.Table, dampers.SplineTable, dampers.ForceSurface, dampers.AccelerationSurface, dampers.NeuralHysteresis,
     dampers.Hybrid),  # numbers without a formula
    (dampers.MonoTube, dampers.PistonFlow, dampers.FrequencySelective),  # hydraulics
)  # fmt: skip
BLACK = "#222222"
GREY = "#7F7F7F"
SHADE = "#F5EEDF"  # behind what is extrapolated

VELOCITY = "velocity [m/s]   (+ rebound, − compression)"
STROKE = "stroke [mm]   (+ rebound, − compression)"
FORCE = "force [N]   (+ resists extension)"
SIMULATE = "Take what `jaxdamp.simulate(vehicle, road)` gives, or several by name: {'before': ..., 'after': ...}."


def new_figure(width: float, height: float) -> "matplotlib.figure.Figure":
    """An empty figure [inch] with automatic margins."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=100, layout="constrained")


def line_style(index: int) -> dict[str, Any]:
    """Colour and dash of the curve of that number; the dash changes once the colours are used up."""
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index // len(COLOURS) % len(DASHES)]}


def law_styles(laws: Mapping[str, AbstractDamper]) -> dict[str, dict[str, Any]]:
    """Colour and dash of laws by name: a law has the colour of its family, solid, in every figure.

    Of several laws of one family in a figure, all but the first are dashed, in colours that no family there has as long
    as there are any.
    """
    families = {name: _family(law) for name, law in laws.items()}
    spare = [colour for colour in range(len(COLOURS)) if colour not in families.values()]
    more = [(colour, dash) for dash in range(1, len(DASHES)) for colour in (*spare, *sorted(set(families.values())))]
    chosen: dict[str, tuple[int, int]] = {}
    for name, family in families.items():
        unused = [place for place in ((family, 0), *more) if place not in chosen.values()]
        chosen[name] = unused[0] if unused else (family, 0)
    return {name: {"color": COLOURS[colour], "linestyle": DASHES[dash]} for name, (colour, dash) in chosen.items()}


def _family(law: AbstractDamper) -> int:
    """The number of the colour of a law: that of its family, or of the first law inside a sum or a wrapper.

    Laws of your own have one by their name.
    """
    families = [number for number, family in enumerate(FAMILIES) if isinstance(law, family)]
    inside = law.inner_laws()
    if families or not inside:
        return families[0] if families else zlib.crc32(type(law).__name__.encode()) % len(COLOURS)
    return _family(inside[0])


def graded(index: int, count: int) -> tuple[float, float, float, float]:
    """One of so many colours in order, dark to light, for curves that have an order themselves."""
    from matplotlib import colormaps

    return colormaps["viridis"](0.88 * index / max(count - 1, 1))


def short(value: float) -> str:
    """Three figures, but no power of ten for thousands."""
    return (f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}").replace("-", "−")


def dress(axes: "matplotlib.axes.Axes", x: str, y: str, title: str = "") -> None:
    """Labels, a light grid, and no frame above and to the right."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title, loc="left", fontsize="medium")
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def cross(axes: "matplotlib.axes.Axes", horizontal: bool = True, vertical: bool = True) -> None:
    """Lines through zero."""
    if horizontal:
        axes.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    if vertical:
        axes.axvline(0.0, color="0.6", linewidth=0.8, zorder=1)


def legend_beside(
    figure: "matplotlib.figure.Figure",
    handles: Sequence[object],
    title: str = "",
    place: Literal["upper", "lower"] = "upper",
) -> None:
    """A legend to the right of all axes, never over data."""
    where = "outside right upper" if place == "upper" else "outside right lower"
    figure.legend(handles=list(handles), loc=where, frameon=False, title=title or None, alignment="left")


def legend_above(figure: "matplotlib.figure.Figure", handles: Sequence[object], columns: int = 3) -> None:
    """A legend above all axes, for pictures that need their width."""
    figure.legend(
        handles=list(handles), loc="outside upper center", frameon=False, ncols=min(columns, max(len(handles), 1))
    )


def by_name(argument: str, given: object, kind: type, words: str, remedy: str, alone: str = "") -> dict[str, Any]:
    """One object to draw, or several by name, as a dictionary; `alone` names a single one.

    Arguments:
        argument: its name in messages.
        given: an object, or objects by name.
        kind: their class.
        words: the class in words, such as "a damper law".
        remedy: what to write.
        alone: the name of a single object.

    Raises:
        ValueError: none, or objects of another kind.
    """
    items = dict(given) if isinstance(given, Mapping) else {alone: given}
    if not items:
        _checks.refuse(argument, "hold at least one", "empty", remedy)
    for name, item in items.items():
        label = f"{argument}[{name!r}]" if isinstance(given, Mapping) else argument
        _checks.instance(label, item, kind, f"be {words}", remedy)
    return items


def note_below(figure: "matplotlib.figure.Figure", sentences: Sequence[str]) -> None:
    """Remarks in small print under all axes; nothing if there are none."""
    lines = [line for sentence in sentences for line in textwrap.wrap(sentence, int(11 * figure.get_figwidth()))]
    if lines:
        figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize="small", color="0.35")


def law_name(law: AbstractDamper) -> str:
    """The classes of a law in words: "SeriesSpring of Besinger", "Linear + CoulombFriction"."""
    if isinstance(law, Sum):
        return " + ".join(law_name(term) for term in law.terms)
    name, inside = type(law).__name__, law.inner_laws()
    return f"{name} of {law_name(inside[0])}" if len(inside) == 1 else name

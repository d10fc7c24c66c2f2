"""Drawings of the sign conventions, made with matplotlib when the site is built."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle


INK, BODY, MARK, ROAD = "#222222", "#D9E4EC", "#D55E00", "#7F7F7F"
ARROW = {"arrowstyle": "-|>", "mutation_scale": 14, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}


def draw_all(folder: Path) -> None:
    """Write every drawing as SVG, where it is not there yet."""
    folder.mkdir(exist_ok=True)
    for draw in (damper, quarter_car, pitch_and_roll):
        path = folder / f"{draw.__name__}.svg"
        if not path.exists() or path.stat().st_mtime < Path(__file__).stat().st_mtime:
            draw().savefig(path)


def damper() -> Figure:
    """Stroke, velocity and force of a damper; the four quadrants of its force-velocity curve."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.25, 1.0])
    for centre, length, title in ((0.0, 1.75, "compressed: x < 0"), (3.0, 2.4, "extended: x > 0")):
        _telescope(left, centre, 0.0, length)
        left.text(centre, -0.35, title, ha="center", va="top", color=INK)
    _arrow(left, (3.75, 1.3), (3.75, 2.6), "v > 0\nrebound", (3.85, 1.95))
    _arrow(left, (-0.75, 1.85), (-0.75, 0.6), "v < 0\ncompression", (-0.85, 1.2), align="right")
    _arrow(left, (2.55, 2.55), (2.55, 1.8), "F > 0", (2.45, 2.2), align="right", colour=INK)
    _arrow(left, (2.55, -0.15), (2.55, 0.6), "", (0, 0), colour=INK)
    _plain(left, (-2.2, 5.0), (-0.9, 4.2))
    left.text(
        1.4,
        3.6,
        "Stroke and velocity are positive in extension;\na positive force pulls the ends together",
        ha="center",
    )

    velocity = np.linspace(-0.5, 0.5, 201)
    force = np.where(velocity > 0, 1.0, 0.45) * np.tanh(velocity / 0.12) * (1.0 + 0.6 * np.abs(velocity))
    right.fill_between([0, 0.55], 0, 1.6, color="#E3F1EA")
    right.fill_between([-0.55, 0], -1.6, 0, color="#E3F1EA")
    right.plot(velocity, force, color=MARK, linewidth=2)
    right.axhline(0, color=INK, linewidth=0.8)
    right.axvline(0, color=INK, linewidth=0.8)
    right.text(0.27, 0.25, "rebound\nF v ≥ 0", ha="center", va="center")
    right.text(-0.27, -1.05, "compression\nF v ≥ 0", ha="center", va="center")
    right.set(xlim=(-0.55, 0.55), ylim=(-1.6, 1.6), xlabel="velocity v [m/s]", ylabel="force F", yticks=[])
    right.set_title("A passive damper stays in the shaded quadrants", fontsize=10)
    return figure


def quarter_car() -> Figure:
    """Heights of body, wheel and road, stroke of the damper, load of the tyre."""
    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.add_patch(Rectangle((-1.2, 3.4), 2.4, 0.8, facecolor=BODY, edgecolor=INK))
    axes.text(0, 3.8, "body $m_s$", ha="center", va="center")
    axes.add_patch(Rectangle((-0.7, 1.4), 1.4, 0.5, facecolor=BODY, edgecolor=INK))
    axes.text(0, 1.65, "wheel $m_u$", ha="center", va="center")
    _spring(axes, -0.45, 1.9, 3.4)
    _telescope(axes, 0.45, 1.9, 1.5, width=0.16, rod=0.95)
    _spring(axes, 0.0, 0.25, 1.4)
    along = np.linspace(-2.0, 2.0, 200)
    axes.plot(along, 0.12 * np.sin(2.3 * along) + 0.13, color=ROAD, linewidth=2)
    for height, name in ((3.8, "$z_s$"), (1.65, "$z_u$"), (0.2, "road $r$")):
        axes.plot([-2.25, -1.9], [height, height], color=INK, linewidth=0.8)
        _arrow(axes, (-2.08, height), (-2.08, height + 0.6), name, (-2.25, height + 0.35), align="right")
    axes.text(1.0, 2.65, "stroke  x = $z_s$ − $z_u$\npositive in extension", va="center")
    axes.text(1.0, 0.8, "tyre load positive\nwhen the tyre is pressed\nonto the road", va="center")
    _plain(axes, (-3.3, 4.2), (-0.2, 5.1))
    axes.text(0.4, 4.8, "z is up. Heights are measured from the equilibrium on the springs", ha="center")
    return figure


def pitch_and_roll() -> Figure:
    """Pitch is positive nose up, roll is positive left side up."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    side, behind = figure.subplots(1, 2, width_ratios=[1.4, 1.0])
    _tilted_body(side, 3.2, 0.12)
    for place in (-1.15, 1.15):
        side.add_patch(Circle((place, -0.75), 0.36, facecolor="white", edgecolor=INK, linewidth=1.6))
    _arrow(side, (2.0, 1.25), (3.0, 1.25), "forwards", (2.5, 1.4), align="center")
    _turn(side, (1.0, 0.75), (0.45, 1.25), "pitch θ > 0: nose up")
    side.annotate("", (1.15, -1.35), (0, -1.35), arrowprops={"arrowstyle": "<->"})
    side.annotate("", (-1.15, -1.35), (0, -1.35), arrowprops={"arrowstyle": "<->"})
    side.plot([0, 0], [-1.5, 0.0], color=INK, linewidth=0.8, linestyle=":")
    side.text(0.12, -1.5, "front_distance", va="top")
    side.text(-0.12, -1.5, "rear_distance", ha="right", va="top")
    side.text(0.0, 1.95, "seen from the right", ha="center")
    _plain(side, (-2.2, 3.4), (-2.0, 2.2))

    _tilted_body(behind, 2.0, -0.14)
    for place in (-0.8, 0.8):
        behind.add_patch(Rectangle((place - 0.16, -1.1), 0.32, 0.7, facecolor="white", edgecolor=INK, linewidth=1.6))
    behind.text(-0.8, -1.3, "left\ny > 0", ha="center", va="top")
    behind.text(0.8, -1.3, "right\ny < 0", ha="center", va="top")
    _turn(behind, (-0.5, 0.7), (0.1, 1.15), "roll φ > 0: left side up", bend=-0.35)
    behind.text(0.0, 1.95, "seen from behind", ha="center")
    _plain(behind, (-2.0, 2.0), (-2.0, 2.2))
    return figure


def _telescope(axes: Axes, centre: float, bottom: float, length: float, width: float = 0.3, rod: float = 1.4) -> None:
    """A damper whose tube is at the bottom; the rod, of fixed length, carries the piston."""
    piston = bottom + length - rod
    axes.add_patch(Rectangle((centre - width, bottom + 0.1), 2 * width, 0.85 * rod, facecolor=BODY, edgecolor=INK))
    axes.plot([centre, centre], [piston, bottom + length], color=INK, linewidth=3)
    axes.plot([centre - 0.8 * width, centre + 0.8 * width], [piston, piston], color=INK, linewidth=4)
    axes.plot([centre, centre], [bottom, bottom + 0.1], color=INK, linewidth=3)
    axes.plot([centre, centre], [bottom, bottom + length], "o", color=INK, markersize=6)


def _spring(axes: Axes, centre: float, bottom: float, top: float) -> None:
    heights = np.linspace(bottom, top, 13)
    offsets = np.array([0, *np.tile([0.14, -0.14], 6)])[:13]
    offsets[-1] = 0
    axes.plot(centre + offsets, heights, color=INK, linewidth=1.4)


def _tilted_body(axes: Axes, length: float, angle: float) -> None:
    corners = np.array([(-1, -0.25), (1, -0.25), (1, 0.25), (-1, 0.25), (-1, -0.25)]) * (length / 2, 1.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    axes.fill(*(turn @ corners.T), facecolor=BODY, edgecolor=INK)
    axes.plot(0, 0, "o", color=INK, markersize=5)


def _turn(axes: Axes, start: tuple, end: tuple, text: str, bend: float = 0.35) -> None:
    axes.add_patch(FancyArrowPatch(start, end, color=MARK, connectionstyle=f"arc3,rad={bend}", **ARROW))
    axes.text(0.0, 1.45, text, ha="center", color=MARK)


def _arrow(
    axes: Axes, start: tuple, end: tuple, text: str, at: tuple, *, align: str = "left", colour: str = MARK
) -> None:
    axes.add_patch(FancyArrowPatch(start, end, color=colour, **ARROW))
    axes.text(*at, text, ha=align, va="center", color=colour)


def _plain(axes: Axes, x: tuple, y: tuple) -> None:
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.axis("off")

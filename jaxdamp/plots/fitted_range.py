"""Marks of the fitted and the extrapolated range of laws in pictures."""

import textwrap
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._display import display
from jaxdamp._types import Axes, Figure
from jaxdamp.dampers import AbstractDamper, extrapolated
from jaxdamp.plots import _style
from jaxdamp.rig import quasi_static
from jaxdamp.simulation import Response, range_sentences


LABEL = "extrapolated: beyond the fitted records"
_MOST_LINES, _LINE_LENGTH = 4, 170  # of footnotes
Points = Float[np.ndarray, " points"]


def curve(axes: Axes, law: AbstractDamper, velocities: Points, force: Points, **style: Any) -> list:
    """A curve of force over velocity, lighter and dotted where it is extrapolated; the handles of what was measured."""
    outside = extrapolated(law, velocities)
    handles = axes.plot(velocities, np.where(outside, np.nan, force), **style)
    if outside.any():
        light = style | {"linestyle": ":", "alpha": 0.6, "label": "_nolegend_"}
        axes.plot(velocities, np.where(_widened(outside), force, np.nan), **light)
    return handles


def settled(
    axes: Axes, law: AbstractDamper, velocities: Points, name: str, *, extra: float = 0.0, **style: object
) -> tuple[list, list[str]]:
    """Settled and extra force [N] of a law over velocity: handles as of `curve`, and a remark where it has a gap."""
    held = quasi_static(law, velocities)
    handles = curve(axes, law, velocities, np.asarray(held.force) + extra, **style)
    return handles, [f"{name}: {held.note}"] if held.note else []


def shade(axes: Axes, laws: Iterable[AbstractDamper], velocities: Points, label: str = LABEL) -> list:
    """Shade the velocities [m/s], which increase, at which all laws are extrapolated; the handle for a legend."""
    masks = [mask for mask in (extrapolated(law, velocities) for law in laws) if mask.any()]
    outside = np.logical_and.reduce(masks) if masks else np.zeros(velocities.size, bool)
    spans = []
    for start, stop in _stretches(outside):
        low, high = velocities[max(start - 1, 0)], velocities[min(stop, velocities.size - 1)]
        name = "_nolegend_" if spans else label
        spans.append(
            axes.axvspan(low, high, facecolor=_style.SHADE, edgecolor="0.7", linewidth=0.5, zorder=0.1, label=name)
        )
    return spans[:1]


def shade_channel(axes: Axes, responses: Iterable[Response], channel: str) -> None:
    """Shade velocities outside those of the records, if the channel is the velocity of a damper."""
    laws: list[AbstractDamper] = []
    for response in responses:
        pairs = zip(response.vehicle.frame().element_names, response.vehicle.elements(), strict=True)
        laws += [law for name, law in pairs if channel == f"{name}_velocity"]
    if not laws:
        return
    low, high = axes.get_ylim()
    points = np.linspace(low, high, 2001)
    outside = np.logical_and.reduce([extrapolated(law, points) for law in laws])
    for start, stop in _stretches(outside):
        axes.axhspan(points[start], points[stop - 1], color=_style.SHADE, linewidth=0.0, zorder=0.1)
    axes.set_ylim(low, high)


def footnotes(figure: Figure, responses: Mapping[str, Response]) -> None:
    """Footnotes on the dampers used outside the range of their records, and by how much."""
    lines = [
        display().words(f"{name + ': ' if name else ''}{text}")
        for name, response in responses.items()
        for text in range_sentences(response.range_use())
    ]
    more = [f"and {len(lines) - _MOST_LINES} more"] * (len(lines) > _MOST_LINES)
    wrapped = [part for line in [*lines[:_MOST_LINES], *more] for part in textwrap.wrap(line, _LINE_LENGTH)]
    if wrapped:
        text = "\n".join(["Beyond the records that the laws were fitted to:", *wrapped])
        figure.supxlabel(text, x=0.01, horizontalalignment="left", fontsize="small", color=_style.GREY)


def _stretches(outside: Bool[np.ndarray, " points"]) -> list[tuple[int, int]]:
    """First and one past the last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], outside, [False]]).astype(int)))
    return [(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def _widened(outside: Bool[np.ndarray, " points"]) -> Bool[np.ndarray, " points"]:
    """One point more on each side, so that the two parts of a curve meet."""
    return outside | np.append(False, outside[:-1]) | np.append(outside[1:], False)

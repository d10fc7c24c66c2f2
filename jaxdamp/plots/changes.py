"""A tuning: laws and spectra before and after, and the change of every ride metric."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import percent_change, typeset_unit
from jaxdamp._types import Axes, Figure, VectorLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.plots import _style, fitted_range
from jaxdamp.plots.rides import default_channels
from jaxdamp.rig import quasi_static
from jaxdamp.tune import TuneResult
from jaxdamp.vehicles import AbstractVehicle


def tuning(result: TuneResult, velocities: VectorLike | None = None) -> Figure:
    """Force over velocity of each damper and response spectra before and after, and the change of each ride metric.

    Arguments:
        result: a tuning.
        velocities: where to draw the laws [m/s]; a little beyond the fastest damper motion of the ride, if the vehicle
            reports it as `peak_damper_velocity`, or −1 to 1 m/s, if left out.
    """
    remedy = "The call is `tuning(result)` with the result of `tune.minimise`."
    _checks.instance("result", result, TuneResult, "be the result of a tuning", remedy)
    if velocities is None:
        peaks = [table.get("peak_damper_velocity", 0.0) for table in (result.before, result.after)]
        reach = 1.1 * max(peaks) or 1.0
        velocities = np.linspace(-reach, reach, 401)
    pairs = _changed(result)
    spectra = result.spectra(default_channels(result.start.layout))
    height = max(6.0, 0.38 * len(result.before))  # a line of text for each metric
    figure = _style.new_figure(12.0, height + 3.0 * bool(spectra))
    rows = figure.add_gridspec(1 + bool(spectra), 1, height_ratios=(height, 3.0)[: 1 + bool(spectra)])
    grid = rows[0].subgridspec(1, 2, width_ratios=(1.0, 1.0))
    bars = figure.add_subplot(grid[1])
    if spectra:
        below = rows[1].subgridspec(1, len(spectra))
        for place, (channel, pair) in enumerate(spectra.items()):
            _spectrum(figure.add_subplot(below[place]), channel, result.start.units[channel], pair)
    points, beside, gaps = np.asarray(velocities, dtype=float), grid[0].subgridspec(len(pairs), 1), []
    for place, (name, pair) in enumerate(pairs.items()):
        gaps += _law(figure.add_subplot(beside[place]), name, pair, points)
    verdict = result.verdict
    colour = _style.GOOD if verdict.better else _style.BAD
    words = f"{verdict.outcome.value}\n{_style.said(verdict.sentence)}"
    figure.suptitle(words, x=0.01, ha="left", fontsize="medium", color=colour, wrap=True)
    _bars(bars, result)
    _style.note_below(figure, gaps)
    return figure


def _law(curves: Axes, name: str, pair: tuple[AbstractDamper, AbstractDamper], points: np.ndarray) -> list[str]:
    """A law before and after over the velocity; a sentence for each that has no settled force somewhere."""
    gaps = []
    for law, when, style in zip(pair, ("before", "after"), (_style.BEFORE, _style.AFTER), strict=True):
        settled = quasi_static(law, points)
        gaps += [f"{name} {when}: {settled.note}"] if settled.note else []
        fitted_range.curve(curves, law, points, np.asarray(settled.force), label=when, **style)
    fitted_range.shade(curves, pair, points)
    _style.dress(curves, _style.VELOCITY, _style.FORCE, name)
    _style.cross(curves)
    curves.legend(loc="upper left", frameon=False)
    return gaps


def _changed(result: TuneResult) -> dict[str, tuple[AbstractDamper, AbstractDamper]]:
    """The laws of both vehicles by the names of the dampers: those that differ, or the first."""
    names = [_style.first_upper(_style.in_words(name)) for name in result.start.frame().element_names]
    pairs = list(zip(*(own_laws(vehicle) for vehicle in (result.start, result.vehicle)), strict=True))
    differing = [i for i, (old, new) in enumerate(pairs) if not eqx.tree_equal(old, new)] or [0]
    return {names[i]: pairs[i] for i in differing}


def own_laws(vehicle: AbstractVehicle) -> list[AbstractDamper]:
    """The laws of a vehicle, one of several equal ones, without those of tyre lift-off."""
    frame = vehicle.frame()
    return [element.law for part in (*frame.links, *frame.wheels) for element in part.elements]


def _bars(axes: Axes, result: TuneResult) -> None:
    """Relative change of each metric, with its values."""
    names = list(result.before)
    rows = np.arange(len(names), dtype=float)
    change = [percent_change(result.before[n], result.after[n]) or 0.0 for n in names]
    colours = [_style.COLOURS[1] if c > 0 else _style.COLOURS[2] for c in change]
    axes.barh(rows, change, 0.65, color=colours)
    reached = {n: " (limit reached)" if n in result.active_limits else " (limited)" for n in result.limits}
    reached |= dict.fromkeys(result.violated, " (LIMIT VIOLATED)")
    labels = []
    for name, value in zip(names, change, strict=True):
        mark = " (minimised)" if name == result.metric else reached.get(name, "")
        values = " → ".join(_style.quantity(side[name], result.units[name]) for side in (result.before, result.after))
        labels.append(f"{_style.metric_words(name)}{mark}\n{values}  ({_style.percent(value, 1)})")
    axes.set_yticks(rows, labels, fontsize="small")
    axes.invert_yaxis()
    axes.margins(x=0.08)
    _style.dress(axes, "change [%]", "", "Ride metrics")
    axes.grid(False, axis="y")
    _style.cross(axes, horizontal=False)


def _spectrum(axes: Axes, channel: str, unit: str, pair: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
    """The power spectral density of a channel before and after."""
    for side, style, label in zip(pair, (_style.BEFORE, _style.AFTER), ("before", "after"), strict=True):
        axes.loglog(*side, label=label, **style)
    title = f"Spectrum of the {_style.metric_words(channel)}"
    squared = f"({typeset_unit(unit)})²" if "/" in unit else f"{unit}²"
    _style.dress(axes, "frequency [Hz]", f"[{squared}/Hz]", title)
    _style.plain_log_axis(axes.xaxis)
    axes.set_xlim(*pair[0][0][[0, -1]])
    axes.legend(frameon=False)

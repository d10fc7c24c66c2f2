"""Rides: time histories, the spectrum of the body acceleration, and the use of the damper."""

import re
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks, metrics
from jaxdamp._tables import typeset_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.plots import _style, fitted_range
from jaxdamp.plots.frequency import third_octaves, welch, whole_spectrum
from jaxdamp.simulation import Response
from jaxdamp.vehicles import ChannelKind, Layout


WINDOW = 3.0  # s, drawn over time: in more, wheel oscillations at 10 Hz cannot be distinguished
_SIGNS = dict.fromkeys((ChannelKind.HEIGHT, ChannelKind.VELOCITY, ChannelKind.ACCELERATION), "+ up") | {
    ChannelKind.STROKE: "+ rebound",
    ChannelKind.DAMPER_VELOCITY: "+ rebound",
    ChannelKind.FORCE: "+ resists extension",
    ChannelKind.TYRE_LOAD: "+ more load",
}


@of_known_numbers
def ride(
    responses: Response | Mapping[str, Response],
    *,
    channels: Sequence[str] | None = None,
    weighting: str | None = None,
    window: tuple[float | int, float | int] | None = None,
    reference: str | None = None,
    frequencies: tuple[float | int, float | int] = (0.3, 30.0),
    title: str = "",
) -> Figure:
    """Channels over time and the power spectral density of the first of them, overlaid for several responses.

    The legend gives the RMS of the first channel over the whole run. Dampers used outside the fitted range of their
    laws are named below the picture, and velocities outside this range are shaded.

    Arguments:
        responses: a response, or responses by name, all of one kind of vehicle.
        channels: what to draw over time; the first one also as a spectrum. Left out, the acceleration of the body, the
            first stroke and the first dynamic tyre load.
        weighting: a frequency weighting of ISO 2631-1, such as "Wk": the legend adds the weighted RMS, and a panel of
            its own shows this in third octaves (`metrics.third_octave_rms`).
        window: part of the run to draw over time [s]; if left out, the whole run, or of a long one the 3 s around its
            largest first channel. The spectrum and the RMS are of the whole run.
        reference: name of the response to draw as a broad grey line beneath the others.
        frequencies: range of the spectrum [Hz].
        title: above the picture, such as the road; the vehicle and the length of the ride if left out.

    Raises:
        ValueError: no response, no channel or an unknown one, an unknown weighting, a window without samples.
    """
    responses = _style.by_name("responses", responses, Response, "a response", _style.SIMULATE)
    first = next(iter(responses.values()))
    channels = _chosen_channels(first, channels)
    if reference is not None:
        _checks.one_of("reference", reference, responses)
    start, stop = _window(first, channels[0]) if window is None else window
    figure = _style.new_figure(12.0, 2.2 * len(channels) + 0.6)
    grid = figure.add_gridspec(len(channels), 2, width_ratios=(1.4, 1.0))
    rows = [figure.add_subplot(grid[0, 0])]
    rows += [figure.add_subplot(grid[i, 0], sharex=rows[0]) for i in range(1, len(channels))]
    right = grid[:, 1].subgridspec(2 if weighting else 1, 1, height_ratios=(1.6, 1.0)[: 2 if weighting else 1])
    spectrum = figure.add_subplot(right[0])
    handles, felt, unit = [], [], _unit(first, channels[0])
    styles = _style.ride_styles(list(responses), reference)
    for name, response in responses.items():
        style = styles[name]
        time, all_channels = np.asarray(response.time), response.channels
        seen = (time >= start) & (time <= stop)
        if not seen.any():
            _checks.refuse("window", f"hold instants of the run, 0 to {time[-1]:g} s", (start, stop))
        for axes, channel in zip(rows, channels, strict=True):
            axes.plot(time[seen], _factor(first, channel) * np.asarray(all_channels[channel])[seen], **style)
        values = np.asarray(all_channels[channels[0]])
        label = f"{_style.in_words(name) + ': ' if name else ''}RMS {_style.short(np.sqrt(np.mean(values**2)))} {unit}"
        frequency, density = _spectrum(values, response.dt, frequencies)
        if weighting is not None:
            felt_rms = metrics.Metric(channels[0], "rms", weighting)
            weighted = response.metrics([felt_rms])[felt_rms.name]
            label += f", weighted by {weighting} {_style.short(float(weighted))} {unit}"
            felt.append(("_", style, whole_spectrum(values, response.dt)))
        handles += spectrum.loglog(frequency, density, label=label, **style)
    for axes, channel in zip(rows, channels, strict=True):
        fitted_range.shade_channel(axes, responses.values(), channel)
        words = re.sub(r"^sprung_", "body_", channel).replace("_", " ")
        _style.dress(axes, "", f"{words} {unit_and_sign(first.system.layout, channel)}".replace("   ", "\n"))
        _style.cross(axes, vertical=False)
        axes.label_outer()
    figure.align_ylabels(rows)
    rows[-1].set_xlabel("time [s]")
    rows[0].set_xlim(start, stop)
    name = re.sub(r"^sprung_", "body_", channels[0]).replace("_", " ")
    _style.dress(spectrum, "frequency [Hz]", f"power spectral density [({unit})²/Hz]", f"Spectrum of the {name}")
    _style.plain_log_axis(spectrum.xaxis)
    _style.within_six_decades(spectrum)
    spectrum.set_xlim(*frequencies)
    if weighting is not None:
        third_octaves(figure.add_subplot(right[1]), felt, weighting, unit, name)
    _style.legend_above(figure, handles)
    vehicle = _style.first_upper(_style.class_words(first.vehicle))
    title = title or f"{vehicle}, ride of {float(first.time[-1] - first.time[0]):g} s"
    rows[0].set_title(_style.said(title), loc="left", fontsize="medium")
    fitted_range.footnotes(figure, responses)
    return figure


def _chosen_channels(response: Response, channels: Sequence[str] | None) -> Sequence[str]:
    """The channels to draw, checked; the default ones if left out."""
    if channels is None:
        return default_channels(response.system.layout)
    if not channels:
        _checks.refuse("channels", "hold at least one channel to draw", "empty")
    for channel in channels:
        _checks.one_of("channels", channel, response.units)
    return channels


def default_channels(layout: Layout) -> tuple[str, ...]:
    """Body acceleration, first stroke, first dynamic tyre load of a vehicle."""
    acceleration = next(m.channel for m in layout.metrics if layout.by_name[m.channel].kind.weighting is not None)
    kinds = ChannelKind.STROKE, ChannelKind.TYRE_LOAD
    others = [next((c.name for c in layout.channels if c.kind is kind), None) for kind in kinds]
    return (acceleration, *[name for name in others if name is not None])


def _window(response: Response, channel: str) -> tuple[float, float]:
    """The whole run, or of a long one the seconds around its largest value."""
    time = np.asarray(response.time)
    end, length = float(time[-1]), WINDOW
    if end <= length:
        return 0.0, end
    centre = float(time[np.argmax(np.abs(np.asarray(response[channel])))])
    start = min(max(centre - 0.5 * length, 0.0), end - length)
    return start, start + length


def _spectrum(
    values: Float[np.ndarray, " time"], dt: float, band: tuple[float | int, float | int]
) -> tuple[Float[np.ndarray, " lines"], Float[np.ndarray, " lines"]]:
    """Welch's estimate with segments longer than a period of the lowest frequency, where the run is."""
    size = min(max(len(values) // 8, round(1.2 / (band[0] * dt))), len(values))
    frequency, density = welch(values, dt, size)
    inside = (frequency > 0) & (frequency >= band[0]) & (frequency <= band[1])
    return frequency[inside], density[inside]


def _unit(response: Response, channel: str) -> str:
    return typeset_unit(response.units[channel], "–")


def _factor(response: Response, channel: str) -> float:
    """Metres of stroke are drawn in millimetres."""
    return 1e3 if response.units[channel] == "m" else 1.0


def unit_and_sign(layout: Layout, channel: str) -> str:
    """The unit that a channel is drawn in and the direction in which it is positive, as a label has them."""
    kind = layout.by_name[channel].kind
    unit = "mm" if kind.unit == "m" else typeset_unit(kind.unit, "–")
    return f"[{unit}]" + (f"   ({_SIGNS[kind]})" if kind in _SIGNS else "")


_BINS, _POINTS, _SHADE_POINTS = 41, 81, 2001


@of_known_numbers
def damper_use(responses: Response | Mapping[str, Response], *, damper: str | None = None) -> Figure:
    """Force over velocity during rides, with the quasi-static curve of the law, and histograms of the velocity.

    The histograms are the share of time and the share of dissipated energy in ranges of equal width; they show which
    part of the curve is important on this road. Velocities outside the fitted range of the laws are shaded.

    Arguments:
        responses: a response, or responses by name, of one kind of vehicle.
        damper: name of the damper, such as "front_damper"; the first if it is left out.

    Raises:
        ValueError: no response, an unknown damper, a vehicle without one.
    """
    responses = _style.by_name("responses", responses, Response, "a response", _style.SIMULATE)
    dampers: tuple[str, ...] = next(iter(responses.values())).dampers
    if not dampers:
        _checks.refuse("responses", "be of a vehicle with a damper", "of one without")
    damper = dampers[0] if damper is None else damper
    _checks.one_of("damper", damper, dampers)
    figure = _style.new_figure(12.0, 4.6)
    trace, time_share, energy_share = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 1.0))
    records = {name: _record(response, damper) for name, response in responses.items()}
    reach = 1.02 * max(float(np.max(np.abs(velocity))) for velocity, _ in records.values()) or 1.0
    edges = np.linspace(-reach, reach, _BINS + 1)
    middles, handles, gaps = 0.5 * (edges[1:] + edges[:-1]), [], []
    laws = {name: response.vehicle.frame().element(damper).law for name, response in responses.items()}
    styles = _style.ride_styles(list(laws))
    for name, (velocity, force) in records.items():
        style, law = styles[name], laws[name]
        held = np.linspace(velocity.min(), velocity.max(), _POINTS)
        trace.plot(velocity, force, color=style["color"], linewidth=0.5, alpha=0.5)
        label = _style.in_words(name) or "law"
        lines, remarks = fitted_range.settled(trace, law, held, name or "law", label=label, **style)
        handles, gaps = handles + lines, gaps + remarks
        for axes, weight in ((time_share, np.ones_like(velocity)), (energy_share, force * velocity)):
            whole = float(np.sum(weight)) or np.nan  # nothing is dissipated at rest
            axes.step(middles, 100.0 * np.histogram(velocity, edges, weights=weight)[0] / whole, where="mid", **style)
    reached = np.linspace(-reach, reach, _SHADE_POINTS)
    shaded = [fitted_range.shade(axes, laws.values(), reached) for axes in (trace, time_share, energy_share)]
    handles += shaded[0]
    words = f"{_style.first_upper(damper.replace('_', ' '))}: law (thick) and its forces in the ride (thin)"
    _style.dress(trace, _style.VELOCITY, _style.FORCE, words)
    _style.cross(trace)
    step = _style.quantity(2.0 * reach / _BINS, "m/s")
    _style.dress(time_share, _style.VELOCITY, "share of time [%]", f"Time, {step} a step")
    _style.dress(energy_share, _style.VELOCITY, "share of dissipated energy [%]", "Energy")
    if len(responses) > 1 or shaded[0]:
        _style.legend_above(figure, handles)
    _style.note_below(figure, gaps)
    return figure


def _record(response: Response, damper: str) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and force of a damper."""
    channels = response.channels
    return np.asarray(channels[f"{damper}_velocity"]), np.asarray(channels[f"{damper}_force"])

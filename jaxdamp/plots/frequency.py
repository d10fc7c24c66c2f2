"""Over frequency: modes, vehicles on a sine of their road, laws on the test machine, what is felt, and roughness."""

import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Array

from jaxdamp import metrics
from jaxdamp._steady_cycles import AbstractSteadyCycles
from jaxdamp._types import Axes, Figure
from jaxdamp.metrics import RoughnessBySegment
from jaxdamp.plots import _style
from jaxdamp.rig import DynamicStiffness
from jaxdamp.roads import RoughnessAssessment, class_limits
from jaxdamp.simulation import HarmonicResponse
from jaxdamp.vehicles import ChannelKind, Modes


def modes(result: Modes) -> Figure:
    """The amplitude of every coordinate in each damped oscillation, signed as in the undamped motion.

    Heights [m] and angles [rad] are compared as numbers, the largest of a mode is 1.

    Arguments:
        result: of `vehicles.modes`.
    """
    shapes = result.damped_shapes.T  # one row for each oscillation
    count, rows = len(shapes), np.arange(len(result.coordinates), dtype=float)
    figure = _style.new_figure(max(2.4 * count + 1.5, 5.0), 1.6 + 0.35 * len(rows))
    panels = np.atleast_1d(figure.subplots(1, max(count, 1), sharey=True))
    for axes, shape, frequency, ratio in zip(panels, shapes, result.frequency, result.damping_ratio, strict=False):
        amplitude = np.abs(shape) * np.where(np.real(shape) < 0, -1.0, 1.0)
        axes.barh(rows, amplitude, 0.6, color=[_style.COLOURS[1 if a < 0 else 0] for a in amplitude])
        axes.set_xlim(-1.1, 1.1)
        _style.dress(axes, "amplitude [–]", "", f"{frequency:.3g} Hz, damping ratio {ratio:.2g}", zero="x")
    words = [re.sub(r"^z_(.*)", r"\1_displacement", name) for name in result.coordinates]
    panels[0].set_yticks(rows, list(map(_style.metric_words, words)))
    panels[0].invert_yaxis()
    return figure


DRAWN = (ChannelKind.ACCELERATION, ChannelKind.STROKE, ChannelKind.TYRE_LOAD)


def harmonic_response(result: HarmonicResponse, channels: Sequence[str] | None = None) -> Figure:
    """First harmonic per metre of road over frequency, one curve for each amplitude; unstable motions are circles.

    Arguments:
        result: of `simulation.harmonic_response`.
        channels: to draw; the first acceleration, stroke and tyre load of the vehicle if left out.
    """
    by_name = result.layout.channels
    if channels is None:
        channels = [
            next(c.name for c in by_name if c.kind is kind) for kind in DRAWN if any(c.kind is kind for c in by_name)
        ]
    gains = {channel: np.abs(np.asarray(result.gain(channel))) for channel in channels}
    units = {c.name: (c.unit, 1.0) for c in by_name} | {c.name: ("N", 1e-3) for c in by_name if c.unit == "N"}
    panels = []
    for channel in channels:
        unit, factor = units[channel]
        label = f"[{unit} per {'m' if factor == 1.0 else 'mm'}]" if unit else "[1/m]"
        panels.append((_style.metric_words(channel), label, factor * gains[channel]))
    return _over_frequency(result, result.amplitude, panels, "road amplitude")


def dynamic_stiffness(result: DynamicStiffness) -> Figure:
    """Stiffness, loss angle and equivalent damping over frequency, one curve for each amplitude.

    Arguments:
        result: of `rig.dynamic_stiffness`.
    """
    panels = [
        ("dynamic stiffness", "[N/mm]", 1e-3 * np.asarray(result.stiffness)),
        ("loss angle", "[deg]", np.rad2deg(np.asarray(result.loss_angle))),
        ("equivalent damping", "[N s/m]", np.asarray(result.damping)),
    ]
    return _over_frequency(result, result.amplitude, panels, "amplitude")


def _over_frequency(
    result: AbstractSteadyCycles,
    amplitude: Array,
    panels: Sequence[tuple[str, str, np.ndarray]],
    legend: str,
) -> Figure:
    """A panel for each title, label and values, with a curve for each amplitude."""
    frequency = np.asarray(result.frequency)
    sizes = 1e3 * np.asarray(amplitude).reshape(-1, frequency.size)
    unstable = (result.steady & ~result.stable).reshape(sizes.shape)
    figure = _style.new_figure(8.0, 0.9 + 2.1 * len(panels))
    columns = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    lines = []
    for axes, (title, label, values) in zip(columns, panels, strict=True):
        lines = []
        for i, (row, size) in enumerate(zip(values.reshape(sizes.shape), sizes, strict=True)):
            constant = np.ptp(size) <= 1e-9 * size[0]
            name = f"{_style.short(size[0])} mm" if constant else f"{size.min():.3g} to {size.max():.3g} mm"
            colour = _style.graded(i, len(sizes))
            lines += axes.plot(frequency, row, color=colour, label=name, linewidth=1.4)
            axes.plot(frequency[unstable[i]], row[unstable[i]], "o", color=colour, markerfacecolor="none")
        _style.dress(axes, "", label, title)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    columns[-1].set_xlabel("frequency [Hz]")
    _style.legend_beside(figure, lines, legend)
    _style.note_below(figure, result.warnings)
    return figure


_FELT = 0.01  # share of the largest band from which bands are drawn


def third_octaves(
    axes: Axes,
    sides: Sequence[tuple[str, _style.Look, tuple[np.ndarray, np.ndarray]]],
    weighting: str,
    unit: str,
    name: str,
) -> None:
    """Weighted RMS in third octaves of spectra: the last one filled, the others as outlines.

    Each side is a label, a look and a spectrum (frequencies, densities).
    """
    octaves = [np.stack([np.asarray(a) for a in metrics.third_octave_rms(*each, weighting)]) for *_, each in sides]
    finite = np.all([np.isfinite(rms) for _, rms in octaves], axis=0)
    largest = np.max([np.where(finite, rms, 0.0) for _, rms in octaves], axis=0)
    drawn = np.flatnonzero(finite & (largest > _FELT * largest.max()))
    bands = slice(drawn[0], drawn[-1] + 1) if drawn.size else slice(None)
    for number, ((label, style, _), (centre, rms)) in enumerate(zip(sides, octaves, strict=True)):
        ends = np.append(centre[bands] * 10.0**-0.05, centre[bands][-1:] * 10.0**0.05)
        look = {name: value for name, value in style.items() if name != "color"} | {"edgecolor": style["color"]}
        filled = number == len(sides) - 1
        shade: _style.Look = {"facecolor": (style["color"], 0.3)} if filled else {}
        axes.stairs(rms[bands], ends, fill=filled, label=label, **look, **shade)
    axes.set_xscale("log")
    _style.dress(
        axes, "frequency [Hz]", f"{name} [{unit}]", f"Third octaves, {weighting} of ISO\N{NO-BREAK SPACE}2631-1"
    )
    _style.plain_log_axis(axes.xaxis)


def welch(
    values: np.ndarray, dt: float, size: int | None = None, *, window: str = "hann"
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and densities of a record, as `metrics.power_spectral_density`, which is compiled for each length.

    `size` is that of a segment, the whole record if left out.
    """
    from scipy import signal

    return signal.welch(values, 1.0 / dt, window, size or len(values))


def whole_spectrum(values: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """The density of a whole record as one segment."""
    return welch(values, dt, window="boxcar")


def roughness_by_segment(roughness: RoughnessBySegment) -> Figure:
    """The international roughness index of each segment over the distance, and that of the whole profile.

    Arguments:
        roughness: of `metrics.roughness_by_segment`.
    """
    figure = _style.new_figure(8.0, 3.5)
    axes = figure.subplots()
    values, whole = 1e3 * np.asarray(roughness.segments), 1e3 * float(roughness.whole)
    bars = axes.bar(roughness.starts, values, roughness.lengths, align="edge", edgecolor="white", label="segment")
    line = axes.axhline(whole, color=_style.GREY, linestyle="--", label=f"whole profile, {whole:.3g} m/km")
    title = "Roughness by segment"
    if roughness.is_partial:
        title += f" (the last one {roughness.lengths[-1]:.4g} m)"
    _style.dress(axes, "", "IRI [m/km]", title)
    axes.set_xlabel("distance [m]")  # along a road, where mm and inches say nothing
    _style.legend_beside(figure, [bars, line])
    return figure


def roughness_spectrum(assessment: RoughnessAssessment) -> Figure:
    """The displacement spectrum of a road over the spatial frequency, its straight line, and the classes of ISO 8608.

    Arguments:
        assessment: of `roads.assess_roughness`.
    """
    figure = _style.new_figure(8.5, 5.0)
    axes = figure.subplots()
    n, density = assessment.spatial_frequency, assessment.displacement_psd
    ends = np.array([n[0], n[-1]])
    line = assessment.roughness_psd * (ends / 0.1) ** -assessment.waviness
    handles = axes.loglog(n, density, "o-", color=_style.COLOURS[0], markersize=3.5, label="mean of each band")
    label = f"straight line, waviness {assessment.waviness:.2f}"
    handles += axes.loglog(ends, line, color=_style.COLOURS[1], label=label)
    low, high = axes.get_ylim()
    for name in "ABCDEFG":
        edge = class_limits(name)[1] * (ends / 0.1) ** -2.0
        if edge[0] > low and edge[1] < high:
            axes.loglog(ends, edge, color="0.8", linewidth=0.9, zorder=0)
            at, side = (1, "left") if edge[1] > low else (0, "right")
            shift = (3 if at else -3, -3)
            axes.annotate(name, (ends[at], edge[at]), shift, textcoords="offset points", color="0.5", ha=side)
    axes.set_ylim(low, high)
    _style.dress(axes, "spatial frequency [cycle/m]", "displacement PSD [m³]", f"Road of class {assessment.road_class}")
    _style.legend_beside(figure, handles, "grey: upper ends of the classes")
    return figure

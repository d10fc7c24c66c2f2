"""The last panels of a ride sheet: what reaches body and tyre over frequency, and how it is felt; a bump over time."""

import textwrap
from collections.abc import Sequence

import numpy as np

from jaxdamp import metrics
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Axes
from jaxdamp.plots import _rides, _sheet, _style
from jaxdamp.plots.frequency import third_octaves, welch, whole_spectrum
from jaxdamp.plots.rides import default_channels
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import Response
from jaxdamp.vehicles import frequency_response, linearise


SETTLED = 0.05  # share of the peak below which the motion over a bump has settled
BANDS = 9  # points of a curve in an octave
LOWEST, HIGHEST = 0.5, 30.0  # Hz, that are shown
_SEGMENT = 4.0  # s
_EXCITED = 1e-3  # share of the largest density of the road's rate from which a response follows from it
_DEEPEST = 3e-3  # share of the largest gain that is shown
_LETTERS = 30  # in a line of a legend
_LINE = 0.1  # height of this line, as a share of the panel
_MM = 1e3


def gains(axes: Sequence[Axes], shown: _rides.Rides) -> None:
    """What reaches the body, its motion over that of the road, and the tyre load over its height.

    The legend is that of the dampers above.
    """
    first, *_, last = default_channels(shown.cars[0].layout)
    channels = (first, last)
    if shown.responses is None and not isinstance(shown.road, WhiteRoad):
        _sheet.remarks(axes[0], "Transmissibility", ["Several roads or conditions; see the page."], width=34)
        _sheet.blank(axes[1])
        return
    sides = [(label, style, _gains(shown, number, channels)) for label, style, number in shown.styles()]
    words = _style.metric_words(channels[0]).removesuffix(" acceleration")
    titles = f"Transmissibility, road to {words}\n{_rides.dips(shown)}".strip(), "Tyre load from the road"
    for panel, channel, title in zip(axes, channels, titles, strict=True):
        for label, style, by_channel in sides:
            panel.loglog(*by_channel[channel], label=label, **style)
        unit = f"[{typeset_unit(shown.cars[0].units[channel])}/mm]" if channel != channels[0] else "[–]"
        _style.plain_log_axis(panel.xaxis)
        _style.plain_log_axis(panel.yaxis)
        _style.dress(panel, "frequency [Hz]", unit, title)
        panel.set_xlim(LOWEST, HIGHEST)
        _bands(panel, shown.frequencies)
    axes[0].axhline(1.0, color="0.6", linewidth=0.8, zorder=1)


def _gains(shown: _rides.Rides, number: int, channels: Sequence[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Frequencies and gains by channel: of accelerations per acceleration of the road, of others per millimetre."""
    car = shown.cars[number]
    if shown.responses is not None:
        response = shown.responses[number]
        by_channel = {name: _driven(response, np.asarray(response[name])) for name in channels}
    else:
        road, frequency = shown.road, np.geomspace(LOWEST, HIGHEST, 200)
        assert isinstance(road, WhiteRoad)
        linear = linearise(car, velocity_psd=road.velocity_psd, speed=road.speed)
        found = frequency_response(linear, frequency, speed=road.speed)
        by_channel = {name: (frequency, np.abs(np.asarray(found[name]))) for name in channels}
    square = {name: (2.0 * np.pi * f) ** 2 if name == channels[0] else _MM for name, (f, _) in by_channel.items()}
    return {name: (frequency, gain / square[name]) for name, (frequency, gain) in by_channel.items()}


def _driven(response: Response, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The gain from the height under the first axle, the mean of both sides, to a channel, where the road has power."""
    from scipy.signal import csd

    axles = np.array(response.vehicle.frame().axles)
    rate, dt = np.asarray(response.road_rate)[:, axles == 0].mean(axis=1), response.dt
    size = min(round(_SEGMENT / dt), len(values))
    frequency, excited = welch(rate, dt, size)
    gain = np.full(excited.size, np.nan, complex)  # where the road has no power
    np.divide(csd(rate, values, 1.0 / dt, nperseg=size)[1], excited, out=gain, where=excited > 0.0)
    measured = (frequency > 0.8 * LOWEST) & (frequency < 1.2 * HIGHEST)
    measured[measured] = excited[measured] > _EXCITED * excited[measured].max()
    frequency = frequency[measured]
    points, squares = smoothed(frequency, (2.0 * np.pi * frequency * np.abs(gain[measured])) ** 2)
    return points, np.sqrt(squares)


def smoothed(frequency: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means of the density in bands of equal width in octaves."""
    band = np.round(BANDS * np.log2(frequency)).astype(int)
    bands = np.unique(band)
    return np.array([np.exp(np.mean(np.log(frequency[band == b]))) for b in bands]), np.array(
        [density[band == b].mean() for b in bands]
    )


def _bands(axes: Axes, frequencies: np.ndarray) -> None:
    """Shade the natural frequencies, those of the body and those of the wheels, and name them."""
    low, high = axes.get_ylim()
    axes.set_ylim(0.5 * max(low, _DEEPEST * high), high)  # with room for the words below the curves
    for word, group in (("body", frequencies[frequencies < 4.0]), ("wheels", frequencies[frequencies >= 4.0])):
        for frequency in group:
            axes.axvspan(frequency / 1.15, frequency * 1.15, color=_style.SHADE, linewidth=0.0, zorder=0.1)
        middle = float(np.exp(np.mean(np.log(group)))) if group.size else 0.0
        if LOWEST < middle < HIGHEST:
            look = {"ha": "center", "color": _style.GREY, "bbox": {"facecolor": "white", "linewidth": 0.0, "pad": 0.5}}
            axes.text(middle, 0.02, word, transform=axes.get_xaxis_transform(), **look)


def comfort(axes: Axes, shown: _rides.Rides) -> None:
    """The weighted acceleration of the body in third octaves, as ISO 2631-1 divides it, and what it calls the whole."""
    channel = default_channels(shown.cars[0].layout)[0]
    weighting = shown.cars[0].layout.by_name[channel].kind.weighting
    spectra = _densities(shown, channel)
    if spectra is None or weighting is None:
        _sheet.remarks(axes, "Comfort by frequency", ["Several roads or conditions; see the page."], width=34)
        return
    unit, whole = typeset_unit(shown.cars[0].units[channel]), f"weighted_rms_{channel}"
    sides = []
    for label, style, number in shown.styles():
        value = shown.values[number].get(whole)
        words = "" if value is None else f"{_style.short(value)} {unit}, {' or '.join(metrics.comfort_reaction(value))}"
        words = "\n".join(textwrap.wrap(": ".join(filter(None, (label, words))), _LETTERS))
        sides.append((words, style, spectra[number]))
    third_octaves(axes, sides, weighting, unit, _style.metric_words(channel))
    lines = sum(label.count("\n") + 1 for label, *_ in sides)
    axes.set_ylim(0.0, axes.get_ylim()[1] / max(0.95 - _LINE * lines, 0.3))
    axes.legend(frameon=False, loc="upper left")


def _densities(shown: _rides.Rides, channel: str) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """Frequencies and densities before and after: of the whole run, whose powers add up to the square of its RMS."""
    if shown.responses is None:
        pair = {} if shown.tuning is None else shown.tuning.spectra([channel])
        return [(one.frequency, one.density) for one in pair[channel]] if pair else None
    return [whole_spectrum(np.asarray(response[channel]), response.dt) for response in shown.responses]


def event(axes: Axes, shown: _rides.Rides) -> None:
    """The motion of the body over a bump, with its peaks, overshoot and settling time."""
    assert shown.responses is not None
    for label, style, number in shown.styles():
        response = shown.responses[number]
        height = np.asarray(response[f"z_{response.vehicle.frame().main_body.name}"])
        time, values = np.asarray(response.time), _MM * (height - height[0])
        moved = np.abs(np.asarray(response.road_rate)).max(axis=1)
        end = float(time[np.flatnonzero(moved > 1e-3 * moved.max())[-1]])
        after = values[time > end]
        over = f", {_style.quantity(float(np.abs(after).max()), 'mm')} after it" if after.size else ""
        last = float(time[np.flatnonzero(np.abs(values) > SETTLED * np.abs(values).max())[-1]])
        settled = (
            "not settled" if last > 0.99 * time[-1] else f"settled {_style.short(max(last - end, 0.0))} s after it"
        )
        up, down = (_style.quantity(float(peak), "mm") for peak in (values.max(), values.min()))
        words = f"up {up}, down {down}{over}, {settled}"
        axes.plot(time, values, label=f"{label}: {words}" if label else words, **style)
    _style.dress(axes, "time [s]", "[mm]   (+ up)", "Height of the body over the bump")
    _style.cross(axes, vertical=False)
    axes.legend(frameon=False, loc="best")

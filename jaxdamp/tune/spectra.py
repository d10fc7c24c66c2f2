"""Power spectral densities of the channels of a vehicle, on a road that is driven over or on a white one."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.metrics import power_spectral_density
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import simulate
from jaxdamp.vehicles import AbstractVehicle, frequency_response, linearise


LOWEST, HIGHEST = 0.3, 30.0  # Hz


class Spectrum(NamedTuple):
    """A one-sided power spectral density.

    Attributes:
        frequency: [Hz].
        density: [unit²/Hz].
    """

    frequency: Float[np.ndarray, " lines"]
    density: Float[np.ndarray, " lines"]


def spectra(
    vehicle: AbstractVehicle,
    road: AbstractRoad | WhiteRoad,
    channels: Sequence[str],
    run: Mapping[str, Any],
) -> dict[str, Spectrum]:
    """The spectrum of each channel between 0.3 and 30 Hz.

    On a white road it is that of the vehicle with equivalent linear laws; otherwise Welch's estimate with
    segments of 4 s, or of the whole run if that is shorter.
    """
    if isinstance(road, WhiteRoad):
        frequency = np.geomspace(LOWEST, HIGHEST, 400)
        linear = linearise(vehicle, velocity_psd=road.velocity_psd, speed=road.speed)
        gains = frequency_response(linear, frequency, speed=road.speed)
        height = 2.0 * float(road.velocity_psd) / (2.0 * np.pi * frequency) ** 2
        return {name: Spectrum(frequency, np.abs(np.asarray(gains[name])) ** 2 * height) for name in channels}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the notes of the tuning say it
        response = simulate(vehicle, road, **run)
    dt = float(response.time[1] - response.time[0])
    by_channel = {}
    for name in channels:
        values = np.asarray(response[name])
        segment = min(round(1.2 / (LOWEST * dt)), len(values))
        frequency, density = (np.asarray(a) for a in power_spectral_density(values - values.mean(), dt, segment))
        inside = (frequency >= LOWEST) & (frequency <= HIGHEST)
        by_channel[name] = Spectrum(frequency[inside], density[inside])
    return by_channel

"""A road whose rate is white noise: the ISO 8608 road of waviness 2 with an unlimited spectrum."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.roads.iso_classes import REFERENCE_SPATIAL_FREQUENCY, roughness


@final
class WhiteRoad(eqx.Module):
    """A road given only by its spectrum, for the stationary response of vehicles; created by `white`.

    Attributes:
        velocity_psd: two-sided power spectral density S of the rate of height [(m/s)²/Hz], as `stationary_rms` takes
            it: half of `one_sided_velocity_psd`.
        speed: speed of the vehicle, for the delays between axles [m/s].
    """

    velocity_psd: Scalar
    speed: Scalar

    @property
    def one_sided_velocity_psd(self) -> Scalar:
        """Power spectral density over positive frequencies [(m/s)²/Hz], 2 S: that of all other spectra here."""
        return 2.0 * self.velocity_psd


def white(road_class: str | ScalarLike, speed: ScalarLike) -> WhiteRoad:
    """The road of an ISO 8608 class at a speed as white noise in the rate of height, S = 2π² G_d(n₀) n₀² V.

    S is two-sided. The one-sided density, with which spectra of simulated and measured signals are compared, is 2 S =
    (2π n₀)² G_d(n₀) V (`one_sided_velocity_psd`).

    It cannot be used in simulations over time, only for stationary responses, in which heights are relative. There,
    each law of a vehicle is replaced by the linear one that is equivalent in the Gaussian motion that results
    (statistical linearisation, `vehicles.linearise`). In `benchmarks/white_road.py`, RMS values of a car with one of
    twelve laws, on classes A to D, are within 5 % of simulations, with hysteresis within 12 %, save the stroke where
    friction mostly sticks.

    Arguments:
        road_class: a letter A to H, or G_d(n₀) [m³].
        speed: vehicle speed V [m/s].

    Raises:
        ValueError: an unknown class, a speed or roughness that is not positive.

    >>> round(float(white("C", speed=20.0).velocity_psd), 9)
    0.001010647
    """
    _checks.positive("speed", speed)
    density = 2.0 * np.pi**2 * roughness(road_class) * REFERENCE_SPATIAL_FREQUENCY**2 * speed
    return WhiteRoad(jnp.asarray(density, float), jnp.asarray(speed, float))

"""The roughness classes of ISO 8608: their spectrum, means and limits."""

import math

import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar, ScalarLike


REFERENCE_SPATIAL_FREQUENCY = 0.1  # n0 [cycle/m]
LOWEST_SPATIAL_FREQUENCY, HIGHEST_SPATIAL_FREQUENCY = 0.011, 2.83  # [cycle/m]

ROUGHNESS_PSD = {road_class: 16e-6 * 4.0**k for k, road_class in enumerate("ABCDEFGH")}
"""Geometric mean of G_d(n0) [m^3] of each class; the limit between two classes is twice the lower mean."""


def displacement_psd(
    spatial_frequency: Float[Array, " lines"], roughness_psd: Scalar, waviness: Scalar
) -> Float[Array, " lines"]:
    """G_d(n) = G_d(n0) (n/n0)^-w [m^3], one-sided, n in cycle/m (not rad/m), n0 = 0.1 cycle/m. Source: ISO 8608."""
    return roughness_psd * (spatial_frequency / REFERENCE_SPATIAL_FREQUENCY) ** -waviness


def roughness(road_class: str | ScalarLike) -> ScalarLike:
    """G_d(n0) [m^3] of a class, or the number itself."""
    if not isinstance(road_class, str):
        _checks.positive("road_class", road_class, "As a number it is G_d(n0) in m^3, for example 64e-6.")
        value = _checks.concrete(road_class)
        if value is not None and np.any(value >= 1.0):
            _checks.refuse(
                "road_class", "be below 1 m^3", value, "Tables give G_d(n0) in 1e-6 m^3: write 256e-6, not 256."
            )
        return road_class
    if road_class not in ROUGHNESS_PSD:
        letters = [letter for letter in road_class.upper() if letter in ROUGHNESS_PSD]
        near = letters[-1] if letters else "H" if road_class.upper() > "H" else "A"
        choices = ", ".join(map(repr, ROUGHNESS_PSD))
        _checks.refuse("road_class", f"be one of {choices}, or a number", repr(road_class), f"Did you mean {near!r}?")
    return ROUGHNESS_PSD[road_class]


def class_limits(road_class: str) -> tuple[float, float]:
    """The least and the greatest G_d(n0) [m^3] of a class, half and twice its mean; 0 and infinity at the ends.

    Arguments:
        road_class: a letter from "A" to "H".

    Raises:
        ValueError: if the class is unknown.

    Source: ISO 8608.

    >>> class_limits("C")
    (0.000128, 0.000512)
    >>> class_limits("A")
    (0.0, 3.2e-05)
    """
    mean = float(roughness(str(road_class)))
    return 0.0 if road_class == "A" else 0.5 * mean, math.inf if road_class == "H" else 2.0 * mean


@of_known_numbers
def road_class(roughness_psd: float) -> str:
    """The letter of the class with a roughness G_d(n0) [m^3], n0 = 0.1 cycle/m; a limit belongs to the rougher class.

    Arguments:
        roughness_psd: G_d(n0) [m^3].

    Raises:
        ValueError: if it is not positive.

    >>> road_class(200e-6), road_class(2e-6), road_class(0.5)
    ('C', 'A', 'H')
    """
    _checks.positive("roughness_psd", roughness_psd, "It is G_d(n0) in m^3, for example 64e-6.")
    return next(letter for letter in ROUGHNESS_PSD if roughness_psd < class_limits(letter)[1])

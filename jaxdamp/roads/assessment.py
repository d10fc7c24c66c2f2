"""The classes of ISO 8608, and roads assessed by them."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table, plain, with_unit
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


# A Hann window correlates neighbouring lines: so many lines count as one independent line (1.94).
_CORRELATED_LINES = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)
# The first lines of a windowed record contain leakage from the longest waves; a band needs at least two lines.
_FIRST_LINE, _LEAST_LINES = 3, 2
# Larger deviations of the bands from the fitted line, in ln G_d (a factor of two), are reported.
_STRAIGHT = 0.7


@dataclass(frozen=True, eq=False)
class RoughnessAssessment(AbstractResult):
    """The roughness of a profile, from `assess_roughness`; prints as a table with a summary in words.

    Attributes:
        spatial_frequency: centres n of the bands [cycle/m].
        displacement_psd: G_d, one-sided, averaged over each band [m^3].
        lines: the number of lines of the spectrum in each band.
        roughness_psd: G_d(n0) of the fitted straight line at n0 = 0.1 cycle/m [m^3].
        waviness: w of the fitted straight line G_d(n0) (n/n0)^-w.
        deviation: the standard deviation of the bands from the straight line, of ln G_d.
        rms: the root mean square of the profile about its straight line [m].
    """

    spatial_frequency: Float[np.ndarray, " bands"]
    displacement_psd: Float[np.ndarray, " bands"]
    lines: np.ndarray
    roughness_psd: float
    waviness: float
    deviation: float
    rms: float

    @property
    def road_class(self) -> str:
        """The class of the fitted roughness at n0, a letter from "A" to "H"."""
        return road_class(self.roughness_psd)

    @property
    def band_classes(self) -> tuple[str, ...]:
        """The class of each band alone: of G_d(n) (n/n0)^2."""
        reference = self.displacement_psd * (self.spatial_frequency / REFERENCE_SPATIAL_FREQUENCY) ** 2
        return tuple(road_class(float(value)) for value in reference)

    @property
    def verdict(self) -> str:
        """Summary in a few sentences."""
        low, high = class_limits(self.road_class)
        limits = f"{1e6 * low:.0f} to {1e6 * high:.0f}" if 0.0 < low and high < 1.0 else f"up to {1e6 * high:.0f}"
        limits = f"from {1e6 * low:.0f}" if math.isinf(high) else limits
        value = float(f"{1e6 * self.roughness_psd:.3g}")
        words = [
            f"Class {self.road_class}: G_d(n0) = {value:.9g}e-6 m^3 (the class has {limits}), waviness "
            f"{self.waviness:.2f}."
        ]
        first, last = self.spatial_frequency[[0, -1]]
        if first > 1.5 * LOWEST_SPATIAL_FREQUENCY:
            words.append(f"Waves longer than {1.0 / first:.3g} m are not included: the record is too short.")
        if last < HIGHEST_SPATIAL_FREQUENCY / 1.5:
            words.append(f"Waves shorter than {1.0 / last:.3g} m are not included: the samples are too far apart.")
        if first > REFERENCE_SPATIAL_FREQUENCY:
            words.append("The value at n0 = 0.1 cycle/m is extrapolated.")
        if self.deviation > _STRAIGHT:
            factor = math.exp(self.deviation)
            words.append(
                f"The spectrum deviates from a straight line by a factor of {factor:.2g}: use the classes of the bands."
            )
        elif abs(self.waviness - 2.0) > 0.3:
            kind = "long waves are stronger" if self.waviness > 2.0 else "short waves are stronger"
            words.append(f"The waviness differs from the value of the standard, 2: {kind}.")
        least, most = min(self.band_classes), max(self.band_classes)
        if least != most:
            worst = int(np.argmax(self.displacement_psd * self.spatial_frequency**2))
            wave = 1.0 / self.spatial_frequency[worst]
            words.append(f"The bands are of class {least} to {most}; the roughest has a wavelength of {wave:.2g} m.")
        return " ".join(words)

    @property
    def summary(self) -> str:
        """`verdict`."""
        return self.verdict

    plot = drawn_by("roughness_spectrum", "The spectrum with its straight line and the classes.")

    def table(self) -> Table:
        """A row for each band."""
        columns = (
            Column("n", "cycle/m"),
            Column("wavelength", "m"),
            Column("G_d", "m^3", ".3e"),
            Column("lines", spec="d"),
            Column("class"),
        )
        numbers = self.spatial_frequency, 1.0 / self.spatial_frequency, self.displacement_psd, self.lines
        return Table("Road roughness", columns, tuple(zip(*map(plain, numbers), self.band_classes, strict=True)))

    def content(self) -> Contents:
        """Class, fitted spectrum, bands and verdict with units, ready for JSON."""
        return {
            "road_class": self.road_class,
            "roughness_psd": with_unit(self.roughness_psd, "m^3"),
            "waviness": self.waviness,
            "deviation": self.deviation,
            "rms": with_unit(self.rms, "m"),
            "bands": self.table().to_dict(),
            "verdict": self.verdict,
        }

    def __str__(self) -> str:
        return f"{self.table().to_text()}\n{self.verdict}"


@of_known_numbers
def assess_roughness(
    height: Float[ArrayLike, " samples"], spacing: float | int, *, bands_per_octave: int = 1
) -> RoughnessAssessment:
    """The spectrum of a profile over spatial frequency, with the roughness, waviness and class of ISO 8608.

    A straight line is taken off the profile, a Hann window put on, and the one-sided periodogram averaged over bands
    of equal width in octaves between 0.011 and 2.83 cycle/m, as far as the record reaches: from its third line and to
    its Nyquist frequency. A straight line through ln G_d over ln n, all bands alike, gives G_d(n0) and the waviness;
    the mean logarithm of a band with few lines is corrected for its bias, digamma(m) - ln m, and G_d(n0) for that of
    means over bands: with w = 3 that of an octave is 6 % above the density at its centre.

    The class is that of the fitted G_d(n0). One kilometre of a random road gives G_d(n0) with a standard deviation of
    10 % and the waviness with one of 0.06. For any road driven at a constant speed, the spacing is that of the times
    multiplied by the speed:

    Arguments:
        height: the heights of one track at equal spacing [m].
        spacing: the distance between them [m].
        bands_per_octave: 1 for octaves, 3 for third octaves, ...

    Raises:
        ValueError: if `height` is not one-dimensional, too short for three bands, not finite or level, or if
            `spacing` or `bands_per_octave` is not positive.

    Source: ISO 8608 for range, reference and classes. The standard narrows its bands towards short waves; equal bands
    are used here, so that every octave counts the same.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import iso8608
    >>> time = 0.005 * jnp.arange(20_000.0)
    >>> road = iso8608("C", speed=20.0, duration=100.0, seed=3, ramp=0.0)
    >>> found = assess_roughness(road.height(time)[:, 0], 20.0 * 0.005)
    >>> found.road_class, round(found.waviness, 1)
    ('C', 2.0)
    """
    _checks.positive("spacing", spacing, "It is in m.")
    _checks.positive("bands_per_octave", bands_per_octave)
    values = np.asarray(height, float)
    if values.ndim != 1:
        _checks.refuse("height", "hold one track", f"of shape {values.shape}", "Take one column: height[:, 0].")
    _checks.finite("height", values, "Cut or fill the gaps first.")
    if values.size >= 2:
        place = np.linspace(-1.0, 1.0, values.size)
        values = values - np.polynomial.Polynomial.fit(place, values, 1)(place)
    if not np.any(np.abs(values) > 1e-12 * (np.max(np.abs(np.asarray(height))) if values.size else 1.0)):
        _checks.refuse("height", "hold a rough road", "level or a straight slope", "There is nothing to assess.")
    centre, psd, lines = _bands(values, float(spacing), int(bands_per_octave))
    from scipy.special import digamma

    independent = np.maximum(lines / _CORRELATED_LINES, 1.0)
    logarithm = np.log(psd) - (digamma(independent) - np.log(independent))
    octave = np.log(centre / REFERENCE_SPATIAL_FREQUENCY)
    slope, level = np.polyfit(octave, logarithm, 1)
    # the mean of n^-w over a band is its value at the centre for w = 0 and 2 only
    inside = math.log(2.0) / bands_per_octave * np.linspace(-0.5, 0.5, 1001)  # ln n about the centre
    share = np.sum(np.exp(inside)) / np.sum(np.exp((1.0 + slope) * inside))
    return RoughnessAssessment(
        spatial_frequency=centre,
        displacement_psd=psd,
        lines=lines,
        roughness_psd=float(share * np.exp(level)),
        waviness=float(-slope),
        deviation=float(np.std(logarithm - level - slope * octave)),
        rms=float(np.sqrt(np.mean(values**2))),
    )


def _bands(
    values: np.ndarray, spacing: float, bands_per_octave: int
) -> tuple[Float[np.ndarray, " bands"], Float[np.ndarray, " bands"], np.ndarray]:
    """The centres [cycle/m], mean densities [m^3] and numbers of lines of the bands that the record can tell."""
    size = values.size
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(size) + 0.5) / size)
    spectrum = np.abs(np.fft.rfft(values * window)) ** 2 * (2.0 * spacing / np.sum(window**2))
    line = np.fft.rfftfreq(size, spacing)
    width = 2.0 ** (1.0 / bands_per_octave)
    low = LOWEST_SPATIAL_FREQUENCY * width ** np.arange(math.floor(8.008 * bands_per_octave))
    centre, psd, lines = [], [], []
    for begin in low:
        inside = (line >= begin) & (line < begin * width)
        reached = begin >= _FIRST_LINE / (size * spacing) and begin * width <= 0.5 / spacing
        if reached and inside.sum() >= _LEAST_LINES:
            centre.append(begin * math.sqrt(width))
            psd.append(spectrum[inside].mean())
            lines.append(int(inside.sum()))
    if len(centre) < 3:
        _checks.refuse(
            "height",
            "be long and fine enough for three bands between 0.011 and 2.83 cycle/m",
            f"{size} samples {spacing:g} m apart, with {len(centre)}",
            "Give a longer record, or one with closer samples.",
        )
    return np.array(centre), np.array(psd), np.array(lines)

"""Roads of measured or computed heights, as arrays."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._types import ScalarLike
from jaxdamp._warned import warn
from jaxdamp.roads._sampled import SampledRoad
from jaxdamp.roads.base import check_speed


# Largest departure from a uniform grid that is taken for rounding in the file, as part of one step.
_UNEVENNESS = 0.01
# Heights rounded more than this disturb a ride by more than 0.1 % [m].
_ROUNDING = 1e-6


def from_profile(
    position: Float[ArrayLike, " samples"],
    height: Float[ArrayLike, " samples"] | Float[ArrayLike, "samples wheels"],
    speed: ScalarLike | int | None = None,
    *,
    periodic: bool = False,
    ramp: float | int = 0.0,
) -> SampledRoad:
    """A road from measured or computed heights at equal spacing, with straight lines between the samples.

    The vehicle is at the first sample at time 0, whatever its position is called. Differentiable in `height` and
    `speed` (the slope jumps at each sample, so the gradient in speed is that of the piecewise linear road).

    A road that is not periodic ends with its last sample: asking for later times raises a `ValueError`, and gives NaN
    inside compiled code, where times cannot be inspected.

    Heights above sea level are too large for single precision, in which a ride at 250 m is off by some 15 %: without
    `jaxdamp.configure()` heights above some 8 m give a warning. Subtract that of the beginning.

    Arguments:
        position: the place of each sample: distance along the road [m] if `speed` is given, otherwise time [s]. It
            must increase in equal steps.
        height: the height of each sample [m], up positive: shape [samples], or [samples, wheels] with one column per
            track.
        speed: the speed of the vehicle [m/s], for a profile over distance.
        periodic: repeat the profile for ever. The sample after the last one is then the first one again, so a closed
            lap must not hold its starting point twice.
        ramp: the time [s] over which the road fades in as a raised cosine, for profiles that do not start at height
            zero; 0 turns it off.

    Raises:
        ValueError: if lengths differ, if there are fewer than two samples, if anything is NaN or infinite, if
            `position` does not increase or its steps are not equal, if `speed` is not one positive number, or if
            `ramp` is negative.

    >>> import jax.numpy as jnp
    >>> ramp_up = from_profile(jnp.arange(4.0), jnp.array([0.0, 0.0, 0.1, 0.1]), speed=10.0)
    >>> ramp_up.height(jnp.array([0.1, 0.15, 0.2]))[:, 0].round(6)
    Array([0.  , 0.05, 0.1 ], dtype=float64)
    >>> round(ramp_up.grid, 6), round(ramp_up.duration, 6)
    (0.1, 0.3)
    """
    _checks.untraced("position", position, "The samples may be traced, not their places.")
    spacing = _uniform_spacing(np.asarray(position, float))
    heights = jnp.asarray(height, float)
    if heights.ndim not in (1, 2) or heights.shape[0] != np.size(position):
        _checks.refuse(
            "height",
            f"hold one value per position ({np.size(position)})",
            f"of shape {heights.shape}",
            "Give an array of shape [samples] or [samples, wheels].",
        )
    concrete = _checks.concrete(heights)
    _refuse_gaps("height", concrete)
    _warn_of_rounding(concrete)
    if speed is not None:
        check_speed(speed, "Roads are driven forwards: reverse the arrays instead.")
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    return SampledRoad(
        samples=heights[:, None] if heights.ndim == 1 else heights,
        driven_at=None if speed is None else jnp.asarray(speed, float),
        spacing=spacing,
        periodic=periodic,
        ramp=float(ramp),
    )


def _warn_of_rounding(heights: np.ndarray | None) -> None:
    if heights is None:
        return
    most = float(np.max(np.abs(heights)))
    rounding = most * float(np.finfo(heights.dtype).eps)
    if rounding > _ROUNDING:
        remedy = "Subtract the height of its beginning, or call `jaxdamp.configure()` first."
        text = f"`height` reaches {most:.4g} m, which single precision rounds to {1e6 * rounding:.2g} µm"
        warn(f"{text}: rides on this road are off by more than 0.1 %, at 250 m by some 15 %. {remedy}")


def _uniform_spacing(position: np.ndarray) -> float:
    if position.ndim != 1 or position.size < 2:
        _checks.refuse("position", "hold at least two samples in a row", f"of shape {position.shape}")
    _refuse_gaps("position", position)
    steps = np.diff(position)
    if np.any(steps <= 0.0):
        first = int(np.argmax(steps <= 0.0))
        _checks.refuse(
            "position",
            "increase from sample to sample",
            f"{position[first]:.6g} followed by {position[first + 1]:.6g} at sample {first + 1}",
            "Sort the record, remove repeated samples, or cut it where it turns back.",
        )
    spacing = float((position[-1] - position[0]) / steps.size)
    if np.max(np.abs(position - np.linspace(position[0], position[-1], position.size))) > _UNEVENNESS * spacing:
        _checks.refuse(
            "position",
            "increase in equal steps",
            f"stepped by {steps.min():.6g} to {steps.max():.6g}",
            "Resample the profile first, for example with numpy.interp on numpy.linspace.",
        )
    return spacing


def _refuse_gaps(argument: str, values: np.ndarray | None) -> None:
    if values is not None and not np.all(np.isfinite(values)):
        bad = ~np.isfinite(values).reshape(values.shape[0], -1).all(axis=1)
        _checks.refuse(
            argument,
            "be finite",
            f"NaN or infinite at {int(bad.sum())} samples, first at sample {int(np.argmax(bad))}",
            "Cut or fill the gaps first, for example with numpy.interp over the good samples.",
        )

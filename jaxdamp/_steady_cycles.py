"""Results on steady cycles at many frequencies: which were found, which are stable."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Complex, Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult
from jaxdamp._status import Status


CLOSE = {"float64": 1e-6, "float32": 1e-3}  # change over a period, relative to the largest values: not steady above
STABLE = 1e-4  # by which a multiplier of a stable motion may seem to be larger than one


def is_steady(change: Float[Array, "..."]) -> Bool[Array, "..."]:
    """Whether so small a change over a period, relative to the largest values in it, is none."""
    return change <= CLOSE[str(change.dtype)]


def span(values: np.ndarray) -> str:
    """The lowest and the highest value, or the only one."""
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:.4g}" if high - low <= 1e-9 * high else f"{low:.4g} to {high:.4g}"


def checked_points(
    frequency: ArrayLike | Sequence[float], amplitude: ArrayLike | Sequence[float] | Sequence[Sequence[float]]
) -> tuple[Float[Array, " frequencies"], Float[Array, "... frequencies"]]:
    """Frequencies [Hz], and an amplitude for each of them, in one sweep or in rows of them.

    Raises:
        ValueError: numbers that are not positive, or shapes that do not fit together.
    """
    _checks.positive("frequency", frequency)
    _checks.positive("amplitude", amplitude)
    points, sizes = jnp.asarray(frequency, dtype=float), jnp.asarray(amplitude, dtype=float)
    if points.ndim != 1 or not points.size:
        _checks.refuse("frequency", "have one axis", f"of shape {points.shape}", "Pass `np.linspace(0.5, 20.0, 100)`.")
    if sizes.ndim and sizes.shape[-1] not in (1, points.size):
        must = f"be one number, one for each of {points.size} frequencies, or rows of them"
        _checks.refuse("amplitude", must, f"of shape {sizes.shape}", "For several amplitudes pass `sizes[:, None]`.")
    return points, jnp.broadcast_to(sizes, (*sizes.shape[:-1], points.size))


class AbstractSteadyCycles(eqx.Module, AbstractResult):
    """Steady cycles at many frequencies.

    Attributes:
        frequency: [Hz], shape (frequencies,).
        monodromy: derivatives of what goes on from period to period, by its values a period earlier.
        change: the largest change over a period, relative to the largest values in it.
    """

    frequency: eqx.AbstractVar[Float[Array, " frequencies"]]
    monodromy: eqx.AbstractVar[Float[Array, "... frequencies state state"]]
    change: eqx.AbstractVar[Float[Array, "... frequencies"]]

    def __repr__(self) -> str:
        return AbstractResult.__repr__(self)

    @property
    def multipliers(self) -> Complex[np.ndarray, "... frequencies state"]:
        """Eigenvalues of the monodromy matrix, the largest first: what a period makes of small disturbances."""
        remedy = "In compiled or differentiated code take those of `monodromy`."
        _checks.untraced("multipliers", self.monodromy, remedy)
        matrices = np.asarray(self.monodromy)
        usable = np.asarray(np.isfinite(matrices).all(axis=(-2, -1), keepdims=True))
        values = np.linalg.eigvals(np.where(usable, matrices, 0.0))
        values = np.take_along_axis(values, np.argsort(-np.abs(values), axis=-1), axis=-1)
        return np.where(usable[..., 0], values, np.nan)

    @property
    def steady(self) -> np.ndarray:
        """Where a steady motion was found, shape (..., frequencies)."""
        _checks.untraced("steady", self.change, "In compiled or differentiated code look at `change`.")
        return np.asarray(self.change) <= CLOSE[str(self.change.dtype)]

    @property
    def stable(self) -> np.ndarray:
        """Where all multipliers are less than one: small disturbances die out, shape (..., frequencies)."""
        return self.steady & ~(np.max(np.abs(self.multipliers), axis=-1, initial=0.0) > 1.0 + STABLE)

    @property
    def status(self) -> tuple[Status, ...]:
        """For every frequency, amplitude by amplitude: converged, not steady, or unstable."""
        each = zip(self.steady.ravel(), self.stable.ravel(), strict=True)
        return tuple(
            Status.NOT_STEADY if not steady else Status.CONVERGED if stable else Status.UNSTABLE
            for steady, stable in each
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Frequencies without a steady motion, and those at which it is unstable."""
        lost, unstable = ~self.steady, self.steady & ~self.stable
        notes = ((lost, Status.NOT_STEADY), (unstable, Status.UNSTABLE))
        frequency = np.broadcast_to(np.asarray(self.frequency), lost.shape)
        return tuple(
            f"At {int(at.sum())} of {at.size} points, {span(frequency[at])} Hz: {status.sentence}"
            for at, status in notes
            if at.any()
        )

"""Five polynomials joined without a jump (paper 000, eqs. 6 and 7)."""

from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most, within
from jaxdamp._types import Number, Scalar, ScalarLike, Vector
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import around_zero, as_float, increasing_negative, parameter, positive, setting


def _poly(shares: Float[Array, " degree"], u: ScalarLike) -> Scalar:
    """Σⱼ sharesⱼ uʲ, j = 1 … n: zero at u = 0."""
    return jnp.polyval(jnp.concatenate([jnp.zeros(1, shares.dtype), shares])[::-1], u)


@final
class SegmentedPolynomial(AbstractMemoryless):
    """Paper 000, eqs. 6-7: quartic, quadratic, quartic in compression, quadratic, quartic in rebound.

    The paper's 21 coefficients belong to the segments v ≤ v₁ (5), v₁ < v ≤ v₂ (3), v₂ < v ≤ 0 (5), 0 < v ≤ v₄ (3) and
    v > v₄ (5). Fitted freely they jump at v₁, v₂, 0 and v₄. Here the four conditions of continuity and F(0) = 0 hold
    by construction: each segment starts at the end value of its inner neighbour, which leaves 16 coefficients
    (`coefficients()` gives the 21 of the paper). Each coefficient is the contribution of its power to the force [N] one
    segment length away from the start of the segment, so all have similar magnitude. The paper says "4th and 3rd order"
    but prints 4th and 2nd; the printed formulas are used.

    Valid in `velocity_range`; outside it the law follows its tangent, because quartics grow fast there.

    Arguments:
        compression_knots: v₁ < v₂ < 0 [m/s].
        rebound_knot: v₄ > 0 [m/s].
        shares_low_compression: powers 1-4 of v/|v₂| on v₂ < v ≤ 0 [N].
        shares_mid_compression: powers 1-2 of (v − v₂)/(v₂ − v₁) on v₁ < v ≤ v₂ [N].
        shares_high_compression: powers 1-4 of (v − v₁)/|v₁| on v ≤ v₁ [N].
        shares_low_rebound: powers 1-2 of v/v₄ on 0 < v ≤ v₄ [N].
        shares_high_rebound: powers 1-4 of (v − v₄)/v₄ on v > v₄ [N].
        velocity_range: lowest and highest velocity [m/s] where the law is valid.
    """

    compression_knots: Vector = parameter("m/s", "velocities v₁ < v₂ < 0", increasing_negative, adjustable=False)
    rebound_knot: Number = parameter("m/s", "velocity v₄ > 0", positive, adjustable=False)
    shares_low_compression: Vector = parameter("N", "shares by power on v₂ < v ≤ 0", linear=True)
    shares_mid_compression: Vector = parameter("N", "shares by power on v₁ < v ≤ v₂", linear=True)
    shares_high_compression: Vector = parameter("N", "shares by power on v ≤ v₁", linear=True)
    shares_low_rebound: Vector = parameter("N", "shares by power on 0 < v ≤ v₄", linear=True)
    shares_high_rebound: Vector = parameter("N", "shares by power on v > v₄", linear=True)
    velocity_range: Vector = setting("m/s", "range where the law is valid", around_zero, default=(-2.0, 2.0))

    def __check_init__(self) -> None:
        sizes = {"compression_knots": 2, "shares_low_compression": 4, "shares_mid_compression": 2}
        sizes |= {"shares_high_compression": 4, "shares_low_rebound": 2, "shares_high_rebound": 4}
        for name, size in sizes.items():
            shape = getattr(self, name).shape
            if shape != (size,):
                _checks.refuse(name, f"hold {size} numbers", f"of shape {shape}")
        arrays = (self.compression_knots, self.rebound_knot, self.velocity_range)
        v1, v4, reach = (_checks.concrete(a) for a in arrays)
        if v1 is not None and v4 is not None and reach is not None and not (reach[0] <= v1[0] and v4 <= reach[1]):
            _checks.refuse("velocity_range", f"hold the knots {v1} and {v4} m/s", reach, "Widen it to the data.")

    def _segments(self, v: ScalarLike) -> Scalar:
        v1, v2, v4 = self.compression_knots[0], self.compression_knots[1], self.rebound_knot
        high_c = _poly(self.shares_high_compression, at_most(v - v1, 0.0) / -v1)
        mid_c = _poly(self.shares_mid_compression, (within(v, v1, v2) - v2) / (v2 - v1))
        low_c = _poly(self.shares_low_compression, within(v, v2, 0.0) / -v2)
        low_r = _poly(self.shares_low_rebound, within(v, 0.0, v4) / v4)
        high_r = _poly(self.shares_high_rebound, at_least(v - v4, 0.0) / v4)
        return high_c + mid_c + low_c + low_r + high_r

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        low, high = self.velocity_range[0], self.velocity_range[1]
        inside = within(v, low, high)
        _, tangent_low = jax.jvp(self._segments, (low,), (jnp.ones_like(low),))
        _, tangent_high = jax.jvp(self._segments, (high,), (jnp.ones_like(high),))
        beyond = tangent_low * at_most(v - low, 0.0) + tangent_high * at_least(v - high, 0.0)
        return self._segments(inside) + beyond

    def coefficients(self) -> dict[str, np.ndarray]:
        """The paper's 21 coefficients a_kj, ascending powers of v [m/s], by segment name."""
        v1, v2 = (float(v) for v in self.compression_knots)
        v4 = float(self.rebound_knot)
        pieces = {
            "1: v <= v1": (self.shares_high_compression, v1, -v1),
            "2: v1 < v <= v2": (self.shares_mid_compression, v2, v2 - v1),
            "3: v2 < v <= 0": (self.shares_low_compression, 0.0, -v2),
            "4: 0 < v <= v4": (self.shares_low_rebound, 0.0, v4),
            "5: v > v4": (self.shares_high_rebound, v4, v4),
        }
        starts = {"1: v <= v1": v1, "2: v1 < v <= v2": v2, "5: v > v4": v4}
        result = {}
        for name, (shares, start, length) in pieces.items():
            line = np.polynomial.Polynomial([-start / length, 1 / length])
            constant = float(self._segments(jnp.asarray(starts[name]))) if name in starts else 0.0
            whole = np.polynomial.Polynomial([constant, *np.asarray(shares)])(line)
            result[name] = np.pad(whole.coef, (0, shares.size + 1 - whole.coef.size))
        return result

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "SegmentedPolynomial":
        """Knots at a third and a tenth of the peak velocities, coefficients by least squares on the data."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        least = 1e-3 * float(np.abs(velocity).max())  # segments are needed even on a side without data
        low, high = min(float(velocity.min()), -least), max(float(velocity.max()), least)
        v1, v2, v4 = 0.4 * low, 0.1 * low, 0.15 * high

        def powers(u: np.ndarray, degree: int) -> np.ndarray:
            return np.stack([u**j for j in range(1, degree + 1)], axis=1)

        blocks = [
            powers(np.clip(velocity, v2, 0.0) / -v2, 4),
            powers((np.clip(velocity, v1, v2) - v2) / (v2 - v1), 2),
            powers(np.minimum(velocity - v1, 0.0) / -v1, 4),
            powers(np.clip(velocity, 0.0, v4) / v4, 2),
            powers(np.maximum(velocity - v4, 0.0) / v4, 4),
        ]
        solved = np.linalg.lstsq(np.concatenate(blocks, axis=1), force, rcond=None)[0]
        shares = np.split(solved, np.cumsum([b.shape[1] for b in blocks])[:-1])
        return cls(np.array([v1, v2]), as_float(v4), *shares, velocity_range=(low, high))

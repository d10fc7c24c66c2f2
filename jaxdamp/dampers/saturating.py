"""A steep slope that levels off: tanh, arctan or algebraic."""

from collections.abc import Callable
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._elementary import algebraic_sigmoid
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._guesses import knee_scan
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import nonnegative, parameter, positive


Numbers = Float[Array, "..."]


SHAPES: dict[str, Callable[[Numbers], Numbers]] = {
    "tanh": jnp.tanh,
    "arctan": lambda u: (2.0 / np.pi) * jnp.arctan((0.5 * np.pi) * u),
    "algebraic": algebraic_sigmoid,
}


@final
class Saturating(AbstractMemoryless):
    """F = F_s g(c₀ v/F_s) + c_∞ v, with F_s, c₀ and c_∞ of its own for each direction.

    g(u) is odd, has slope 1 at u = 0 and reaches ±1 far away:

    - `"tanh"`: tanh u, the quickest (99 % at u = 2.65);
    - `"algebraic"`: u/√(1 + u²) (99 % at u = 7.0);
    - `"arctan"`: (2/π) arctan(π u/2), the slowest (99 % at u = 41).

    The slope is c₀ + c_∞ at v = 0 and falls to c_∞. F(0) = 0, F grows with v everywhere, so the law is passive. It is
    smooth on each side; at v = 0 the slope is continuous (C¹) only if c₀ + c_∞ is equal on both sides, and it is
    infinitely smooth there if F_s and c_∞ are equal too.

    Valid for dampers whose blow-off is gradual; `DigressiveProgressive` has a knee. Data that do not reach F_s/c₀ leave
    F_s undetermined.

    Attributes:
        shape: the function g, "tanh", "algebraic" or "arctan".

    >>> law = Saturating(900.0, 9000.0, 400.0, 6000.0, rebound_high_rate=700.0, compression_high_rate=300.0)
    >>> [round(float(law.force_velocity(v)), 2) for v in (1e-4, 1.0, -1.0)]
    [0.97, 1600.0, -700.0]
    """

    rebound_force: Number = parameter("N", "F_s in rebound, level that the curved part reaches", positive)
    rebound_rate: Number = parameter("N s/m", "c₀ in rebound, slope of the curved part at v = 0", positive)
    compression_force: Number = parameter("N", "F_s in compression, level that the curved part reaches", positive)
    compression_rate: Number = parameter("N s/m", "c₀ in compression, slope of the curved part at v = 0", positive)
    rebound_high_rate: Number = parameter(
        "N s/m", "c_∞ in rebound, slope at high velocity", nonnegative, linear=True, default=0.0
    )
    compression_high_rate: Number = parameter(
        "N s/m", "c_∞ in compression, slope at high velocity", nonnegative, linear=True, default=0.0
    )
    shape: str = eqx.field(static=True, default="tanh")

    def __check_init__(self) -> None:
        _checks.one_of("shape", self.shape, SHAPES)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        extends = jnp.asarray(v) >= 0
        level = jnp.where(extends, self.rebound_force, self.compression_force)
        rate = jnp.where(extends, self.rebound_rate, self.compression_rate)
        high_rate = jnp.where(extends, self.rebound_high_rate, self.compression_high_rate)
        return level * SHAPES[self.shape](jnp.asarray(rate * v / level)) + high_rate * v

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray, shape: str = "tanh") -> "Saturating":
        """Start values from measured data: F_s and c_∞ by least squares for several F_s/c₀, the best of them."""
        _checks.one_of("shape", shape, SHAPES)
        curve = SHAPES[shape]
        sides = []
        for side in (1, -1):
            knee, (level, high_rate) = knee_scan(
                velocity,
                force,
                side,
                lambda v, knee: [np.asarray(curve(jnp.asarray(v / knee))), v],
                np.geomspace(0.02, 1.5, 30),
            )
            level = max(float(level), 1e-2 * float(np.abs(force).max()), 1e-3)
            sides.append((level, level / knee, float(high_rate)))
        (fr, cr, hr), (fc, cc, hc) = sides
        return cls(fr, cr, fc, cc, hr, hc, shape)

"""Oil flow through a damper piston: bleed, leak and a spring-loaded valve for each direction."""

from typing import NamedTuple, final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from jaxdamp._elementary import reciprocal_root
from jaxdamp._limits import at_least, at_most
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import nonnegative, parameter, positive, setting


def orifice_root(drop: ScalarLike, transition: ScalarLike) -> Scalar:
    """S = Δp/(Δp² + ε²)^¼ [√Pa] of a pressure drop: the signed square root, with the slope 1/√ε at zero."""
    return drop * reciprocal_root(jnp.sqrt(drop * drop + transition * transition))


@jax.custom_jvp
def orifice_drop(root: Scalar, transition: Scalar) -> Scalar:
    """Δp [Pa] of S [√Pa], the inverse of `orifice_root`."""
    return root * jnp.sqrt(0.5 * (root * root + _quartic(root, transition)))


def _quartic(root: Scalar, transition: Scalar) -> Scalar:
    """√(S⁴ + 4 ε²) [Pa]."""
    square = root * root
    return jnp.sqrt(square * square + 4.0 * transition * transition)


@orifice_drop.defjvp
def _orifice_drop_slope(primals: tuple[Scalar, Scalar], tangents: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    """∂Δp/∂S = r (1 + S²/q) and ∂Δp/∂ε = S ε/(q r), r = Δp/S, q as above: fewer quotients than the rules of roots."""
    (root, transition), (change, shift) = primals, tangents
    square, q = root * root, _quartic(root, transition)
    mean, inverse = jnp.sqrt(0.5 * (square + q)), 1.0 / q
    slope = mean * (1.0 + square * inverse)
    return root * mean, slope * change + root * transition * inverse / mean * shift


DENSITY, DISCHARGE = 850.0, 0.7  # kg/m³ of the oil, and C_d, where nothing else is stated


def flow_per_area(density: ScalarLike = DENSITY, discharge: ScalarLike = DISCHARGE) -> Scalar:
    """C_d √(2/ρ) [m/s/√Pa], volume flow of an orifice per area and root of the pressure drop."""
    return discharge * jnp.sqrt(2.0 / density)


class Passages(NamedTuple):
    """What the oil flows through in one direction, in terms that a search evaluates with few quotients.

    Attributes:
        opening: p_o of the valve [Pa].
        per_pressure: 1/(k A_max) [1/Pa].
        valve: C_d √(2/ρ) A_max/A [m/s/√Pa], of the valve fully open.
        bleed: C_d √(2/ρ) A_b/A [m/s/√Pa].
        leak: k_l/A [m/s/Pa].
    """

    opening: Scalar
    per_pressure: Scalar
    valve: Scalar
    bleed: Scalar
    leak: Scalar


@final
class PistonFlow(AbstractMemoryless):
    """F = A Δp with the pressure drop Δp of the flow Q(Δp) = A v through the piston; no gas, no compressibility.

    Q = C_d √(2/ρ) (A_b + A_v) S + k_l Δp with S = Δp/(Δp² + ε²)^¼, a square root with a finite slope at zero: below ε
    the orifice flow is laminar. The valve area is A_v = A_max tanh((|Δp| − p_o)/(k A_max)), and zero below the opening
    pressure p_o; one valve opens for Δp > 0 (rebound), another for Δp < 0 (compression). The force is continuous, with
    kinks where a valve opens, and increases with v, so the law is passive. After Talbott and Starkey (SAE
    2002-01-3337), from a secondary source.

    A test determines only the product of C_d √(2/ρ) and an area, so C_d and ρ are settings and the areas are fitted. A
    valve is determined only by records with forces above A p_o, its largest area only if it is nearly fully open.

    The unknown of the equation is S, in which the flow through the bleed is linear; derivatives come from the implicit
    function theorem.

    >>> import jax
    >>> law = PistonFlow(1.42e-3, 1.6e-6, 1.2e6, 1.2e11, 2.5e-5, 5e5, 4e10, 4e-5)
    >>> force = jax.jit(jax.vmap(law.force_velocity))(jnp.array([0.02, 0.3, -0.3]))
    >>> [round(float(f), 1) for f in force]
    [388.0, 2949.1, -1363.7]
    """

    area: Number = setting("m²", "A, of the piston without the rod", positive)
    bleed_area: Number = parameter("m²", "A_b, orifice that is always open", positive)
    rebound_opening_pressure: Number = parameter("Pa", "p_o of the rebound valve", positive)
    rebound_valve_stiffness: Number = parameter("Pa/m²", "k, pressure per area of the rebound valve", positive)
    rebound_valve_area: Number = parameter("m²", "A_max, largest area of the rebound valve", positive)
    compression_opening_pressure: Number = parameter("Pa", "p_o of the compression valve", positive)
    compression_valve_stiffness: Number = parameter("Pa/m²", "k, pressure per area of the compression valve", positive)
    compression_valve_area: Number = parameter("m²", "A_max, largest area of the compression valve", positive)
    leak: Number = parameter("m³/s/Pa", "k_l, laminar leak past the piston", nonnegative, default=0.0, adjustable=False)
    density: Number = setting("kg/m³", "ρ, of the oil", positive, default=DENSITY)
    discharge: Number = setting("", "C_d, discharge coefficient", positive, default=DISCHARGE)
    transition_pressure: Number = setting("Pa", "ε, drop below which orifice flow is laminar", positive, default=1e3)

    def passages(self, rebound: Bool[Array, ""]) -> Passages:
        """Bleed, leak and the valve that opens in a direction."""
        opening = jnp.where(rebound, self.rebound_opening_pressure, self.compression_opening_pressure)
        stiffness = jnp.where(rebound, self.rebound_valve_stiffness, self.compression_valve_stiffness)
        largest = jnp.where(rebound, self.rebound_valve_area, self.compression_valve_area)
        per_area = flow_per_area(self.density, self.discharge) / self.area
        return Passages(
            opening, 1.0 / (stiffness * largest), per_area * largest, per_area * self.bleed_area, self.leak / self.area
        )

    def root(self, drop: ScalarLike) -> Scalar:
        """S [√Pa] of a pressure drop [Pa]."""
        return orifice_root(drop, self.transition_pressure)

    def drop(self, root: ScalarLike) -> Scalar:
        """Pressure drop [Pa] of S [√Pa]."""
        return orifice_drop(jnp.asarray(root), jnp.asarray(self.transition_pressure))

    def flow_velocity(self, root: ScalarLike, passages: Passages) -> Scalar:
        """Q/A [m/s] at S [√Pa]: the velocity of a piston that displaces this flow, through those of its direction."""
        drop = self.drop(root)
        share = jnp.tanh(at_least(jnp.abs(drop) - passages.opening, 0.0) * passages.per_pressure)
        return (passages.bleed + passages.valve * share) * root + passages.leak * drop

    def flow_either(self, root: ScalarLike) -> Scalar:
        """Q/A [m/s] at S [√Pa], through the valve that opens in its direction."""
        return self.flow_velocity(root, self.passages(jnp.asarray(root) >= 0))

    def _root_at(self, v: ScalarLike) -> Scalar:
        """S [√Pa] at which Q/A is v."""
        v = jnp.asarray(v)
        speed, passages = jnp.abs(v), self.passages(v >= 0)
        most = speed / passages.bleed  # through the bleed alone
        # A first estimate, correct in the leading digit: all flow through the valve, partly or fully open, or the leak.
        cube = speed / (passages.valve * passages.per_pressure)
        guess = jnp.sqrt(passages.opening + at_most(cube / jnp.sqrt(passages.opening), jnp.cbrt(cube) ** 2))
        guess = at_least(guess, speed / (passages.bleed + passages.valve))
        leak_alone = jnp.sqrt(speed / at_least(passages.leak, jnp.finfo(passages.leak.dtype).tiny))
        guess = at_most(guess, at_most(leak_alone, most))
        zero = jnp.zeros_like(most)
        lower, upper = jnp.where(v >= 0, zero, -most), jnp.where(v >= 0, most, zero)
        guess = jnp.where(v >= 0, guess, -guess)
        return increasing_root(lambda root: self.flow_velocity(root, passages) - v, guess, lower, upper)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        return self.area * self.drop(self._root_at(v))

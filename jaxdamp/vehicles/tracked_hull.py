"""The hull of a tracked vehicle on its road wheels, with the rules of paper 003 for its shock absorbers."""

from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike, Vector
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Element, Place, Wheel
from jaxdamp.vehicles.suspension import Seat, Suspension, seat_parts


class PitchDecay(NamedTuple):
    """Amplitude ratios of a free pitch decay, each amplitude divided by the next: over a half cycle and a whole one.

    Attributes:
        nose_down: over the half cycle with the nose down [-].
        nose_up: over the half cycle with the nose up [-].
        whole: over a whole cycle [-].
    """

    nose_down: Scalar
    nose_up: Scalar
    whole: Scalar


@final
class TrackedHull(AbstractVehicle):
    """Hull with heave z and pitch θ (nose up) on road wheels that follow the ground; some have shock absorbers.

        m z̈ = −2 Σ F_i,   J θ̈ = −2 Σ l_i F_i,   F_i = C e_i + damper(e_i, ė_i),  e_i = z + l_i θ − z_ri,

    for wheels i on each side, l_i ahead of the centre of gravity; both sides together. The channels
    `wheel_i_damper_force` and the powers are those of one shock absorber, the wheel loads those of both sides. The mass
    of the road wheels is neglected, as in paper 003. Each wheel of the list stands for both sides.

    For free pitch without heave, J θ̈ + 2 μ Σ_d l² θ̇ + 2 C Σ l² θ = 0, with one sum over the damped wheels and one
    over all: θ decays by exp(2πn/√(ω² − n²)) a cycle, n = μ Σ_d l²/J, ω² = 2 C Σ l²/J (paper 003, equations 8 to 13).

    Arguments:
        wheel_positions: l_i, from the first wheel to the last [m], decreasing.
        wheel_rate: C of one wheel [N/m].
        damper: law of one shock absorber, referred to the wheel.
        damped: numbers of the wheels with a shock absorber, counted from 1 at the front.
        places: where on the hull accelerations are of interest.
        seats: on the hull.
        tyre_lifts: whether the road wheels can lift off: spring and shock absorber of a wheel, which has no mass, then
            never pull together (`LiftOff`).
        extra_spring: law of one road wheel parallel to its linear spring, on every wheel.
        bump_stop: law of one road wheel, on every wheel.
        friction: law of one road wheel, on every wheel.

    Raises:
        ValueError: positions that do not decrease, a damped wheel that does not exist.

    >>> from jaxdamp.vehicles.presets import m113_003
    >>> hull = m113_003()
    >>> round(float(hull.pitch_frequency()), 3), round(float(hull.required_damping(12.0)) / 1e3, 2)
    (6.86, 15.13)
    """

    sprung_mass: Number = parameter("kg", "mass of the hull", positive, adjustable=False)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the hull in pitch", positive, adjustable=False)
    wheel_positions: Vector = parameter(
        "m", "road wheels ahead of the centre of gravity, first to last", adjustable=False
    )
    wheel_rate: Number = parameter("N/m", "spring rate of one road wheel", positive)
    damper: AbstractDamper
    damped: tuple[int, ...] = eqx.field(static=True)
    places: tuple[Place, ...] = ()
    seats: tuple[Seat, ...] = ()
    tyre_lifts: bool = eqx.field(static=True, default=False)
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None

    def __check_init__(self) -> None:
        positions = _checks.concrete(self.wheel_positions)
        if positions is not None and (positions.ndim != 1 or positions.size < 2 or np.any(np.diff(positions) >= 0)):
            must = "hold two or more decreasing positions, from the first wheel to the last [m]"
            _checks.refuse("TrackedHull.wheel_positions", must, positions)
        count = self.wheel_positions.shape[0]
        if any(not 1 <= number <= count for number in self.damped) or len(set(self.damped)) < len(self.damped):
            must = f"hold numbers of wheels, 1 to {count}, each once"
            _checks.refuse("TrackedHull.damped", must, self.damped, "Wheels are counted from 1 at the front.")

    def frame(self) -> Frame:
        """Coordinates z_sprung, pitch, then seats; wheels wheel_1, wheel_2 and so on."""
        body = Body("sprung", self.sprung_mass, pitch_inertia=self.pitch_inertia)
        beside = self.extra_spring, self.bump_stop, self.friction
        laws = [
            Suspension(self.wheel_rate, self.damper if i + 1 in self.damped else None, *beside).elements
            for i in range(self.wheel_positions.shape[0])
        ]
        wheels = tuple(
            Wheel(
                f"wheel_{i + 1}",
                body.at(place),
                2.0 * self.wheel_rate,
                behind=self.wheel_positions[0] - place,
                elements=tuple(Element(element.name, element.law, count=2) for element in laws[i]),  # on both sides
                sides=2,
            )
            for i, place in enumerate(self.wheel_positions)
        )
        bodies, links = seat_parts(self.seats, body)
        return Frame((body, *bodies), links, wheels, self.places).lifting(self.tyre_lifts)

    def _squares(self) -> tuple[Scalar, Scalar, Scalar]:
        """Σ l² [m²] of all wheels of a side, of the damped ones ahead and of those behind the centre of gravity."""
        squares, ahead = self.wheel_positions**2, self.wheel_positions > 0
        has = jnp.array([i + 1 in self.damped for i in range(squares.size)])
        of_damped = jnp.where(has, squares, 0.0)
        front = jnp.sum(jnp.where(ahead, of_damped, 0.0))
        return jnp.sum(squares), front, jnp.sum(of_damped) - front

    def pitch_frequency(self) -> Scalar:
        """ω = √(2 C Σ l²/J) of undamped pitch without heave [rad/s]."""
        return jnp.sqrt(2.0 * self.wheel_rate * self._squares()[0] / self.pitch_inertia)

    def required_damping(self, decrement: ScalarLike | int) -> Scalar:
        """Mean coefficient μ of a shock absorber [N s/m] for pitch to decay by `decrement` a cycle (equation 14).

        μ = √2 ln d/Σ_d l² · √(J C Σ l²/(4π² + ln² d)); the paper's 1.41 is √2, and its sums run over the damped wheels
        in front of the root and over all under it.
        """
        if (concrete := _checks.concrete(decrement)) is not None and not np.all(concrete > 1.0):
            _checks.refuse("decrement", "be above 1", decrement, "It is an amplitude divided by that a cycle later.")
        every, front, rear = self._squares()
        logarithm = jnp.log(jnp.asarray(decrement, dtype=every.dtype))
        root = jnp.sqrt(self.pitch_inertia * self.wheel_rate * every / (4.0 * jnp.pi**2 + logarithm**2))
        return jnp.sqrt(2.0) * logarithm / (front + rear) * root

    def split_damping(self, mean: ScalarLike | int, ratio: ScalarLike | int) -> tuple[Scalar, Scalar]:
        """Coefficients in compression and in rebound [N s/m] of a given ratio r that damp nose-down motion as the mean.

        μ₂ = μ Σ_d l²/(r Σ_front l² + Σ_rear l²), μ₁ = r μ₂ (equations 15 and 16): nose down, the dampers in front are
        compressed and those behind extended. Nose up it is the other way round, so that the decay over a whole cycle is
        not that of the mean (`pitch_decay`).
        """
        _checks.positive("mean", mean)
        _checks.positive("ratio", ratio)
        _, front, rear = self._squares()
        rebound = mean * (front + rear) / (ratio * front + rear)
        return ratio * rebound, rebound

    def pitch_decay(self, compression: ScalarLike | int, rebound: ScalarLike | int) -> PitchDecay:
        """Decay of free pitch without heave with these coefficients [N s/m], by half cycles and over a whole one.

        Each half cycle, from one turning point to the next, decays by exp(πn/√(ω² − n²)) with n of its direction; the
        whole cycle by their product. Valid below critical damping, n < ω; other and negative coefficients are refused.

        A hull that is free to heave decays a little differently, as its dampers, on wheels 1, 2 and 5, also lift it.
        From 0.02 rad, `simulate(hull, flat_road, start={"pitch": 0.02})` gives for `m113_003` 14.05, 15.09 and 17.14
        a cycle with coefficients of 16:16, 12.5:20.5 and 11.5:23 kN s/m, where this formula has 14.18, 15.66 and
        18.23: 0.9, 3.8 and 6.4 % more. Use the simulation if this difference matters.

        >>> from jaxdamp.vehicles.presets import m113_003
        >>> decay = m113_003().pitch_decay(11.5e3, 23e3)  # the paper wants 12 to 15
        >>> [round(float(ratio), 2) for ratio in decay]
        [4.0, 4.56, 18.23]
        """
        _checks.nonnegative("compression", compression)
        _checks.nonnegative("rebound", rebound)
        _, front, rear = self._squares()
        frequency = self.pitch_frequency()

        def half(ahead: ScalarLike, behind: ScalarLike) -> Scalar:
            n = (ahead * front + behind * rear) / self.pitch_inertia
            concrete = _checks.concrete(n / frequency)
            if concrete is not None and not np.all(concrete < 1.0):
                remedy = "Pitch does not oscillate: simulate it, or take smaller ones."
                _checks.refuse(
                    "compression, rebound", "be below critical damping", f"{np.max(concrete):.3g} times it", remedy
                )
            return jnp.exp(jnp.pi * n / jnp.sqrt(frequency**2 - n**2))

        down, up = half(compression, rebound), half(rebound, compression)
        return PitchDecay(down, up, down * up)

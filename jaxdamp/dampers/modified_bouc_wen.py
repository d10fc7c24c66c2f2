"""The magnetorheological damper of Spencer and others: Bouc and Wen's law in series with a dashpot."""

import math
from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._limits import at_least
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._guesses import sliding_fit
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import GAMMA, sdirk2
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.bouc_wen import hysteresis_rate, hysteresis_step
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import interval, nonnegative, parameter, positive, real, setting


@final
class ModifiedBoucWen(AbstractDamper):
    """F = c₁ ẏ + k₁ x + f₀, c₁ ẏ = c₀ ṙ + k₀ r + F_y z, r = x − y (Spencer et al. 1997; formula quoted from memory).

    A `BoucWen` law over the inner stroke r, in series with the dashpot c₁, which reduces the force at low velocities;
    parallel to both the accumulator, a spring k₁. Hysteresis as in `BoucWen`: z from −1 to 1, with yield
    displacement x_y, shape γ̂ and exponent n. At a constant voltage U the law has c₀ + c₀ᵤ U, c₁ + c₁ᵤ U, F_y + F_yᵤ U;
    the first-order filter between the commanded voltage and U is not included. If the accumulator is relaxed at x₀,
    f₀ = −k₁ x₀; the default is zero, so that the damper has no force at rest. Passive at constant voltage.

    States: r [m] and z. At constant velocity F tends to c₁ v with the time constant (c₀ + c₁)/k₀. The step is the
    two-stage SDIRK method (second order, L-stable) with one monotone scalar equation for ṙ per stage. It is stable at
    any step, which is necessary since the published set saturates within 0.02 mm.

    >>> law = ModifiedBoucWen.prototype(voltage=1.5)
    >>> round(float(law.yield_force + 1.5 * law.yield_force_per_volt), 1)
    761.4
    """

    viscous_rate: Number = parameter("N s/m", "c₀, viscous damping parallel to the hysteresis", nonnegative)
    series_rate: Number = parameter("N s/m", "c₁, dashpot in series", positive, adjustable=False)
    stiffness: Number = parameter("N/m", "k₀, stiffness parallel to the hysteresis", nonnegative, adjustable=False)
    yield_force: Number = parameter("N", "F_y, hysteretic force when saturated", positive)
    yield_displacement: Number = parameter(
        "m", "x_y, inner travel from rest to F_y at the first slope", positive, adjustable=False
    )
    shape: Number = parameter(
        "", "γ̂ = γ/(β + γ), shape of the unloading", interval(0.5, 1.0), default=0.75, adjustable=False
    )
    exponent: Number = parameter("", "n, sharpness of the knee", interval(1.0, 20.0), default=2.0, adjustable=False)
    accumulator_stiffness: Number = parameter(
        "N/m", "k₁, stiffness of the accumulator", nonnegative, default=0.0, adjustable=False
    )
    static_force: Number = parameter("N", "f₀, force at rest at stroke zero", real, default=0.0)
    viscous_rate_per_volt: Number = parameter(
        "N s/m/V", "c₀ᵤ, change of c₀ with voltage", nonnegative, default=0.0, adjustable=False
    )
    series_rate_per_volt: Number = parameter(
        "N s/m/V", "c₁ᵤ, change of c₁ with voltage", nonnegative, default=0.0, adjustable=False
    )
    yield_force_per_volt: Number = parameter(
        "N/V", "F_yᵤ, change of F_y with voltage", nonnegative, default=0.0, adjustable=False
    )
    voltage: Number = setting("V", "U, voltage at the damper", nonnegative, command=True, default=0.0)

    def at_voltage(self) -> tuple[Scalar, Scalar, Scalar]:
        """c₀ and c₁ [N s/m] and F_y [N] at the voltage."""
        viscous = self.viscous_rate + self.viscous_rate_per_volt * self.voltage
        series = self.series_rate + self.series_rate_per_volt * self.voltage
        return viscous, series, self.yield_force + self.yield_force_per_volt * self.voltage

    def inner_velocity(self, v: ScalarLike, stroke: Scalar, z: Scalar) -> Scalar:
        """ṙ [m/s] for which dashpot and hysteresis have the same force."""
        viscous, series, level = self.at_voltage()
        return (series * v - self.stiffness * stroke - level * z) / (viscous + series)

    def traits(self) -> Traits:
        """The static force is an offset."""
        return super().traits()._replace(contains_offset=True)

    def initial_state(self) -> State:
        """No inner stroke, no hysteretic force."""
        return jnp.zeros(2)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        stroke, z = own_states(self, state, 2)
        _, series, _ = self.at_voltage()
        dashpot = series * (v - self.inner_velocity(v, stroke, z))
        return dashpot + self.accumulator_stiffness * x + self.static_force

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """ṙ [m/s] and ż [1/s]."""
        del x
        stroke, z = own_states(self, state, 2)
        w = self.inner_velocity(v, stroke, z)
        return jnp.stack([w, hysteresis_rate(w / self.yield_displacement, z, self.shape, self.exponent)])

    def _stage(self, v: ScalarLike, stroke: Scalar, z: Scalar, duration: ScalarLike) -> Scalar:
        """The constant inner velocity ṙ [m/s] for which the forces balance at the end of the stage."""
        viscous, series, level = self.at_voltage()

        def surplus(w: Scalar) -> Scalar:
            ahead, z_ahead = self._moved(w, stroke, z, duration)
            return viscous * w + self.stiffness * ahead + level * z_ahead - series * (v - w)

        held = self.stiffness * jnp.abs(stroke) + level * at_least(jnp.abs(z), 1.0)
        limit = (series * jnp.abs(v) + held) / (viscous + series)
        return increasing_root(surplus, jnp.zeros_like(limit), -limit, limit, steps=20)

    def _moved(self, w: ScalarLike, stroke: Scalar, z: Scalar, duration: ScalarLike) -> tuple[Scalar, Scalar]:
        """Inner stroke [m] and z after moving at an inner velocity [m/s]."""
        travel = duration * w
        return stroke + travel, hysteresis_step(travel / self.yield_displacement, z, self.shape, self.exponent)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        del x0, x1
        stroke, z = own_states(self, state, 2)

        def stage(share: float, states: tuple[Scalar, Scalar]) -> Scalar:
            return self._stage(v0 + share * (v1 - v0), *states, GAMMA * dt)

        def moved(w: Scalar, states: tuple[Scalar, Scalar], part: float) -> tuple[Scalar, Scalar]:
            return self._moved(w, *states, part * dt)

        return jnp.stack(sdirk2(stage, moved, (stroke, z)))

    @classmethod
    def prototype(cls, voltage: float = 0.0) -> "ModifiedBoucWen":
        """The prototype damper of Spencer et al. (1997), 0 to 2.25 V.

        The parameters are quoted from memory and not verified: α = 14 000 + 69 500 U N/m, A = 301, β = γ = 3.63e6 m⁻²,
        n = 2 and so on. The accumulator offset x₀ = 0.143 m is not included; it corresponds to `static_force=-71.5`.
        """
        slope, size = 301.0, 3.63e6 + 3.63e6
        largest = math.sqrt(slope / size)
        return cls(
            viscous_rate=2100.0,
            series_rate=28_300.0,
            stiffness=4690.0,
            yield_force=14_000.0 * largest,
            yield_displacement=largest / slope,
            shape=0.5,
            exponent=2.0,
            accumulator_stiffness=500.0,
            viscous_rate_per_volt=350.0,
            series_rate_per_volt=295.0,
            yield_force_per_volt=69_500.0 * largest,
            voltage=voltage,
        )

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "ModifiedBoucWen":
        """Start values from measured data: as for `BoucWen`, with a very stiff series dashpot."""
        rate, level, offset = sliding_fit(velocity, force)
        series = max(20.0 * rate, 5.0 * level / max(float(np.max(np.abs(velocity))), 1e-6))
        return cls(rate, series, rate, level, 1e-3, accumulator_stiffness=0.1 * rate, static_force=offset)

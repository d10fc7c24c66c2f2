"""Any law that heats itself: its force falls with the energy that it keeps."""

from typing import final

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter, positive, setting


def fade(rise: ScalarLike, sensitivity: ScalarLike) -> Scalar:
    """exp(−κ ϑ), the share of the damping force that is left."""
    return jnp.exp(-sensitivity * rise)


@final
class AtRise(AbstractWrapper):
    """F = F_law exp(−κ ϑ) + s ϑ with a known rise ϑ of the temperature: what `Heated` is where one is measured."""

    law: AbstractDamper
    rise: Number = setting("K", "ϑ, rise of the temperature")
    sensitivity: Number = parameter("1/K", "κ, relative loss of damping force per kelvin", adjustable=False)
    static_force_slope: Number = parameter("N/K", "s, change of the static force per kelvin", adjustable=False)

    def outer_force(self, force: Scalar) -> Scalar:
        """Force [N] at this temperature."""
        return fade(self.rise, self.sensitivity) * force + self.static_force_slope * self.rise


@final
class Heated(AbstractWrapper):
    """F = F_d + s ϑ, F_d = F_law exp(−κ ϑ), C ϑ' = F_d v − C ϑ/τ: the damping fades with the heat of the damper.

    ϑ is the rise [K] of the temperature of oil and body above that of the law's own parameters. It grows with the power
    that the law dissipates and decays with the cooling time τ. A hydraulic damper loses 0.1 to 0.4 % of its force for
    each kelvin (`TemperatureScaled` is the same for a constant temperature), and its gas pushes harder: s is negative.
    Passive if the law is and s is zero.

    Where a temperature T is measured, ϑ = T − T₀ instead, and is no state: fits take it from the temperature channel of
    the records, sample by sample, and `respond` takes it as an argument. Then τ, C and the initial ϑ have no effect:
    freeze `cooling_time` and `initial_rise`.

    Records without a temperature determine only κ/C and s/C; the heat capacity is therefore a setting, by default that
    of 2 kg of steel, and then ϑ is an estimate. Records that begin warm have their own start: stated by their setting
    `temperature` ("60 degC"), or fitted, `fit(..., per_record=["initial_rise"])`; then a new record is predicted from
    the start that its first cycles show. The heat flows into a room at T₀.

    State: ϑ [K], then the states of the law. The step takes the power as the mean of both ends, second order.

    Arguments:
        law: the damping at ϑ = 0, without gas force or springs, which do not dissipate.
        sensitivity: κ [1/K].
        cooling_time: τ [s].
        static_force_slope: s [N/K].
        initial_rise: ϑ at the start [K].
        heat_capacity: C [J/K].
        reference_temperature: T₀ [K].

    >>> from jaxdamp.dampers import Linear
    >>> law = Heated(Linear(2000.0), sensitivity=0.002, cooling_time=600.0)
    >>> round(float(law.force(0.0, 0.5, jnp.array([50.0]))), 3)
    904.837
    """

    law: AbstractDamper
    sensitivity: Number = parameter(
        "1/K", "κ, relative loss of damping force per kelvin", default=0.002, adjustable=False
    )
    cooling_time: Number = parameter("s", "τ, time constant of cooling", positive, default=600.0, adjustable=False)
    static_force_slope: Number = parameter(
        "N/K", "s, change of the static force per kelvin", default=0.0, adjustable=False
    )
    initial_rise: Number = parameter("K", "ϑ at the start", default=0.0, adjustable=False)
    heat_capacity: Number = setting("J/K", "C, heat capacity of oil and body", positive, default=1000.0)
    reference_temperature: Number = setting(
        "K", "T₀, temperature of the law's own parameters", positive, default=293.15
    )

    def __check_init__(self) -> None:
        _checks.kelvin("Heated.reference_temperature", self.reference_temperature)

    def own_state_count(self) -> int:
        """The rise of the temperature [K]."""
        return 1

    def traits(self) -> Traits:
        """The heating power has a kink where the velocity has one."""
        return super().traits()._replace(extrapolable_states=False, temperature_dependent=True)

    def at_temperature(self, temperature: ScalarLike) -> AtRise:
        """The law with a known temperature [K] in place of that which its losses give."""
        rise = temperature - self.reference_temperature
        return AtRise(self.law.at_temperature(temperature), rise, self.sensitivity, self.static_force_slope)

    def values_at_start(self, temperature: ScalarLike) -> dict[str, ScalarLike]:
        """ϑ at the start, T − T₀."""
        return {"initial_rise": temperature - self.reference_temperature}

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion; the force inside is not known."""
        return [(self.law, motion.with_force(None))]

    def initial_state(self) -> State:
        """The rise at the start, then the states of the law at rest."""
        return super().initial_state().at[0].set(self.initial_rise)

    def damping_force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """F_d [N], the part of the force that heats the damper."""
        (rise,), inner = self.split(state)
        return self.law.force(x, v, inner) * fade(rise, self.sensitivity)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        return self.damping_force(x, v, state) + self.static_force_slope * state[0]

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """ϑ' [K/s], then the rates of the law."""
        (rise,), inner = self.split(state)
        rate = self.damping_force(x, v, state) * v / self.heat_capacity - rise / self.cooling_time
        return jnp.concatenate([rate[None], self.law.state_rate(x, v, inner)])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step of the law, then the temperature by the mean power of both ends."""
        (rise,), inner = self.split(state)

        def warmed(power: ScalarLike) -> Scalar:
            final_rise = power * self.cooling_time / self.heat_capacity
            return final_rise + (rise - final_rise) * jnp.exp(-dt / self.cooling_time)

        before = self.damping_force(x0, v0, state) * v0
        after = jnp.concatenate([warmed(before)[None], self.law.advance(x0, v0, x1, v1, inner, dt)])
        return after.at[0].set(warmed(0.5 * (before + self.damping_force(x1, v1, after) * v1)))

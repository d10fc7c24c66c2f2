"""What a vehicle did on a road: motion, forces, channels with units, energy, ride metrics."""

from typing import TYPE_CHECKING, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks, metrics
from jaxdamp._types import Scalar, Signal, State
from jaxdamp.simulation.exponential import road_rate
from jaxdamp.vehicles import AbstractVehicle, Instant


if TYPE_CHECKING:
    import xarray


STATISTICS = {
    "rms": metrics.rms,
    "peak": metrics.peak,
    "peak_to_peak": metrics.working_space_peak,
    "standard_deviation": jnp.std,
}


class Comfort(NamedTuple):
    """An acceleration as ISO 2631-1 counts it: RMS and maximum in the unit of its channel, the dose times s^(1/4)."""

    weighted_rms: Scalar
    max_transient_value: Scalar
    vibration_dose_value: Scalar


def _middle(values: Array) -> Array:
    """Mean over each step."""
    return 0.5 * (values[1:] + values[:-1])


@final
class Response(eqx.Module):
    """The response of a vehicle to a road, at uniformly spaced instants.

    `response["sprung_acceleration"]` is a channel; `response.units` and `response.channels` say which there are.
    """

    vehicle: AbstractVehicle
    time: Signal
    motion: Float[Array, "time n"]
    port_force: Float[Array, "time ports"]
    road: Float[Array, "time wheels"]
    final_state: list[State]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel."""
        return self.vehicle.units

    @property
    @eqx.filter_jit
    def channels(self) -> dict[str, Signal]:
        """All channels by name; the road's rate is the mean of the slopes before and after an instant."""
        system, n = self.vehicle.port_form().first_order(), len(self.vehicle.coordinates)
        rate = road_rate(self.road, self.time[1] - self.time[0])
        forces = self.port_force @ system.port_input.T + self.road @ system.road_input.T
        change = self.motion @ system.state_matrix.T + forces + rate @ system.road_rate_input.T
        parts = (self.motion[:, :n], self.motion[:, n:], change[:, n:], self.road, rate, self.port_force)
        return jax.vmap(lambda *instant: self.vehicle.channels(Instant(*instant)))(*parts)

    def __getitem__(self, channel: str) -> Signal:
        _checks.one_of("channel", channel, self.units)
        return self.channels[channel]

    @eqx.filter_jit
    def metrics(self) -> dict[str, Scalar]:
        """The vehicle's ride metrics by name, over the whole run."""
        channels = self.channels
        return {m.name: STATISTICS[m.statistic](channels[m.channel]) for m in self.vehicle.ride_metrics}

    def metric_units(self) -> dict[str, str]:
        """Unit of each ride metric."""
        return {m.name: self.units[m.channel] for m in self.vehicle.ride_metrics}

    @eqx.filter_jit
    def comfort(self) -> dict[str, Comfort]:
        """What of each acceleration of body, seats and places people feel, by ISO 2631-1.

        Heights are weighted by Wk, angles by We, exactly for accelerations straight from sample to sample; the ride
        starts from rest, so its mean counts. Differentiable but for the maximum.
        """
        channels, dt = self.channels, self.time[1] - self.time[0]
        found = {}
        for name in dict.fromkeys(m.channel for m in self.vehicle.ride_metrics if m.channel.endswith("_acceleration")):
            weighting = "Wk" if self.units[name] == "m/s^2" else "We"
            felt = metrics.weighted_signal(channels[name], dt, weighting, method="step", remove_mean=False)
            transient = metrics.max_transient_value(felt, dt, None)
            dose = metrics.vibration_dose_value(felt, dt, None)
            found[name] = Comfort(metrics.rms(felt), transient, dose)
        return found

    @eqx.filter_jit
    def energy_balance(self) -> dict[str, Scalar]:
        """Where the energy that the road put in has gone [J].

        `road_work` = `stored` (in masses and linear springs, at the end less at the start) + `absorbed` (by the laws;
        springs among them give it back later, dampers do not: `absorbed_by` takes them apart) + `dashpots` (linear
        ones, as in the tyre), up to `error`, which falls with the square of the step. All integrals by the trapezoid
        rule. Heights count from static equilibrium, so that weight and static loads do no work.
        """
        form, n = self.vehicle.port_form(), len(self.vehicle.coordinates)
        q, rate, dt = self.motion[:, :n], self.motion[:, n:], jnp.diff(self.time)
        slope = jnp.diff(self.road, axis=0) / dt[:, None]

        def stored(i: int) -> Scalar:
            spring = 0.5 * form.stiffness @ q[i] - form.road_stiffness @ self.road[i]
            ground = 0.5 * self.road[i] @ form.ground_stiffness @ self.road[i]
            return 0.5 * rate[i] @ form.mass @ rate[i] + q[i] @ spring + ground

        push = self.road @ form.ground_stiffness - q @ form.road_stiffness
        if form.port_road is not None:
            push = push - self.port_force @ form.port_road
        towed = _middle(rate) @ form.road_damping
        rolled = slope @ form.ground_damping
        road_work = jnp.sum((_middle(push) + rolled - towed) * slope * dt[:, None])
        dashpots = _middle(jnp.sum((rate @ form.damping) * rate, axis=1))
        dashed = jnp.sum((dashpots + jnp.sum((rolled - 2.0 * towed) * slope, axis=1)) * dt)
        absorbed = sum(self.absorbed_by().values(), jnp.zeros(()))
        change = stored(-1) - stored(0)
        parts = {"road_work": road_work, "stored": change, "absorbed": absorbed, "dashpots": dashed}
        return parts | {"error": road_work - change - absorbed - dashed}

    @eqx.filter_jit
    def absorbed_by(self) -> dict[str, Scalar]:
        """Energy that each element has taken in [J], ∫ F ė dt, by its name."""
        form, n = self.vehicle.port_form(), len(self.vehicle.coordinates)
        dt = jnp.diff(self.time)
        moved = _middle(self.port_force * (self.motion[:, n:] @ form.ports.T))
        if form.port_road is not None:
            slope = jnp.diff(self.road, axis=0) / dt[:, None]
            moved = moved - _middle(self.port_force) * (slope @ form.port_road.T)
        taken = jnp.sum(moved * dt[:, None], axis=0)
        return dict(zip(self.vehicle.frame().element_names, taken, strict=True))

    def to_xarray(self) -> "xarray.Dataset":
        """All channels as an `xarray.Dataset` over time, with units."""
        import xarray

        channels = {
            name: ("time", np.asarray(values), {"units": self.units[name]}) for name, values in self.channels.items()
        }
        return xarray.Dataset(channels, {"time": ("time", np.asarray(self.time), {"units": "s"})})

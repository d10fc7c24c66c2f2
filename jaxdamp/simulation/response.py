"""What a vehicle did on a road: motion, forces, channels with units, energy, ride metrics."""

from typing import TYPE_CHECKING, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks, metrics
from jaxdamp._types import Scalar, Signal, State
from jaxdamp.vehicles import AbstractVehicle, Instant


if TYPE_CHECKING:
    import xarray


STATISTICS = {
    "rms": metrics.rms,
    "peak": metrics.peak,
    "peak_to_peak": metrics.working_space_peak,
    "standard_deviation": jnp.std,
}


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

    def _road_rate(self) -> Float[Array, "time wheels"]:
        steps = jnp.diff(self.road, axis=0) / jnp.diff(self.time)[:, None]
        return jnp.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])

    @property
    @eqx.filter_jit
    def channels(self) -> dict[str, Signal]:
        """All channels by name; with tyre damping the road's rate is the mean of the slopes on both sides."""
        form = self.vehicle.port_form()
        n = form.mass.shape[0]
        rate = self._road_rate()
        forces = self.port_force @ form.port_input().T + self.road @ form.road_input().T
        change = self.motion @ form.state_matrix().T + forces + rate @ form.road_rate_input().T
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
    def energy_balance(self) -> dict[str, Scalar]:
        """Where the energy that the road put in has gone [J].

        `road_work` = `stored` (in masses and springs, at the end less at the start) + `absorbed` (by the laws, in
        which a series spring also stores some) + `dashpots` (linear ones, as in the tyre), up to `error`, which falls
        with the square of the step. All integrals by the trapezoid rule.
        """
        form = self.vehicle.port_form()
        n = form.mass.shape[0]
        q, rate, dt = self.motion[:, :n], self.motion[:, n:], jnp.diff(self.time)
        slope = jnp.diff(self.road, axis=0) / dt[:, None]

        def stored(i: int) -> Scalar:
            spring = 0.5 * form.stiffness @ q[i] - form.road_stiffness @ self.road[i]
            ground = 0.5 * self.road[i] @ form.ground_stiffness @ self.road[i]
            return 0.5 * rate[i] @ form.mass @ rate[i] + q[i] @ spring + ground

        def over_step(values: Array) -> Array:
            return 0.5 * (values[1:] + values[:-1])

        spring_push = over_step(self.road @ form.ground_stiffness - q @ form.road_stiffness)
        towed = over_step(rate) @ form.road_damping
        rolled = slope @ form.ground_damping
        road_work = jnp.sum((spring_push + rolled - towed) * slope * dt[:, None])
        absorbed = jnp.sum(over_step(self.port_force * (rate @ form.ports.T)) * dt[:, None])
        dashpots = over_step(jnp.sum((rate @ form.damping) * rate, axis=1))
        tyre = jnp.sum((dashpots + jnp.sum((rolled - 2.0 * towed) * slope, axis=1)) * dt)
        change = stored(-1) - stored(0)
        parts = {"road_work": road_work, "stored": change, "absorbed": absorbed, "dashpots": tyre}
        return parts | {"error": road_work - change - absorbed - tyre}

    def to_xarray(self) -> "xarray.Dataset":
        """All channels as an `xarray.Dataset` over time, with units."""
        import xarray

        channels = {
            name: ("time", np.asarray(values), {"units": self.units[name]}) for name, values in self.channels.items()
        }
        return xarray.Dataset(channels, {"time": ("time", np.asarray(self.time), {"units": "s"})})

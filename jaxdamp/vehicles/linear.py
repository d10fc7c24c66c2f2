"""The linearised vehicle: about the static equilibrium, or for a given amplitude of its laws."""

from typing import Any, final

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._matrices import solve
from jaxdamp._types import ScalarLike
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.equilibrium import refuse_restless, rest_position
from jaxdamp.vehicles.equivalent import equivalent_slopes
from jaxdamp.vehicles.ports import Ports


@final
class LinearVehicle(eqx.Module):
    """ẋ = A x + B z_r + E ż_r, channels = C x + D z_r + F ż_r, in SI units.

    x = (q, q̇, states of the laws) minus the static equilibrium.

    Arguments:
        state_matrix: A.
        road_input: B, for the road height [m] under each wheel.
        road_rate_input: E, for the rate of this height [m/s].
        output: C.
        road_feed: D.
        feed_through: F.
        behind: distance of each wheel behind the front axle [m].
        left: distance of each wheel to the left of the middle [m].
        coordinates: names of q.
        channels: names of the channels.
        axles: number of axles.
    """

    state_matrix: Float[Array, "n n"]
    road_input: Float[Array, "n wheels"]
    road_rate_input: Float[Array, "n wheels"]
    output: Float[Array, "channels n"]
    road_feed: Float[Array, "channels wheels"]
    feed_through: Float[Array, "channels wheels"]
    behind: Float[Array, " wheels"]
    left: Float[Array, " wheels"]
    coordinates: tuple[str, ...] = eqx.field(static=True)
    channels: tuple[str, ...] = eqx.field(static=True)
    axles: int = eqx.field(static=True)

    def settled(self) -> Float[Array, "n wheels"]:
        """−A⁻¹ B: static position of the vehicle for a unit road height under each wheel."""
        return -solve(self.state_matrix, self.road_input)

    def delays(self, speed: ScalarLike | int | None, in_phase: bool = False) -> Float[Array, " wheels"]:
        """Delay of each wheel [s] behind the front axle at a speed [m/s]; zero if `in_phase`.

        Raises:
            ValueError: a speed that is not positive or comes with `in_phase`; several axles and neither of the two.
        """
        if in_phase and speed is not None:
            _checks.refuse("speed", "be left out with `in_phase`", speed, "The road is then under all axles at once.")
        if speed is None:
            if self.axles > 1 and not in_phase:
                must = f"be given for a vehicle of {self.axles} axles, which the road reaches one after the other"
                _checks.refuse("speed", must, None, "Pass `speed=20.0` [m/s], or `in_phase=True` for all at once.")
            return jnp.zeros_like(self.behind)
        _checks.positive("speed", speed)
        return self.behind / speed


def linearise(vehicle: AbstractVehicle, *, amplitude: Any = None, frequency: Any = None) -> LinearVehicle:
    """Linearise the laws of a vehicle at its static equilibrium.

    By default for small motion, including the states of the laws. With an amplitude and a frequency, for a sinusoidal
    stroke: each law is replaced by an equivalent spring and dashpot with the same first harmonic of the force
    (`equivalent_slopes`). Differentiable in every parameter.

    Arguments:
        vehicle: any vehicle.
        amplitude: amplitude of the deflection at all ports [m], or one for each port; left out for small motion.
        frequency: frequency of this stroke [Hz].

    Raises:
        ValueError: an amplitude without a frequency or the reverse; one that is not positive; a vehicle without static
            equilibrium.

    >>> from jaxdamp.dampers import PowerLaw
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> car = quarter_car_000(PowerLaw(1800.0, 0.6, 900.0, 0.6, knee_width=0.01))
    >>> linear = linearise(car, amplitude=0.02, frequency=1.0)
    >>> round(float(-1200.0 * linear.state_matrix[2, 2]))  # equivalent damping [N s/m]
    3355
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), "linearise(vehicle)")
    if (amplitude is None) != (frequency is None):
        missing = "frequency" if frequency is None else "amplitude"
        _checks.refuse(missing, "be given with the other of the two", None, "Pass `amplitude=0.02, frequency=1.2`.")
    if amplitude is not None:
        _checks.positive("amplitude", amplitude)
        _checks.positive("frequency", frequency)
        amplitude, frequency = jnp.asarray(amplitude, dtype=float), jnp.asarray(frequency, dtype=float)
    linear = _linearise(vehicle, amplitude, frequency)
    matrix = _checks.concrete(linear.state_matrix)
    if matrix is not None and not np.all(np.isfinite(matrix)):
        refuse_restless(vehicle)
    return linear


@eqx.filter_jit
def _linearise(vehicle: AbstractVehicle, amplitude: Array | None, frequency: Array | None) -> LinearVehicle:
    system, frame = vehicle.system(), vehicle.frame()
    form, ports, layout = system.form, Ports(system.laws), system.layout
    n, wheels = form.road_stiffness.shape
    level = jnp.zeros(wheels)
    rest = rest_position(system, level)
    start, unravel = jax.flatten_util.ravel_pytree(ports.initial())
    equivalent = None
    if amplitude is not None and frequency is not None:
        equivalent = equivalent_slopes(ports, form.at_ports(rest, level), amplitude, frequency)
        start = start[:0]

    rest_state = jnp.concatenate([rest, jnp.zeros(n), start])
    size = rest_state.size

    def rates_and_channels(inputs: Array) -> Array:
        """Rates of the state, then channels, as a function of state, road heights and road rates."""
        x, road, road_rate = inputs[:size], inputs[size : size + wheels], inputs[size + wheels :]
        deflection, rate = form.at_ports(x[:n], road), form.at_ports(x[n : 2 * n], road_rate)
        inner: list[Array] = []
        if equivalent is not None:
            forces = equivalent[0] * deflection + equivalent[1] * rate
        else:
            states = unravel(x[2 * n :])
            forces = ports.force(deflection, rate, states)
            inner = ports.state_rate(deflection, rate, states)
        at = x[: 2 * n], forces, road, road_rate
        return jnp.concatenate([system.motion(*at), *map(jnp.ravel, inner), system.outputs(*at)])

    slopes = jax.jacfwd(rates_and_channels)(jnp.concatenate([rest_state, level, level]))
    (a, b, e), (c, d, f) = (jnp.split(part, [size, size + wheels], axis=1) for part in jnp.split(slopes, [size]))
    behind, left = (jnp.stack(values) for values in zip(*((w.behind, w.left) for w in frame.wheels), strict=True))
    return LinearVehicle(a, b, e, c, d, f, behind, left, layout.coordinates, tuple(layout.units), max(layout.axles) + 1)


def as_linear(vehicle: AbstractVehicle | LinearVehicle) -> LinearVehicle:
    """The vehicle linearised about its static equilibrium, unless it is linear already."""
    check_module("vehicle", vehicle, (AbstractVehicle, LinearVehicle))
    return vehicle if isinstance(vehicle, LinearVehicle) else linearise(vehicle)

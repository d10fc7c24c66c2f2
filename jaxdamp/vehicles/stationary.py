"""Stationary response of the linearised vehicle to a road whose rate is white noise."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, root
from jaxdamp._quickly import compiled_quickly
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.gaussian import channel_covariance
from jaxdamp.vehicles.linear import LinearVehicle, linearise
from jaxdamp.vehicles.statistical import nonlinear_variables


def stationary_rms(
    vehicle: AbstractVehicle | LinearVehicle,
    velocity_psd: ScalarLike = 1.0,
    *,
    speed: ScalarLike | int | None = None,
    in_phase: bool = False,
) -> dict[str, Scalar]:
    """RMS of every channel on a road whose rate is Gaussian white noise, with linear laws equivalent to the vehicle's.

    The laws are linearised statistically in the motion that results (`linearise(vehicle, velocity_psd=...)`, which says
    how accurate that is); a vehicle with linear laws is exact. For another linearisation, such as that at rest, pass
    `linearise(vehicle)`. RMS values are those about the mean: laws that differ in both directions shift it.

    All wheels run on the same road: with a `speed` one axle after the other, so that their motions are correlated, or
    `in_phase`. A channel is y(t) = ∫ k(s) u(t − s) ds with the white rate u of the road, and its mean square S ∫ k² ds
    is computed exactly, from axle to axle: while no wheel meets the impulse, k is a row times the matrix exponential of
    the state, plus a constant. The part after the last axle follows from A X + X Aᵀ + x xᵀ = 0. Differentiable in every
    parameter and in the speed.

    Channels that contain the white noise itself (the tyre load, if there is tyre damping) have an infinite RMS,
    returned as `inf`. Absolute heights (`z_…`) have no finite RMS; the returned ones are relative to the road under the
    front axle. Where a spring holds the vehicle to the ground (`Guide`), those heights, strokes and loads that a
    lasting height of the road changes have none either: `inf`.

    Arguments:
        vehicle: a vehicle, or what `linearise` made of it.
        velocity_psd: two-sided power spectral density S of the rate of the height [(m/s)²/Hz]; for an ISO 8608 road of
            waviness 2 it is 2π² G_d(n₀) n₀² V (`roads.white`).
        speed: of the vehicle [m/s]; not needed for a single axle.
        in_phase: the road is under all axles at once, instead of a speed.

    Returns:
        RMS of each channel by name, in the unit of the channel.

    Raises:
        ValueError: a density or a speed that is not positive, several axles with neither `speed` nor `in_phase`, or
            with both; a vehicle that does not come to rest.

    Source: for the quarter car, closed forms exist (see the tests).

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> round(float(stationary_rms(quarter_car_000())["sprung_acceleration"]) ** 2, 3)
    853.472
    """
    _checks.positive("velocity_psd", velocity_psd)
    linear = _in_motion(vehicle, velocity_psd, speed, in_phase)
    matrix = _checks.concrete(linear.state_matrix)
    if matrix is not None and np.max(np.linalg.eigvals(matrix).real) > -1e-9 * np.abs(matrix).max():
        remedy = (
            "Friction models such as Dahl, LuGre and Bouc-Wen have an undamped state for small motion: pass the "
            "vehicle itself, or `linearise(vehicle, velocity_psd=...)`."
            if isinstance(vehicle, LinearVehicle)
            else "One of its motions is not damped: `vehicles.modes(vehicle)` shows which. A damper with a negative "
            "slope, for instance, feeds energy in."
        )
        _checks.refuse("vehicle", "come to rest when linearised", "one that does not", remedy)
    everything = tuple(range(len(linear.channels)))
    squares = jnp.diagonal(_covariance(linear, linear.delays(speed, in_phase), everything))
    noisy = jnp.any(linear.feed_through != 0, axis=1)
    rms = root(velocity_psd * jnp.where(noisy, jnp.inf, at_least(squares, 0.0)))
    return {name: rms[i] for i, name in enumerate(linear.channels)}


class EquivalentDamper(NamedTuple):
    """The linear damper that stands for a law in the stationary motion on a white road.

    Attributes:
        slope: E[v F]/E[v²] [N s/m]: it dissipates the same power.
        velocity_rms: σ of the velocity [m/s], normally distributed.
        linear: whether the law is linear, so that nothing is approximated.
    """

    slope: Scalar
    velocity_rms: Scalar
    linear: bool

    def words(self) -> str:
        """As in "Gaussian, equivalent slope 2006 N s/m at 0.21 m/s RMS"."""
        kind = "linear, slope" if self.linear else "Gaussian, equivalent slope"
        return f"{kind} {self.slope:.0f} N s/m at {self.velocity_rms:.2g} m/s RMS"


def equivalent_dampers(
    vehicle: AbstractVehicle,
    velocity_psd: ScalarLike = 1.0,
    *,
    speed: ScalarLike | int | None = None,
    in_phase: bool = False,
) -> dict[str, EquivalentDamper]:
    """What `stationary_rms` takes in place of each damper, by name.

    Arguments:
        vehicle: a vehicle.
        velocity_psd: two-sided power spectral density of the rate of the height [(m/s)²/Hz].
        speed: of the vehicle [m/s]; not needed for a single axle.
        in_phase: the road is under all axles at once, instead of a speed.

    Raises:
        ValueError: as `stationary_rms`.

    >>> from jaxdamp.dampers import CoulombFriction, Linear
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> car = quarter_car_000(Linear(1500.0) + CoulombFriction(150.0, 1e-3))
    >>> equivalent_dampers(car, 1e-3)["damper"].words()
    'Gaussian, equivalent slope 2012 N s/m at 0.23 m/s RMS'
    """
    _checks.positive("velocity_psd", velocity_psd)
    linear = _in_motion(vehicle, velocity_psd, speed, in_phase)
    numbers = {name: i for i, name in enumerate(linear.channels)}
    laws = dict(zip(vehicle.layout.ports, vehicle.elements(), strict=True))
    names = [name for name in laws if f"{name}_velocity" in numbers]
    pairs = {name: (numbers[f"{name}_force"], numbers[f"{name}_velocity"]) for name in names}
    chosen = tuple(number for pair in pairs.values() for number in pair)
    if not chosen:
        return {}
    covariance = velocity_psd * _covariance(linear, linear.delays(speed, in_phase), chosen)
    dampers = {}
    for i, (name, (_, rate)) in enumerate(pairs.items()):
        power, square = covariance[2 * i, 2 * i + 1], at_least(covariance[2 * i + 1, 2 * i + 1], 1e-30)
        noisy = jnp.any(linear.feed_through[rate] != 0)
        velocity = jnp.where(noisy, jnp.inf, root(square))
        dampers[name] = EquivalentDamper(power / square, velocity, not nonlinear_variables(laws[name]))
    return dampers


def _in_motion(
    vehicle: AbstractVehicle | LinearVehicle, velocity_psd: ScalarLike, speed: ScalarLike | int | None, in_phase: bool
) -> LinearVehicle:
    if isinstance(vehicle, LinearVehicle):
        return vehicle
    return linearise(vehicle, velocity_psd=velocity_psd, speed=speed, in_phase=in_phase)


@compiled_quickly
def _covariance(
    linear: LinearVehicle, delays: Float[Array, " wheels"], chosen: tuple[int, ...]
) -> Float[Array, "channels channels"]:
    """∫ k kᵀ ds of some channels; infinite for a vehicle that does not come to rest.

    The mean square of a channel that follows the height of the road, which has no end, is infinite.
    """
    c, settled = linear.output[np.array(chosen)], linear.settled()
    # ξ = x − settled z_r obeys ξ̇ = A ξ + (E − settled) ż_r; channels are C ξ + (C settled + D) z_r + F ż_r
    static = c @ settled + linear.road_feed[np.array(chosen)]
    covariance, ends = channel_covariance(linear.state_matrix, c, linear.road_rate_input - settled, static, delays)
    follows = jnp.sum(static, axis=1) - np.array([linear.channels[i].startswith("z_") for i in chosen], c.dtype)
    size = jnp.sum(jnp.abs(c), axis=1) + jnp.sum(jnp.abs(linear.road_feed[np.array(chosen)]), axis=1)
    adrift = jnp.abs(follows) > np.finfo(c.dtype).eps ** (1 / 3) * size
    return jnp.where(ends & ~jnp.diag(adrift), covariance, jnp.inf)

"""The linearised vehicle: about the static equilibrium, for a given amplitude of its laws, or on a random road."""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._matrices import solve
from jaxdamp._quickly import compiled_quickly
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.dampers import coverage
from jaxdamp.metrics import weighting_state_space
from jaxdamp.vehicles.base import AbstractVehicle, refuse_controller
from jaxdamp.vehicles.equilibrium import refuse_restless, rest_position
from jaxdamp.vehicles.port_form import Ports, States
from jaxdamp.vehicles.statistical import NoiseAtLaw, statistical_laws
from jaxdamp.vehicles.system import LinearLaws, with_linear_laws


POINTS = 256  # in a cycle
CYCLES = 8  # the last one is evaluated; laws with states settle before


def equivalent_slopes(
    ports: Ports, centre: Float[Array, " ports"], amplitude: Float[Array, "..."], frequency: Scalar
) -> tuple[Float[Array, " ports"], Float[Array, " ports"]]:
    """First harmonic of each force for x = centre + X sin ωt: F ≈ k (x − centre) + c v.

    k = (2/X) mean(F sin ωt) [N/m], c = (2/(Xω)) mean(F cos ωt) [N s/m] over the last of eight cycles of 256 points. c
    dissipates the same energy as the law, k is its part in phase with the stroke. Zeros without elements.

    Arguments:
        ports: the laws at the ports.
        centre: mean deflection [m], shape (ports,).
        amplitude: X [m], one for all or one for each port.
        frequency: ω/2π [Hz].
    """
    x_max = jnp.broadcast_to(jnp.abs(amplitude), centre.shape)
    rate = 2.0 * jnp.pi * frequency
    phase = 2.0 * jnp.pi * jnp.arange(CYCLES * POINTS + 1.0, dtype=centre.dtype) / POINTS
    sine, cosine = jnp.sin(phase), jnp.cos(phase)
    x = centre[None, :] + sine[:, None] * x_max[None, :]
    v = cosine[:, None] * (rate * x_max)[None, :]

    def step(states: States, ends: tuple[Array, ...]) -> tuple[States, Array]:
        x0, v0, x1, v1 = ends
        states = ports.advance(x0, v0, x1, v1, states, 1.0 / (frequency * POINTS))
        return states, ports.force(x1, v1, states)

    _, forces = jax.lax.scan(step, ports.at_rest(centre), (x[:-1], v[:-1], x[1:], v[1:]))
    last, of_cycle = forces[-POINTS:], slice(-POINTS, None)
    stiffness = 2.0 * jnp.mean(last * sine[of_cycle, None], axis=0) / x_max
    return stiffness, 2.0 * jnp.mean(last * cosine[of_cycle, None], axis=0) / (rate * x_max)


INSTEAD = 'Drive over a random road instead: `roads.iso8608("C", speed=20.0, length=1200.0, seed=1)`.'


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
        return delays_of(self.behind, self.axles, speed, in_phase)


def linearise(
    vehicle: AbstractVehicle,
    *,
    amplitude: ArrayLike | Sequence[float] | None = None,
    frequency: ScalarLike | int | None = None,
    velocity_psd: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    in_phase: bool = False,
) -> LinearVehicle:
    """Linearise the laws of a vehicle: at its static equilibrium, for a sinusoidal stroke or on a random road.

    By default for small motion, including the states of the laws. With an amplitude and a frequency, for a sinusoidal
    stroke: each law is replaced by an equivalent spring and dashpot with the same first harmonic of the force
    (`equivalent_slopes`). With a `velocity_psd`, for the motion on a road whose rate is Gaussian white noise: each law,
    with its states, is replaced by the linear one with the least mean square error in the motion that results
    (statistical linearisation), for a law of the velocity alone F ≈ E[v F]/E[v²] v. Differentiable in every parameter.

    Statistical linearisation takes stroke, velocity and states as normally distributed. RMS values are within 5 % of
    simulations, with hysteresis (`Dahl`, `BoucWen`) within 12 %; where friction mostly sticks, the stroke is up to 17 %
    low (`benchmarks/white_road.py`).

    Where no stationary motion is found in code that JAX traces, which cannot raise an error, F and with it every RMS is
    infinite.

    Arguments:
        vehicle: any vehicle.
        amplitude: amplitude of the deflection at all ports [m], or one for each port; left out for small motion.
        frequency: frequency of this stroke [Hz].
        velocity_psd: two-sided power spectral density of the rate of the road [(m/s)²/Hz], as of `roads.white`.
        speed: of the vehicle on this road [m/s]; not needed for a single axle.
        in_phase: this road is under all axles at once, instead of a speed.

    Raises:
        ValueError: an amplitude without a frequency or the reverse, or with a density; one that is not positive; a
            vehicle without static equilibrium; a nonlinear law at the road itself, whose rate is white noise; no
            stationary motion.

    Source: for random roads, Roberts and Spanos, Random Vibration and Statistical Linearization (1990); for laws with
    hysteresis Wen, J. Appl. Mech. 47 (1980).

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
    if velocity_psd is not None:
        if amplitude is not None:
            _checks.refuse("amplitude", "be left out on a random road", amplitude, "Its motion follows from the road.")
        return _on_random_road(vehicle, velocity_psd, speed, in_phase)
    if amplitude is not None:
        _checks.positive("amplitude", amplitude)
        _checks.positive("frequency", frequency)
    sinusoidal = [None if a is None else jnp.asarray(a, dtype=float) for a in (amplitude, frequency)]
    shapes, ports = [jnp.shape(0.0 if a is None else a) for a in sinusoidal], vehicle.layout.ports
    if shapes[0] not in ((), (1,), (len(ports),)):
        must = f"be one number, or one for each of the ports {', '.join(ports)}"
        _checks.refuse("amplitude", must, f"of shape {shapes[0]}")
    if shapes[1]:
        _checks.refuse("frequency", "be one number", f"of shape {shapes[1]}", "Call it once for each.")
    linear = _linearise(vehicle, *sinusoidal)
    matrix = _checks.concrete(linear.state_matrix)
    if matrix is not None and not np.all(np.isfinite(matrix)):
        refuse_restless(vehicle)
    return linear


def _on_random_road(
    vehicle: AbstractVehicle, velocity_psd: ScalarLike | int, speed: ScalarLike | int | None, in_phase: bool
) -> LinearVehicle:
    """With the nearest linear laws in the stationary motion."""
    _checks.positive("velocity_psd", velocity_psd)
    behind = jnp.stack([wheel.behind for wheel in vehicle.frame().wheels])
    delays = delays_of(behind, max(vehicle.layout.axles) + 1, speed, in_phase)
    try:
        linear, converged = _linearise_statistically(vehicle, jnp.asarray(velocity_psd, dtype=float), delays)
    except NoiseAtLaw as noise:
        name = vehicle.layout.ports[noise.port]
        law = type(vehicle.frame().element(name).law).__name__
        must = (
            f"have linear laws between wheel and road on a white road: the velocity of {name} has no finite RMS there"
        )
        _checks.refuse("vehicle", must, f"one with a {law}", INSTEAD)
    success = _checks.concrete(converged)
    if success is not None and not success:
        names = vehicle.layout.ports[: len(vehicle.layout.ports) - sum(vehicle.layout.lifts)]
        laws = ", ".join(f"{name} ({type(vehicle.frame().element(name).law).__name__})" for name in names)
        must = "have a stationary motion with linear laws equivalent to its own"
        remedy = " ".join([*filter(None, map(coverage, vehicle.elements())), INSTEAD])
        _checks.refuse("vehicle", must, f"one for which none was found: {laws}", remedy)
    return linear


@compiled_quickly
def _linearise_statistically(
    vehicle: AbstractVehicle, velocity_psd: Array, delays: Float[Array, " wheels"]
) -> tuple[LinearVehicle, Scalar]:
    refuse_controller(vehicle, "a statistically equivalent linear vehicle")
    system, frame = vehicle.system(), vehicle.frame()
    at_road = {name for wheel in frame.wheels for name in wheel.element_names}
    on_road = [name in at_road for name in system.layout.ports]
    lifting = sum(system.layout.lifts)
    lifts = [number >= len(on_road) - lifting for number in range(len(on_road))]
    laws, converged = statistical_laws(system, velocity_psd, delays, on_road, lifts)
    linear = _assembled(vehicle, laws)
    lost = jnp.where(converged > 0, linear.feed_through, jnp.inf)
    return eqx.tree_at(lambda linear: linear.feed_through, linear, lost), converged


@compiled_quickly
def _linearise(vehicle: AbstractVehicle, amplitude: Array | None, frequency: Array | None) -> LinearVehicle:
    refuse_controller(vehicle, "a linear vehicle")
    system = vehicle.system()
    form, ports, count = system.form, Ports(system.laws), len(system.laws)
    level = jnp.zeros(form.road_stiffness.shape[1])
    at_rest = form.at_ports(rest_position(system, level), level)
    if amplitude is not None and frequency is not None:
        slopes = jnp.concatenate([*map(jnp.diag, equivalent_slopes(ports, at_rest, amplitude, frequency))], axis=1)
        return _assembled(vehicle, LinearLaws(jnp.zeros(count), slopes, tuple(range(count))))
    start, unravel = jax.flatten_util.ravel_pytree(ports.at_rest(at_rest))

    def answers(motions: Array) -> Array:
        """Forces, then rates of the states, as a function of deflections, rates and states."""
        deflection, rate, states = motions[:count], motions[count : 2 * count], unravel(motions[2 * count :])
        rates = ports.state_rate(deflection, rate, states)
        return jnp.concatenate([ports.force(deflection, rate, states), *map(jnp.ravel, rates)])

    slopes = jax.jacfwd(answers)(jnp.concatenate([at_rest, jnp.zeros(count), start]))
    return _assembled(vehicle, LinearLaws(jnp.zeros(count + start.size), slopes, tuple(range(count))))


def _assembled(vehicle: AbstractVehicle, laws: LinearLaws) -> LinearVehicle:
    """The vehicle with these laws."""
    system, frame = vehicle.system(), vehicle.frame()
    linear, layout = with_linear_laws(system, laws), system.layout
    behind, left = (jnp.stack(values) for values in zip(*((w.behind, w.left) for w in frame.wheels), strict=True))
    axles = max(layout.axles) + 1
    return LinearVehicle(*linear[:6], behind, left, layout.coordinates, tuple(layout.units), axles)


def delays_of(
    behind: Float[Array, " wheels"], axles: int, speed: ScalarLike | int | None, in_phase: bool
) -> Float[Array, " wheels"]:
    """Delay of each wheel [s] behind the front axle at a speed [m/s]; zero if `in_phase`.

    Raises:
        ValueError: a speed that is not positive or comes with `in_phase`; several axles and neither of the two.
    """
    if in_phase and speed is not None:
        _checks.refuse("speed", "be left out with `in_phase`", speed, "The road is then under all axles at once.")
    if speed is None:
        if axles > 1 and not in_phase:
            must = f"be given for a vehicle of {axles} axles, which the road reaches one after the other"
            _checks.refuse("speed", must, None, "Pass `speed=20.0` [m/s], or `in_phase=True` for all at once.")
        return jnp.zeros_like(behind)
    _checks.positive("speed", speed)
    return behind / speed


def as_linear(vehicle: AbstractVehicle | LinearVehicle) -> LinearVehicle:
    """The vehicle linearised about its static equilibrium, unless it is linear already."""
    check_module("vehicle", vehicle, (AbstractVehicle, LinearVehicle))
    return vehicle if isinstance(vehicle, LinearVehicle) else linearise(vehicle)


def with_weightings(linear: LinearVehicle, weightings: Sequence[tuple[str, str]]) -> LinearVehicle:
    """The linearised vehicle with added channels `weighted_…`: ẇ = A_w w + B_w y, output C_w w, for a channel y.

    `stationary_rms` then gives the weighted RMS of a white road, `frequency_response` the weighted response.

    Arguments:
        linear: result of `linearise`.
        weightings: pairs of a channel and a weighting, such as `[("sprung_acceleration", "Wk")]`.

    Raises:
        ValueError: an unknown channel or weighting.

    >>> from jaxdamp.vehicles import linearise, stationary_rms
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> weighted = with_weightings(linearise(quarter_car_000()), [("sprung_acceleration", "Wk")])
    >>> rms = stationary_rms(weighted, 3e-3)
    >>> [round(float(rms[name]), 3) for name in ("sprung_acceleration", "weighted_sprung_acceleration")]
    [1.6, 1.026]
    """
    for name, _ in weightings:
        _checks.one_of("channel", name, linear.channels)
    filters = [weighting_state_space(weighting) for _, weighting in weightings]
    picked = jnp.array([linear.channels.index(name) for name, _ in weightings], dtype=int)
    size, inner = linear.state_matrix.shape[0], sum(f.input_vector.size for f in filters)
    into = jax.scipy.linalg.block_diag(*[f.input_vector[:, None] for f in filters])
    out = jax.scipy.linalg.block_diag(*[f.output_vector[None, :] for f in filters])
    filter_states = jax.scipy.linalg.block_diag(*[f.state_matrix for f in filters])
    above = jnp.concatenate([linear.state_matrix, jnp.zeros((size, inner))], axis=1)
    below = jnp.concatenate([into @ linear.output[picked], filter_states], axis=1)
    unweighted = jnp.concatenate([linear.output, jnp.zeros((len(linear.channels), inner))], axis=1)
    weighted = jnp.concatenate([jnp.zeros((len(filters), size)), out], axis=1)
    wheels = linear.road_input.shape[1]
    nothing = jnp.zeros((len(filters), wheels))
    return LinearVehicle(
        jnp.concatenate([above, below]),
        jnp.concatenate([linear.road_input, into @ linear.road_feed[picked]]),
        jnp.concatenate([linear.road_rate_input, into @ linear.feed_through[picked]]),
        jnp.concatenate([unweighted, weighted]),
        jnp.concatenate([linear.road_feed, nothing]),
        jnp.concatenate([linear.feed_through, nothing]),
        linear.behind,
        linear.left,
        linear.coordinates,
        (*linear.channels, *[f"weighted_{name}" for name, _ in weightings]),
        linear.axles,
    )

"""How many steps between two instants the laws of a vehicle need."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._quickly import compiled_quickly
from jaxdamp._traced import at_compile_time, is_batched, is_traced, known, row, rows
from jaxdamp._types import Scalar
from jaxdamp.control import ControlLoop, laws_at_levels
from jaxdamp.dampers import AbstractDamper, Linkage, MotionRatio
from jaxdamp.vehicles import AbstractVehicle, System


LARGEST = 0.5  # of the share below; the corrected step is stable up to 1
STIFF = 0.05  # of the share through the travel alone, from which on two steps are taken: they err a tenth as much
MOST = 64
HEUN = 1.0  # largest rate of a state times the step for the explicit step of slow states, which is stable up to 2
_VELOCITIES = np.concatenate([-np.geomspace(3.0, 1e-4, 14), [0.0], np.geomspace(1e-4, 3.0, 14)])  # m/s
_STROKES = np.array([-0.05, 0.0, 0.05])  # m
# Strokes at which damping is looked for [m], such as that of a stop; at those in pairs far away only if it has settled
# there: a polynomial of the stroke, fitted to some centimetres, grows without limit beyond them.
_CONTACTS = np.array([0.0, *(side * x for side in (-1.0, 1.0) for x in (0.005, 0.01, 0.02, 0.035, 0.05, 0.2, 0.3))])
_FAR = np.abs(_CONTACTS) > 0.1
_SETTLED = 0.01  # largest relative difference of the damping within a pair


class Need(NamedTuple):
    """What the laws of a vehicle ask of a step.

    Arguments:
        substeps: steps between two instants.
        by_travel: the largest share of a velocity's error that comes back in one undivided step through the travel,
            as from a spring; laws of the velocity alone, such as friction, are accurate even where they are divided.
        by_contact: the largest share that comes back through damping that begins along the stroke, as in a stop: the
            step before it knows nothing of it.
    """

    substeps: int
    by_travel: float
    by_contact: float


class Slopes(NamedTuple):
    """The largest slopes of a law."""

    damping: float = 0.0  # of the force by the velocity at the end of a step [N s/m]
    contact: float = 0.0  # by how much of it is beyond that at stroke zero [N s/m]
    stiffness: float = 0.0  # of the force by the travel within a step, through the stroke and the states [N/m]
    at_rest: float = 0.0  # of the force by the stroke at rest [N/m], the states held
    rate: float = 0.0  # of states that an explicit step carries on [1/s]


class _Samples(NamedTuple):
    """Slopes of a law at many velocities and strokes, as `Slopes` takes the largest of them; arrays."""

    damping: Array | np.ndarray  # at strokes and velocities; over a step where states are extrapolated [N s/m]
    by_velocity: Array | np.ndarray | None = None  # through the states, [N/m]
    by_stroke: Array | np.ndarray | None = None  # [N/m]
    rates: Array | np.ndarray | None = None  # of the states, where an explicit step carries them on, [1/s]

    def largest(self) -> Slopes:
        """The largest of each."""
        rate = 0.0
        if self.rates is not None:
            rate = float(np.max(np.abs(np.linalg.eigvals(np.nan_to_num(self.rates)))))
        damping = _largest_along_strokes(self.damping)
        contact = damping - _largest(self.damping[0])
        if self.by_velocity is None or self.by_stroke is None:  # the states are extrapolated
            return Slopes(2.0 * damping, 2.0 * contact, rate=rate)
        at_rest = float(np.nan_to_num(self.by_stroke[_STROKES.size // 2]))
        by_travel = _largest(self.by_velocity) + _largest(np.abs(self.by_stroke))
        return Slopes(damping, contact, by_travel, at_rest, rate)


class KnownCar(NamedTuple):
    """A car whose numbers are known: its equations, with arrays of NumPy, and the largest slopes of each law."""

    system: System
    slopes: list[Slopes]


def substeps_needed(vehicle: AbstractVehicle, dt: float) -> int:
    """Steps of the exponential engine between two instants that keep every law stable: see `step_need`.

    Under `jax.grad` and `jax.vmap` those of the values that are differentiated, the most of a batch.

    Arguments:
        vehicle: any vehicle.
        dt: spacing of the instants [s].

    Raises:
        ValueError: a vehicle whose numbers are not known, as inside `jax.jit`.
    """
    return max(each_needs(vehicle, _checks.plain_number("dt", dt), MOST))


def each_needs(vehicle: AbstractVehicle, dt: float, most: int | float) -> list[int]:
    """The same of each car of a batch, refused above `most`."""
    cars = known_cars(known_system(vehicle), dt)
    if cars is None:
        _checks.refuse("vehicle", "have numbers that are known", "traced", "Call it outside `jax.jit`.")
    return [step_need(*car, dt, most=most).substeps for car in cars]


def known_system(vehicle: AbstractVehicle) -> System:
    """The equations of a vehicle, with known numbers also inside `jax.jit` if the vehicle is not an argument there."""
    if is_traced(vehicle):
        return vehicle.system()
    with at_compile_time():
        return vehicle.system()


def known_cars(system: System, dt: float) -> list[KnownCar] | None:
    """A car, or each car of a batch; None where numbers are not known.

    Arguments:
        system: of the vehicle; derivatives and batches are looked behind.
        dt: the step over which slopes are taken where they depend on it [s].
    """
    if is_batched(system):
        return _cars_of_batch(jax.tree.map(lambda a: jax.lax.stop_gradient(a) if eqx.is_array(a) else a, system), dt)
    with at_compile_time():
        one = known(system)
        return None if one is None else _cars_of_batch(one, dt)


def _cars_of_batch(system: System, dt: float) -> list[KnownCar] | None:
    both = system, [[_samples(law, dt) for law in laws] for laws in _at_all_commands(system)]
    values = rows(both)
    if values is None:
        return None
    cars = []
    for index in range(len(values[0])):
        of_one, samples = row(both, values, index)
        cars.append(KnownCar(of_one, [_steepest([_added(terms) for terms in laws]) for laws in samples]))
    return cars


def _at_all_commands(system: System) -> list[list[AbstractDamper]]:
    """The laws that each port may have: one, or those at all levels of a damper that is commanded."""
    control: ControlLoop | None = system.control
    commanded = () if control is None else control.ports
    return [laws_at_levels(law) if port in commanded else [law] for port, law in enumerate(system.laws)]


def _added(terms: Sequence[_Samples]) -> Slopes:
    """The largest slopes of laws that act side by side."""
    return Slopes(*map(sum, zip(*(term.largest() for term in terms), strict=True)))


def _steepest(slopes: Sequence[Slopes]) -> Slopes:
    """The largest of each slope."""
    return Slopes(*map(max, zip(*slopes, strict=True)))


def step_need(system: System, slopes: Sequence[Slopes], dt: float, *, most: int | float = MOST) -> Need:
    """Steps of the exponential engine between instants dt [s] apart that keep every law stable.

    A force that grows by c [N s/m] with the velocity at the end of a step, and by k [N/m] with the travel within it,
    takes back the share (c + k dt/2) dt/(2m) of an error of the predicted velocity; here m is what the port feels,
    1/m = P M⁻¹ Pᵀ. The steepest slopes count, such as that of friction at standstill, and k also through the states:
    a law in which a fast state follows the travel is a spring over a short step, whatever its own step makes of it.
    Laws whose states are extrapolated, such as a lag much shorter than the step, count twice. Slow states, carried on
    by the explicit step of `AbstractStateful`, also need a step shorter than their time constant. A law that is
    nearly a stiff spring over the step, such as compressible oil, takes two steps for the sake of accuracy.

    Raises:
        ValueError: more than `most` would be needed.
    """
    mass, ports = np.asarray(system.form.mass), np.asarray(system.form.ports)
    if not any(any(s) for s in slopes):
        return Need(1, 0.0, 0.0)
    felt = np.diag(ports @ np.linalg.solve(mass, ports.T))
    by_rate, by_contact = (0.5 * dt * np.array(of) * felt for of in zip(*(s[:2] for s in slopes), strict=True))
    by_travel = 0.25 * dt * dt * np.array([s.stiffness for s in slopes]) * felt
    # the least n with by_rate/n + by_travel/n² <= LARGEST
    counts = 0.5 * (by_rate + np.sqrt(by_rate * by_rate + 4.0 * LARGEST * by_travel)) / LARGEST
    counts = np.maximum(np.nan_to_num(counts, nan=np.inf), dt * np.array([s.rate for s in slopes]) / HEUN)
    count, worst = max(1, math.ceil(min(float(counts.max()), 1e9))), int(counts.argmax())
    if count > most:
        _refuse_law(system.layout.ports[worst], slopes[worst], dt, count)
    count = max(count, 1 + bool(by_travel.max() > STIFF))
    return Need(count, float(by_travel.max()), float(by_contact.max()))


def _refuse_law(name: str, slopes: Slopes, dt: float, count: int) -> None:
    remedy = (
        f"Pass `dt={rounded_down(dt * MOST / count):g}` or less, widen the velocity over which its force changes "
        "sign, or take an implicit solver, `engine=simulation.Adaptive(diffrax.Kvaerno5())`."
    )
    if dt * slopes.rate / HEUN > MOST:
        must, value = f"have states that {MOST} steps in {dt:g} s can follow", f"{slopes.rate:.3g} 1/s fast"
    elif 0.5 * dt * slopes.stiffness > slopes.damping:
        must, value = f"have a stiffness that {MOST} steps in {dt:g} s can follow", f"{slopes.stiffness:.3g} N/m stiff"
    else:
        must = f"have a slope that {MOST} steps in {dt:g} s can follow"
        value = f"{slopes.damping:.3g} N s/m steep at some velocity"
    _checks.refuse(name, must, value, remedy)


def rounded_down(value: float) -> float:
    """To one digit."""
    unit = 10.0 ** math.floor(math.log10(value))
    return math.floor(value / unit * (1.0 + 1e-12)) * unit


def _samples(law: AbstractDamper, dt: float) -> list[_Samples]:
    """The slopes of each of the laws that act side by side in a law."""
    return [_of_term(term, dt) for term in _at_largest_ratio(law).side_by_side()]


def _at_largest_ratio(law: AbstractDamper) -> AbstractDamper:
    """The law with the largest ratio of each linkage inside, at which the slopes of its force are steepest."""

    def steepest(part: PyTree) -> PyTree:
        return MotionRatio(_at_largest_ratio(part.law), jnp.max(part.ratio)) if isinstance(part, Linkage) else part

    return jax.tree.map(steepest, law, is_leaf=lambda part: isinstance(part, Linkage))


def _of_term(law: AbstractDamper, dt: float) -> _Samples:
    velocity, size, traits = jnp.asarray(_VELOCITIES, float), law.initial_state().size, law.traits()
    contact = jnp.asarray(_CONTACTS if traits.stroke_dependent else _CONTACTS[:1], float)
    rates = _slopes_of_rates(law, velocity) if size and traits.has_explicit_step else None
    if size and traits.extrapolable_states:
        return _Samples(_slopes_over_step(law, velocity, contact, jnp.asarray(dt, dtype=float)), rates=rates)
    return _Samples(*_slopes_at_instant(law, velocity, contact, jnp.asarray(_STROKES, float)), rates)


def _largest_along_strokes(damping: Array | np.ndarray) -> float:
    """The largest damping at any velocity: at strokes near the middle, and at those far away where it has settled."""
    at_strokes = np.max(np.nan_to_num(np.asarray(damping)), axis=1, initial=0.0)
    if at_strokes.size == 1:
        return float(at_strokes[0])
    inner, outer = at_strokes[_FAR].reshape(-1, 2).T
    settled = np.abs(outer - inner) <= _SETTLED * inner
    return float(max(at_strokes[~_FAR].max(), outer[settled].max(initial=0.0)))


def _largest(values: Array | np.ndarray) -> float:
    return float(np.max(np.nan_to_num(np.asarray(values)), initial=0.0))


@compiled_quickly
def _slopes_over_step(
    law: AbstractDamper, velocity: Float[Array, " velocities"], contact: Float[Array, " contacts"], dt: Scalar
) -> Float[Array, "contacts velocities"]:
    """Slope of the force after a step by the velocity at its end [N s/m], of a law whose states are extrapolated."""

    def force(end: Scalar, v: Scalar, x: Scalar) -> Scalar:
        return law.force(x, end, law.advance(x, v, x, end, law.initial_state(), dt))

    return jax.vmap(lambda x: jax.vmap(jax.grad(force), (0, 0, None))(velocity, velocity, x))(contact)


@compiled_quickly
def _slopes_at_instant(
    law: AbstractDamper,
    velocity: Float[Array, " velocities"],
    contact: Float[Array, " contacts"],
    stroke: Float[Array, " strokes"],
) -> tuple[Array, Array, Array]:
    """∂F/∂v [N s/m] at strokes and velocities, Σ ∂F/∂s ∂ṡ/∂v [N/m] at velocities, ∂F/∂x [N/m] at strokes, from rest."""
    start, zero = law.initial_state(), jnp.zeros_like(velocity[0])

    def damping(x: Scalar, v: Scalar) -> Scalar:
        return jax.jvp(lambda v: law.force(x, v, start), (v,), (jnp.ones_like(v),))[1]

    def by_states(v: Scalar) -> Scalar:
        if not start.size:
            return jnp.zeros_like(v)
        change = jax.jvp(lambda v: law.state_rate(zero, v, start), (v,), (jnp.ones_like(v),))[1]
        return jax.jvp(lambda s: law.force(zero, v, s), (start,), (change,))[1]

    by_stroke = jax.vmap(lambda x: jax.jvp(lambda x: law.force(x, zero, start), (x,), (jnp.ones_like(x),))[1])(stroke)
    of_contacts = jax.vmap(lambda x: jax.vmap(lambda v: damping(x, v))(velocity))(contact)
    return of_contacts, jax.vmap(by_states)(velocity), by_stroke


@compiled_quickly
def _slopes_of_rates(
    law: AbstractDamper, velocity: Float[Array, " velocities"]
) -> Float[Array, "velocities states states"]:
    zero = jnp.zeros_like(velocity[0])
    return jax.vmap(lambda v: jax.jacfwd(lambda s: law.state_rate(zero, v, s))(law.initial_state()))(velocity)

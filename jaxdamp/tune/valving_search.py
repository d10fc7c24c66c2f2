"""`valving`: the bleed, valves and gas pressure of a mono-tube or twin-tube damper that give a wanted force."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias, Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._jacobian import with_jacobian
from jaxdamp._progress import Progress
from jaxdamp._settings import with_defaults
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp._triangles import triangle
from jaxdamp._types import VectorLike
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.dampers import AbstractDamper, MonoTube, TwinTube
from jaxdamp.parameters import FreeParameters
from jaxdamp.rig import march, quasi_static, respond
from jaxdamp.solve import BoundedLevenbergMarquardt, Linearisation, least_squares_on_host
from jaxdamp.tune.cavities import lacking, with_cavities
from jaxdamp.tune.ranges import INSIDE, Bound, SearchRange, search_range
from jaxdamp.tune.settings import Free
from jaxdamp.tune.valving_result import OutOfReach, ValveParameter, ValvingResult


VELOCITIES = np.linspace(-1.0, 1.0, 101)  # m/s
LONGEST_STEP, CYCLE = 1e-3, 400  # s, and least number of steps in a cycle
SETTLING = 0.1  # share of a measured record that is not compared
BINDING = 0.02  # decrease of the squared error per 100 % of a parameter beyond its bound, relative to that error
CLOSE_ENOUGH = 0.05  # of the tolerance, at which no further start is tried
HOPS = (0.01, 0.1)  # relative changes of each parameter that must not lower the error at the end of a search
LOWER = 1e-6  # relative decrease of the squared error that is worth another search
CAVITY = 0.1  # of the tolerance, above which a difference by cavities is named
APART = 2.0  # a start is a factor of up to so much from the given one, within the bounds


class ValvingSettings(Free, total=False):
    """Further keywords of `valving`."""

    bounds: Mapping[str, Bound] | None
    starts: int
    max_steps: int


DEFAULTS: ValvingSettings = {"over": None, "freeze": (), "bounds": None, "starts": 8, "max_steps": 200}
Target: TypeAlias = AbstractDamper | BenchRun | Sequence[BenchRun] | tuple[VectorLike, VectorLike]
# Of values: all forces, then those that the pressure lacks to that of a cavity, and their derivatives.
ForceOf = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class Loop(NamedTuple):
    """A motion with the wanted force at some of its instants."""

    dt: float
    stroke: Float[np.ndarray, " time"]
    velocity: Float[np.ndarray, " time"]
    force: Float[np.ndarray, " time"]
    first: int  # sample that is compared


class Wanted(NamedTuple):
    """The wanted force: points of the curve at constant velocity, then loops."""

    velocity: Float[np.ndarray, " points"]
    force: Float[np.ndarray, " points"]
    loops: tuple[Loop, ...]

    @property
    def all_forces(self) -> np.ndarray:
        """Every wanted force in one vector."""
        return np.concatenate([self.force, *(loop.force[loop.first :] for loop in self.loops)])

    @property
    def all_velocities(self) -> np.ndarray:
        """The velocity at each of them."""
        return np.concatenate([self.velocity, *(loop.velocity[loop.first :] for loop in self.loops)])


class _End(NamedTuple):
    """Where a search ended."""

    values: np.ndarray
    squares: float
    status: Status


@of_known_numbers
@with_defaults(DEFAULTS)
def valving(
    target: Target,
    start: MonoTube | TwinTube,
    *,
    velocities: VectorLike | None = None,
    motions: Sequence[tuple[float, float]] = (),
    tolerance: float = 0.03,
    substeps: int = 1,
    **settings: Unpack[ValvingSettings],
) -> ValvingResult:
    """Find the valving of a tube that gives a wanted force, or the nearest one within its bounds.

    Least squares of the force with exact derivatives by `jaxdamp.solve.BoundedLevenbergMarquardt`, from several starts.
    If the remaining error is above the tolerance, the result says in which range of velocity, by how much, and which
    bound prevents more.

    Curves are compared without cavities, which have no slope that leads out of them; what the pressure of the oil lacks
    to that of a cavity counts as an error, as a force on the area of the chamber. The error that is stated is that with
    cavities that have just opened, the largest one, and a sentence says where one opens.

    The force has kinks where valves open, and rises within a sample or two where a cavity closes, so the sum of squares
    has narrow local minima. Where a search ends, each parameter is therefore changed by 1 and 10 %, up and down, and
    the search continues from the best of these as long as one of them has a smaller error.

    Arguments:
        target: the wanted force: a law; a force-velocity curve `(velocities [m/s], forces [N])`; or one or more
            measured records, with hysteresis. It holds the gas force at mid-stroke, which the damper has.
        start: the damper to start from, with the geometry that is to stay.
        velocities: of the curve of a law [m/s]; −1 to 1 m/s if left out.
        motions: of a law also loops of sinusoidal motion, `[(frequency [Hz], amplitude [m]), ...]`, for its hysteresis.
        tolerance: largest error of a feasible valving: RMS over RMS of the wanted force.
        substeps: steps between two samples of a record, as in `respond`.
        settings: keywords, all optional: `over`, the parameters to choose, all of the valves and the gas pressure if
            left out, `freeze` and `bounds`, as in `minimise`; `starts`, the number of starts, 8 if left out;
            `max_steps`, the largest number of steps from each, 200 if left out.

    Returns:
        The damper with its error, the parameters with their bounds, and the parts of the target out of reach.

    Raises:
        ValueError: a target of another kind or without force; `motions` beside records; a motion beyond the strokes of
            the damper; what `minimise` refuses of `over`, `freeze` and `bounds`.

    >>> wanted = MonoTube.reference().incompressible()
    >>> chosen = ["bleed_area", "*_opening_pressure"]
    >>> result = valving(wanted, MonoTube.reference(), velocities=[-0.8, -0.3, -0.1, 0.1, 0.3, 0.8], over=chosen)
    >>> result.feasible, result.rmse < 1.0
    (True, True)
    """
    check_module("start", start, (MonoTube, TwinTube), "valving(target, start)")
    valves = ["piston.*", *["base.*"] * isinstance(start, TwinTube)]
    over = [*valves, "gas.pressure"] if settings["over"] is None else settings["over"]
    _checks.positive("tolerance", tolerance)
    starts, max_steps = settings["starts"], settings["max_steps"]
    _checks.counts(starts=starts, substeps=substeps, max_steps=max_steps)
    wanted = _wanted(target, start, velocities, motions)
    size = float(np.sqrt(np.mean(wanted.all_forces**2)))
    if not size > 0.0:
        _checks.refuse("target", "have a force", "zero everywhere")
    space = search_range(start, over, settings["freeze"], settings["bounds"])
    charge = np.array([name == "gas.pressure" for name in space.free.names])  # which must stay above that of a cavity
    cavity = (1.0 + INSIDE) * float(start.cavitation_pressure)
    space = dataclasses.replace(space, lower=np.where(charge, np.maximum(space.lower, cavity), space.lower))
    force_of = _forces(space.free, wanted, substeps)
    best = _best(space, force_of, wanted, starts, max_steps, CLOSE_ENOUGH * tolerance)
    if best is None:
        _checks.refuse("start", "give a finite force", start, "Widen its valves, or shorten the motion.")
    compared, slopes = (values[: wanted.all_forces.size] for values in force_of(best.values))
    law = space.free.build(jnp.asarray(best.values, space.free.values.dtype))
    reached, cavities = with_cavities(law, wanted.velocity, compared, CAVITY * tolerance * size)
    error = reached - wanted.all_forces
    full = np.where(cavities, 0.0, error)  # where no valve has an effect, nothing is to be said of its bound
    parameters = tuple(
        ValveParameter(c.name, c.unit, c.before, c.after, c.lower, c.upper, c.note, p.meaning)
        for c, p in zip(space.changes(best.values), space.free.owners, strict=True)
    )
    rmse = float(np.sqrt(np.mean(error**2)))
    far = rmse > tolerance * size
    return ValvingResult(
        law=law,
        start=start,
        parameters=parameters,
        velocity=wanted.all_velocities,
        target_force=wanted.all_forces,
        force=reached,
        curve_points=len(wanted.velocity),
        loop_lengths=tuple(len(loop.force) - loop.first for loop in wanted.loops),
        rmse=rmse,
        error_percent=100.0 * rmse / size,
        tolerance=tolerance,
        out_of_reach=_out_of_reach(wanted, full, slopes, parameters, tolerance * size) if far else (),
        status=best.status,
        cavities=cavities,
    )


def _best(
    space: SearchRange, force_of: ForceOf, wanted: Wanted, starts: int, max_steps: int, close: float
) -> _End | None:
    """The best end of searches from several starts, until an error relative to the wanted force is close enough."""
    best: _End | None = None
    forces = np.pad(wanted.all_forces, (0, 2 * wanted.velocity.size))  # and no lack of pressure
    with Progress("Choosing the valving") as line:
        for number, begin in enumerate(_starts(space, starts)):
            line(f"start {number + 1} of {starts}")
            end = _search(space, force_of, forces, begin, max_steps)
            if np.isfinite(end.squares) and (best is None or end.squares < best.squares):
                best = end
            if best is not None and best.squares < close**2 * np.sum(forces**2):
                break
    return best


def _wanted(
    target: Target, start: MonoTube | TwinTube, velocities: VectorLike | None, motions: Sequence[tuple[float, float]]
) -> Wanted:
    """The target as points and loops."""
    if isinstance(target, AbstractDamper):
        points = np.asarray(VELOCITIES if velocities is None else velocities, float)
        if not (points.size or motions):
            _checks.refuse("velocities", "hold one or more without `motions`", points)
        curve = np.asarray(quasi_static(target, points).force, float)
        if not np.all(np.isfinite(curve)):
            _checks.refuse("target", "have a force at every velocity", curve, "Choose others by `velocities`.")
        return Wanted(points, curve, tuple(_loop(target, start, *motion) for motion in motions))
    if motions or velocities is not None:
        must = "be left out unless the target is a law"
        _checks.refuse("motions" if motions else "velocities", must, motions or velocities)
    if isinstance(target, tuple):
        return _points(target)
    runs = as_runs(target, "target", "valving(law or (velocities, forces) or records, start)")
    if not runs:
        _checks.refuse("target", "hold a record", _checks.described(target), "`bench.read(paths)` gives records.")
    loops = [(r, float(r.time[-1] - r.time[0]) / (len(r.time) - 1)) for r in runs]
    cut = tuple(Loop(dt, r.stroke, r.velocity, r.force, int(SETTLING * len(r.time))) for r, dt in loops)
    return Wanted(np.zeros(0), np.zeros(0), cut)


def _points(target: tuple[object, ...]) -> Wanted:
    """Velocities and forces as a target."""
    shapes = [np.asarray(values).shape for values in target]
    if len(shapes) != 2 or len(shapes[0]) != 1 or shapes[0] != shapes[1] or shapes[0] == (0,):
        _checks.refuse("target", "be velocities, one or more, and as many forces", _checks.described(target))
    points, curve = (np.asarray(values, float) for values in target)
    _checks.finite("target", np.concatenate([points, curve]))
    return Wanted(points, curve, ())


def _loop(target: AbstractDamper, start: MonoTube | TwinTube, frequency: float, amplitude: float) -> Loop:
    """Two cycles of a sine, the second of which is compared."""
    _checks.positive("motions", np.array([frequency, amplitude]))
    steps = max(CYCLE, int(np.ceil(1.0 / (frequency * LONGEST_STEP))))
    dt = 1.0 / (frequency * steps)
    angle = 2.0 * np.pi * np.arange(2 * steps + 1) / steps
    ahead = np.round(np.cos(angle), 15)  # zero where the motion turns, so that no rounding error is a velocity
    stroke, velocity = amplitude * np.sin(angle), 2.0 * np.pi * frequency * amplitude * ahead
    time = dt * np.arange(len(angle))
    respond(start, time, stroke, velocity, state=start.state_at_rest(stroke[0]))  # refuses strokes beyond its chambers
    wanted = respond(target, time, stroke, velocity, state=target.state_at_rest(stroke[0]))
    return Loop(dt, stroke, velocity, np.asarray(wanted, float), steps)


def _forces(free: FreeParameters, wanted: Wanted, substeps: int) -> ForceOf:
    """Every row of a search as a function of the values of the free parameters, with derivatives."""

    def marched(law: MonoTube | TwinTube, loop: Loop) -> Array:
        dt, stroke, velocity = (jnp.asarray(values) for values in (loop.dt, loop.stroke, loop.velocity))
        return march(law, dt, stroke, velocity, substeps)[loop.first :]

    @eqx.filter_jit
    def forces(free: FreeParameters, values: Array) -> tuple[Array, Array]:
        def one(values: Array) -> Array:
            law = free.build(values)
            still, velocity = law.incompressible(), jnp.asarray(wanted.velocity)
            curve = jax.vmap(lambda v: still.force(0.0, v, still.initial_state()))(velocity)
            return jnp.concatenate([curve, *(marched(law, loop) for loop in wanted.loops), lacking(law, velocity)])

        return with_jacobian(one)(values)

    def evaluate(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        computed = forces(free, jnp.asarray(values, free.values.dtype))
        return np.asarray(computed[0], np.float64), np.asarray(computed[1], np.float64)

    return evaluate


def _starts(space: SearchRange, count: int) -> list[np.ndarray]:
    """The given start, and others around it by a factor of up to `APART`, the same ones each time."""
    shares = np.random.default_rng(0).uniform(size=(count - 1, len(space.start)))
    moved = space.start * APART ** (2.0 * shares - 1.0)
    return [space.start, *np.clip(moved, space.lower, space.upper)]


def _search(space: SearchRange, force_of: ForceOf, wanted: np.ndarray, begin: np.ndarray, max_steps: int) -> _End:
    """Least squares within the bounds from one start, and again from lower points beside its end."""
    size = float(np.linalg.norm(wanted))
    precision = float(jnp.finfo(space.free.values.dtype).eps)
    solver = BoundedLevenbergMarquardt(
        lower=space.lower / space.unit, upper=space.upper / space.unit, precision=precision
    )

    def at(y: np.ndarray, lanes: np.ndarray) -> tuple[Linearisation, np.ndarray]:
        force, slopes = force_of(np.clip(y[0] * space.unit, space.lower, space.upper))
        rows = np.concatenate([slopes * space.unit, (force - wanted)[:, None]], axis=1) / size
        free = np.zeros((1, 0)), np.zeros((1, 0, y.shape[1]))
        return Linearisation(triangle(rows)[None], *free, np.array([float(wanted.size)])), (force - wanted)[None]

    def squares(values: np.ndarray) -> float:
        return float(np.sum((force_of(values)[0] - wanted) ** 2))

    changes = 1.0 + np.array([*HOPS, *(-hop for hop in HOPS)])[:, None, None] * np.eye(len(begin))
    values = begin
    while True:
        end = least_squares_on_host(at, solver, (values / space.unit)[None], max_steps)
        values = np.clip(end.y[0] * space.unit, space.lower, space.upper)
        reached = float(np.sum(end.aux**2))
        near = np.clip(values * changes.reshape(-1, len(begin)), space.lower, space.upper)
        others = [squares(point) for point in near]
        if not min(others) < (1.0 - LOWER) * reached:
            return _End(values, reached, end.status[0])
        values = near[int(np.argmin(others))]


def _out_of_reach(
    wanted: Wanted, error: np.ndarray, slopes: np.ndarray, parameters: Sequence[ValveParameter], allowed: float
) -> tuple[OutOfReach, ...]:
    """The ranges of velocity in rebound and in compression where the error is large, with what prevents less."""
    velocity, parts = wanted.all_velocities, []
    for side, inside in (("rebound", velocity > 0.0), ("compression", velocity < 0.0)):
        far = inside & (np.abs(error) > allowed)
        if not far.any():
            continue
        square = float(np.sum(error[far] ** 2))
        # decrease of the squared error there, relative to it, if a parameter could grow by 100 %
        gain = {p.name: float(-2.0 * error[far] @ slopes[far, i] * p.value / square) for i, p in enumerate(parameters)}
        binding = {
            p.name: abs(gain[p.name])
            for p in parameters
            if (("upper" in p.note and gain[p.name] > BINDING) or ("lower" in p.note and gain[p.name] < -BINDING))
        }
        worst = int(np.argmax(np.where(far, np.abs(error), 0.0)))
        speeds = np.abs(velocity[far])
        order = tuple(sorted(binding, key=lambda name: -binding[name]))
        parts.append(
            OutOfReach(
                side, float(speeds.min()), float(speeds.max()), float(error[worst]), float(velocity[worst]), order
            )
        )
    return tuple(parts)

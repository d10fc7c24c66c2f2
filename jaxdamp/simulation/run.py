"""`simulate`: a vehicle on a road."""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Literal, Unpack, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types, check_module
from jaxdamp._settings import with_defaults
from jaxdamp._traced import at_compile_time, behind, is_traced
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.dampers import coverage, warn_outside
from jaxdamp.parameters import modules_inside
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation.engine import AbstractEngine, RunState, check_control, check_demands, chosen_engine
from jaxdamp.simulation.equations import Equations, RoadEdges
from jaxdamp.simulation.exponential import Exponential
from jaxdamp.simulation.notes import range_sentences
from jaxdamp.simulation.observer import recorded
from jaxdamp.simulation.response import Response
from jaxdamp.simulation.ride_metrics import first_rows
from jaxdamp.simulation.settings import SIMULATION, SimulationSettings
from jaxdamp.simulation.stability import known_system, rounded_down
from jaxdamp.simulation.step_size import RunCheck
from jaxdamp.simulation.wheels import axle_timing, heights_under_wheels
from jaxdamp.vehicles import AbstractVehicle, System, refuse_restless, static_equilibrium


@overload
def simulate(
    vehicle: AbstractVehicle,
    road: AbstractRoad,
    *,
    return_state: Literal[False] = ...,
    **settings: Unpack[SimulationSettings],
) -> Response: ...
@overload
def simulate(
    vehicle: AbstractVehicle, road: AbstractRoad, *, return_state: Literal[True], **settings: Unpack[SimulationSettings]
) -> tuple[Response, RunState]: ...
@with_defaults(SIMULATION)
def simulate(
    vehicle: AbstractVehicle, road: AbstractRoad, *, return_state: bool = False, **settings: Unpack[SimulationSettings]
) -> Response | tuple[Response, RunState]:
    """Drive a vehicle over a road.

    The vehicle starts at rest in its static equilibrium on the road's first heights, or as `start` says. The road is
    taken as linear between instants.

    With `state` a run goes on where an earlier one stopped (`return_state`): the motion, the states of the laws, what
    the engine remembers, and the place on the road. With fixed steps parts are the whole run to rounding; an `Adaptive`
    engine chooses its steps anew, and parts agree within its tolerances. The vehicle may differ in its numbers, such as
    the command of a damper. Metrics of a part are those of the part alone, with weightings from rest; displacements
    count from the static equilibrium on the heights where the first part began.

    Arguments:
        vehicle: any vehicle, with its laws.
        road: heights under its wheels over time: one track, or a left-hand and a right-hand one. It reaches one axle
            after the other, delayed by `vehicle.axle_positions` and the road's speed; `roads.delayed` has other
            delays, `roads.in_phase` none. Motions over time alone have a column for each of `vehicle.wheel_names`.
        return_state: whether to return where this run stopped, too.
        settings: keywords, all optional: `duration`, `dt` and `engine` (see `Run`); `start`, `state`, `substeps` and
            `every` (see `SimulationSettings`).

    A damper that leaves the range that its law was fitted to (`law.fitted_to`) gives an `OutsideFittedRangeWarning`
    and a sentence in `response.notes`; `response.range_use()` has the numbers.

    Returns:
        The response at `round(duration/dt) + 1` instants, or one in `every` of them and the first; without a `duration`
        at those up to the end of the road. With `return_state` a pair of it and the state at the last instant.

    Raises:
        ValueError: a step longer than the spacing of a sampled road, or too long for the vehicle; no duration, a road
            of other tracks than wheels, a road without a speed under several axles, an unknown coordinate, a vehicle
            without equilibrium, instants that cannot be divided by `every`, a run that diverged; a state of another
            kind of vehicle or engine.

    >>> from jaxdamp import roads, vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> response = simulate(car, roads.cosine_bump(0.05, start=0.5, duration=0.25), duration=3.0)
    >>> round(float(response.metrics()["working_space_peak_to_peak"]), 3)
    0.072
    """
    duration, dt, engine, substeps = settings["duration"], settings["dt"], settings["engine"], settings["substeps"]
    start, state, every = settings["start"], settings["state"], settings["every"]
    check_module("vehicle", vehicle, (AbstractVehicle,), "simulate(vehicle, road)")
    check_module("road", road, (AbstractRoad,), "simulate(vehicle, road)")
    refuse_stacked(vehicle)
    if engine is not None:
        check_module("engine", engine, (AbstractEngine,), "simulate(vehicle, road, engine=...)")
    engine, dt = chosen_engine(engine, Exponential(substeps=substeps), dt, substeps)
    system = vehicle.system()
    if state is not None:
        _check_state(state, start, engine, system)
    begins = None if state is None else state.time
    time, heights = sampled(vehicle, road, duration, dt, begins)
    goes_on = (state is not None, return_state)
    check_control(engine, system, dt, (time.size - 1) * dt, part=any(goes_on))
    _strides(time.size - 1, every, dt)
    begin = None if start is None else _displaced(vehicle, heights[0], start)
    engine = engine.prepared(run_check(vehicle, system, road, heights, dt, begin, begins))
    edges = _edges(vehicle, road, time, heights, goes_on)
    with engine.naming_derivatives():
        step = jnp.asarray(dt, dtype=float)
        saved, status = recorded(engine, system, heights, step, begin if state is None else state, every, edges)
    check_demands(system, time[::every], saved.motion, saved.commands)
    motion = behind(saved.motion)
    if motion is not None and not np.all(np.isfinite(last := motion[..., -1, :])):
        if not np.all(np.isfinite(motion[..., 0, :])):
            refuse_restless(vehicle)
        remedy = " ".join([*filter(None, map(coverage, system.laws)), engine.remedy(status, dt)])
        _checks.refuse("vehicle", "have a finite response", f"at {last} (position, rate) at the end", remedy)
    timing, first = axle_timing(vehicle, road), None if state is None else state.first
    response = Response(vehicle, system, time[::every], *saved[:5], timing, every * dt, every, saved.commands, first)
    warn_outside(range_sentences(response.range_use()))
    if not return_state:
        return response
    if saved.last is None:
        remedy = "Its `run` must fill in `Outcome.last`."
        _checks.refuse(
            "return_state", f"be left out beside a {type(engine).__name__}, which does not say", True, remedy
        )
    return response, RunState(time[-1], saved.last, first_rows(response), dt / engine.step_count, type(engine).__name__)


def _check_state(state: RunState, start: Mapping[str, float] | None, engine: AbstractEngine, system: System) -> None:
    """Refuse a state that no run of this vehicle by this engine can go on from."""
    check_module("state", state, (RunState,), "simulate(vehicle, road, state=...)")
    if start is not None:
        _checks.refuse("start", "be left out of a run that goes on from a `state`", start)
    if state.engine != type(engine).__name__:
        _checks.refuse("state", f"be of a run by {type(engine).__name__}", f"of one by {state.engine}")
    now, ports = state.now, Equations(system).ports
    of_vehicle = [(2 * len(system.layout.coordinates),), *map(jnp.shape, jax.eval_shape(lambda: ports.initial()))]
    of_state = [*map(jnp.shape, (now.motion, *now.states))]
    if of_state != of_vehicle:
        must = f"have motion and states of the shapes {of_vehicle}, as the vehicle"
        _checks.refuse("state", must, of_state, "Go on with the same kind of vehicle and laws.")
    _checks.finite("state", now.motion)


def _edges(
    vehicle: AbstractVehicle,
    road: AbstractRoad,
    time: Signal,
    heights: Float[Array, "time wheels"],
    goes_on: tuple[bool, bool],
) -> RoadEdges | None:
    """The road an instant before and after a run that goes on there; straight where the road itself ends."""
    if not any(goes_on):
        return None
    span, slack = [behind(end) for end in road.span], 1e-6

    def at(beyond: Scalar, straight: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        instant = behind(beyond)
        if instant is not None:
            inside = [side * (instant - end) for side, end in zip((1, -1), span, strict=True) if end is not None]
            if any(np.any(length < -slack) for length in inside):
                return straight
        there = heights_under_wheels(vehicle, road, beyond[None])[0]
        return jnp.where(jnp.isfinite(there), there, straight)

    before = at(2.0 * time[0] - time[1], 2.0 * heights[0] - heights[1]) if goes_on[0] else None
    after = at(2.0 * time[-1] - time[-2], 2.0 * heights[-1] - heights[-2]) if goes_on[1] else None
    return RoadEdges(before, after)


def _strides(count: int, every: int, dt: float) -> None:
    """Whether so many steps are whole strides."""
    if not isinstance(every, int | np.integer) or every < 1:
        _checks.refuse("every", "be a whole number of instants, 1 or more", repr(every))
    if count % every:
        remedy = f"Pass `duration={count // every * every * dt:g}` or `duration={-(-count // every) * every * dt:g}`."
        _checks.refuse("every", f"divide the {count} steps of the run", every, remedy)


def sampled(
    vehicle: AbstractVehicle, road: AbstractRoad, duration: float | None, dt: float, begins: Scalar | None = None
) -> tuple[Signal, Float[Array, "time wheels"]]:
    """The instants of a run and the heights under the wheels, with the checks of `simulate`.

    Arguments:
        vehicle: any vehicle.
        road: under its wheels.
        duration: length of the run [s]; if left out, as many whole steps as the road has.
        dt: spacing of the instants [s].
        begins: the first instant [s] of a run that goes on; zero if left out.
    """
    first, beyond = np.zeros(()) if begins is None else behind(begins), 0.0
    whole: Callable[[float], int] = round
    if duration is None and road.duration is not None and first is not None and not first.ndim:
        duration = road.duration - float(first)
        beyond = 1e-9 * road.duration + float(np.finfo(first.dtype).eps * first)  # what rounding takes off it
        whole = math.floor  # not beyond the road
    if duration is None:
        _checks.refuse("duration", "be given for a road without an end of its own", None, "Pass `duration=10.0`.")
    duration = _checks.plain_number("duration", duration)
    _checks.positive("duration", duration)
    _checks.positive("dt", dt)
    longest = road.longest_run
    if longest is not None and first is not None and np.max(first) + duration > longest * (1 + 1e-9):
        must = f"not be longer than the random road, which repeats after {longest:g} s"
        remedy = f"Make the road with `duration={duration:g}`, or with a greater `length`."
        _checks.refuse("duration", must, f"{duration:g} s", remedy)
    if dt > duration:
        _checks.refuse("dt", f"be shorter than the run of {duration:g} s", dt)
    if road.grid is not None and dt > road.grid * (1 + 1e-9):
        remedy = f"Pass `dt={road.grid:g}` or less, or make the road with a coarser grid."
        _checks.refuse("dt", f"not be longer than the road's grid of {road.grid:g} s", dt, remedy)
    event = road.shortest_event
    if event is not None and event < 2 * dt * (1 - 1e-9):
        must = f"be at most half the time over the shortest bump, {event:.3g} s, which steps would skip"
        _checks.refuse("dt", must, f"{dt:g} s", f"Pass `dt={rounded_down(event / 8):g}`, or make the bump longer.")
    time = _instants(whole((duration + beyond) / dt), dt, begins)
    return time, heights_under_wheels(vehicle, road, time)


@jax.jit(static_argnames="count")
def _instants(count: int, dt: ScalarLike, begins: Scalar | None) -> Signal:
    time = jnp.arange(count + 1, dtype=float)
    if begins is not None:  # a whole number of steps, so that instants are those of the whole run to the last bit
        steps = begins / dt
        time = time + jnp.where(jnp.abs(steps - jnp.round(steps)) < 1e-6, jnp.round(steps), steps)
    return time * dt


def refuse_stacked(vehicle: AbstractVehicle) -> None:
    """Refuse a vehicle or a law in it that stands for several, as `jax.vmap` of a constructor makes it."""
    for _, module in modules_inside(vehicle):
        check_field_types(module)


def run_check(
    vehicle: AbstractVehicle,
    system: System,
    road: AbstractRoad,
    heights: Float[Array, "time wheels"],
    dt: float,
    start: Float[Array, " n"] | None = None,
    begins: Scalar | None = None,
) -> RunCheck:
    """The checks of a run before it is driven, with known numbers as far as they are not arguments of `jax.jit`."""
    count = heights.shape[0] - 1
    if is_traced(heights) and not is_traced((vehicle, road, begins)):
        with at_compile_time():
            heights = sampled(vehicle, road, count * dt, dt, begins)[1]
    half = functools.partial(half_sampled, vehicle, road, count, dt, begins)
    system = known_system(vehicle) if is_traced(system) else system
    return RunCheck(system, heights, half, dt, start, road.grid)


def half_sampled(
    vehicle: AbstractVehicle, road: AbstractRoad, count: int, dt: float, begins: Scalar | None = None
) -> Float[Array, "fine wheels"]:
    """The heights under the wheels of a run of so many steps at twice as many instants."""
    return sampled(vehicle, road, count * dt, 0.5 * dt, begins)[1]


def _displaced(
    vehicle: AbstractVehicle, road: Float[Array, " wheels"], start: Mapping[str, float]
) -> Float[Array, " n"]:
    """The motion (q, q̇) at rest in the static equilibrium, with other values of some coordinates."""
    names = vehicle.coordinates
    _checks.instance("start", start, Mapping, f'be coordinates by name, such as {{"{names[0]}": 0.1}}')
    for name, value in start.items():
        _checks.one_of("start", name, names)
        _checks.finite(f"start[{name!r}]", value)
        if shape := np.shape(value):
            _checks.refuse(f"start[{name!r}]", "be one number", f"of shape {shape}", "Use `jax.vmap` for many.")
    position = static_equilibrium(vehicle, road) | {name: jnp.asarray(v, dtype=float) for name, v in start.items()}
    return jnp.concatenate([jnp.stack([position[name] for name in names]), jnp.zeros(len(names))])

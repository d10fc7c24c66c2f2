"""What explains records: a law, a law on a machine that adds to its force, a vehicle with its sensors."""

import dataclasses
import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxdamp import _checks
from jaxdamp._types import Scalar, State, Vector
from jaxdamp.dampers import AbstractDamper, FittedRange, with_fitted_range, without_standard_errors
from jaxdamp.identify.initial_states import Cycle, periodic_state
from jaxdamp.parameters import (
    AbstractDeclared,
    FreeParameters,
    Module,
    get,
    matching,
    name_patterns,
    parameter,
    parameters,
    readable,
    with_values,
)
from jaxdamp.rig import Followed, Rig, Sensor, march
from jaxdamp.vehicles import AbstractVehicle


Given = TypeVar("Given")
Tree = TypeVar("Tree")
STARTS = "records."  # with which the paths of the states at the beginning of records begin


FORGOTTEN = 7.0  # time constants, after which 0.1 % is left of how a filter began
START_PATH = STARTS + "{}.initial_state"  # by the number of the record


@final
class RecordStart(Module):
    """The states of a law at the first sample of a record."""

    initial_state: Vector = parameter("", "state of the law at the beginning")


@final
class OnRig(Module):
    """A law on a machine; paths of parameters begin with `law.`, `rig.` and `records.`.

    Arguments:
        law: the law.
        rig: the machine, if there is one.
        records: how each record begins, if this is estimated; None where it is not known.
    """

    law: AbstractDamper
    rig: Rig | None
    records: tuple[RecordStart | None, ...] = ()


Model = AbstractDamper | OnRig


@final
class InitialMotion(AbstractDeclared):
    """How a record begins: displacements and rates of all coordinates, beside rest on the first heights.

    Arguments:
        position: displacement of each coordinate from the equilibrium [m, rad].
        rate: rate of each coordinate [m/s, rad/s].
    """

    position: Vector = parameter("", "displacement of a coordinate at the first sample, in m or rad")
    rate: Vector = parameter("", "rate of a coordinate at the first sample, in m/s or rad/s")


@final
class VehicleTest(Module):
    """A vehicle with the sensors of its records; paths of parameters begin with `vehicle.`, `sensors.` and so on.

    Arguments:
        vehicle: the vehicle.
        sensors: the sensor of a channel, by the channel's name; channels without one are shown as they are.
        starts: the initial motion of each record; empty if all begin at rest.
        rig: the test machine of the bench records of its damper, if it adds to the force.
    """

    vehicle: AbstractVehicle
    sensors: dict[str, Sensor]
    starts: tuple[InitialMotion, ...] = ()
    rig: Rig | None = None

    def __repr__(self) -> str:
        return readable(self)


def fitted_part(model: PyTree) -> PyTree:
    """What a user asked to be fitted: the law or the vehicle, without machine, sensors and beginnings of records."""
    return model.vehicle if isinstance(model, VehicleTest) else law_of(model)


def on_rig(law: AbstractDamper, rig: Rig | None, records: Sequence[RecordStart | None] = ()) -> Model:
    """The law, on the machine if there is one, with the beginnings of the records if they are estimated."""
    return law if rig is None and not records else OnRig(law, rig, tuple(records))


class OwnNames(NamedTuple):
    """Names of a law or a vehicle, found beside machine or sensors, where they begin with "law." or "vehicle."."""

    alone: list[str]  # the paths of the law or the vehicle
    beside: list[str]  # those with machine and sensors
    inside: str = "law."

    def find(self, argument: str, names: Iterable[str]) -> list[str]:
        """The names, with "law." or "vehicle." before those that are a whole path of it.

        Without it the last part of another path would count too: "stiffness" is that of a `SeriesSpring` alone.

        A name that is one thing for the law alone and another beside the machine is refused, such as "law.lag_time" of
        `Lag(Lag(law))`.
        """
        return [self._one(argument, name) for name in name_patterns(argument, names)]

    def find_keys(self, argument: str, given: Mapping[str, Given] | None) -> Mapping[str, Given]:
        """A mapping by name with the names that `find` returns, also as values (ties); empty for none."""
        if not given:
            return {}
        if not isinstance(given, Mapping):
            return given  # refused in words of its own where it is used
        values = [self._one(argument, value) if isinstance(value, str) else value for value in given.values()]
        names = self.find(argument, list(given))
        if len(set(names)) < len(names):
            two = [written for written, name in zip(given, names, strict=True) if names.count(name) > 1]
            _checks.refuse(argument, "name each number once", " and ".join(map(repr, two)), "Keep one of them.")
        return dict(zip(names, values, strict=True))  # type: ignore[arg-type]

    def _one(self, argument: str, name: str) -> str:
        if not self.alone:
            return name
        if name in self.alone and name not in self.beside:
            return f"{self.inside}{name}"
        short = [f"{self.inside}{path}" for path in matching(self.alone, name)]
        long = [path for path in matching(self.beside, name) if path.startswith(self.inside)]
        if short and long and short != long:
            what, with_what = ("law", "a machine") if self.inside == "law." else ("vehicle", "sensors")
            remedy = (
                f"It is {', '.join(short)} of the {what}, but {', '.join(long)} beside {with_what}, where all paths"
            )
            single = f"Write {long[0].removeprefix(self.inside)!r} or {short[0]!r}."
            single = "Write the names that you mean." if "*" in name else single
            remedy += f' of the {what} begin with "{self.inside}". {single}'
            _checks.refuse(argument, "have names with one meaning", repr(name), remedy)
        return name


def own_names(model: Model | VehicleTest) -> OwnNames:
    """How names of the law or the vehicle of a model are found in it."""
    part = fitted_part(model)
    alone, with_machine = ([] if part is model else [p.path for p in parameters(tree)] for tree in (part, model))
    return OwnNames(alone, with_machine, "vehicle." if isinstance(model, VehicleTest) else "law.")


def starts_in(model: object) -> tuple[RecordStart | None, ...]:
    """How each record begins, if this is estimated; of a vehicle none."""
    return model.records if isinstance(model, OnRig) else ()


def of_record(model: Model, number: int) -> Model:
    """The model of one record: the same, with the beginning of this record only."""
    starts = starts_in(model)
    return dataclasses.replace(model, records=(starts[number],)) if starts else model  # type: ignore[call-arg]


def law_of(model: Model) -> AbstractDamper:
    """The law itself."""
    return model.law if isinstance(model, OnRig) else model


def rig_of(model: Model) -> Rig | None:
    """The machine, if there is one."""
    return model.rig if isinstance(model, OnRig) else None


def of_law(free: FreeParameters) -> tuple[FreeParameters, Bool[np.ndarray, " free"]]:
    """The free parameters of the law alone, and which of the numbers they are."""
    law = law_of(free.tree)
    if law is free.tree:
        return free, np.ones(free.values.size, bool)
    start = len("law.")
    columns = np.array([p.path.startswith("law.") for p in free.owners], bool)
    chosen = [dataclasses.replace(p, path=p.path[start:]) for p in free.chosen if p.path.startswith("law.")]
    ties = [(path[start:], leader[start:]) for path, leader in free.ties if path.startswith("law.")]
    return FreeParameters(law, tuple(chosen), tuple(ties)), columns


def effects_of(model: Model) -> tuple[str, ...]:
    """What of the machine depends on more than the instant (`Rig.effects`); asked of known numbers, not traced ones."""
    rig = rig_of(model)
    return () if rig is None else rig.effects()


def count_states(model: Model) -> int:
    """How many states the law has; nothing is compiled for that."""
    leaves, structure = jax.tree.flatten(law_of(model))
    return _count_states(structure, *(_type(leaf) if eqx.is_array_like(leaf) else leaf for leaf in leaves))


def _type(number: object) -> jax.ShapeDtypeStruct:
    kind = jax.typeof(number)
    return jax.ShapeDtypeStruct(kind.shape, kind.dtype)


@functools.lru_cache(maxsize=256)
def _count_states(structure: Any, *leaves: object) -> int:
    """It is asked ten times in a fit, of laws that differ in their numbers alone."""
    law: AbstractDamper = structure.unflatten(leaves)
    return int(eqx.filter_eval_shape(lambda law: law.initial_state(), law).size)


def is_memoryless(model: Model) -> bool:
    """Whether the force depends on stroke and velocity of the instant alone."""
    return count_states(model) == 0 and not effects_of(model)


def can_rest(model: Model) -> bool:
    """Whether the law has states, which rest can tell of: friction that holds, a force that relaxes.

    Without them its force at rest is one number, while dry friction holds any force up to its own.
    """
    return count_states(model) > 0


def initial_state_for(model: Model, initial_state: str) -> str:
    """How records start with this model: there is nothing to be estimated for a law without states."""
    return initial_state if can_rest(model) or initial_state != "estimated" else "warm_up"


def with_range(model: Model, fitted_to: FittedRange) -> Model:
    """The same with the range that the law was fitted to, and without standard errors of an earlier fit."""
    return on_rig(with_fitted_range(without_standard_errors(law_of(model)), fitted_to), rig_of(model), starts_in(model))


def with_means(model: Tree, paths: Sequence[str]) -> Tree:
    """The model with the mean over the records at paths where it has a value for each."""
    return with_values(model, {path: jnp.mean(get(model, path)) for path in paths})


def spread(model: Tree, paths: Sequence[str], records: int) -> Tree:
    """The model with a vector of values, one for each record, at some paths."""
    return with_values(model, {path: jnp.full(records, get(model, path)) for path in paths})


def memory_of_machine(model: Model) -> float:
    """How long the machine remembers the motion before [s]: zero without delay and lags, little with short ones."""
    rig = rig_of(model)
    if rig is None:
        return 0.0
    lags = (np.max(np.asarray(lag)) for lag in (rig.force_lag, rig.command_lag))
    return float(FORGOTTEN * max(lags) + np.max(np.abs(np.asarray(rig.force_delay))))


def blind_end(model: Model, dt: float) -> int:
    """So many samples at the end of a record cannot be predicted: their force needs the motion behind the end."""
    rig = rig_of(model)
    if rig is None or not {"inertia", "delay"} & {*rig.effects()}:  # the others need the motion before
        return 0
    return 2 + int(np.ceil(np.max(np.abs(np.asarray(rig.force_delay))) / dt))


def marched(
    model: Model,
    effects: tuple[str, ...],
    dt: Array,
    stroke: Float[Array, " time"],
    velocity: Float[Array, " time"],
    followed: Followed,
    substeps: int,
    state: State | None,
) -> Float[Array, " time"]:
    """Force [N] in a record with this motion, for use inside compiled functions, from this state if one is given."""
    law, rig = law_of(model), rig_of(model)
    if rig is None:
        return march(law, dt, stroke, velocity, substeps, followed, state)
    return rig.march(law, effects, dt, stroke, velocity, followed, substeps, state).force


def state_history(
    model: Model, dt: Array, stroke: Float[Array, " time"], velocity: Float[Array, " time"], followed: Followed
) -> Float[Array, "time states"]:
    """The states of the law at every sample of a motion [m, m/s] that begins at rest, under what is measured first."""
    law = followed.first(law_of(model))

    def step(state: State, ends: tuple[Array, Array, Array, Array]) -> tuple[State, State]:
        x0, v0, x1, v1 = ends
        state = law.advance(x0, v0, x1, v1, state, dt)
        return state, state

    begin = law.state_at_rest(stroke[0])
    ends = (stroke[:-1], velocity[:-1], stroke[1:], velocity[1:])
    return jnp.concatenate([begin[None], jax.lax.scan(step, begin, ends)[1]])


def initial_state(
    model: Model, effects: tuple[str, ...], first: Scalar, cycle: Cycle, followed: Followed
) -> tuple[State, Scalar]:
    """The states at the first stroke of a record: periodic, or at rest; and their change over the cycle."""
    rig = rig_of(model)
    if rig is not None:
        before = [jnp.concatenate([channel[:-1], channel]) for channel in (cycle.stroke, cycle.velocity)]
        stroke, velocity = rig.delayed_motion(effects, cycle.dt, *before)
        again = -cycle.stroke.size
        first = first - rig.stroke_offset
        cycle = cycle._replace(stroke=stroke[again:] - rig.stroke_offset, velocity=velocity[again:])
    law = followed.first(law_of(model))
    state, change = periodic_state(law, cycle)
    return jnp.where(cycle.periodic, state, law.state_at_rest(first)), jnp.where(cycle.periodic, change, 0.0)

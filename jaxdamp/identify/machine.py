"""The test machine of a fit: its start from the records, and the static force that only it can have."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, laws_inside
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.model import law_of, on_rig, rig_of, starts_in
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.several import Solution
from jaxdamp.identify.starting import LearntStart, Start, started
from jaxdamp.identify.stated import charged_apart
from jaxdamp.parameters import get, matching, parameters, real, with_values
from jaxdamp.rig import Rig


Machine = Rig | str | Sequence[str] | None

OFFSET = "offset"  # the machine of a comparison of laws: the least that any load cell adds
NEAR_REST = 0.1  # velocity, relative to its peak, below which the force shows gas, offset and springs
SMALL = 1e-3  # of the force: a start that is nearly zero
CALL = 'fit(law, runs, rig=["gas", "delay"])'
COMMAND_LAG = 5e-3  # s, start of the lag of an actuator: coils and valves have 2 to 20 ms
LARGE = 0.02  # of the standard deviation of the force, above which a static force is said


@dataclasses.dataclass(frozen=True)
class _Records:
    """What the records show of the machine before any fit."""

    level: float  # N, mean force near rest
    stiffness: float  # N/m, slope of the force over the stroke near rest
    force: float  # N, RMS about the level
    acceleration: float  # m/s², RMS
    lag: float  # s, of the force behind the velocity
    measured_temperature: bool


_Start = Callable[[_Records], Mapping[str, float]]
EFFECTS: dict[str, _Start] = {
    "offset": lambda r: {"force_offset": r.level},
    "gas": lambda r: {"gas_force": min(r.level, -SMALL * r.force)},
    "gas_stiffness": lambda r: {"gas_stiffness": max(r.stiffness, 1.0)},
    "friction": lambda r: {"friction": 0.05 * r.force},
    "mass": lambda r: {"moving_mass": 0.01 * r.force / r.acceleration},
    "delay": lambda r: {"force_delay": min(r.lag, 2e-3)},
    "lag": lambda r: {"force_lag": min(r.lag, 2e-3)},
    "command_lag": lambda _: {"command_lag": COMMAND_LAG},
    "stroke_offset": lambda r: {"stroke_offset": 1e-4},
    "heat": lambda r: (
        {"temperature_slope": 2e-3} | ({} if r.measured_temperature else {"heating": 2e-3, "cooling": 2e-3})
    ),
}
"""Effects of a machine by name, each with the numbers of `Rig` that describe it and their starts."""


def machine_names(argument: str, names: str | Sequence[str]) -> list[str]:
    """Names of effects, each once: "gas,delay" names two, "none" none.

    Arguments:
        argument: its name in messages.
        names: of the effects.

    Raises:
        ValueError: an unknown name.

    >>> machine_names("rig", "gas, delay")
    ['gas', 'delay']
    """
    words = [word.strip() for text in ([names] if isinstance(names, str) else names) for word in text.split(",")]
    for word in filter(None, words):
        _checks.one_of(argument, word, ("none", *EFFECTS))
    return [word for word in dict.fromkeys(words) if word not in ("", "none")]


def started_machine(rig: Machine, runs: Sequence[BenchRun]) -> Rig | None:
    """The machine with the starts of its free numbers; names get starts from the records."""
    if rig is None:
        return None
    if not isinstance(rig, Rig) and (isinstance(rig, str) or all(isinstance(name, str) for name in rig)):
        names = machine_names("rig", rig)
        refuse_lag_of_held("command_lag" in names, runs)
        shown = _shown(runs) if names else None
        starts = [EFFECTS[name](shown) for name in names] if shown else []
        return Rig(**{field: value for start in starts for field, value in start.items()}) if starts else None
    check_module("rig", rig, (Rig,), CALL)
    assert isinstance(rig, Rig)
    refuse_lag_of_held("command_lag" in free_fields(rig), runs)
    if not free_fields(rig):
        remedy = f"Give the numbers to be fitted a start, name effects as in `{CALL}`, or leave `rig` out."
        _checks.refuse("rig", "have a number that is not at its default", "one that adds nothing", remedy)
    return rig


def without_command_lag(rig: Machine) -> tuple[Machine, float]:
    """The machine as it was asked for, but without a lag of the actuator; and the start of this lag [s], 0 if none."""
    if isinstance(rig, Rig):
        held = dataclasses.replace(rig, command_lag=0.0)
        return (held if free_fields(held) else None), float(rig.command_lag)
    names = machine_names("rig", rig or ())
    return [name for name in names if name != "command_lag"], COMMAND_LAG * ("command_lag" in names)


def refuse_lag_of_held(asked: bool, runs: Sequence[BenchRun]) -> None:
    """Refuse a lag of the actuator where no record has a command that varies."""
    if asked and all(run.command_channel is None for run in runs):
        remedy = "Record the command as a channel, `BenchRun.command_channel`, or leave the lag out."
        _checks.refuse("rig", "have no `command_lag` beside commands that are held", "one with it", remedy)


class Beginning(NamedTuple):
    """A law to start from and the machine beside it."""

    law: AbstractDamper
    rig: Rig | None
    held: tuple[str, ...] = ()  # paths of constant forces of the law, zero since the machine has the static force


def started_on(law: Start, runs: Sequence[BenchRun], rig: Machine, named: Iterable[str] = ()) -> Beginning:
    """The law to start from and the machine beside it, which was asked for as `rig`.

    A law class or function gets the records without what the machine adds at rest. If the machine was asked for by
    names with an offset or gas force, this has the whole static force of the records: a constant force of the law, such
    as the preload of a `Spring`, is held at zero. The machine's is left out beside a law whose static force has a
    meaning of its own, such as the gas charge of a `MonoTube`, which is the points of a table together, or which the
    call gives a value or a name; but it stays where records state several charges, which tell the two apart.

    `named` are the parameters to which the call gives bounds, priors, partners or values by record.
    """
    machine = started_machine(rig, runs)
    bare, trained = without_machine(machine, runs), isinstance(law, LearntStart)
    begin = law.untrained(bare) if isinstance(law, LearntStart) else started(law, bare)
    if machine is not None and holds_static_force(rig) and begin.traits().contains_offset:
        constants = constant_forces(begin)
        stated = any(matching(constants or (), name.removeprefix("law.")) for name in named)
        if isinstance(law, AbstractDamper):
            stated |= any(float(get(begin, path)) != 0.0 for path in constants or ())
        if constants and not stated:
            begin = started(law, bare) if trained else begin
            zero = with_values(begin, {path: np.zeros_like(get(begin, path)) for path in constants})
            return Beginning(zero, machine, tuple(f"law.{path}" for path in constants))
        if not charged_apart(begin, runs):
            left = dataclasses.replace(machine, force_offset=Rig().force_offset, gas_force=Rig().gas_force)
            machine = left if free_fields(left) else None
    elif not trained:
        return Beginning(begin, machine)
    return Beginning(started(law, without_machine(machine, runs)), machine)


def constant_forces(law: AbstractDamper) -> list[str] | None:
    """Paths of the single numbers that only add a constant to the force; None if its static force is more than that."""
    paths = []
    for prefix, part in laws_inside(law):
        if part.inner_laws() or not part.traits().contains_offset:
            continue
        names = part.constant_forces()
        if not names or any(jnp.ndim(getattr(part, name)) for name in names):
            return None
        paths += [prefix + name for name in names]
    return paths


def free_fields(rig: Rig) -> list[str]:
    """The numbers of a machine that differ from their defaults; the others have no part in a fit."""
    pairs = zip(parameters(rig), parameters(Rig()), strict=True)
    return [p.path for p, default in pairs if np.asarray(p.value) != np.asarray(default.value)]


def absent_paths(rig: Rig | None) -> list[str]:
    """Paths of the numbers of a machine that are left at their defaults, and so have no part in a fit."""
    if rig is None:
        return []
    given = free_fields(rig)
    return [f"rig.{p.path}" for p in parameters(rig) if p.path not in given]


def without_machine(rig: Rig | None, runs: Sequence[BenchRun]) -> list[BenchRun]:
    """Records without gas force, gas stiffness and offset of a machine, from which a law can be started or drawn.

    Arguments:
        rig: the machine; None changes nothing.
        runs: the records.
    """
    if rig is None:
        return list(runs)
    gas, stiffness, offset = (float(a) for a in (rig.gas_force, rig.gas_stiffness, rig.force_offset))
    added = [gas + offset + stiffness * run.stroke for run in runs]
    return [dataclasses.replace(run, force=run.force - force) for run, force in zip(runs, added, strict=True)]


def _slowest(run: BenchRun) -> Bool[np.ndarray, " time"]:
    """The samples near rest; of a table that has none, the points nearest to it in both directions."""
    speed, near = np.abs(run.velocity), np.abs(run.velocity) < NEAR_REST * run.peak_velocity
    if near.any():
        return near
    return np.any(
        [speed == np.min(speed, where=side, initial=np.inf) for side in (run.velocity > 0, run.velocity < 0)], 0
    )


def _shown(runs: Sequence[BenchRun]) -> _Records:
    force, stroke = (np.concatenate([getattr(run, name) for run in runs]) for name in ("force", "stroke"))
    slow = np.concatenate([_slowest(run) for run in runs])
    level = float(np.mean(force[slow]))
    around = stroke[slow] - np.mean(stroke[slow])
    stiffness = float(around @ force[slow] / max(around @ around, np.finfo(float).tiny))
    acceleration = np.concatenate([np.gradient(run.velocity, run.time) for run in runs])
    rms = float(np.sqrt(np.mean((force - level) ** 2)))
    level = level if abs(level) > SMALL * rms else SMALL * rms  # zero would count as left out
    moving = max(float(np.sqrt(np.mean(acceleration**2))), np.finfo(float).tiny)
    return _Records(level, stiffness, rms, moving, lag_time(runs), any(run.temperature is not None for run in runs))


def lag_time(runs: Sequence[BenchRun]) -> float:
    """Delay [s] of the force behind the velocity, from the phase of their fundamentals: median of tan(φ)/ω."""
    times = []
    for run in runs:
        omega = 2 * np.pi * run.frequency
        turning = np.exp(-1j * omega * run.time) * np.hanning(len(run))
        velocity, force = (
            part @ turning for part in (run.velocity - run.velocity.mean(), run.force - run.force.mean())
        )
        lead = np.angle(velocity / force) if force else 0.0
        if 0.0 < lead < 1.4:
            times.append(np.tan(lead) / omega)
    return float(np.clip(np.median(times) if times else 1e-3, 1e-4, 0.1))


def holds_static_force(rig: Machine) -> bool:
    """Whether a machine was asked for by names, an offset or a gas force among them."""
    if rig is None or isinstance(rig, Rig):
        return False
    return bool({"offset", "gas"} & set(machine_names("rig", rig)))


def with_static_force_on_machine(problem: Problem, solution: Solution) -> tuple[Problem, Solution]:
    """A fitted table less its force at rest, which the machine gets: the same forces in other places.

    The points of a table may all move by one force, so that no single number of it could be held at zero in the fit.
    Other laws, and points with bounds, stay as they are.
    """
    free, model = problem.free, problem.free.tree
    law, rig = law_of(model), rig_of(model)
    places = [
        prefix + name
        for prefix, part in laws_inside(law)
        if not part.inner_laws()
        for name in part.constant_forces()
        if jnp.ndim(getattr(part, name))
    ]
    inside = "" if law is model else "law."
    moved = np.array([p.path == f"{inside}{places[0]}" for p in free.owners]) if len(places) == 1 else np.zeros(1, bool)
    domains = {p.domain.name for p in free.chosen if places and p.path == f"{inside}{places[0]}"}
    if not moved.any() or domains != {real.name} or problem.per_record or (rig is not None and rig.force_offset != 0.0):
        return problem, solution
    velocity = np.concatenate([run.velocity for run in problem.fitted_to])
    if not velocity.min() < 0.0 < velocity.max():
        return problem, solution
    nearest = float(velocity[velocity <= 0.0].max()), float(velocity[velocity >= 0.0].min())

    def at_rest(values: np.ndarray) -> float:
        """The force [N] between those at the slowest samples in both directions: zero velocity may not be sampled."""
        law = law_of(free.started_at(values).tree)
        forces = [force_at(law, v) for v in nearest]
        return float(np.interp(0.0, nearest, forces))

    unit = at_rest(np.asarray(free.values) + moved) - at_rest(np.asarray(free.values))

    def shifted(end: SearchEnd) -> SearchEnd:
        return end._replace(values=end.values - moved * at_rest(end.values) / unit)

    static = at_rest(solution.best.values)
    machine = dataclasses.replace(rig or Rig(), force_offset=static)
    chosen = tuple(dataclasses.replace(p, path=p.path if inside else f"law.{p.path}") for p in free.chosen)
    ties = free.ties if inside else tuple((f"law.{a}", f"law.{b}") for a, b in free.ties)
    best = shifted(solution.best)
    free = dataclasses.replace(free, tree=on_rig(law, machine, starts_in(model)), chosen=chosen, ties=ties)
    ends = tuple(best if end is solution.best else shifted(end) for end in solution.ends)
    return problem._replace(free=free.started_at(best.values)), solution._replace(best=best, ends=ends)


def force_at(law: AbstractDamper, velocity: float) -> float:
    """The force [N] at a velocity [m/s], stroke zero and the states of rest, in one program for all its operations."""
    return float(_force(law, jnp.asarray(np.asarray(velocity, float))))


@compiled_for_loops
def _force(law: AbstractDamper, velocity: Float[Array, ""]) -> Scalar:
    return law.force(0.0, velocity, law.initial_state())


def static_force_in_words(result: FitResult, runs: tuple[BenchRun, ...]) -> list[str]:
    """A sentence on a static force that is gas force or zero error, if it is large enough to matter."""
    offset = 0.0 if result.rig is None else float(np.mean(np.asarray(result.rig.force_offset)))
    small = LARGE * float(np.std(np.concatenate([run.force for run in runs])))
    if abs(offset) < small or charged_apart(result.law, runs):
        return []
    return [
        f"The static force of {offset:.0f} N is gas force or zero error of the load cell: these records cannot tell."
        " It is in `result.rig`, not in the law, so that a ride, a table or exported code is without it. Read the load"
        f" cell without the damper; `law + dampers.Spring(0.0, {offset:.0f})` is the damper if it is gas."
    ]


def held_constant_forces(law: AbstractDamper, machine: Rig | None) -> list[str]:
    """The constant forces of a law that stay zero, since the machine, if there is one, has the static force."""
    return [] if machine is None else [path for path in constant_forces(law) or [] if float(get(law, path)) == 0.0]

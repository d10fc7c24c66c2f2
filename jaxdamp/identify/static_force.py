"""The static force of a damper on a bench: gas force or zero error, which records of force alone cannot tell apart."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import laws_inside
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.machine import Machine, machine_names
from jaxdamp.identify.model import law_of, on_rig, rig_of, starts_in
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.several import Solution
from jaxdamp.parameters import real
from jaxdamp.rig import Rig


LARGE = 0.02  # of the standard deviation of the force, above which a static force is said


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
    beside = float(velocity[velocity <= 0.0].max()), float(velocity[velocity >= 0.0].min())

    def at_rest(values: np.ndarray) -> float:
        """The force [N] between those at the slowest samples in both directions: zero velocity may not be sampled."""
        law = law_of(free.started_at(values).tree)
        forces = [float(law.force(0.0, v, law.initial_state())) for v in beside]
        return float(np.interp(0.0, beside, forces))

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


def static_force_in_words(result: FitResult, runs: tuple[BenchRun, ...]) -> list[str]:
    """A sentence on a static force that is gas force or zero error, if it is large enough to matter."""
    offset = 0.0 if result.rig is None else float(np.mean(np.asarray(result.rig.force_offset)))
    if abs(offset) < LARGE * float(np.std(np.concatenate([run.force for run in runs]))):
        return []
    return [
        f"The static force of {offset:.0f} N is gas force or zero error of the load cell: these records cannot tell."
        " It is in `result.rig`, not in the law, so that a ride, a table or exported code is without it. Read the load"
        f" cell without the damper; `law + dampers.Spring(0.0, {offset:.0f})` is the damper if it is gas."
    ]

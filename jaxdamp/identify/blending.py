"""Between settings: whether to interpolate the parameters of two laws or to blend their forces."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, Scheduled, laws_inside, without_fitted_ranges
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.model import Model, is_memoryless, law_of, on_rig
from jaxdamp.identify.predicting import predict_runs, used_samples
from jaxdamp.parameters import FreeParameters
from jaxdamp.rig import Rig


Tree = TypeVar("Tree")

BETTER = 0.98  # error of blended forces, relative to that of interpolated parameters, from which they are taken
MARGIN = 0.02  # of the force, by which the law between two settings may leave the span of its neighbours


class AtSetting(NamedTuple):
    """A law fitted to the records of one setting alone."""

    law: AbstractDamper  # the fitted law
    rig: Rig | None  # the fitted test machine, if one was fitted
    runs: tuple[BenchRun, ...]  # the records
    fit_percent: float  # over all records
    rmse: float  # the same [N]
    is_only_minimum: bool  # whether no other start can lead elsewhere
    free: FreeParameters  # what was fitted
    undetermined: tuple[str, ...] = ()  # the numbers of the law that these records do not determine

    @property
    def model(self) -> Model:
        """The law on its machine."""
        return on_rig(self.law, self.rig)


class Choice(NamedTuple):
    """What lies between the settings, and why."""

    blend: str
    reason: str


def choose_blend(alone: Mapping[float, AtSetting], initial_state: str) -> Choice:
    """Interpolated parameters or blended forces, from the fits of each setting alone.

    Laws of different structure have no common parameters. With three or more settings, each one between two others is
    predicted from its neighbours in both ways, and the errors decide. With two, parameters are interpolated if the
    records determine all of them and the law halfway stays within the span of its neighbours' forces.
    """
    if not Scheduled.of_equal_structure([at.law for at in alone.values()]):
        return Choice("force", "The laws at the settings have different structures, so their forces are blended.")
    if len(alone) > 2:
        return _by_score(alone, initial_state)
    (low, below), (high, above) = alone.items()
    open_at = [f"{', '.join(at.undetermined[:4])} at {u:g}" for u, at in alone.items() if at.undetermined]
    if open_at:
        reason = f"The records do not determine all numbers of the law ({'; '.join(open_at)}), so forces are blended:"
        return Choice("force", f"{reason} such numbers may differ from setting to setting without a meaning.")
    runs = (*below.runs, *above.runs)
    forces = [_force(model, runs, initial_state) for model in (below.model, _between(below, above, 0.5), above.model)]
    if said := _leaving(low, high, *forces):
        return Choice("force", f"{said} Therefore the forces are blended.")
    return Choice("parameters", "Parameters are interpolated: the records at both settings determine all of them.")


def _by_score(alone: Mapping[float, AtSetting], initial_state: str) -> Choice:
    """The way with the smaller error at the settings between others, predicted from the laws of their neighbours."""
    errors = {"parameters": 0.0, "force": 0.0}
    for low, own, high in zip(alone, list(alone)[1:], list(alone)[2:], strict=False):
        below, at, above = alone[low], alone[own], alone[high]
        share, runs = (own - low) / (high - low), at.runs
        models = (below.model, _between(below, above, share), above.model)
        low_force, middle, high_force = (_force(model, runs, initial_state) for model in models)
        ways = {"parameters": middle, "force": (1.0 - share) * low_force + share * high_force}
        lengths = np.cumsum([len(run) for run in runs])[:-1]
        used = [used_samples(at.model, run, is_memoryless(at.model), initial_state) for run in runs]
        level = sum(float(np.sum(run.force[k] ** 2)) for run, k in zip(runs, used, strict=True))
        for name, forces in ways.items():
            pairs = zip(runs, np.split(forces, lengths), used, strict=True)
            squares = sum(float(np.sum((run.force[k] - force[k]) ** 2)) for run, force, k in pairs)
            errors[name] += squares / level if np.isfinite(squares) else np.inf
    by_force = np.sqrt(errors["force"]) < BETTER * np.sqrt(errors["parameters"])
    count = len(alone) - 2
    by = "Forces are blended" if by_force else "Parameters are interpolated"
    percent = {name: 100.0 * np.sqrt(error / count) for name, error in errors.items()}
    where = ", ".join(f"{setting:g}" for setting in list(alone)[1:-1])
    reason = (
        f"{by}: predicted from the laws of its neighbours, the force at {where} is missed by {percent['force']:.1f} %"
        f" with blended forces and by {percent['parameters']:.1f} % with interpolated parameters."
    )
    return Choice("force" if by_force else "parameters", reason)


def _between(below: AtSetting, above: AtSetting, share: float) -> Model:
    """The law and the machine with parameters between those of two settings."""
    models = without_fitted_ranges((below.model, above.model))
    return jax.tree.map(lambda a, b: jnp.asarray((1.0 - share) * np.asarray(a) + share * np.asarray(b)), *models)


def _force(model: Model, runs: Sequence[BenchRun], initial_state: str) -> Float[np.ndarray, " samples"]:
    """The force [N] at all samples; not a number where the model has none on this motion."""
    try:
        return np.concatenate(predict_runs(model, runs, initial_state))
    except ValueError:  # no finite force, or states that drift: possible between two laws that have neither
        return np.full(sum(map(len, runs)), np.nan)


def _leaving(low: float, high: float, below: np.ndarray, middle: np.ndarray, above: np.ndarray) -> str:
    """A sentence on a force halfway that is farther from the mean of its neighbours than they are; empty otherwise."""
    mean = 0.5 * (below + above)
    away, half = (float(np.sqrt(np.mean(a**2))) for a in (middle - mean, 0.5 * (above - below)))
    if not np.isfinite(half) or away <= half + MARGIN * float(np.std(mean)):
        return ""
    where = f"its force is {away:.3g} N RMS from their mean, and they are {half:.3g} N"
    where = where if np.isfinite(away) else "it has no force on the motion of the records"
    return (
        f"Between {low:g} and {high:g} the law with interpolated parameters leaves the span of its neighbours' forces:"
        f" halfway {where}. The numbers at the two do not belong together."
    )


def off_span(model: Model, runs: Sequence[BenchRun], initial_state: str) -> list[str]:
    """Sentences on settings between which a `Scheduled` law leaves the span of its neighbours' forces.

    Compared is the force on the motion of all records, halfway between two levels and at these levels.
    """
    inside = [law for _, law in laws_inside(law_of(model)) if isinstance(law, Scheduled) and law.blend == "parameters"]
    if not inside:
        return []
    levels = np.unique(np.concatenate([np.asarray(law.levels) for law in inside]))

    def at(command: float) -> np.ndarray:
        return _force(model, [run.held_at(command) for run in runs], initial_state)

    forces = {level: at(level) for level in map(float, levels)}
    remedy = ' Blend the forces, `Scheduled(..., blend="force")`, or add records at a setting in between.'
    pairs = itertools.pairwise(forces)
    said = [_leaving(low, high, forces[low], at(0.5 * (low + high)), forces[high]) for low, high in pairs]
    return [f"{sentence}{remedy}" for sentence in said if sentence]


def with_blended_forces(result: FitResult) -> FitResult:
    """The same fit of a `Scheduled` law with blended forces; at its levels, where the records are, both are one law."""

    def is_schedule(node: object) -> bool:
        return isinstance(node, Scheduled)

    def changed(tree: Tree) -> Tree:
        return jax.tree.map(
            lambda node: dataclasses.replace(node, blend="force") if is_schedule(node) else node,
            tree,
            is_leaf=is_schedule,
        )

    evidence = result.evidence
    assert evidence is not None
    problem = evidence.problem
    free = dataclasses.replace(problem.free, tree=changed(problem.free.tree))
    said = off_span(on_rig(result.law, result.rig), result.runs, result.initial_state)
    return dataclasses.replace(
        result,
        law=changed(result.law),
        record_laws=tuple(map(changed, result.record_laws)),
        warnings=tuple(warning for warning in result.warnings if warning not in said),
        evidence=evidence._replace(problem=problem._replace(free=free, law=changed(problem.law))),
    )

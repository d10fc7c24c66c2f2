"""Parameters that the records do not determine: which, why, and which tests would."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._display import plus_minus
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, laws_inside
from jaxdamp.identify.estimates import Estimate
from jaxdamp.identify.model import STARTS, Model, law_of, rig_of
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.stated import charged_apart, gas_charges
from jaxdamp.identify.traces import Batch, signals


MOST = 0.95  # part of the squared effect on the force that counts as all of it
RARE = 0.15  # share of the samples that show an effect below which this is the reason
FAST, SLOW = 0.8, 0.25  # of the largest velocity: above, or below, which an effect is one of fast or slow motion
SPREAD = 0.8  # share of the velocities of the records that counts as all of them
ALIKE = 0.98  # correlation of two numbers, from which the records hardly tell them apart
SAME = 0.1  # relative difference below which frequencies or amplitudes of records count as one
MOST_NAMED = 6  # numbers in a sentence
NEEDLESS = "the curve hardly bends there", "Take one with fewer knots."


class Effect(NamedTuple):
    """Where in the records a parameter changes the force."""

    share: float  # of the samples, that hold `MOST` of its squared effect
    velocities: tuple[float, float]  # m/s, of these samples
    largest: float  # m/s, largest magnitude in the records

    @property
    def words(self) -> str:
        """The reason why so few samples cannot determine the parameter; empty if they are not few.

        >>> Effect(0.09, (-1.57, 1.46), 1.6).words
        'only 9 % of the samples show it, at all velocities'
        """
        if self.share >= RARE:
            return ""
        low, high = self.velocities
        everywhere = high - low > SPREAD * 2.0 * self.largest
        where = "all velocities" if everywhere else f"velocities from {low:.3g} to {high:.3g} m/s"
        return f"only {100 * self.share:.2g} % of the samples show it, at {where}"

    @property
    def remedy(self) -> str:
        """What tests would show more of it; empty if that does not follow from the velocities."""
        low, high = self.velocities
        if self.share >= RARE:
            return ""
        if low > FAST * self.largest or high < -FAST * self.largest:
            way = "rebound" if low > 0 else "compression"
            return f"Add tests that are faster in {way} than {max(abs(low), abs(high)):.3g} m/s."
        if max(abs(low), abs(high)) < SLOW * self.largest:
            return f"Add tests slower than {max(abs(low), abs(high)):.3g} m/s."
        return ""


def effects(problem: Problem, minimum: SearchEnd) -> list[Effect | None]:
    """Where each free number acts, `None` where it does not; everywhere if the records are not those of a bench."""
    if not all(isinstance(part, Batch) for part in problem.residuals):
        return [Effect(1.0, (0.0, 0.0), 0.0)] * minimum.values.size
    used = problem.used
    velocity = signals(problem.residuals, "velocity")[0][used]
    return [_effect(column, velocity) for column in minimum.jacobian[used].T]


def _effect(column: Float[np.ndarray, " samples"], velocity: Float[np.ndarray, " samples"]) -> Effect | None:
    squares = column**2
    if not squares.sum() > 0:
        return None
    order = np.argsort(-squares, kind="stable")
    count = 1 + int(np.searchsorted(np.cumsum(squares[order]), MOST * squares.sum()))
    shown = velocity[order[:count]]
    return Effect(count / velocity.size, (float(shown.min()), float(shown.max())), float(np.abs(velocity).max()))


def on_identifiability(
    problem: Problem,
    minimum: SearchEnd,
    estimates: Sequence[Estimate],
    directions: Sequence[Float[np.ndarray, " free"]],
) -> tuple[tuple[Estimate, ...], list[str]]:
    """The estimates with the reasons why parameters are not identifiable, and sentences on these.

    Also on parameters at bounds, and on groups of which only a combination is identifiable by the `weak_directions`.
    """
    shown, groups = effects(problem, minimum), _groups(estimates, directions)
    knots = problem.coordinates.ordered
    noted, notes = [], []
    for i, (e, effect) in enumerate(zip(estimates, shown, strict=True)):
        unit = f" {e.unit}" if e.unit else ""
        if e.note == "at a bound":
            notes.append(f"{e.name} = {e.value:.4g}{unit} is at a bound: the best value is beyond it.")
        reason = ""
        if e.note == "not identifiable":
            others = [estimates[j].name for members, *_ in groups if i in members for j in sorted(members - {i})]
            reason = _reason(effect, others)
            remedy = (effect and effect.remedy) or "Freeze it or add records that excite it."
            remedy = "It keeps the value that is expected from the motion." if e.name.startswith(STARTS) else remedy
            reason, remedy = NEEDLESS if knots[i] else (reason, remedy)
            notes.append(
                f"{e.name} is not identifiable from these records ({plus_minus(e.value, e.standard_error)}{unit})"
                + f": {reason}" * bool(reason)
                + f". {remedy}"
            )
        noted.append(e._replace(reason=reason))
    return tuple(noted), notes + [_together(problem, estimates, *group) for group in groups]


def _reason(effect: Effect | None, others: Sequence[str]) -> str:
    if effect is None:
        return "it does not change the force"
    return effect.words or (f"a change of it looks like one of {_listed(others, 'or')}" if others else "")


def _groups(
    estimates: Sequence[Estimate], directions: Sequence[Float[np.ndarray, " free"]]
) -> list[tuple[set[int], str, int]]:
    """Groups of parameters of which the records leave directions open: what hardly changes the force, and how many."""
    weak = np.array([e.note == "not identifiable" for e in estimates])
    groups: list[tuple[set[int], str, int]] = []
    for direction in directions:
        signs = np.sign(direction) * weak
        members = set(map(int, np.flatnonzero(signs)))
        if len(members) < 2:
            continue
        ways = (("raising", np.flatnonzero(signs > 0)), ("lowering", np.flatnonzero(signs < 0)))
        how = " while ".join(f"{way} {_listed([estimates[int(i)].name for i in who])}" for way, who in ways if who.size)
        joined = [group for group in groups if group[0] & members]
        groups = [group for group in groups if not group[0] & members]
        count = 1 + sum(group[2] for group in joined)
        groups.append((members.union(*(group[0] for group in joined)), "" if joined else how, count))
    return groups


def _together(problem: Problem, estimates: Sequence[Estimate], members: set[int], how: str, count: int) -> str:
    """A sentence on parameters that only tests of another kind tell apart, and what kind."""
    on_bench = bool(problem.runs) and all(isinstance(run, BenchRun) for run in problem.runs)
    runs = problem.fitted_to if on_bench else []
    lacking = [
        f"another {what}"
        for what, values in (("frequency", [r.frequency for r in runs]), ("stroke", [r.amplitude for r in runs]))
        if runs and max(values) - min(values) < SAME * max(values)
    ]
    tests = f"records of {_listed(lacking)}" if lacking else "records"
    tests += " (`identify.design_experiment` proposes tests)" * bool(runs and not lacking)
    return (
        f"These records cannot distinguish {_listed([estimates[i].name for i in sorted(members)])}"
        + f": {how} hardly changes the force" * bool(how)
        + f". Freeze {'one' if count == 1 else count} of them, or add {tests}."
    )


def _listed(names: Sequence[str], word: str = "and") -> str:
    """Names in words, the first ones of many, such as the weights of a network.

    >>> _listed("abc"), _listed("abcdefghij", "or")
    ('a, b and c', 'a, b, c, d, e, f or 4 more')
    """
    first, last = names[:-1], names[-1]
    if len(names) > MOST_NAMED:
        first, last = names[:MOST_NAMED], f"{len(names) - MOST_NAMED} more"
    return f" {word} ".join(filter(None, [", ".join(first), last]))


def gas_in_words(
    model: Model,
    runs: Sequence[BenchRun],
    estimates: Sequence[Estimate],
    covariance: Float[np.ndarray, "free free"],
) -> list[str]:
    """A sentence on numbers of the gas force that the records hardly tell apart, since they are at one pressure."""
    law, inside = law_of(model), "" if isinstance(model, AbstractDamper) else "law."
    gas = tuple(inside + prefix for prefix, _ in gas_charges(law))
    if not gas or charged_apart(law, runs):
        return []
    constant = [f"{inside}{prefix}{name}" for prefix, part in laws_inside(law) for name in part.constant_forces()]
    constant += ["rig.force_offset", "rig.gas_force"] * (rig_of(model) is not None)
    names = [e.name for e in estimates]
    of_gas = np.array([name.startswith(gas) for name in names], bool)
    set_apart = of_gas | np.isin(names, constant)
    mixed = np.any(_alike(covariance) & np.outer(set_apart, set_apart) & (of_gas[:, None] | of_gas), axis=0)
    if not mixed.any():
        return []
    pressures = [name.removeprefix(inside) for name in names if name.startswith(gas) and name.endswith("pressure")]
    return [
        f"These records, at one gas pressure, hardly tell {', '.join(np.array(names)[mixed])} apart: the gas pushes"
        f" with pressure times area. Freeze what is known, or add records at other pressures that state them,"
        f' `settings={{"{(*pressures, "pressure")[0]}": "20 bar"}}` (absolute).'
    ]


def _alike(covariance: Float[np.ndarray, "free free"]) -> Bool[np.ndarray, "free free"]:
    """Which numbers are hardly told from which others."""
    error = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.abs(covariance / np.outer(error, error)) > ALIKE
    return alike & ~np.eye(len(error), dtype=bool)

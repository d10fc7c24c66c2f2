"""Which direction of a file is rebound, and whether its force resists or pushes.

The work of a passive damper over a cycle is positive, ∮ F dx > 0, so a record shows whether force and stroke agree in
sign. Which of the two directions is rebound no work can show: turning both leaves it as it is. That is given, or stated
by the header of the stroke or of the velocity, or taken as rebound positive and said so.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.headers import direction_of
from jaxdamp.bench.motion import Samples, cycle_instants, cycle_works


SIGNS = ("rebound-positive", "compression-positive")
FORCE_SIGNS = ("same", "opposite")
LEAST_WAY = 0.3  # of the range of a stroke, there and back
LEAST_LOSS = 0.05  # of a viscous damper's work, from which the sign of the work is clear
OPPOSITE = "force and stroke of the file have opposite signs"  # begins the note of a record whose force was turned


@dataclass(frozen=True)
class Decision:
    """Factors that bring the motion and the force of a file to the library's sign, and the sentences that say why."""

    motion: float
    force: float
    notes: tuple[str, ...]


def require(sign: str | None, where: str, what: str, teller: str) -> None:
    """Refuse numbers whose direction neither the file nor the caller tells."""
    if sign is None:
        ways = [Setting("sign", word) for word in SIGNS]
        said = f"{where}: positive {what} may be rebound or compression, and the {teller} does not say which"
        raise ArgumentError(f"{said}. Pass {ways[0]} or {ways[1]}.", *ways)


def check_words(sign: str | None, force_sign: str | None) -> None:
    """Refuse words that are no sign."""
    if sign is not None:
        _checks.one_of("sign", sign, SIGNS)
    if force_sign is not None:
        _checks.one_of("force_sign", force_sign, FORCE_SIGNS)


def loss_fraction(time: Samples, stroke: Samples, force: Samples) -> tuple[float, float]:
    """Median work per cycle [J] and its ratio to that of a viscous damper with the same RMS force and stroke.

    The ratio W / (2 π σ_F σ_x), over full cycles, is 1 for a viscous damper on a sine, 0 for a spring, -1 if force or
    stroke has the wrong sign. In a record without a full cycle the way there and back counts; where the stroke does not
    come back, a spring or a gas force may give energy: the work is then NaN and the ratio 0.
    """
    instants, power = cycle_instants(time, stroke), force * np.gradient(stroke, time)
    if len(instants) < 2:
        instants = _there_and_back(time, stroke)
    if len(instants) < 2:
        return np.nan, 0.0
    work, part = float(np.median(cycle_works(time, power, instants))), (time >= instants[0]) & (time < instants[-1])
    scale = 2 * np.pi * float(np.std(force[part]) * np.std(stroke[part]))
    return work, work / scale if scale > 0 else 0.0


def _there_and_back(time: Samples, stroke: Samples) -> Float[np.ndarray, " instants"]:
    """First and last instant [s] at the same stroke, that of the middle or of an end of the record; none if it is open.

    The way between them must be `LEAST_WAY` of the range, which noise is not.
    """
    ways = [np.zeros(0)]
    for level in (0.5 * (stroke.min() + stroke.max()), stroke[0], stroke[-1]):
        x = stroke - level
        at = np.flatnonzero((x[:-1] <= 0) != (x[1:] <= 0))
        instants = time[at] - x[at] * (time[at + 1] - time[at]) / (x[at + 1] - x[at])
        if len(at) and level == stroke[0]:
            instants = np.concatenate([time[:1], instants])
        if len(at) and level == stroke[-1]:
            instants = np.concatenate([instants, time[-1:]])
        inside = stroke[(time >= instants[0]) & (time <= instants[-1])] if len(instants) > 1 else stroke[:0]
        if inside.size and np.ptp(inside) >= LEAST_WAY * np.ptp(stroke):
            ways.append(instants[[0, -1]])
    return max(ways, key=lambda way: np.ptp(way) if len(way) else 0.0)


def decide(
    time: Samples,
    stroke: Samples,
    force: Samples,
    sign: str | None,
    force_sign: str | None,
    where: str,
    headers: Sequence[str] = (),
) -> Decision:
    """How the channels of a file have to be turned, by what is given (as for `bench.read`) and by the work.

    `headers` are those of stroke and velocity, which may state what is not given, such as "compression travel".
    """
    check_words(sign, force_sign)
    stated, header = _stated(headers, sign, where)
    work, loss = loss_fraction(time, stroke, force)
    clear = abs(loss) >= LEAST_LOSS
    done = f"work per cycle {work:+.4g} J"
    evidence = f"the {done} is only {abs(loss):.1%} of that of a damper with this force and stroke"
    doubt = (
        evidence if np.isfinite(work) else "the stroke does not come back: its work may be that of a spring or of gas"
    )
    if sign is None and force_sign is None and not clear:
        _refuse_unclear(doubt, stated, where)
    if clear:
        _refuse_contradiction(loss, sign, force_sign, f"{where}: ", done)
    turned = force_sign == "opposite" or (force_sign is None and sign is None and loss < 0)
    motion = -1.0 if (sign or stated) == "compression-positive" else 1.0
    notes = (
        _of_force(turned, done, "" if clear else doubt),
        _of_motion(sign or stated, header if sign is None else ""),
    )
    return Decision(motion, -motion if turned else motion, notes)


def _stated(headers: Sequence[str], sign: str | None, where: str) -> tuple[str | None, str]:
    """The sign that headers state, and one that does; refused where they state both, or another one is given."""
    said = {SIGNS[direction_of(header) < 0]: header for header in headers if direction_of(header)}
    if len(said) > 1:
        without = Setting("columns", {"velocity": None})
        names = " and ".join(map(repr, said.values()))
        raise ArgumentError(
            f"{where}: columns {names} are positive in opposite directions, as their headers say. Mend one of them, or "
            f"derive the velocity from the stroke: {without}.",
            without,
        )
    stated, header = next(iter(said.items()), (None, ""))
    if stated and sign not in (None, stated):
        given = Setting("sign", sign)
        raise ArgumentError(
            f"{where}: {given} contradicts the header {header!r}, which says {stated}. Leave it out, or mend the "
            "header.",
            given,
        )
    return stated, header


def _refuse_unclear(doubt: str, stated: str | None, where: str) -> NoReturn:
    ways = [Setting("sign", word) for word in SIGNS if stated in (None, word)]
    said = f"{where}: the sign convention cannot be established from the data, because {doubt}"
    raise ArgumentError(f"{said}. Pass {' or '.join(map(str, ways))}.", *ways)


def _refuse_contradiction(loss: float, sign: str | None, force_sign: str | None, where: str, done: str) -> None:
    """Refuse signs with which the damper would give energy."""
    if force_sign is not None and (loss < 0) == (force_sign == "same"):
        other = "opposite" if force_sign == "same" else "same"
        given, remedy = Setting("force_sign", force_sign), Setting("force_sign", other)
        raise ArgumentError(
            f"{where}{given} contradicts the data ({done} as the file counts): a damper cannot give energy. "
            f"Pass {remedy}, or leave it out.",
            given,
            remedy,
        )
    if force_sign is None and sign is not None and loss < 0:
        given, remedy = Setting("sign", sign), Setting("force_sign", "opposite")
        raise ArgumentError(
            f"{where}{given} contradicts the data: with force and stroke of the same sign the {done}, and "
            f"a damper cannot give energy. If the force of this bench counts the other way, pass also {remedy}.",
            given,
            remedy,
        )


def _of_force(turned: bool, work: str, doubt: str) -> str:
    if turned:
        return f"{OPPOSITE} ({doubt or work}): force turned"
    if doubt:
        return f"force and stroke of the file taken to agree in sign: {doubt}"
    return f"force and stroke of the file agree in sign ({work})"


def _of_motion(sign: str | None, header: str) -> str:
    if sign is None:
        other = Setting("sign", "compression-positive")
        return f"positive stroke taken as rebound: if the bench counts compression positive, pass {other}"
    why = f"as the header {header!r} says" if header else "as given"
    turned = ": stroke, velocity and force turned" if sign == "compression-positive" else ""
    return f"positive stroke is {sign.removesuffix('-positive')}, {why}{turned}"

"""Effects that a fit left out, recognised by their traces in its residual: of a machine, a damper, a sensor.

A force that the model does not have leaves its own pattern in the residual: a constant for an offset, the rate of the
force for a delay, the force times the dissipated energy for heat. The patterns are compared with the residual after
both have been cleared of everything that the free parameters explain, the most similar first. Likewise a sensor that is
late, shifted or scaled leaves the slope of its channel, a constant, the channel itself.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.bench import RideRecord
from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.noise import channel_noise, correlation_time
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.traces import Batch
from jaxdamp.identify.vehicle_preparing import FreeScale
from jaxdamp.identify.vehicle_residuals import RideBatch
from jaxdamp.identify.vehicle_result import ChannelScore
from jaxdamp.parameters import get
from jaxdamp.rig import Sensor


LEAST_SHARE = 0.02  # of the squared residual that an effect must explain
LEAST_F = 12.0  # F statistic with independent samples only, from which an effect is named
LARGE_SHARE, LEAST_F_OF_LARGE = 0.1, 5.0  # a large share is named with less certainty
CLEARER = 0.9  # of the largest share, from which the first effect in the order of the list is named
FRICTION_VELOCITY = 0.005  # m/s, width of the sign change of friction
GAPS = (0.02, 0.05, 0.1)  # clearances that are tried, relative to the half stroke
MOST_EFFECTS = 3
TO_THE_MACHINE = 'add "{}" to the machine (`rig`)'
SURE = 6.0  # standard errors from which an effect is named
NOTICEABLE = 0.01  # sampling intervals of a delay, and tenths of a channel, below which an effect does not matter
REVERSED = -0.3  # correlation of a channel with its prediction below which its sign is doubted
POORLY = 30.0  # fit [%] of a channel below which the vehicle of the start is asked too
OF_ITS_OWN = 1e-3  # share of an effect that no fitted number has, below which it cannot be shown


class _Effect(NamedTuple):
    """A pattern in the residual and what it means."""

    name: str
    signal: Float[np.ndarray, " samples"]  # weighted force for a unit of the effect
    signed: bool  # whether it may have either sign
    words: str  # with the size
    remedy: str


class _Motion(NamedTuple):
    """One record as it stands in the residuals."""

    time: Float[np.ndarray, " samples"]
    stroke: Float[np.ndarray, " samples"]
    velocity: Float[np.ndarray, " samples"]
    force: Float[np.ndarray, " samples"]  # as predicted
    rise: Float[np.ndarray, " samples"] | None  # measured temperature above that at the start of all records


def left_out(problem: Problem, best: SearchEnd) -> list[str]:
    """A sentence on each effect that the residual shows: offset, gas spring, mass, friction, delay, heat, clearance.

    Arguments:
        problem: a problem on bench records that was minimised.
        best: its minimum.
    """
    used = problem.used
    if problem.is_rounding(best.squares) or np.count_nonzero(used) <= 2 * best.values.size:
        return []
    scale = np.linalg.norm(best.jacobian, axis=0)
    span = np.linalg.qr(best.jacobian[used] / np.where(scale > 0, scale, 1.0))[0]
    owner = problem.owner[used]
    residual = _cleared(span, -best.residual[used])
    squares = float(residual @ residual)
    open_effects = [e._replace(signal=e.signal[used]) for e in _effects(problem, best)]
    sentences: list[str] = []
    while open_effects and len(sentences) < MOST_EFFECTS:
        found = _clearest(open_effects, span, residual, owner, squares)
        if found is None:
            break
        effect, size, share, rest, span = found
        open_effects = [e for e in open_effects if e.name != effect.name]
        sentences.append(
            f"{100 * share:.0f} % of the squared residual look like {effect.words.format(size)}, which the fit leaves"
            f" out: {effect.remedy}."
        )
        residual = rest
    return sentences


def _cleared(span: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values - span @ (span.T @ values)


def _clearest(
    effects: list[_Effect], span: np.ndarray, residual: np.ndarray, owner: np.ndarray, squares: float
) -> tuple[_Effect, float, float, np.ndarray, np.ndarray] | None:
    """The effect that explains most, its size, its share, the residual without it and the space with it."""
    found = []
    for effect in effects:
        signal = _cleared(span, effect.signal)
        length = float(np.linalg.norm(signal))
        if length > 1e-6 * np.linalg.norm(effect.signal):
            size = float(signal @ residual) / length**2
            if size > 0 or effect.signed:
                found.append((effect, size, (size * length) ** 2 / squares, signal / length))
    most = max((share for _, _, share, _ in found), default=0.0)
    if most < LEAST_SHARE:
        return None
    effect, size, share, direction = next(entry for entry in found if entry[2] >= CLEARER * most)
    rest = residual - direction * (direction @ residual)
    alike = correlation_time([rest[owner == i] for i in np.unique(owner)])
    independent = rest.size / alike
    least = LEAST_F_OF_LARGE if share >= LARGE_SHARE else LEAST_F
    if share * squares < least * float(rest @ rest) / independent:
        return None
    return effect, size, share, rest, np.concatenate([span, direction[:, None]], axis=1)


def _motions(problem: Problem, best: SearchEnd) -> Iterator[tuple[np.ndarray, _Motion]]:
    """The samples of each fitted record in the residuals, and its motion there."""
    stroke, velocity, force, weight = (_channel(problem, name) for name in ("stroke", "velocity", "force", "weight"))
    predicted = force + np.divide(best.residual[: weight.size], weight, out=np.zeros_like(force), where=weight > 0)
    first = [run.temperature[0] for run in problem.runs if run.temperature is not None]
    for i, run in enumerate(problem.runs):
        at = np.flatnonzero((problem.owner == i) & problem.used)
        if at.size < 8:
            continue
        step = problem.sample_steps[i]
        time = step * np.arange(at.size)
        rise = None
        if run.temperature is not None:
            end = run.time[-1] - run.time[0]
            rise = np.interp(time + max(end - time[-1], 0.0), run.time - run.time[0], run.temperature) - min(first)
        yield at, _Motion(time, stroke[at], velocity[at], predicted[at], rise)


def _channel(problem: Problem, name: str) -> Float[np.ndarray, " samples"]:
    """One channel at all samples of the residuals of bench records."""
    parts = [part for part in problem.residuals if isinstance(part, Batch)]
    return np.concatenate([np.ravel(np.asarray(getattr(part, name))) for part in parts])


def _effects(problem: Problem, best: SearchEnd) -> list[_Effect]:
    """All effects as patterns over all samples, the likelier ones first."""
    amplitude = problem.reach.stroke
    gaps = [f"a clearance of about {1e3 * gap * amplitude:.2g} mm (no force after each reversal)" for gap in GAPS]
    kinds = [
        ("offset", True, "a constant force of {:.3g} N", 'add "gas" or "offset" to the machine (`rig`)'),
        ("gas_stiffness", False, "a spring of {:.3g} N/m", f"{TO_THE_MACHINE}, or a `Spring` to the law"),
        ("mass", False, "a moving mass of {:.3g} kg", TO_THE_MACHINE),
        ("friction", False, "friction of {:.3g} N", f"{TO_THE_MACHINE}, or take a law with friction"),
        ("delay", True, "a delay of the force by {:.2g} s", f"{TO_THE_MACHINE}, or take a law with hysteresis"),
        ("heat", True, "damping that falls as the oil warms up", f"{TO_THE_MACHINE}, or cut the records"),
        *(("clearance", False, gap, "look for play in the mounts, or put the law into `Play`") for gap in gaps),
    ]
    signals = np.zeros((len(kinds), best.residual.size))
    weight = _channel(problem, "weight")
    for at, motion in _motions(problem, best):
        signals[:, at] = weight[at] * np.stack(_patterns(motion, amplitude))
    return [
        _Effect(name, signal, signed, words, remedy.format(name))
        for signal, (name, signed, words, remedy) in zip(signals, kinds, strict=True)
    ]


def _patterns(motion: _Motion, amplitude: float) -> list[np.ndarray]:
    """The change of the measured force for a unit of each effect, in the order of the list."""
    time, x, v, force, rise = motion
    energy = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] * v[1:] + force[:-1] * v[:-1]) * np.diff(time))])
    patterns = [np.ones_like(x), x, np.gradient(v, time), np.tanh(v / FRICTION_VELOCITY), -np.gradient(force, time)]
    since = _travel_since_reversal(x, v)
    return [
        *patterns,
        -force * (energy if rise is None else rise),
        *(-force * (since < gap * amplitude) for gap in GAPS),
    ]


def _travel_since_reversal(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Distance [m] from the last reversal; infinite before the first."""
    turns = np.flatnonzero(np.signbit(v[1:]) != np.signbit(v[:-1])) + 1
    last = np.searchsorted(turns, np.arange(x.size), side="right") - 1
    from_last = np.abs(x - x[turns[np.maximum(last, 0)]]) if turns.size else np.full(x.size, np.inf)
    return np.where(last >= 0, from_last, np.inf)


def on_signs(scores: Sequence[ChannelScore], at_start: Sequence[ChannelScore]) -> list[str]:
    """A sentence on each channel that the vehicle predicts with the other sign.

    A fit may bend the vehicle until a reversed channel runs with it a little, and explain it badly all the same: then
    the vehicle that the fit started from tells.
    """
    notes = []
    for score, first in zip(scores, at_start, strict=True):
        which, against = "fitted vehicle", score.correlation
        if score.fit_percent < POORLY:
            which, against = min((which, against), ("vehicle of the start", first.correlation), key=lambda one: one[1])
        if against < REVERSED:
            notes.append(
                f"{score.channel} of {score.record} runs against the {which} (correlation {against:.2f}): its sign, or"
                " that of the other channels, is reversed. Accelerations and heights count positive up, travels in"
                " extension; `read_rides(..., reversed_channels=[...])` and --reversed turn a channel round."
            )
    return notes


def on_free_scale(scale: FreeScale, model: VehicleTest) -> list[str]:
    """A sentence on numbers of which the records show the ratios only."""
    if not scale.names:
        return []
    value = f"{float(get(model, scale.held_name)):.6g}" if scale.held_name else ""
    held = f" {scale.held_name} was held at {value}; the standard errors are for this." if value else ""
    return [
        "These records hold no force, so only ratios of masses, rates and forces can be determined:"
        f" {', '.join(scale.names)} may all be larger by one factor.{held}"
        " Fix one mass that is known, or measure a force."
    ]


def on_sensors(
    problem: Problem,
    end: SearchEnd,
    records: Sequence[RideRecord],
    channels: Sequence[str],
    sensors: Mapping[str, Sensor],
) -> list[str]:
    """A sentence on each sensor whose channel looks late, shifted or scaled, beside all fitted numbers.

    The residual is regressed on what each sensor could add to first order (the slope of its channel, a constant, the
    channel itself), after both are freed of what the fitted numbers can explain.

    Arguments:
        problem: the problem that was solved.
        end: its minimum.
        records: the records.
        channels: all channels in the order of `problem.sigma`.
        sensors: the fitted sensors.
    """
    effects, columns = [], []
    for channel in channels:
        given = sensors[channel].given if channel in sensors else ()
        for effect in ("delay", "offset", "gain"):
            if effect not in given and not (effect == "delay" and "lag" in given):
                column = _column(problem, end, records, channel, effect)
                if column is not None:
                    effects.append((channel, effect))
                    columns.append(column)
    if not columns:
        return []
    whole = np.stack([*columns, end.residual], axis=1)
    basis, _ = np.linalg.qr(end.jacobian / np.linalg.norm(end.jacobian, axis=0).clip(1e-300))
    rest = whole - basis @ (basis.T @ whole)
    shown = np.linalg.norm(rest[:, :-1], axis=0) > OF_ITS_OWN * np.linalg.norm(whole[:, :-1], axis=0)
    inverse = np.linalg.pinv(rest[:, :-1][:, shown])
    sizes = inverse @ rest[:, -1]
    left = channel_noise(problem, rest[:, -1] - rest[:, :-1][:, shown] @ sizes, end.values.size)
    errors = np.linalg.norm(inverse * left.sigma, axis=1)
    chosen = [effect for effect, own in zip(effects, shown, strict=True) if own]
    sentences = []
    for (channel, effect), size, error in zip(chosen, map(float, sizes), errors, strict=True):
        values = np.concatenate([record[channel] for record in records if channel in record.channels])
        unit = {"delay": records[0].dt, "offset": 0.1 * float(np.std(values)), "gain": 0.1}[effect]
        if abs(size) > max(SURE * error, NOTICEABLE * unit):
            sentences.append(_sentence(channel, effect, size, problem.law.units[channel]))
    return sentences


def _column(
    problem: Problem, end: SearchEnd, records: Sequence[RideRecord], channel: str, effect: str
) -> Float[np.ndarray, " samples"] | None:
    """Change of the weighted residual for each unit of an effect; None for a law on a bench."""
    parts, begin, found = [], 0, False
    for part in problem.residuals:
        size = part.used().size
        column = np.zeros(size)
        if isinstance(part, RideBatch) and channel in part.channels:
            weight = np.asarray(part.weight)
            row, shaped, found = part.channels.index(channel), column.reshape(weight.shape), True
            errors = end.residual[begin : begin + size].reshape(weight.shape)
            for i, number in enumerate(np.asarray(part.number)):
                counts = weight[i, row] > 0
                error = np.divide(errors[i, row], weight[i, row], out=np.zeros(counts.size), where=counts)
                expected = records[number][channel] + error
                slope = np.gradient(expected, records[number].dt)
                by_effect = {"delay": slope, "offset": -np.ones_like(slope), "gain": -expected}
                shaped[i, row] = weight[i, row] * by_effect[effect]
        parts.append(column)
        begin += size
    return np.concatenate(parts) if found else None


def _sentence(channel: str, effect: str, size: float, unit: str) -> str:
    words = {
        "delay": f"comes {1e3 * abs(size):.3g} ms too {'late' if size > 0 else 'early'}",
        "offset": f"has a zero error of {size:.3g} {unit}",
        "gain": f"has a gain of {1 + size:.4g}",
    }
    how = {"delay": "lag or delay"}.get(effect, effect)
    return (
        f"By its residual, {channel} {words[effect]}, unless the vehicle misses something else:"
        f" fit the {how} of its sensor."
    )

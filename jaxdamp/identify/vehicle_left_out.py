"""Effects that a fit of a vehicle left out: a sensor that is late, shifted, scaled or reversed, friction, a free scale.

A sensor that is late, shifted or scaled leaves the slope of its channel, a constant, or the channel in the residual.
Friction, dry or such that gives before it slides, is put into the fitted vehicle and its channels are computed anew.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.bench import RideRecord
from jaxdamp.dampers import Dahl, LuGre
from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.noise import channel_noise
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.vehicle_ladder import Place, friction_places, with_laws
from jaxdamp.identify.vehicle_preparing import FreeScale
from jaxdamp.identify.vehicle_residuals import RideBatch
from jaxdamp.identify.vehicle_result import ChannelScore, predicted
from jaxdamp.parameters import get
from jaxdamp.rig import Sensor


GIVES = (1e-4, 3e-4, 1e-3)  # m, that friction gives before it slides
CLEARLY = 0.7  # of the squares left without it: friction that leaves less is named, and so are forms among each other
SURE = 6.0  # standard errors from which an effect is named
NOTICEABLE = 0.01  # sampling intervals of a delay, and tenths of a channel, below which an effect does not matter
REVERSED = -0.3  # correlation of a channel with its prediction below which its sign is doubted
POORLY = 30.0  # fit [%] of a channel of a record below which the vehicle of the start is asked too
ANOTHER_UNIT = 4.0  # times a channel of the vehicle of the start, whose numbers are within a factor of two
ALIKE = 0.7  # correlation from which a channel is the one of the vehicle, in another unit
OF_ITS_OWN = 1e-3  # share of an effect that no fitted number has, below which it cannot be shown


def on_signs(scores: Sequence[ChannelScore], at_start: Sequence[ChannelScore]) -> list[str]:
    """A sentence on each channel that the vehicle predicts with the other sign.

    A fit may bend the vehicle until a reversed channel runs with it, and others of the record against it. So where it
    explains any of them badly, the vehicle that it started from is asked about all, and a channel that runs with that
    one is right if another runs against it.
    """
    notes = []
    poor = {score.record for score in scores if score.fit_percent < POORLY}
    told = {first.record for first in at_start if first.correlation < REVERSED}
    for score, first in zip(scores, at_start, strict=True):
        which, against = "fitted vehicle", score.correlation
        if score.record in poor:
            which, against = min((which, against), ("vehicle of the start", first.correlation), key=lambda one: one[1])
        right = score.record in poor & told and first.correlation > -REVERSED
        if against < REVERSED and not right:
            notes.append(
                f"{score.channel} of {score.record} runs against the {which} (correlation {against:.2f}): its sign, or"
                " that of the other channels, is reversed. Accelerations and heights count positive up, travels in"
                " extension; `read_rides(..., reversed_channels=[...])` turns a channel round."
            )
    return notes


def on_units(at_start: Sequence[ChannelScore], sensors: Mapping[str, Sensor]) -> list[str]:
    """A sentence on each channel that is like that of the vehicle of the start, but several times as large or small.

    Not on those whose sensor has a gain of its own.
    """
    return [
        f"{score.channel} of {score.record} is {score.size:.2g} times what the vehicle of the start shows: its unit, or"
        " that of the other channels, is wrong, or the start is far off. State units by `read_rides(..., units={...})`."
        for score in at_start
        if "gain" not in (sensors[score.channel].given if score.channel in sensors else ())
        and max(score.size, 1.0 / max(score.size, 1e-300)) > ANOTHER_UNIT
        and abs(score.correlation) > ALIKE
    ]


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
    regression = _regressed(problem, end, columns)
    if regression is None:
        return []
    chosen = [effect for effect, is_shown in zip(effects, regression.shown, strict=True) if is_shown]
    sentences = []
    for (channel, effect), size, error in zip(chosen, map(float, regression.sizes), regression.errors, strict=True):
        values = np.concatenate([record[channel] for record in records if channel in record.channels])
        unit = {"delay": records[0].dt, "offset": 0.1 * float(np.std(values)), "gain": 0.1}[effect]
        if abs(size) > max(SURE * error, NOTICEABLE * unit):
            sentences.append(_sentence(channel, effect, size, problem.law.units[channel]))
    return sentences


def _column(
    problem: Problem, end: SearchEnd, records: Sequence[RideRecord], channel: str, effect: str
) -> Float[np.ndarray, " samples"] | None:
    """Change of the weighted residual for each unit of an effect; None for a law on a bench."""
    columns, any_column = np.zeros_like(end.residual), False
    for (part, column), (_, residual) in zip(problem.by_part(columns), problem.by_part(end.residual), strict=True):
        if isinstance(part, RideBatch) and channel in part.channels:
            weight = np.asarray(part.weight)
            row, shaped, any_column = part.channels.index(channel), column.reshape(weight.shape), True
            errors = residual.reshape(weight.shape)
            for i, number in enumerate(np.asarray(part.number)):
                counts = weight[i, row] > 0
                error = np.divide(errors[i, row], weight[i, row], out=np.zeros(counts.size), where=counts)
                expected = records[number][channel] + error
                slope = np.gradient(expected, records[number].dt)
                by_effect = {"delay": slope, "offset": -np.ones_like(slope), "gain": -expected}
                shaped[i, row] = weight[i, row] * by_effect[effect]
    return columns if any_column else None


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


class _Regression(NamedTuple):
    """A residual regressed on effects, after both are freed of what the fitted numbers can explain."""

    shown: Bool[np.ndarray, " effects"]  # which effects are not like fitted numbers
    sizes: Float[np.ndarray, " shown"]  # of these
    errors: Float[np.ndarray, " shown"]  # their standard errors
    left: float  # share of the squares that they leave


def _regressed(problem: Problem, end: SearchEnd, effects: Sequence[np.ndarray]) -> _Regression | None:
    """The sizes of effects by their columns, the change of the weighted residual for each unit; None if none shows."""
    columns = np.stack(effects, axis=1) if effects else np.zeros((0, 0))
    if not columns.size or not np.all(np.isfinite(columns)):
        return None
    basis, _ = np.linalg.qr(end.jacobian / np.linalg.norm(end.jacobian, axis=0).clip(1e-300))
    left_columns, left_residual = (a - basis @ (basis.T @ a) for a in (columns, end.residual))
    shown = np.linalg.norm(left_columns, axis=0) > OF_ITS_OWN * np.linalg.norm(columns, axis=0)
    if not shown.any():
        return None
    inverse = np.linalg.pinv(left_columns[:, shown])
    sizes = inverse @ left_residual
    left = left_residual - left_columns[:, shown] @ sizes
    errors = np.linalg.norm(inverse * channel_noise(problem, left, end.values.size).by_sample, axis=1)
    return _Regression(shown, sizes, errors, float(left @ left) / max(float(left_residual @ left_residual), 1e-300))


class Friction(NamedTuple):
    """Friction that explains a residual."""

    places: tuple[Place, ...]  # where it is
    give: float | None  # that it gives before it slides [m]; None for dry friction
    left: float  # share of the squares of the residual that it leaves, beside all fitted numbers
    columns: Float[np.ndarray, "samples places"]  # change of the weighted residual by it, for each place

    @property
    def sentence(self) -> str:
        """What to do about it."""
        where, had = " and ".join(place.path for place in self.places), self.places[0].friction
        ladder = "compare with `identify.friction_ladder(vehicle)`"
        if self.give is None:
            what = f"there is dry friction at {where} that the vehicle has not"
        else:
            what = f"the friction at {where} gives before it slides, by about {1e3 * self.give:.2g} mm"
            what += f", which {type(had).__name__} does not" if had is not None else ""
        return f"By its residual, {what}: {100 * (1 - self.left):.0f} % of the squared error; {ladder}."


def friction_left_out(problem: Problem, end: SearchEnd) -> Friction | None:
    """The friction that the residual at the end of a fit shows; None if it shows none.

    Of dry friction and friction that gives by 0.1, 0.3 or 1 mm that with the least squares is named, friction that
    gives only where it leaves clearly less than dry friction.
    """
    everywhere = friction_places(problem.free.tree.vehicle)
    places = [place for place in everywhere if place.force > 0.0 and not isinstance(place.friction, Dahl | LuGre)]
    dry = _friction(problem, end, places, None) if all(place.friction is None for place in places) else None
    giving = [one for give in GIVES if (one := _friction(problem, end, places, give)) is not None]
    best = min(giving, key=lambda friction: friction.left, default=None)
    if dry is not None and (best is None or best.left > CLEARLY * dry.left):
        best = dry
    return best if best is not None and best.left < CLEARLY else None


def _friction(problem: Problem, end: SearchEnd, places: Sequence[Place], give: float | None) -> Friction | None:
    """Friction of one form where the residual shows it for sure."""
    form, model = "coulomb" if give is None else "dahl", problem.free.tree
    changes = []
    for place in places:
        changed = with_laws(model.vehicle, [place], [place.with_form(form, give)])
        changes.append(_residual(problem, dataclasses.replace(model, vehicle=changed)) - end.residual)
    regression = _regressed(problem, end, changes)
    sure = [] if regression is None else np.flatnonzero(regression.shown)[-regression.sizes > SURE * regression.errors]
    if regression is None or not len(sure):
        return None
    return Friction(tuple(places[i] for i in sure), give, regression.left, np.stack(changes, axis=1)[:, sure])


def _residual(problem: Problem, model: VehicleTest) -> Float[np.ndarray, " samples"]:
    """The weighted residual of the records of motion with another vehicle; that of bench records does not change."""
    parts = list[np.ndarray]()
    for part in problem.residuals:
        if isinstance(part, RideBatch):
            missed = (np.asarray(predicted(part, model)) - np.asarray(part.measured)) * np.asarray(part.weight)
            parts.append(missed.ravel())
        else:
            parts.append(np.asarray(part(problem.free.tree)))
    return np.concatenate(parts)

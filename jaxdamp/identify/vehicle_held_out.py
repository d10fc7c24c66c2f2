"""How well a vehicle predicts drives that it was not fitted to: drives, or parts of them, are left out in turn."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._one_thread import one_thread
from jaxdamp.bench import RideRecord
from jaxdamp.identify.held_out import PARTS, REFIT_STEPS, anchored_at
from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import search
from jaxdamp.identify.vehicle_residuals import RideBatch
from jaxdamp.identify.vehicle_result import ChannelScore, VehicleFit, figures, predicted


FEWEST_DRIVES = 3  # whose errors show by how much they vary; of fewer, parts are scored one by one
Left = Sequence[Bool[np.ndarray, " _"]]  # the samples of each record that are left out


def without_drives(result: VehicleFit) -> tuple[tuple[ChannelScore, ...], str]:
    """The errors of a fit on its own drives, each predicted by a fit to the others, and in words what was left out.

    The fits start at the minimum of all. Of two drives or more, each is left out (in up to four groups). The quarters
    in time are left out instead if there is one drive, or if numbers or initial motions of single drives are fitted,
    which no other drive determines; the vehicle is driven through the part left out. Weights stay those of the fit of
    all drives.

    Arguments:
        result: of `fit_vehicle`.
    """
    evidence = result.evidence
    assert evidence is not None
    problem, rides = anchored_at(evidence), result.records
    whole = len(rides) > 1 and not problem.per_record and not problem.free.tree.starts
    scores = list[ChannelScore]()
    for number in range(min(PARTS, len(rides)) if whole else PARTS):
        if whole:
            left = [np.full(len(ride), i % PARTS == number) for i, ride in enumerate(rides)]
        else:
            left = [part == number for part in map(_quarter, rides)]
        model = _refitted(problem, left)
        for i, ride in enumerate(rides):
            if left[i].any():
                shown, counts = _shown(problem, model, i)
                alone = not whole or len(rides) >= FEWEST_DRIVES
                scores += _scores(result, ride, shown, counts & left[i], alone=alone, number=None if whole else number)
    how = f"each of {len(rides)} drives" if whole else f"each quarter of the drive{'s' * (len(rides) > 1)}"
    return tuple(scores), f"{how} predicted by fits without it"


def on_drives(result: VehicleFit, rides: Sequence[RideRecord]) -> tuple[tuple[ChannelScore, ...], str]:
    """The errors of a fit on other drives, and these in words; in four parts of each if they are fewer than three.

    Arguments:
        result: of `fit_vehicle`.
        rides: drives that were not fitted.
    """
    scores = list[ChannelScore]()
    for ride in rides:
        counts = ride.time - ride.time[0] >= result.settling
        scores += _scores(result, ride, result.respond(ride), counts, alone=len(rides) >= FEWEST_DRIVES)
    return tuple(scores), f"{len(rides)} drive{'s' * (len(rides) > 1)} held out"


def _scores(
    result: VehicleFit,
    ride: RideRecord,
    shown: dict[str, Float[np.ndarray, " time"]],
    counts: Bool[np.ndarray, " time"],
    *,
    alone: bool,
    number: int | None = None,
) -> list[ChannelScore]:
    """The errors of each channel of a drive: as a whole, in quarters, or of the quarter that was left out."""
    parts = {ride.name if number is None else f"{ride.name}, part {number + 1} of {PARTS}": counts}
    if not alone:
        quarter = _quarter(ride)
        parts = {f"{ride.name}, part {k + 1} of {PARTS}": counts & (quarter == k) for k in range(PARTS)}
    return [
        ChannelScore(name, channel, result.vehicle.units[channel], *figures(measured[part], error[part]))
        for name, part in parts.items()
        for channel, values in shown.items()
        for measured, error in [(ride[channel], values - ride[channel])]
        if part.any()
    ]


def _quarter(ride: RideRecord) -> np.ndarray:
    """The number of the quarter in time of each sample."""
    return np.arange(len(ride)) * PARTS // len(ride)


def _shown(
    problem: Problem, model: VehicleTest, number: int
) -> tuple[dict[str, Float[np.ndarray, " time"]], Bool[np.ndarray, " time"]]:
    """The channels of a fitted drive with this model, and which samples were compared."""
    for part in problem.residuals:
        if isinstance(part, RideBatch) and number in (numbers := np.asarray(part.number).tolist()):
            row = numbers.index(number)
            values = np.asarray(predicted(part, model))[row]
            return dict(zip(part.channels, values, strict=True)), np.asarray(part.weight)[row, 0] > 0
    raise ValueError(f"Record {number} is not among those fitted.")


@one_thread()
def _refitted(problem: Problem, left: Left) -> VehicleTest:
    """The model fitted to the samples that are not left out."""
    factors = []
    for part in problem.residuals:
        factor = np.ones(part.used().size)
        if isinstance(part, RideBatch):
            shaped = factor.reshape(part.weight.shape)
            for row, number in enumerate(np.asarray(part.number)):
                shaped[row, :, left[number]] = 0.0
        factors.append(factor)
    end = search(problem.reweighted(np.concatenate(factors)), REFIT_STEPS)
    return problem.free.started_at(end.values).tree

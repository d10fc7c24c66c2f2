"""Friction that a fit of a vehicle left out, by its residual: dry friction, or friction that gives before it slides.

Each form is put into the fitted vehicle and its channels are computed anew. The residual is regressed on their change,
after both are freed of what the fitted numbers can explain.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.noise import channel_noise
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.vehicle_ladder import Place, friction_places, with_laws
from jaxdamp.identify.vehicle_residuals import RideBatch
from jaxdamp.identify.vehicle_result import predicted


GIVES = (1e-4, 3e-4, 1e-3)  # m, that friction gives before it slides
CLEARLY = 0.7  # of the squares left without it: friction that leaves less is named, and so are forms among each other
SURE = 6.0  # standard errors from which friction is named
OF_ITS_OWN = 1e-3  # share of an effect that no fitted number has, below which it cannot be shown


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
    model = problem.free.tree
    places = [place for place in friction_places(model.vehicle) if place.could_give]
    if not places:
        return None
    basis, _ = np.linalg.qr(end.jacobian / np.linalg.norm(end.jacobian, axis=0).clip(1e-300))
    rest = end.residual - basis @ (basis.T @ end.residual)

    def of(give: float | None) -> Friction | None:
        form = "coulomb" if give is None else "dahl"
        columns = []
        for place in places:
            changed = with_laws(model.vehicle, [place], [place.with_form(form, give)])
            columns.append(_residual(problem, dataclasses.replace(model, vehicle=changed)) - end.residual)
        return _explained(problem, end, tuple(places), give, np.stack(columns, axis=1), basis, rest)

    dry = [of(None)] if all(place.friction is None for place in places) else [None]
    giving = [friction for friction in map(of, GIVES) if friction is not None]
    best = min(giving, key=lambda friction: friction.left, default=None)
    if dry[0] is not None and (best is None or best.left > CLEARLY * dry[0].left):
        best = dry[0]
    return best if best is not None and best.left < CLEARLY else None


def _explained(
    problem: Problem,
    end: SearchEnd,
    places: tuple[Place, ...],
    give: float | None,
    columns: Float[np.ndarray, "samples places"],
    basis: Float[np.ndarray, "samples rank"],
    rest: Float[np.ndarray, " samples"],
) -> Friction | None:
    """The friction at those places where the residual shows it for sure."""
    if not np.all(np.isfinite(columns)):
        return None
    own = columns - basis @ (basis.T @ columns)
    shown = np.linalg.norm(own, axis=0) > OF_ITS_OWN * np.linalg.norm(columns, axis=0)
    if not shown.any():
        return None
    inverse = np.linalg.pinv(own[:, shown])
    sizes = -(inverse @ rest)
    left = rest + own[:, shown] @ sizes
    errors = np.linalg.norm(inverse * channel_noise(problem, left, end.values.size).sigma, axis=1)
    sure = np.flatnonzero(shown)[sizes > SURE * errors]
    if not sure.size:
        return None
    share = float(left @ left) / max(float(rest @ rest), 1e-300)
    return Friction(tuple(places[i] for i in sure), give, share, columns[:, sure])


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

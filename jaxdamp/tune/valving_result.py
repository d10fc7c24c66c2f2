"""The result of a choice of valving."""

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._status import Status
from jaxdamp._tables import Column, Contents, Table, with_unit
from jaxdamp.dampers import MonoTube, TwinTube
from jaxdamp.tune.limits import amount


class ValveParameter(NamedTuple):
    """A chosen number with its bounds."""

    name: str  # path of the parameter
    unit: str  # in SI
    start: float  # value of the start, in the unit
    value: float  # chosen value, in the unit
    lower: float  # lower bound of the search
    upper: float  # upper bound of the search
    note: str  # "", "at its lower bound" or "at its upper bound"
    meaning: str  # in words


class OutOfReach(NamedTuple):
    """A part of the target that the damper does not reach."""

    side: str  # `"rebound"` or `"compression"`
    slowest: float  # lowest speed with a large error [m/s]
    fastest: float  # highest speed with a large error [m/s]
    largest_error: float  # reached minus wanted force where they differ most [N]
    at: float  # velocity there [m/s]
    binding: tuple[str, ...]  # parameters beyond whose bounds the error would be smaller, the most effective first

    @property
    def sentence(self) -> str:
        """Where, by how much and why."""
        why = "no bound of these numbers prevents it: what is held, such as the geometry, would have to change"
        if self.binding:
            whose = "its bound" if len(self.binding) == 1 else "their bounds"
            why = f"{' and '.join(self.binding)} would have to pass {whose}"
        return (
            f"In {self.side}, {self.slowest:.2g} to {self.fastest:.2g} m/s, the target is out of reach, by up to "
            f"{self.largest_error:+.0f} N at {self.at:.2g} m/s: {why}."
        )


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ValvingResult(AbstractResult):
    """A mono-tube or twin-tube damper whose valving was chosen for a wanted force.

    Attributes:
        law: the damper: the nearest one within the bounds.
        start: the damper before.
        parameters: the chosen numbers with their bounds.
        velocity: velocities of all compared forces [m/s]: those of the curve first, then those of the loops.
        target_force: the wanted forces [N].
        force: the forces of the damper [N].
        curve_points: number of points of the curve at constant velocity.
        loop_lengths: number of samples of each loop.
        rmse: error of the force [N].
        error_percent: the same relative to the RMS of the wanted force [%].
        tolerance: largest relative error of a feasible valving.
        out_of_reach: the parts of the target that the damper does not reach.
        status: how the search ended.
        cavities: at which of the compared forces a cavity takes more than a tenth of the tolerance from the damper.
    """

    law: MonoTube | TwinTube
    start: MonoTube | TwinTube
    parameters: tuple[ValveParameter, ...]
    velocity: Float[np.ndarray, " samples"]
    target_force: Float[np.ndarray, " samples"]
    force: Float[np.ndarray, " samples"]
    curve_points: int
    loop_lengths: tuple[int, ...]
    rmse: float
    error_percent: float
    tolerance: float
    out_of_reach: tuple[OutOfReach, ...]
    status: Status
    cavities: Bool[np.ndarray, " samples"]

    @property
    def feasible(self) -> bool:
        """Whether the damper gives the wanted force within the tolerance."""
        return self.error_percent <= 100.0 * self.tolerance

    @property
    def summary(self) -> str:
        """The error, the bounds reached and the parts out of reach, in sentences."""
        verdict = "reached" if self.feasible else "not reached; this is the nearest force within the bounds"
        texts = [f"The target is {verdict}: error {self.rmse:.3g} N ({self.error_percent:.2g} %)."]
        texts += [f"{p.name} is {p.note}, {amount(p.value, p.unit)}." for p in self.parameters if p.note]
        return " ".join([*texts, *self.warnings])

    @property
    def warnings(self) -> tuple[str, ...]:
        """The parts of the target out of reach, cavities, and a search that did not end at an optimum."""
        ended = () if self.status is Status.CONVERGED else (self.status.sentence,)
        return (*(part.sentence for part in self.out_of_reach), *self._on_cavities(), *ended)

    def _on_cavities(self) -> Iterator[str]:
        """A sentence on each direction in which a cavity opens."""
        sides = (("rebound", "an intake", "less"), ("compression", "a base valve", "more"))
        for (side, valve, resists), inside in zip(sides, (self.velocity > 0.0, self.velocity < 0.0), strict=True):
            if np.any(at := inside & self.cavities):
                slowest, error = np.abs(self.velocity[at]).min(), np.abs(self.force - self.target_force)[at].max()
                other = f", or {valve} that resists {resists}" * isinstance(self.law, TwinTube)
                remedy = f"allow a higher `gas.pressure`{other}"
                if any(p.name == "gas.pressure" and "upper" not in p.note for p in self.parameters):
                    remedy = "a higher `gas.pressure`, which was allowed, suits the rest of the wanted force less"
                opens = f"In {side} a cavity opens from {slowest:.2g} m/s on, with an error of up to {error:.0f} N"
                yield f"{opens}: {remedy}."

    def table(self) -> Table:
        """The chosen numbers with start, bounds and meaning."""
        names = ["parameter", "unit", "start", "chosen", "lower", "upper", "note", "meaning"]
        rows = ((p.name, p.unit, p.start, p.value, p.lower, p.upper, p.note, p.meaning) for p in self.parameters)
        return Table("Valving", tuple(map(Column, names)), tuple(rows))

    def content(self) -> Contents:
        """The result as numbers with units and words, ready for JSON; the law is written by `export.to_json`."""
        forces = self._data(rmse="N", velocity="m/s", target_force="N", force="N")
        error = {"error": with_unit(self.error_percent, "%")}
        return self._data("feasible", "parameters", "out_of_reach") | forces | error

    plot = drawn_by("valving", "Wanted and reached force over velocity with the parts out of reach; the error.")

    def __repr__(self) -> str:
        return f"{self.summary}\n{self.table().to_text()}"

"""The result of a tuning."""

import dataclasses
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from jaxdamp._status import Status
from jaxdamp._tables import Column, Compared, Table, comparison_table, percent_change, plain, with_tied, with_unit
from jaxdamp.tune.objective import Objective
from jaxdamp.vehicles import AbstractVehicle


if TYPE_CHECKING:
    from matplotlib.figure import Figure


V = TypeVar("V", bound=AbstractVehicle)


class Change(NamedTuple):
    """One parameter before and after."""

    name: str
    before: float
    after: float
    unit: str
    note: str  # "", "at its lower bound" or "at its upper bound"
    lower: float
    upper: float
    tied: tuple[str, ...] = ()  # the numbers that have the same value

    @property
    def remark(self) -> str:
        """The note, and the names of the numbers tied to this one."""
        return with_tied(self.note, self.tied)


@dataclasses.dataclass(frozen=True, repr=False)
class TuneResult(Generic[V]):
    """A tuned vehicle and the vehicle before the tuning.

    Attributes:
        vehicle: the tuned vehicle.
        start: the vehicle before the tuning.
        metric: name of the ride metric that was minimised.
        parameters: each free number before and after.
        before: all ride metrics of the start.
        after: all ride metrics of the tuned vehicle.
        units: unit of each metric.
        limits: largest allowed values of metrics.
        active_limits: names of the metrics at their limit or beyond.
        warnings: doubts about the result, in words.
        status: how the search ended; `CONVERGED` only if the gradient condition of an optimum is satisfied.
        history: the metric after each step of the search.
        objective: the objective with all metrics of the tuning.
    """

    vehicle: V
    start: V
    metric: str
    parameters: tuple[Change, ...]
    before: dict[str, float]
    after: dict[str, float]
    units: dict[str, str]
    limits: dict[str, float]
    active_limits: tuple[str, ...]
    warnings: tuple[str, ...]
    status: Status
    history: tuple[float, ...]
    objective: Objective | None = None

    @property
    def converged(self) -> bool:
        """Whether the search ended at an optimum, by its gradient."""
        return self.status is Status.CONVERGED

    def plot(self, **options: Any) -> "Figure":
        """The laws and the metrics before and after."""
        from jaxdamp.plots import tuning

        return tuning(self, **options)

    @property
    def summary(self) -> str:
        """The improvement, and the bounds and limits that are active, in a sentence."""
        before, after, unit = self.before[self.metric], self.after[self.metric], self.units[self.metric]
        share = f" ({100 * (after / before - 1):+.1f} %)" if before else ""
        stops = [f"{name} at its limit" for name in self.active_limits]
        stops += [f"{change.name} {change.note}" for change in self.parameters if change.note]
        inside = "all parameters inside their bounds" if not any(c.note for c in self.parameters) else ""
        state = "an optimum" if self.converged else "not an optimum"
        parts = [f"{state} after {len(self.history)} steps", *stops, *[inside] * bool(inside)]
        return f"{self.metric} {before:.4g} -> {after:.4g} {unit}{share}: {', '.join(parts)}."

    def table(self) -> Table:
        """The ride metrics before and after, with notes on the minimised metric and on limits."""
        notes = {n: f"limit {top:.4g}{', reached' * (n in self.active_limits)}" for n, top in self.limits.items()}
        notes[self.metric] = "minimised"
        rows = [
            Compared(name, self.units[name], (before, after), percent_change(before, after), (notes.get(name, ""),))
            for (name, before), after in zip(self.before.items(), self.after.values(), strict=True)
        ]
        return comparison_table("Ride metrics", "metric", ("before", "after"), rows, (Column("note"),))

    def parameter_table(self) -> Table:
        """The free numbers before and after, with the bounds of the search."""
        rows = [
            Compared(
                p.name, p.unit, (p.before, p.after), percent_change(p.before, p.after), (p.lower, p.upper, p.remark)
            )
            for p in self.parameters
        ]
        more = (Column("lower"), Column("upper"), Column("note"))
        return comparison_table(
            "Parameters, with the bounds of the search", "parameter", ("before", "after"), rows, more
        )

    def to_dict(self) -> dict[str, Any]:
        """The tuning as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        sides = {"before": self.before, "after": self.after}
        return {
            "summary": self.summary,
            "metric": self.metric,
            "converged": self.converged,
            "metrics": {
                name: {side: plain(values[name]) for side, values in sides.items()} | {"unit": unit}
                for name, unit in self.units.items()
            },
            "parameters": [plain(change._asdict()) for change in self.parameters],
            "limits": {name: with_unit(limit, self.units[name]) for name, limit in self.limits.items()},
            "active_limits": list(self.active_limits),
            "history": plain(self.history),
            "warnings": list(self.warnings),
        }

    def __repr__(self) -> str:
        tables = [self.table().to_text(), self.parameter_table().to_text()]
        return "\n".join([self.summary, *tables, *(f"warning: {warning}" for warning in self.warnings)])

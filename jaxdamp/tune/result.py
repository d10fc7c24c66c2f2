"""What a tuning changed and what that did to the ride."""

import dataclasses
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from jaxdamp._status import Status
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


@dataclasses.dataclass(frozen=True, repr=False)
class TuneResult(Generic[V]):
    """A tuned vehicle beside the one it came from.

    Attributes:
        vehicle: the tuned vehicle.
        start: the vehicle it came from.
        metric: name of the ride metric that was minimised.
        parameters: each free number before and after.
        before: all ride metrics of the start.
        after: all ride metrics of the tuned vehicle.
        units: unit of each metric.
        limits: largest allowed value of metrics, as asked for.
        active_limits: the metrics among these that are at their limit, or beyond.
        warnings: what a user should know, in words.
        status: how the search ended; `CONVERGED` only at a point where the gradient says optimum.
        history: the metric after each step of the search.
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

    @property
    def converged(self) -> bool:
        """Whether the search ended at a point where the gradient says optimum."""
        return self.status is Status.CONVERGED

    def plot(self, **options: Any) -> "Figure":
        """The laws and the metrics before and after."""
        from jaxdamp.plots import tuning

        return tuning(self, **options)

    @property
    def summary(self) -> str:
        """What was reached and what stopped it, in a sentence."""
        before, after, unit = self.before[self.metric], self.after[self.metric], self.units[self.metric]
        share = f" ({100 * (after / before - 1):+.1f} %)" if before else ""
        stops = [f"{name} at its limit" for name in self.active_limits]
        stops += [f"{change.name} {change.note}" for change in self.parameters if change.note]
        inside = "all parameters inside their bounds" if not any(c.note for c in self.parameters) else ""
        state = "an optimum" if self.converged else "not an optimum"
        parts = [f"{state} after {len(self.history)} steps", *stops, *[inside] * bool(inside)]
        return f"{self.metric} {before:.4g} -> {after:.4g} {unit}{share}: {', '.join(parts)}."

    def __repr__(self) -> str:
        metrics = {name: f"{name} [{unit or '-'}]" for name, unit in self.units.items()}
        numbers = {p.name: f"{p.name} [{p.unit or '-'}]" for p in self.parameters}
        width = max(map(len, [*metrics.values(), *numbers.values()]))
        lines = [self.summary, f"{'':<{width}}{'before':>12}{'after':>12}{'change':>9}"]
        for name, before in self.before.items():
            after, mark = self.after[name], "  <- minimised" if name == self.metric else ""
            if name in self.limits:
                mark += f"  <- limit {self.limits[name]:.4g}" + ", reached" * (name in self.active_limits)
            lines.append(f"{metrics[name]:<{width}}{_before_after(before, after)}{mark}")
        for p in self.parameters:
            bounds = f"  ({p.lower:.5g} to {p.upper:.5g}{', ' * bool(p.note)}{p.note})"
            tied = f"  = {', '.join(p.tied)}" * bool(p.tied)
            lines.append(f"{numbers[p.name]:<{width}}{_before_after(p.before, p.after)}{bounds}{tied}")
        return "\n".join(lines + [f"warning: {warning}" for warning in self.warnings])


def _before_after(before: float, after: float) -> str:
    """Two numbers and the relative change."""
    share = f"{100 * (after / before - 1):+8.1f}%" if before else ""
    return f"{before:>12.5g}{after:>12.5g}{share:>9}"

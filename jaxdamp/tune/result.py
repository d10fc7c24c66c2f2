"""What a tuning changed and what that did to the ride."""

import dataclasses
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

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
    note: str  # "" or "at a bound"


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
        warnings: what a user should know, in words.
        converged: whether the search ended at a point where the gradient says optimum.
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
    warnings: tuple[str, ...]
    converged: bool
    history: tuple[float, ...]

    def plot(self, **options: Any) -> "Figure":
        """The laws and the metrics before and after."""
        from jaxdamp.plots import tuning

        return tuning(self, **options)

    def __repr__(self) -> str:
        lines = [f"{'':<34}{'before':>12}{'after':>12}{'change':>9}"]
        for name, before in self.before.items():
            after, mark = self.after[name], " <- minimised" if name == self.metric else ""
            if name in self.limits:
                mark += f" <- limit {self.limits[name]:.4g}"
            share = f"{100 * (after / before - 1):+8.1f}%" if before else ""
            lines.append(f"{name + ' [' + self.units[name] + ']':<34}{before:>12.5g}{after:>12.5g}{share:>9}{mark}")
        for p in self.parameters:
            note = f" ({p.note})" if p.note else ""
            lines.append(f"{p.name + ' [' + p.unit + ']':<34}{p.before:>12.5g}{p.after:>12.5g}{note}")
        return "\n".join(lines + [f"warning: {warning}" for warning in self.warnings])

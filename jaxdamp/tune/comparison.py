"""The result of `compare_dampers`: differences between dampers in ride metrics, with their uncertainty."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Table, plain, plus_minus, typeset_unit


class Difference(NamedTuple):
    """The change of a metric from the first damper to another one, relative to the first.

    Attributes:
        damper: name of the other damper.
        metric: name of the metric.
        change: mean over the roads [%].
        from_parameters: standard error due to the fitted parameters [%].
        from_roads: standard error due to the choice of roads, the same for both dampers [%].
        margin: half the width of the 95 % interval from both sources [%].
    """

    damper: str
    metric: str
    change: float
    from_parameters: float
    from_roads: float
    margin: float

    @property
    def significant(self) -> bool:
        """Whether the interval excludes zero."""
        return abs(self.change) > self.margin

    @property
    def sentence(self) -> str:
        """The difference in words."""
        parts = f"± {self.from_parameters:.2g} % from the fitted parameters, ± {self.from_roads:.2g} % from the roads"
        less = "less" if self.change < 0 else "more"
        size = f"{plus_minus(abs(self.change), self.margin)} % {less} {self.metric}"
        verdict = "" if self.significant else ", which may be none"
        return f"{self.damper} has {size}{verdict} (95 %; standard errors {parts})."


@dataclasses.dataclass(frozen=True, repr=False)
class DamperComparison(AbstractResult):
    """Ride metrics of several dampers on the same roads, with their uncertainties.

    Attributes:
        values: each metric of each damper on each road, by damper and metric.
        parameter_errors: standard error of the mean of each metric due to the fitted parameters, likewise.
        road_errors: standard error of the mean of each metric due to the choice of roads, likewise.
        differences: from the first damper to each other one.
        units: of the metrics.
        warnings: parameters that no record determines but that matter here.
    """

    values: dict[str, dict[str, Float[np.ndarray, " roads"]]]
    parameter_errors: dict[str, dict[str, float]]
    road_errors: dict[str, dict[str, float]]
    differences: tuple[Difference, ...]
    units: dict[str, str]
    warnings: tuple[str, ...]

    @property
    def summary(self) -> str:
        """The differences of the first metric in words."""
        first = next(iter(self.units))
        return " ".join(d.sentence for d in self.differences if d.metric == first)

    def difference(self, metric: str, damper: str | None = None) -> Difference:
        """The difference in a metric; of the second damper, if none is named."""
        _checks.one_of("metric", metric, self.units)
        damper = list(self.values)[1] if damper is None else damper
        _checks.one_of("damper", damper, list(self.values)[1:])
        return next(d for d in self.differences if (d.metric, d.damper) == (metric, damper))

    def table(self) -> Table:
        """Each metric of each damper with both standard errors, and the change from the first one."""
        names = ["metric", "unit", "damper", "mean", "from parameters", "from roads"]
        columns = [*map(Column, names), Column("change", "%", "+.2f"), Column("95 %", "%", ".2f"), Column("note")]
        changes = {(d.damper, d.metric): d for d in self.differences}
        rows = []
        for metric, unit in self.units.items():
            for damper, values in self.values.items():
                errors = self.parameter_errors[damper][metric], self.road_errors[damper][metric]
                d = changes.get((damper, metric))
                more = (None, None, "") if d is None else (d.change, d.margin, "" if d.significant else "may be none")
                rows.append((metric, typeset_unit(unit, "–"), damper, float(values[metric].mean()), *errors, *more))
        return Table("Ride metrics with standard errors", tuple(columns), tuple(rows))

    def content(self) -> dict[str, Any]:
        """All numbers with units and words, ready for JSON; numbers that are not finite are None."""
        return {
            "units": self.units,
            "values": plain(self.values),
            "parameter_errors": plain(self.parameter_errors),
            "road_errors": plain(self.road_errors),
            "differences": [plain(d._asdict()) | {"significant": bool(d.significant)} for d in self.differences],
        }

    plot = drawn_by("damper_comparison", "The change of each metric with its interval, and the share of each source.")

"""The result of a tuning."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks, _tables
from jaxdamp._display import display
from jaxdamp._results import AbstractResult, plotted
from jaxdamp._status import Status
from jaxdamp._tables import (
    Column,
    Compared,
    Table,
    comparison_table,
    percent_change,
    percentage,
    plain,
    typeset_unit,
    with_unit,
)
from jaxdamp._types import Figure
from jaxdamp.tune.combinations import Combinations
from jaxdamp.tune.limits import LimitRange, amount, written
from jaxdamp.tune.objective import Objective, Targets
from jaxdamp.tune.ranges import Change
from jaxdamp.tune.rescoring import Rescore, Spectrum, spectra
from jaxdamp.tune.scenarios import Road
from jaxdamp.tune.settings import Run
from jaxdamp.tune.verdict import Verdict, at_limit, change_in_percent, mean_change, verdict_of
from jaxdamp.vehicles import AbstractVehicle


V = TypeVar("V", bound=AbstractVehicle, covariant=True)
NAMED = 2  # parameters at bounds that a summary names; of more it says how many, and the table which


class ScenarioValues(NamedTuple):
    """All metrics in every scenario."""

    names: tuple[str, ...]  # of the scenarios
    before: dict[str, Float[np.ndarray, " scenarios"]]  # metrics of the start, shape (scenarios,)
    after: dict[str, Float[np.ndarray, " scenarios"]]  # metrics of the tuned vehicle


class Drive(NamedTuple):
    """What a tuning drove over: a road, that of the first scenario, and how: the keywords of `Run`."""

    road: Road
    run: Run


class Attempt(NamedTuple):
    """The search from one start."""

    start: np.ndarray  # the free numbers at its start
    end: np.ndarray  # the free numbers at its end
    metric: float  # the metric at its end
    meets_limits: bool  # whether all limits are met there
    converged: bool  # whether it ended at an optimum


class ToleranceEffect(NamedTuple):
    """The effect of the scatter of one parameter on a metric, to second order."""

    parameter: str  # its name
    scatter: float  # its standard deviation relative to its value
    mean: float  # mean change of the metric, relative: half the second derivative times the variance
    deviation: float  # standard deviation of the metric, relative: slope times deviation, and the part of the curvature

    def sentence(self, metric: str) -> str:
        """In words, such as "A 10 % scatter of damper.blow_off_rate costs 1.4 % of rms_sprung_acceleration"."""
        verb = "costs" if self.mean >= 0.0 else "gains"
        cost = f"{verb} {100 * abs(self.mean):.2g} % of {metric} on average, and scatters it by"
        return f"A {100 * self.scatter:g} % scatter of {self.parameter} {cost} {100 * self.deviation:.2g} %."


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class TuneResult(AbstractResult, Generic[V]):
    """A tuned vehicle and the vehicle before the tuning.

    Attributes:
        vehicle: the tuned vehicle.
        start: the vehicle before the tuning.
        metric: name of the ride metric that was minimised.
        parameters: each free number before and after.
        before: all ride metrics of the start.
        after: all ride metrics of the tuned vehicle.
        units: unit of each metric.
        limits: largest allowed value of metrics, or the smallest and the largest one.
        active_limits: names of the metrics at the limit of the search.
        tightened: names of the metrics whose limit was tighter in the search, so that it holds on other roads.
        warnings: doubts about the result, in words.
        status: how the search ended; `CONVERGED` only if the gradient condition of an optimum is satisfied, or if every
            combination of choices was driven.
        history: the metric after each step of the search.
        objective: the objective with all metrics of the tuning.
        active: the constraints that hold the search, in words: limits, shapes, bounds.
        fresh: all metrics on other realisations of a random road; None if there is no random road.
        starts: the searches from several starts.
        scenarios: all metrics in every scenario; None for a tuning on one road.
        drive: what was driven over.
        without_effect: names of the parameters by which the derivative of the minimised metric is zero.
        violated: each metric or shape beyond its limit, in words with its number.
        extrapolated: by how much each damper of the tuned vehicle leaves its fitted range for 1 % of the time or more.
        allowed: the limits as they are written, which may be relative to the start on each road.
        elsewhere: where the numbers hold if there are no fresh roads, in words.
        tolerances: the effect of the scatter of each parameter on the metric, at the tuned vehicle, of `robust`.
        relaxation: which limit, relaxed by how much, would make the metric 1 % smaller, on the road of the tuning and
            to first order; where limits are not met, those that the search could have met. In words, empty without.
        combinations: of choices, each driven, if nothing else was free.
    """

    vehicle: V
    start: V
    metric: str
    parameters: tuple[Change, ...]
    before: dict[str, float]
    after: dict[str, float]
    units: dict[str, str]
    limits: dict[str, float | tuple[float, float]]
    active_limits: tuple[str, ...]
    warnings: tuple[str, ...]
    status: Status
    history: tuple[float, ...]
    objective: Objective | None = None
    active: tuple[str, ...] = ()
    fresh: Rescore | None = None
    starts: tuple[Attempt, ...] = ()
    scenarios: ScenarioValues | None = None
    drive: Drive | None = None
    without_effect: tuple[str, ...] = ()
    violated: dict[str, str] = dataclasses.field(default_factory=dict)
    extrapolated: tuple[str, ...] = ()
    allowed: dict[str, LimitRange] = dataclasses.field(default_factory=dict)
    elsewhere: str = ""
    tolerances: tuple[ToleranceEffect, ...] = ()
    relaxation: str = ""
    tightened: tuple[str, ...] = ()
    combinations: "Combinations | None" = None

    @property
    def verdict(self) -> Verdict:
        """Better or not, by how much and at what price: on fresh roads if there are any."""
        return verdict_of(self)

    def plot(self, kind: str = "changes", **options: object) -> Figure:
        """The laws and the metrics before and after, or the sheet of the ride.

        Arguments:
            kind: "changes" (`plots.tuning`), or "sheet" for one A4 page (`plots.ride_sheet`).
            options: of that function.
        """
        from jaxdamp.plots import ride_sheet, tuning

        return plotted(kind, {"changes": tuning, "sheet": ride_sheet}, self, **options)

    @property
    def summary(self) -> str:
        """The verdict, and `ending`."""
        return f"{self.verdict.sentence} {self.ending}"

    @property
    def ending(self) -> str:
        """The change on the road of the tuning, bounds and limits with their price, and extreme scenarios, in words."""
        before, after, unit = self.before[self.metric], self.after[self.metric], self.units[self.metric]
        change = change_in_percent(self, self.metric, before, after)
        share = "" if change is None else f" ({percentage(change)})"
        stops = [f"{name} {at_limit(self, name)}" for name in self.active_limits]
        at_bounds = [f"{change.name} {change.note}" for change in self.parameters if change.note]
        inside = "" if at_bounds else "all parameters inside their bounds"
        few = len(at_bounds) <= NAMED
        stops += at_bounds if few else [f"{len(at_bounds)} of {len(self.parameters)} parameters at their bounds"]
        stops = [*(f"{name} beyond its limit" for name in self.violated), *stops]
        stops += [f"no effect of {name}" for name in self.without_effect]
        if self.combinations is not None:
            parts = [self.combinations.sentence, *stops]
        else:
            state = "an optimum" if self.converged else "not an optimum"
            parts = [f"{state} after {len(self.history)} steps", *stops, *[inside] * bool(inside)]
        text = f"{self.metric} {amount(after, unit, before)}{share}: {', '.join(parts)}."
        return " ".join(filter(None, (f"{text}{self._extremes}", self.relaxation)))

    @property
    def _extremes(self) -> str:
        """The scenarios in which the metric is largest and smallest, in a sentence; nothing for one road."""
        if self.scenarios is None or len(self.scenarios.names) < 2:
            return ""
        values = self.scenarios.after[self.metric]
        largest = f"{self.scenarios.names[int(values.argmax())]!r}, {values.max():.4g}"
        return f" Largest in {largest}; smallest {values.min():.4g}."

    @property
    def sentences(self) -> tuple[str, ...]:
        """The effects of the tolerances in words, the largest first."""
        return tuple(effect.sentence(self.metric) for effect in self.tolerances)

    def table(self) -> Table:
        """The ride metrics before and after, with notes on the minimised metric and on limits.

        A metric that may be negative, such as a mean, has no change in percent.
        """
        rows = []
        for (name, before), after in zip(self.before.items(), self.after.values(), strict=True):
            on_fresh = () if self.fresh is None else (mean_change(self, name),)
            more = (*on_fresh, self._note(name))
            change = change_in_percent(self, name, before, after)
            rows.append(Compared(name, self.units[name], (before, after), change, more))
        fresh = () if self.fresh is None else (Column("on fresh roads", "%", "+.1f"),)
        return comparison_table("Ride metrics", "metric", ("before", "after"), rows, (*fresh, Column("note")))

    def _note(self, name: str) -> str:
        """What a metric is to the tuning, in words."""
        if name == self.metric:
            return "minimised"
        function = self.objective.function if self.objective else None
        target = function.note(name, self.after[name]) if isinstance(function, Targets) else ""
        if name not in self.limits:
            return target
        span = self.limits[name]
        shown, (lower, upper) = display().read(self.units[name]), span if isinstance(span, tuple) else (-math.inf, span)
        text = f"{written((shown(lower), shown(upper)))} {typeset_unit(shown.unit)}".rstrip()
        text += ", tightened" * (name in self.tightened)
        mark = ", violated" if name in self.violated else ", reached" * (name in self.active_limits)
        return "; ".join(filter(None, (f"{text}{mark}", target)))

    def scenario_table(self, metrics: Sequence[str] | None = None) -> Table:
        """Metrics in every scenario before and after.

        Arguments:
            metrics: their names; the minimised metric and those with limits if left out.

        Raises:
            ValueError: a tuning on one road, an unknown metric.
        """
        if self.scenarios is None:
            _checks.refuse("result", "be of a tuning with `tune.Scenarios`", "of one road")
        names = list(dict.fromkeys([self.metric, *self.limits])) if metrics is None else list(metrics)
        each, rows = self.scenarios, []
        for name in names:
            _checks.one_of("metrics", name, each.after)
            pairs = zip(each.names, each.before[name].tolist(), each.after[name].tolist(), strict=True)
            rows += [
                Compared(name, self.units[name], pair, change_in_percent(self, name, *pair), (scenario,))
                for scenario, *pair in pairs
            ]
        return comparison_table("In every scenario", "metric", ("before", "after"), rows, (Column("scenario"),))

    def spectra(self, channels: Sequence[str]) -> dict[str, tuple[Spectrum, Spectrum]]:
        """The power spectral density of channels before and after; in scenarios, on the first road.

        Arguments:
            channels: of the vehicle.

        Returns:
            For each channel the spectra before and after: frequencies [Hz] and densities [unit²/Hz].
        """
        if self.drive is None:
            return {}
        sides = [spectra(car, self.drive.road, channels, self.drive.run) for car in (self.start, self.vehicle)]
        return {channel: (sides[0][channel], sides[1][channel]) for channel in channels}

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

    def tolerance_table(self) -> Table:
        """What the scatter of parameters costs: a row for each, the most effective first."""
        columns = (
            Column("parameter"),
            Column("scatter", "%", ".3g"),
            Column(f"{self.metric}, mean", "%", "+.3f"),
            Column("scatter of it", "%", ".3f"),
        )
        rows = ((e.parameter, 100 * e.scatter, 100 * e.mean, 100 * e.deviation) for e in self.tolerances)
        return Table(f"What the scatter of parameters costs {self.metric}", columns, tuple(rows))

    def tables(self) -> dict[str, Table]:
        """Metrics and parameters before and after; combinations, metrics in every scenario, tolerances, if any."""
        several = {} if self.scenarios is None else {"scenarios": self.scenario_table()}
        tolerances = {"tolerances": self.tolerance_table()} if self.tolerances else {}
        driven = {"combinations": self.combinations.table()} if self.combinations else {}
        return {"metrics": self.table(), "parameters": self.parameter_table()} | driven | several | tolerances

    def content(self) -> _tables.Contents:
        """The tuning as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        sides = {"before": self.before, "after": self.after}
        words = ("metric", "violated", "active", "active_limits", "tightened", "relaxation", "without_effect")
        return self._data(*words, "parameters", "scenarios", "starts", "tolerances", "history") | {
            "verdict": self.verdict.outcome.name,
            "metrics": {
                name: {side: plain(values[name]) for side, values in sides.items()} | {"unit": unit}
                for name, unit in self.units.items()
            },
            "limits": {name: with_unit(limit, self.units[name]) for name, limit in self.limits.items()},
            "fresh": None if self.fresh is None else self.fresh.to_dict(),
            "combinations": None if self.combinations is None else self.combinations.to_dict(),
        }

    def __repr__(self) -> str:
        tables = [table.to_text() for table in self.tables().values()]
        return "\n".join([self.summary, *tables, *(f"warning: {warning}" for warning in self.warnings)])

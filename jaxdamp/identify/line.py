"""A production line in control charts: the fitted numbers of each damper beside those of a baseline."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from statistics import NormalDist

import numpy as np
from jaxtyping import Float, Int

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._status import Status
from jaxdamp._tables import Column, Contents, Table, plain
from jaxdamp._traced import of_known_numbers
from jaxdamp.identify.control_charts import AbstractChart, Cusum, Ewma, Shewhart, signals
from jaxdamp.identify.dependence import OWN
from jaxdamp.identify.many_result import ManyFits


D2 = 1.128379  # mean range of two normal numbers, in standard deviations
FEWEST, FEW = 8, 25  # dampers of a baseline: without less there are no limits, below the other ones they are doubtful
CHANCE = 0.01  # that a normal baseline of known limits holds a damper as far out as one that is named
LARGE = 0.5  # share of the variance that is due to the fits, from which it is said
CALL = "control_charts(many, baseline=50)"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ControlCharts(AbstractResult):
    """The dampers of a line in control charts.

    Attributes:
        names: of the dampers, in the order of their production.
        quantities: the numbers that are charted, with their units.
        values: of each damper, NaN where there is none, shape (dampers, quantities).
        baseline: which dampers the limits come from.
        centre: mean of the baseline.
        deviation: standard deviation in the baseline, the mean moving range over 1.128.
        fit_share: of the variance in the baseline that standard errors of the fits explain; NaN without any.
        neighbours: correlation of each damper with the one before it, in the baseline.
        charts: individuals, EWMA, CUSUM.
        remarks: of the fits, one for each damper.
    """

    names: tuple[str, ...]
    quantities: Mapping[str, str]
    values: Float[np.ndarray, "dampers quantities"]
    baseline: Int[np.ndarray, " some"]
    centre: Float[np.ndarray, " quantities"]
    deviation: Float[np.ndarray, " quantities"]
    fit_share: Float[np.ndarray, " quantities"]
    neighbours: Float[np.ndarray, " quantities"]
    charts: tuple[AbstractChart, ...]
    remarks: tuple[str, ...]

    @property
    def scores(self) -> Float[np.ndarray, "dampers quantities"]:
        """Distances from the centre in standard deviations."""
        return (self.values - self.centre) / self.deviation

    @functools.cached_property
    def signals(self) -> Mapping[str, Int[np.ndarray, "charts dampers"]]:
        """By quantity, for each chart and damper: 1 above the limit, −1 below it, 0 within."""
        columns = zip(self.quantities, self.scores.T, strict=True)
        return {name: np.array([signals(chart, scores) for chart in self.charts]) for name, scores in columns}

    def since(self, quantity: str) -> str:
        """The damper from which a shift probably dates that the last damper still shows; empty if it shows none.

        Of a cumulative sum, the damper after the last one at which the sum was zero; else the first of the signals
        that have not ended. Dampers without the number do not count, the last one neither.

        Arguments:
            quantity: name.
        """
        _checks.one_of("quantity", quantity, self.quantities)
        scores, starts = self.scores[:, list(self.quantities).index(quantity)], []
        there = np.flatnonzero(np.isfinite(scores))
        for chart, row in zip(self.charts, self.signals[quantity][:, there], strict=True):
            if row.size and row[-1]:
                high, low = chart.statistics(scores[there])
                rest = (high if row[-1] > 0 else low) == 0.0 if isinstance(chart, Cusum) else row != row[-1]
                starts.append(int(np.flatnonzero(rest)[-1]) + 1 if rest.any() else 0)
        return self.names[there[starts[-1]]] if starts else ""

    @property
    def chart_names(self) -> tuple[str, ...]:
        """Of the charts: their kind, and of several of one kind their numbers, as "Ewma(weight=0.1, width=2.8)"."""
        kinds = [chart.name for chart in self.charts]
        return tuple(chart.name if kinds.count(chart.name) == 1 else repr(chart) for chart in self.charts)

    @property
    def false_alarms(self) -> float:
        """So many signals are expected of as many dampers that are all alike but for chance."""
        rate = sum(1.0 / chart.average_run_length() for chart in self.charts)
        return rate * float(np.count_nonzero(np.isfinite(self.values)))

    @functools.cached_property
    def _texts(self) -> tuple[str, ...]:
        """The signals of each damper in words."""
        texts: list[list[str]] = [[] for _ in self.names]
        for quantity, rows in self.signals.items():
            for i in np.flatnonzero(np.any(rows != 0, axis=0)):
                signed = [(chart, int(s)) for chart, s in zip(self.chart_names, rows[:, i], strict=True) if s]
                words = ", ".join(f"{name} {'high' if sign > 0 else 'low'}" for name, sign in signed)
                texts[i].append(f"{quantity}: {words}")
        return tuple("; ".join(text) for text in texts)

    @property
    def summary(self) -> str:
        """How many dampers signal, which shifts last, and how many signals are expected by chance."""
        count = sum(bool(text) for text in self._texts)
        head = f"{count} of {len(self.names)} dampers signal ({self.false_alarms:.2g} signals expected by chance)"
        lasting = [f"{name} since {damper!r}" for name in self.quantities if (damper := self.since(name))]
        return f"{head}; out of control at the end: {', '.join(lasting)}" if lasting else head

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubts about the limits."""
        said, count = [], self.baseline.size
        if count < FEW:
            said.append(f"The baseline has {count} dampers: its limits are doubtful below {FEW}.")
        for name, share, alike in zip(self.quantities, self.fit_share, self.neighbours, strict=True):
            if share > LARGE:
                said.append(f"{name}: the error of the fits makes {100 * share:.0f} % of the variance in the baseline.")
            if alike > 2.0 / np.sqrt(count):
                words = f"{name}: dampers made one after the other are alike (correlation {alike:.2f})"
                said.append(f"{words}, so that the limits are too narrow and alarms more frequent.")
            elif outside := self._outside(name):
                said.append(f"{name}: {outside}")
        missing = int(np.count_nonzero(~np.all(np.isfinite(self.values), axis=1)))
        return (*said, *([f"Dampers without some number, which are not charted there: {missing}."] if missing else []))

    def _outside(self, quantity: str) -> str:
        """A sentence on dampers of the baseline that lie so far from its mean that they widen the limits, or empty."""
        scores = self.scores[self.baseline, list(self.quantities).index(quantity)]
        far = np.flatnonzero(np.abs(scores) > NormalDist().inv_cdf(1.0 - 0.5 * CHANCE / scores.size))  # NaN is not
        if not far.size:
            return ""
        which = ", ".join(f"{self.names[self.baseline[i]]!r} ({scores[i]:+.1f})" for i in far)
        remedy = "If there is a cause, give a `baseline` of names without them."
        words = "dampers of the baseline lie far from its mean and widen the limits (standard deviations)"
        return f"{words}: {which}. {remedy}"

    def table(self) -> Table:
        """A row for each damper: its numbers, its signals, and what its fit remarks."""
        columns = (Column("damper"), *(Column(name, unit) for name, unit in self.quantities.items()))
        rows = tuple(
            (name, *(float(v) if np.isfinite(v) else None for v in values), text, remark)
            for name, values, text, remark in zip(self.names, self.values, self._texts, self.remarks, strict=True)
        )
        return Table("Dampers of the line", (*columns, Column("signals"), Column("remark")), rows)

    def tables(self) -> dict[str, Table]:
        """A row for each damper, the limits, and the run lengths of the charts."""
        charts = tuple(
            (name, chart.limit, *(chart.average_run_length(shift) for shift in (0.0, 0.5, 1.0, 2.0)))
            for name, chart in zip(self.chart_names, self.charts, strict=True)
        )
        columns = [Column("chart"), Column("limit", "standard deviations")]
        columns += [Column("no shift"), *(Column(f"shift of {shift}") for shift in ("0.5", "1", "2"))]
        return {
            "dampers": self.table(),
            "limits": self._limits(),
            "run_lengths": Table("Dampers until a signal, on average", tuple(columns), charts),
        }

    def _limits(self) -> Table:
        columns = (Column("quantity"), Column("unit"), Column("centre"), Column("standard deviation"))
        counts = tuple(Column(f"{name}, signals", spec="d") for name in self.chart_names)
        rows = tuple(
            (name, unit, float(centre), float(deviation), *map(int, np.count_nonzero(rows, axis=1)), self.since(name))
            for (name, unit), centre, deviation, rows in zip(
                self.quantities.items(), self.centre, self.deviation, self.signals.values(), strict=True
            )
        )
        title = f"Limits from {self.baseline.size} dampers"
        return Table(title, (*columns, *counts, Column("out of control since")), rows)

    plot = drawn_by("control_charts", "Each quantity in each chart, with its limits and signals.")

    def content(self) -> Contents:
        """Tables and signals as plain data."""
        signs = {name: plain(rows.tolist()) for name, rows in self.signals.items()}
        return {name: table.to_dict() for name, table in self.tables().items()} | {"signals": signs}

    def __repr__(self) -> str:
        return "\n".join([self.summary, *self.warnings, self._limits().to_text()])


@of_known_numbers
def control_charts(
    dampers: ManyFits | Mapping[str, Sequence[float] | np.ndarray],
    baseline: int | Sequence[str],
    *,
    charts: Sequence[AbstractChart] | None = None,
    names: Sequence[str] | None = None,
) -> ControlCharts:
    """Control charts of the fitted numbers of a line: which dampers stand out, and which numbers drift since when.

    Dampers are charted in their order. The limits come from a baseline that was in control: its mean, and its standard
    deviation as the mean moving range over 1.128. Numbers that a record does not determine are left out, and those that
    the dampers share.

    Arguments:
        dampers: of `identify.fit_many`; or numbers of your own for each damper by name, such as forces at a velocity.
        baseline: how many dampers at the beginning were in control, or their names, each that of one
            damper; 25 or more.
        charts: individuals at 3, EWMA with λ = 0.2 and L = 3, and CUSUM with k = 0.5 and h = 5 if left out.
        names: of the dampers, if `dampers` are numbers.

    Returns:
        The charts: `summary`, a row for each damper in `table()`, `signals`, and a page by `report(path)`.

    Raises:
        ValueError: no numbers, or not as many of each; a baseline of fewer than 8 dampers, unknown, repeated or all
            alike.

    >>> rng = np.random.default_rng(0)
    >>> force = 1000.0 + 5.0 * rng.standard_normal(120)
    >>> force[80:] += 8.0
    >>> found = control_charts({"force": force}, baseline=50)
    >>> found.since("force"), bool(found.signals["force"][2, 90:].all())
    ('80', True)
    """
    if isinstance(dampers, ManyFits):
        columns, errors, units = _fitted(dampers)
        labels, remarks = dampers.names, dampers.remarks
    else:
        columns, errors, units, labels = _given(dampers, names)
        remarks = ("",) * len(labels)
    values = np.stack(list(columns.values()), axis=1)
    some = _baseline(baseline, labels)
    centre, deviation, share, alike = (np.full(values.shape[1], np.nan) for _ in range(4))
    for j, name in enumerate(columns):
        there = values[some, j]
        finite = np.isfinite(there)
        if np.count_nonzero(finite) < FEWEST or np.ptp(there[finite]) == 0.0:
            must = f"hold {FEWEST} or more dampers that determine {name!r} and are not all alike"
            _checks.refuse("baseline", must, f"{np.count_nonzero(finite)} of {some.size} such dampers")
        there = there[finite]
        centre[j], deviation[j] = there.mean(), np.mean(np.abs(np.diff(there))) / D2
        share[j] = np.mean(errors[some, j][finite] ** 2) / deviation[j] ** 2
        alike[j] = np.corrcoef(there[:-1], there[1:])[0, 1]
    chosen = (Shewhart(), Ewma(), Cusum()) if charts is None else tuple(charts)
    if not chosen:
        _checks.refuse("charts", "hold one or more", "empty", "Leave it out for the three usual ones.")
    for i, chart in enumerate(chosen):
        _checks.instance(
            f"charts[{i}]", chart, AbstractChart, "be a chart", "Write `charts=[identify.Ewma(0.1, 2.8)]`."
        )
    return ControlCharts(tuple(labels), units, values, some, centre, deviation, share, alike, chosen, tuple(remarks))


def _fitted(many: ManyFits) -> tuple[dict[str, np.ndarray], np.ndarray, dict[str, str]]:
    """The numbers that the records determine for each damper by itself, standard errors and units."""
    sure = np.isfinite(many.standard_errors)
    if many.dependence is not None:
        sure &= many.dependence.degree == OWN
    sure &= np.array([status is not Status.LEFT_OUT for status in many.status])[:, None]
    values = np.where(sure, many.values, np.nan)
    moving = [j for j in range(values.shape[1]) if np.any(sure[:, j])]
    if not moving:
        _checks.refuse("dampers", "hold a number of each damper's own that the records of some determine", many.summary)
    names = [many.parameters[j] for j in moving]
    units = dict(zip(names, (many.free.owners[j].unit for j in moving), strict=True))
    return {name: values[:, j] for name, j in zip(names, moving, strict=True)}, many.standard_errors[:, moving], units


def _given(
    dampers: object, names: Sequence[str] | None
) -> tuple[dict[str, np.ndarray], np.ndarray, dict[str, str], list[str]]:
    """Numbers of a user's own."""
    if not isinstance(dampers, Mapping) or not dampers:
        must = "be the result of `fit_many`, or numbers by name"
        _checks.refuse("dampers", must, _checks.described(dampers), f"The call is `{CALL}`.")
    columns = {str(name): np.asarray(values, np.float64) for name, values in dampers.items()}
    size = next(iter(columns.values())).size
    for name, column in columns.items():
        if column.shape != (size,):
            _checks.refuse(
                f"dampers[{name!r}]", f"be one number for each of {size} dampers", f"of shape {column.shape}"
            )
    labels = [str(i + 1) for i in range(size)] if names is None else list(map(str, names))
    if len(labels) != size:
        _checks.refuse("names", f"be one for each of {size} dampers", f"{len(labels)} names")
    return columns, np.full((size, len(columns)), np.nan), dict.fromkeys(columns, ""), labels


def _baseline(baseline: int | Sequence[str], labels: Sequence[str]) -> np.ndarray:
    """The places of the dampers of the baseline."""
    if isinstance(baseline, int | np.integer):
        if len(labels) < FEWEST:
            must = f"be {FEWEST} dampers or more, and there are {len(labels)}"
            _checks.refuse("baseline", must, baseline, "Control charts need a longer line.")
        if not FEWEST <= baseline <= len(labels):
            must = f"be from {FEWEST} to {len(labels)} dampers"
            _checks.refuse("baseline", must, baseline, "25 or more give limits that hold.")
        return np.arange(baseline)
    places: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        places.setdefault(label, []).append(i)
    charts = []
    for name in baseline:
        _checks.one_of("baseline", name, places)
        if len(places[name]) > 1:
            at = ", ".join(str(i + 1) for i in places[name])
            remedy = "Give labels that differ, or the number of dampers at the beginning."
            _checks.refuse("baseline", "name dampers whose label is theirs alone", f"{name!r}, of numbers {at}", remedy)
        if places[name][0] in charts:
            _checks.refuse("baseline", "name each damper once", f"{name!r} repeatedly", "Remove the repeated names.")
        charts += places[name]
    return np.array(sorted(charts))

"""Numbers with their spread: many dampers, control charts, posteriors, targets, other roads, points of a sweep."""

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Axes, Figure
from jaxdamp.identify import ControlCharts, ManyFits, Posterior, TargetFit
from jaxdamp.plots import _style
from jaxdamp.sweeps import SweepSummary
from jaxdamp.tune import DamperComparison, Rescore


_COLUMNS = 3  # of panels
_BINS = 30
_NAMED, _ROW = 40, 0.2  # dampers whose names have room, a line [inch] for each


def many_fits(result: ManyFits) -> Figure:
    """The parameters of each damper ± 2 standard errors, and the error of each damper.

    Over the setting of the dampers, if it is stated; otherwise a line for each, with its name, or over their number if
    they are many. Intervals without an end are left out.

    Arguments:
        result: of `identify.fit_many`.
    """
    count, units = len(result.names), [owner.unit for owner in result.free.owners]
    named = result.settings is None and count <= _NAMED
    figure, panels = _panels(len(result.parameters) + 1, height=max(2.8, 1.0 + _ROW * count) if named else 2.8)
    places = np.arange(count, dtype=float) if result.settings is None else np.asarray(result.settings)
    drawn = [
        (name, unit, result.values[:, i], 2.0 * result.standard_errors[:, i], _style.COLOURS[0])
        for i, (name, unit) in enumerate(zip(result.parameters, units, strict=True))
    ]
    drawn.append(("root of the mean squared force error", "N", result.rmse, np.zeros(count), _style.COLOURS[1]))
    for axes, (name, unit, values, error, colour) in zip(panels, drawn, strict=True):
        look: _style.Look = {"fmt": "o", "color": colour, "markersize": 4, "capsize": 2}
        error = np.where(np.isfinite(error) & (error > 0.0), error, np.nan)
        label, title = f"[{typeset_unit(unit, '–')}]", _style.path_words(name)
        if named:
            axes.errorbar(values, places, xerr=error, **look)
            _style.dress(axes, label, "", title)
            axes.set_yticks(places, [])
            axes.set_ylim(count - 0.5, -0.5)
        else:
            axes.errorbar(places, values, error, **look)
            _style.dress(axes, "damper" if result.settings is None else "setting", label, title)
    for axes in panels[::_COLUMNS] if named else ():
        axes.set_yticks(places, list(map(_style.brief, result.names)))
    figure.suptitle(f"{count} dampers, ± 2 standard errors")
    return figure


def posterior(result: Posterior) -> Figure:
    """Histograms of the samples of every number, with the mean and the 95 % interval.

    Arguments:
        result: of `FitResult.posterior`.
    """
    figure, panels = _panels(len(result.parameters))
    for axes, parameter, samples in zip(panels, result.parameters, result.samples.T, strict=True):
        axes.hist(samples, _BINS, color=_style.COLOURS[0], alpha=0.6)
        axes.axvline(parameter.mean, color=_style.BLACK, linewidth=1.2)
        for end in parameter.interval:
            axes.axvline(end, color=_style.BLACK, linewidth=0.9, linestyle="--")
        label = f"{_style.path_words(parameter.name)} [{typeset_unit(parameter.unit, '–')}]"
        _style.dress(axes, label, "samples", f"r hat {parameter.r_hat:.3f}")
    figure.suptitle(f"Posterior from {len(result.samples)} samples: mean and 95 % interval")
    return figure


def targets(result: TargetFit) -> Figure:
    """The distance of each value from its target, in tolerances; the shaded values meet it.

    Arguments:
        result: of `identify.fit_targets`.
    """
    rows = np.arange(len(result.targets), dtype=float)
    figure = _style.new_figure(8.0, 1.6 + 0.35 * len(rows))
    axes = figure.subplots()
    axes.axvspan(-1.0, 1.0, color=_style.SHADE, zorder=0)
    axes.plot([met.deviation for met in result.targets], rows, "o", color=_style.COLOURS[0])
    axes.set_yticks(rows, [f"{t.name}: {_style.short(t.value)} for {_style.short(t.target)}" for t in result.targets])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    _style.dress(axes, "distance from the target [tolerances]", "", "Reached and wanted", zero="x")
    return figure


def rescore(result: Rescore) -> Figure:
    """The change of each ride metric by the tuning on each of the other roads, and its mean.

    Metrics without a change in percent, as they are zero or negative on a road or may be, are left out.

    Arguments:
        result: of `tune.rescore`.
    """
    names = result.in_percent
    rows = np.arange(len(names), dtype=float)
    figure = _style.new_figure(8.5, 1.6 + 0.35 * len(names))
    axes = figure.subplots()
    changes = [100.0 * result.change(name) for name in names]
    dots = axes.plot(np.concatenate(changes), np.repeat(rows, result.roads), "o", alpha=0.5, label="a road")
    means = axes.plot([c.mean() for c in changes], rows, "|", color=_style.BLACK, markersize=14, label="mean")
    axes.set_yticks(rows, [_style.metric_words(n) + " (minimised)" * (n == result.metric) for n in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    _style.dress(axes, "change by the tuning [%]", "", f"Ride metrics on {result.roads} other roads", zero="x")
    _style.legend_beside(figure, [*dots, *means])
    return figure


def _panels(count: int, head: float = 0.6, height: float = 2.8) -> tuple[Figure, list[Axes]]:
    """So many panels of this height [inch], three in a row, below a head of this height."""
    rows = -(-count // _COLUMNS)
    figure = _style.new_figure(12.0, head + height * rows)
    grid = figure.add_gridspec(rows, _COLUMNS)
    return figure, [figure.add_subplot(grid[i // _COLUMNS, i % _COLUMNS]) for i in range(count)]


def damper_comparison(comparison: DamperComparison) -> Figure:
    """The change of each metric from the first damper, with its 95 % interval; hollow where it may be none.

    Thick lines are the standard error from the fitted parameters alone.

    Arguments:
        comparison: result of `tune.compare_dampers`.
    """
    remedy = "The call is `damper_comparison(comparison)` with the result of `tune.compare_dampers`."
    _checks.instance("comparison", comparison, DamperComparison, "be a comparison of dampers", remedy)
    first, *others = comparison.values
    base = _style.brief(first)
    metrics = list(comparison.units)
    figure = _style.new_figure(8.5, 1.6 + 0.3 * len(metrics) * max(len(others), 1))
    axes = figure.add_subplot()
    handles = []
    for number, name in enumerate(others):
        rows = np.arange(len(metrics)) + 0.7 * ((number + 0.5) / len(others) - 0.5)
        differences = [comparison.difference(metric, name) for metric in metrics]
        change, margin, from_parameters = (
            np.array([getattr(d, key) for d in differences]) for key in ("change", "margin", "from_parameters")
        )
        colour = _style.COLOURS[number % len(_style.COLOURS)]
        faces = [colour if d.significant else "white" for d in differences]
        thick = {"ecolor": colour, "linewidth": 3.5, "alpha": 0.6}
        axes.errorbar(change, rows, xerr=_finite(margin), fmt="none", ecolor=colour, capsize=3.0, linewidth=1.0)
        axes.errorbar(change, rows, xerr=_finite(from_parameters), fmt="none", **thick)
        axes.scatter(change, rows, 40.0, faces, edgecolors=colour, zorder=3)
        handles.append(axes.scatter([], [], 40.0, colour, label=f"{_style.brief(name)} relative to {base}"))
    axes.set_yticks(range(len(metrics)), [_style.metric_words(metric) for metric in metrics])
    axes.invert_yaxis()
    roads = len(next(iter(comparison.values[first].values())))
    where = f"on the same {roads} roads" if roads > 1 else "on a white road"
    _style.dress(axes, "change [%]", "", f"Ride metrics beside those of {base}, {where}", zero="x")
    axes.grid(False, axis="y")
    _style.legend_above(figure, handles)
    legend = "With 95 % intervals; hollow where there may be no difference; thick: standard error from the parameters."
    _style.note_below(figure, [legend, *map(_style.said, comparison.warnings)])
    return figure


def _finite(errors: np.ndarray) -> np.ndarray:
    """Errors to draw: none where they are unknown, which the notes below say."""
    return np.where(np.isfinite(errors), errors, 0.0)


MOST = 8  # quantities that are drawn


def control_charts(result: ControlCharts) -> Figure:
    """Each quantity in each chart: points over the dampers, the limits, and signals in another colour.

    The baseline is shaded. Individuals are in the unit of the quantity, the others in standard deviations.

    Arguments:
        result: of `identify.control_charts`.
    """
    remedy = "The call is `control_charts(charts)` with the result of `identify.control_charts`."
    _checks.instance("result", result, ControlCharts, "be control charts", remedy)
    drawn = list(result.quantities.items())[:MOST]
    figure = _style.new_figure(4.2 * len(result.charts), 0.9 + 2.4 * len(drawn))
    grid, place = figure.add_gridspec(len(drawn), len(result.charts)), np.arange(len(result.names)) + 1
    for row, (name, unit) in enumerate(drawn):
        for column, (chart, kind) in enumerate(zip(result.charts, result.chart_names, strict=True)):
            axes = figure.add_subplot(grid[row, column])
            scale, centre, label = 1.0, 0.0, "[standard deviations]"
            if chart.name == "individuals":
                scale, centre = float(result.deviation[row]), float(result.centre[row])
                label = f"[{typeset_unit(unit, '–')}]"
            signs = result.signals[name][column]
            axes.axvspan(result.baseline[0] + 0.5, result.baseline[-1] + 1.5, color=_style.SHADE, zorder=0)
            for level, style in ((-chart.limit, "--"), (0.0, "-"), (chart.limit, "--")):
                axes.axhline(centre + scale * level, color=_style.BLACK, linewidth=0.9, linestyle=style)
            for values in {id(v): v for v in chart.statistics(result.scores[:, row])}.values():
                axes.plot(place, centre + scale * values, ".-", color=_style.COLOURS[0], linewidth=0.6, markersize=3)
                out = (signs != 0) & (np.abs(values) > chart.limit)
                axes.plot(place[out], centre + scale * values[out], "o", color=_style.COLOURS[1], markersize=4)
            _style.dress(axes, "damper" if row == len(drawn) - 1 else "", label, f"{name}, {kind}")
    figure.suptitle(f"{len(result.names)} dampers, limits from {result.baseline.size} of them (shaded)")
    more = len(result.quantities) - len(drawn)
    _style.note_below(figure, [f"{more} further quantities are in the tables."] if more else [])
    return figure


def sweep_summary(result: "SweepSummary") -> Figure:
    """A histogram of each result that has one, with its mean and standard deviation; else its mean and range.

    The Pareto set is drawn over its first two results. Points outside the bins are counted in the title.

    Arguments:
        result: of `jaxdamp.sweep(..., summary=...)`.
    """
    remedy = "The call is `sweep_summary(found)` with the result of `jaxdamp.sweep(..., summary=sweeps.Summary())`."
    _checks.instance("result", result, SweepSummary, "be the summary of a sweep", remedy)
    names = [str(name) for name in result.statistics.data_vars]
    count = len(names) + (result.pareto is not None)
    figure, panels = _panels(count, head=0.9)
    for axes, name in zip(panels, names, strict=False):
        _spread(axes, result, name)
    if result.pareto is not None:
        x, y = result.pareto.attrs["objectives"][:2]
        first, second = (str(name) for name in (x, y))
        axes, units = panels[-1], [typeset_unit(result.pareto[name].attrs.get("units", ""), "–") for name in (x, y)]
        axes.plot(result.pareto[x], result.pareto[y], ".", color=_style.COLOURS[1])
        title = f"Pareto set of {result.pareto.sizes['point']} points"
        _style.dress(
            axes, f"{_style.metric_words(first)} [{units[0]}]", f"{_style.metric_words(second)} [{units[1]}]", title
        )
    figure.suptitle(result.summary)
    return figure


def _spread(axes: Axes, result: "SweepSummary", name: str) -> None:
    """A histogram with mean and standard deviation, or these alone between the ends."""
    _, mean, deviation, low, high = result.statistics[name].values.tolist()
    title = _style.metric_words(name)
    if name in result.histograms:
        counts = result.histograms[name]
        lower, upper = counts["lower"].values[1:-1], counts["upper"].values[1:-1]
        axes.bar(lower, counts.values[1:-1], upper - lower, align="edge", color=_style.COLOURS[0], alpha=0.6)
        outside = int(counts.values[0] + counts.values[-1])
        title += f", {outside} points outside" if outside else ""
        label = "points"
    else:
        axes.plot([low, high], [0.0, 0.0], "|-", color=_style.COLOURS[0], markersize=14)
        axes.set_yticks([])
        label = ""
    if np.isfinite(mean):
        axes.axvspan(mean - deviation, mean + deviation, color=_style.SHADE, zorder=0)
        axes.axvline(mean, color=_style.BLACK, linewidth=1.2)
    unit = typeset_unit(result.statistics[name].attrs.get("units", ""), "–")
    _style.dress(axes, f"mean, standard deviation{'' if label else ', range'} [{unit}]", label, title)

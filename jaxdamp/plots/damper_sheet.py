"""The sheet of a damper: one A4 page of what was measured, the law fitted to it, and how far to trust it."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display, rounded
from jaxdamp._tables import typeset_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Axes, Figure
from jaxdamp.bench import BenchRun, Evaluation, LimitCheck, evaluate, last_steady_cycle, peak_velocity_points
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Band, Comparison, FitResult, Rung
from jaxdamp.plots import _sheet, _style, fitted_range
from jaxdamp.plots.evaluation import both_directions, gas_and_friction_words, limit_bars
from jaxdamp.plots.loops import closed_cycle, spread
from jaxdamp.rig import quasi_static


VELOCITIES = (25, 50, 100, 200, 300, 500, 700, 1000, 1500, 2000)  # mm/s, of the table of forces
_MOST_SETTINGS, _MOST_LOOPS, _MOST_ROWS = 4, 6, 11
_MM = 1e3
_SEEN = 0.005  # share of the largest force from which a static force is worth a word


@dataclasses.dataclass(frozen=True)
class _Damper:
    """What a sheet shows: an evaluation of records, and a fit of them if there is one."""

    evaluation: Evaluation
    rung: Rung | None
    fit: FitResult | None
    laws: Mapping[str, AbstractDamper]
    static: Mapping[str, float]  # N, of gas and load cell by setting: in the records and not in the curves
    name: str

    @classmethod
    def of(cls, result: Comparison | FitResult | Evaluation, evaluation: Evaluation | None) -> "_Damper":
        if isinstance(result, Evaluation):
            forces = result.gas_and_friction
            gas = {name: forces[name].gas_force if name in forces else 0.0 for name in result.settings}
            return cls(result, None, None, {}, gas, "Damper records")
        rung, fit = (result.best, result.best.result) if isinstance(result, Comparison) else (None, result)
        measured = evaluate(fit.runs) if evaluation is None else evaluation
        name = _style.law_name(fit.law) if rung is None else _style.in_words(rung.name)
        laws = {_style.in_words(name): law for name, law in rung.laws().items()} if rung else {name: fit.law}
        return cls(measured, rung, fit, laws, dict.fromkeys(measured.settings, fit.static_force), name)

    @property
    def runs(self) -> tuple[BenchRun, ...]:
        return tuple(self.evaluation.runs)

    @functools.cached_property
    def colours(self) -> _style.Look:
        """The colour of each setting; a single one is measured grey."""
        names = list(self.evaluation.settings)
        return {n: _style.graded(i, len(names)) if len(names) > 1 else _style.GREY for i, n in enumerate(names)}

    @property
    def expected(self) -> dict[str, np.ndarray]:
        """The fitted force of each record."""
        if self.fit is None:
            return {}
        return {run.name: force for run, force in zip(self.fit.runs, self.fit.respond(self.fit.runs), strict=True)}

    @property
    def largest(self) -> float:
        return max(float(np.abs(run.force - self.static_of(run)).max()) for run in self.runs)

    def static_of(self, run: BenchRun) -> float:
        """The static force [N] of the setting of a record."""
        return next(self.static[name] for name, runs in self.evaluation.settings.items() if run in runs)


@of_known_numbers
def damper_sheet(
    result: Comparison | FitResult | Evaluation,
    *,
    evaluation: Evaluation | None = None,
    sentence: str = "",
    name: str = "",
    warnings: Sequence[str] | None = None,
    baseline: AbstractDamper | None = None,
    band: Band | None = None,
    limits: LimitCheck | None = None,
) -> Figure:
    """One A4 page of a damper, to print or to send: `result.plot("sheet")`.

    Force over velocity with the points at peak velocity, the loops and the law; forces at stated velocities; loops over
    stroke; the error of each record over its frequency; gas force and friction; parameters; the first warnings. Gas
    force and zero error of the load cell are taken off, and the sheet says how much. Save it by
    `figure.savefig("damper.pdf")`.

    Arguments:
        result: of `identify.compare`, `identify.fit` or `bench.evaluate`.
        evaluation: of `bench.evaluate` for the fitted records; computed if left out.
        sentence: at the top; the verdict or summary of the result if left out.
        name: of the damper; that of the law if left out.
        warnings: doubts, the most important first; those of the result if left out.
        baseline: another law, drawn black and dashed.
        band: 95 % band of the law (`FitResult.band`).
        limits: of `evaluation.check`, drawn as bars and named in the table.
    """
    remedy = "Take the result of `identify.compare`, `identify.fit` or `bench.evaluate`."
    _checks.instance("result", result, (Comparison, FitResult, Evaluation), "be a fit or an evaluation", remedy)
    damper = _Damper.of(result, evaluation)
    if not sentence:
        sentence = result.verdict[0] if isinstance(result, Comparison) else result.summary
    fit = damper.fit
    doubts = damper.evaluation.notes if fit is None else fit.main_warnings or fit.warnings
    with _sheet.lettering():
        figure = _sheet.page()
        rows = figure.add_gridspec(4, 1, height_ratios=(0.95, 4.6, 3.0, 2.5), hspace=0.02)
        _sheet.head(figure.add_subplot(rows[0].subgridspec(1, 1)[0]), name or damper.name, sentence, _facts(damper))
        first = rows[1].subgridspec(1, 2, width_ratios=(2.5, 1.0))
        _force_velocity(figure.add_subplot(first[0]), damper, baseline, band, limits)
        _forces(figure.add_subplot(first[1]), damper)
        second = [figure.add_subplot(at) for at in rows[2].subgridspec(1, 3)]
        _loops(second[0], damper)
        _errors(second[1], damper)
        _gas_and_friction(second[2], damper)
        third = [figure.add_subplot(at) for at in rows[3].subgridspec(1, 2, width_ratios=(1.15, 1.0))]
        _parameters(third[0], damper)
        none = "No warnings" + ": what was fitted is determined, and the residual looks like noise." * bool(fit)
        _sheet.remarks(third[1], "Warnings", doubts if warnings is None else warnings, width=62, none=none)
    return figure


def _facts(damper: _Damper) -> str:
    """Records, their range, temperature and settings in a line."""
    runs, settings = damper.runs, [name for name in damper.evaluation.settings if name]
    fastest, slowest = (end(run.frequency for run in runs) for end in (max, min))
    facts = [f"{len(runs)} record{'s' * (len(runs) > 1)}"]
    facts += [f"{_style.short(slowest)} to {_style.short(fastest)} Hz" if fastest > slowest else f"{fastest:.3g} Hz"]
    facts += [display().words(f"up to {_style.short(_MM * max(run.peak_velocity for run in runs))} mm/s")]
    facts += [f"settings {', '.join(settings)}"] * (len(settings) > 1)
    temperatures = [float(run.temperature.mean()) for run in runs if run.temperature is not None]
    facts += [f"{np.mean(temperatures) - 273.15:.0f} °C"] if temperatures else []
    return " · ".join([*facts, display().text("+ rebound")])


def _force_velocity(
    axes: Axes, damper: _Damper, baseline: AbstractDamper | None, band: Band | None, limits: LimitCheck | None
) -> None:
    """Points at peak velocity over loops, and the law."""
    reach = _MM * max(run.peak_velocity for run in damper.runs)
    lines = _records(axes, damper)
    for number, (label, law) in enumerate(damper.laws.items()):
        alone = len(damper.laws) == 1
        style = _style.AFTER if alone else _style.AFTER | {"color": _style.graded(number, len(damper.laws))}
        _curve(axes, law, reach, "law" if alone else label, style)
    if baseline is not None:
        _curve(axes, baseline, reach, "reference damper", _style.BEFORE)
    if band is not None:
        ends = {"color": _style.AFTER["color"], "alpha": 0.25, "linewidth": 0.0, "label": "95 % band of the law"}
        axes.fill_between(_MM * np.asarray(band.velocity), band.lower, band.upper, **ends)
    if limits is not None:
        _tolerances(axes, limits, damper.static)
    _style.dress(axes, "velocity [mm/s]", "force [N]", _force_title(damper), turns="xy", zero="xy")
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    if len(damper.evaluation.settings) > 1:
        _style.label_ends(axes, lines if damper.fit is None else axes.get_lines()[-len(damper.laws) :])
    else:
        axes.plot([], [], color=_style.GREY, linewidth=0.7, label="loops (CVP)")
        axes.legend(loc="best", frameon=False)


def _records(axes: Axes, damper: _Damper) -> list:
    """Loops and peak-velocity points of each setting; the lines through the points."""
    lines: list = []
    for setting, runs in damper.evaluation.settings.items():
        colour = damper.colours[setting]
        for run in spread(runs, _MOST_LOOPS):
            part = last_steady_cycle(run)
            loop = {"color": colour, "linewidth": 0.7, "alpha": 0.55, "zorder": 1.2}
            axes.plot(_MM * run.velocity[part], run.force[part] - damper.static[setting], **loop)
        peaks = peak_velocity_points(runs)
        velocity, force = (np.asarray(a).ravel() for a in (peaks.velocity, peaks.force))
        order = np.argsort(velocity)
        points = _MM * velocity[order], force[order] - damper.static[setting]
        several = len(damper.evaluation.settings) > 1 and damper.fit is None
        look = {"color": colour, "linestyle": "-" if several else "", "linewidth": 1.4}
        look |= {"marker": "o", "markersize": 4.5, "markerfacecolor": "white", "zorder": 3.0}
        lines += axes.plot(*points, label=setting or "peak-velocity points", **look)
    return lines


def _force_title(damper: _Damper) -> str:
    """What the picture shows, what was taken off, and what the measured forces have more than the law."""
    shown = display().of("N", signed=True)
    least, most = (_style.short(end(map(shown, damper.static.values()))) for end in (min, max))
    span = least if least == most else f"{least} to {most}"
    seen = max(map(abs, damper.static.values())) > _SEEN * damper.largest
    off = f", without the static force of {span} {shown.unit}" if seen else ""
    friction = 0.0 if damper.fit is None or damper.fit.rig is None else float(damper.fit.rig.friction)
    on = f", measured with the machine's friction of {_style.quantity(friction, 'N')}" if friction else ""
    return f"Force over velocity{off}{on}"


def _curve(axes: Axes, law: AbstractDamper, reach: float, label: str, style: Mapping) -> None:
    """A settled law over velocities in mm/s, dotted where it is extrapolated."""
    points = np.linspace(-1.05 * reach, 1.05 * reach, 401) / _MM
    drawn, _ = fitted_range.settled(axes, law, points, "", label=label, **style)
    for line in [*drawn, *[one for one in axes.get_lines()[-2:] if one not in drawn]]:
        if np.size(line.get_xdata()) == points.size:
            line.set_xdata(_MM * points)


def _tolerances(axes: Axes, limits: LimitCheck, static: Mapping[str, float]) -> None:
    """Bars from the least to the largest force at stated velocities, red where the measured force is outside."""
    look: _style.Look = {"linewidth": 6.0, "alpha": 0.6, "zorder": 1.0, "solid_capstyle": "butt"}
    alike = next(iter(static.values()))  # of a fit, whose records may be evaluated without their settings
    for setting, at, ends, passed in limit_bars(limits):
        forces = [end - static.get(setting, alike) for end in ends]
        axes.plot([_MM * at] * 2, forces, color=_style.GOOD if passed else _style.BAD, **look)


def _forces(axes: Axes, damper: _Damper) -> None:
    """Rebound and compression at stated velocities: of the law where there is one, otherwise measured."""
    both = not damper.laws and len(damper.evaluation.settings) > 1  # sides below one another
    newton, speed = display().of("N", signed=True), display().of("mm/s", signed=both)
    if damper.laws:
        reach = _MM * max(run.peak_velocity for run in damper.runs)
        usual = np.array(VELOCITIES) * (1.016 if speed.unit == "in/s" else 1.0)  # round numbers of either
        speeds = np.array([v for v in usual if v <= 1.02 * reach] or [reach], dtype=float) / _MM
        name, law = list(damper.laws.items())[-1]
        sides = np.split(np.asarray(quasi_static(law, np.concatenate([speeds, -speeds])).force), 2)
        title = f"Forces of the law [{newton.unit}]" + f", {name}" * (len(damper.laws) > 1)
        columns = dict(zip(("rebound", "compr."), sides, strict=True))
    else:
        speeds, columns = _measured_forces(damper)
        title = f"Measured forces [{newton.unit}]"
    cells = zip(speed(_MM * speeds), *map(newton, columns.values()), strict=True)
    ends = list(np.linspace(1.0, 0.3, len(columns) + 1)[:-1][::-1])
    step = min(0.066, 0.9 / (len(speeds) + 1))
    _sheet.table(axes, title, [speed.unit, *columns], [[*map(_style.short, row)] for row in cells], ends, step=step)


def _measured_forces(damper: _Damper) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Velocities [m/s] and forces [N] by column: both sides of one setting, or the first settings over both sides."""
    evaluation, settings = damper.evaluation, list(damper.evaluation.settings)[:_MOST_SETTINGS]
    speeds = np.array(evaluation.velocities, dtype=float)
    forces = {
        (side, setting): np.array([evaluation.get(f"{side} force", setting=setting, velocity=v).value for v in speeds])
        - damper.static[setting]
        for side in ("rebound", "compression")
        for setting in settings
    }
    if len(settings) == 1:
        return speeds, {"rebound": forces["rebound", settings[0]], "compr.": forces["compression", settings[0]]}
    both = {s: np.append(forces["rebound", s], forces["compression", s]) for s in settings}
    return np.append(speeds, -speeds), both


def _loops(axes: Axes, damper: _Damper) -> None:
    """Force over stroke by speed: measured broad, the fit thin over it."""
    shown = spread(damper.runs, _MOST_LOOPS)
    fitted = damper.expected
    for number, run in enumerate(shown):
        part, colour = closed_cycle(run), _style.graded(number, len(shown))
        stroke, static = _MM * run.stroke[part], damper.static_of(run)
        force = run.force[part] - static
        broad: _style.Look = {"linewidth": 3.0, "alpha": 0.35} if fitted else {"linewidth": 1.2}
        axes.plot(stroke, force, color=colour, **broad)
        if run.name in fitted:
            expected = fitted[run.name][part] - static
            axes.plot(stroke, expected, color=colour, linewidth=1.0)
    fastest, slowest = (_style.short(_MM * shown[i].peak_velocity) for i in (-1, 0))
    speeds = f"{slowest} to {fastest} mm/s (light)" if len(shown) > 1 else f"{fastest} mm/s"
    title = f"Loops, {speeds}" + ("\nbroad: measured, thin: law" if fitted else "")
    _style.dress(axes, "stroke [mm]", "force [N]", title, turns="xy", zero="xy")


def _errors(axes: Axes, damper: _Damper) -> None:
    """The error of each record over its frequency; without a law, the scatter of its cycles."""
    frequency = {run.name: run.frequency for run in damper.runs}
    if damper.fit is not None:
        groups = {"fitted": damper.fit.scores}
        if damper.rung is not None and damper.rung.judged_on:
            groups = {"fitted": damper.fit.scores, "not fitted": damper.rung.scores}
        sizes = {label: {s.name: s.rmse for s in scores} for label, scores in groups.items()}
        title = "Error of the law"
    else:
        cycles = damper.evaluation.cycles
        values = {name: c.force.std(axis=0, ddof=1).mean() for name, c in cycles.items() if len(c.periods) > 1}
        sizes, title = {"": values}, "Scatter from cycle to cycle"
    for (label, errors), mark in zip(sizes.items(), ("o", "x"), strict=False):
        at = [(frequency[name], 100.0 * rmse / damper.largest) for name, rmse in errors.items() if name in frequency]
        colour = _style.AFTER["color"] if mark == "o" else _style.COLOURS[1]
        if at:
            axes.semilogx(*np.array(at).T, mark, color=colour, markersize=5, label=label)
    _style.dress(axes, "frequency [Hz]", "% of the largest force", f"{title},\nby record")
    _style.plain_log_axis(axes.xaxis)
    axes.set_ylim(0.0, 1.3 * axes.get_ylim()[1])
    if "not fitted" in sizes:
        axes.legend(frameon=False)


def _gas_and_friction(axes: Axes, damper: _Damper) -> None:
    """The slowest record in both directions, with gas force and friction in numbers."""
    separated = next(iter(damper.evaluation.gas_and_friction.values()), None)
    if separated is None:
        note = "Run a slow triangle or sine, below 20 mm/s, to tell gas force from friction."
        _sheet.remarks(axes, "Gas force and friction: not measured", [note], width=36)
        return
    both_directions(axes, separated)
    _style.dress(axes, "stroke [mm]", "force [N]", gas_and_friction_words(separated, ",\n"), turns="xy")


def _parameters(axes: Axes, damper: _Damper) -> None:
    """The numbers of the law with half their 95 % intervals; of records alone, rates, knees, gas force and friction."""
    if damper.fit is not None:
        rows, colours = [], []
        for e in damper.fit.parameters:
            shown = display().of(e.unit)
            factor, unit = (1e3, "ms") if e.unit == "s" else (shown.factor, typeset_unit(shown.unit, "–"))
            half = max(abs(end - e.value) for end in e.interval)  # the side that no edge of the range cuts
            value, error = rounded(factor * e.value, factor * half)
            plain = f"{value} ± {error}".replace("-", "−")
            text = f"{_style.short(factor * e.value)}  ({e.note})" if e.note else plain
            rows.append([_style.path_words(e.name), text, unit])
            colours.append(_style.BAD if e.note else _style.BLACK)
        title, headings = "Parameters, ± 95 %", ["", "value", "unit"]
    else:
        texts = damper.evaluation.settings_table().texts()
        rows = [[name, value.replace("-", "−"), unit] for name, unit, value, *_ in texts if value]
        setting = next(iter(damper.evaluation.settings))
        title, headings = "Rates, knees, gas force" + f", setting {setting}" * bool(setting), ["", "value", "unit"]
        colours = [_style.BLACK] * len(rows)
    more = len(rows) - _MOST_ROWS
    if more > 0:
        rows, colours = [*rows[:_MOST_ROWS], [f"and {more} more on the page", "", ""]], colours[: _MOST_ROWS + 1]
    _sheet.table(axes, title, headings, rows, [0.78, 0.97], step=0.075, colours=colours)

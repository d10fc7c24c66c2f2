"""Laws as curves of force over velocity, all settings of a table, and the card of a law."""

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._field_types import check_module
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Axes, Figure, VectorLike
from jaxdamp.bench import BenchRun, ForceVelocityTable, as_runs, last_steady_cycle, peak_velocity_points
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges
from jaxdamp.identify import Band
from jaxdamp.parameters import FreeParameters, free_parameters
from jaxdamp.plots import _sheet, _style, fitted_range
from jaxdamp.rig import march


_MOST_LABELS = 10  # at the ends of curves
_SAME = 0.005  # difference of curves, relative to the largest force, that a line is too wide to show


@of_known_numbers
def force_velocity(
    laws: AbstractDamper | Mapping[str, AbstractDamper],
    velocities: VectorLike | None = None,
    runs: BenchRun | Sequence[BenchRun] | None = None,
    *,
    baseline: str | None = None,
    note: str = "",
    title: str = "",
    bands: Band | Mapping[str, Band] | None = None,
    static_force: float | Mapping[str, float] = 0.0,
) -> Figure:
    """Force over velocity of one law or several, over the samples and the peak-velocity points of records.

    The first law is blue, others have other colours, the baseline is black and dashed.

    A law with states is drawn at constant velocity with settled states: the curve in the middle of its loops. Where it
    has no settled or no finite force the curve has a gap, and a remark under the picture gives the reason. Outside the
    fitted velocities (`law.fitted_to`) a curve is dotted; where this applies to all laws, the picture is shaded.

    Arguments:
        laws: a law, or laws by name.
        velocities: where to draw the curves [m/s]; the range of the records, or −1 to 1 m/s, if left out.
        runs: measured records to draw under the curves.
        baseline: name of the law to draw as a dashed black line, for comparison.
        note: a remark to write under the picture.
        title: above the picture; the only law and the records if left out.
        bands: 95 % bands of the laws by name (`FitResult.band`), or that of the only law.
        static_force: gas force or zero error [N] in the records and not in the laws, such as
            `result.static_force` of a fit; the points are drawn without it, and a remark says so. If laws were fitted
            with different ones, by the names of the laws: the points are drawn without the first, and each law with the
            difference of its own.

    Raises:
        ValueError: no law, or a baseline or band that is not of one of the laws.
    """
    alone = _style.law_name(laws) if isinstance(laws, AbstractDamper) else ""
    remedy = "Take `result.law` of a fit, or laws by name."
    laws = _style.by_name("laws", laws, AbstractDamper, "a damper law", remedy, alone)
    without, extra = _static_forces(static_force, laws)
    runs = () if runs is None else as_runs(runs)
    runs = tuple(dataclasses.replace(run, force=run.force - without) for run in runs)
    if baseline is not None:
        _checks.one_of("baseline", baseline, laws)
    if velocities is None:
        lower, upper = _range(runs)
        velocities = np.linspace(lower, upper, 401)
    points = np.asarray(velocities, dtype=float)
    figure = _style.new_figure(9.5, 5.5)
    axes = figure.subplots()
    measured = _measured(axes, runs)
    bands = {alone: bands} if isinstance(bands, Band) else bands or {}
    for name in bands:
        _checks.one_of("bands", name, laws)
    curves, gaps = draw_laws(axes, laws, points, baseline, bands, extra)
    shaded = fitted_range.shade(axes, laws.values(), points)
    _style.dress(axes, _style.VELOCITY, _style.FORCE, title or _title(alone, runs), zero="xy")
    axes.set_xlim(float(points.min()), float(points.max()))
    _name(figure, axes, measured, curves, shaded)
    said = f"The measured points are drawn without the static force of {_style.quantity(without, 'N', 'static force')}"
    words = ", and each law with the difference of its own" * any(extra.values())
    remarks = [note, f"{said}{words}: gas or zero error." if runs and (without or words) else "", *gaps, _alike(curves)]
    _style.note_below(figure, [remark for remark in remarks if remark])
    return figure


def _static_forces(
    given: float | Mapping[str, float], laws: Mapping[str, AbstractDamper]
) -> tuple[float, dict[str, float]]:
    """The static force without which records are drawn, and what that of each law is more."""
    by_law = given if isinstance(given, Mapping) else dict.fromkeys(laws, given)
    for name, force in by_law.items():
        _checks.one_of("static_force", name, laws)
        _checks.finite("static_force", force)
    first = float(next(iter(by_law.values()), 0.0))
    return first, {name: float(force) - first for name, force in by_law.items()}


def _name(figure: Figure, axes: Axes, measured: list, curves: list, shaded: list) -> None:
    """Several curves have their names at their ends, one or many in a legend, of many beside the axes."""
    from matplotlib.lines import Line2D

    lines = [curve for curve in curves if isinstance(curve, Line2D)]
    if direct := 1 < len(lines) <= _MOST_LABELS:
        _style.label_ends(axes, lines, outside=True)
    handles = [*measured, *(curve for curve in curves if not (direct and curve in lines)), *shaded]
    if len(lines) > _MOST_LABELS:
        _style.legend_beside(figure, handles)
    elif handles:
        axes.legend(handles=handles, loc="upper left", frameon=False, fontsize="small")


def _alike(curves: list) -> str:
    """Which curves hide one another, in a sentence."""
    from matplotlib.lines import Line2D

    lines = {str(one.get_label()): np.asarray(one.get_ydata(), float) for one in curves if isinstance(one, Line2D)}
    close = _SAME * max((float(np.nanmax(np.abs(force), initial=0.0)) for force in lines.values()), default=0.0)
    groups: dict[str, list[str]] = {}
    for name, force in lines.items():
        same = (first for first in groups if np.allclose(lines[first], force, rtol=0.0, atol=close, equal_nan=True))
        groups.setdefault(next(same, name), []).append(name)
    over = [", ".join(group) for group in groups.values() if len(group) > 1]
    return f"Curves over one another, within {100.0 * _SAME:g} % of the largest force: {'; '.join(over)}." * bool(over)


def _title(law: str, runs: Sequence[BenchRun]) -> str:
    """What the picture shows: the only law, and the records."""
    names = [law] if law else []
    names += [_style.brief(runs[0].name) if len(runs) == 1 else f"{len(runs)} records"] if runs else []
    return "Force over velocity" + (f": {', '.join(names)}" if names else "")


def draw_laws(
    axes: Axes,
    laws: Mapping[str, AbstractDamper],
    velocities: Float[np.ndarray, " points"],
    baseline: str | None,
    bands: Mapping[str, Band] = MappingProxyType({}),
    extra: Mapping[str, float] = MappingProxyType({}),
) -> tuple[list, list[str]]:
    """One curve for each law, with the extra force [N] of some; the handles for the legend, and remarks on gaps."""
    handles, gaps = [], []
    styles = _style.design_styles(list(laws), baseline)
    for name, law in laws.items():
        label, style = _style.in_words(name) + " (settled)" * bool(law.initial_state().size), styles[name]
        more = extra.get(name, 0.0)
        lines, remarks = fitted_range.settled(axes, law, velocities, name, extra=more, label=label, **style)
        handles, gaps = handles + lines, gaps + remarks
        if name in bands:
            band, label = bands[name], f"{_style.in_words(name)}, 95 %"
            shade = {"color": style["color"], "alpha": 0.25, "linewidth": 0.0, "zorder": 2.0, "label": label}
            handles.append(axes.fill_between(band.velocity, band.lower + more, band.upper + more, **shade))
    return handles, gaps


def _range(runs: Sequence[BenchRun]) -> tuple[float, float]:
    if not runs:
        return -1.0, 1.0
    lower, upper = min(run.velocity.min() for run in runs), max(run.velocity.max() for run in runs)
    return 1.05 * float(min(lower, 0.0)), 1.05 * float(max(upper, 0.0))


def _measured(axes: Axes, runs: Sequence[BenchRun]) -> list:
    """Samples as a cloud, points at peak velocity or of a table as rings; the handles for the legend."""
    if not runs:
        return []
    look: _style.Look = {"color": _style.BLACK, "markerfacecolor": "white", "markersize": 4.5, "zorder": 3}
    if all(run.of_points for run in runs):
        velocity, force = np.concatenate([np.stack([run.velocity, run.force]) for run in runs], axis=1)
        return axes.plot(velocity, force, "o", label="points of the table", **look)
    cycles = [np.stack([run.velocity, run.force])[:, last_steady_cycle(run)] for run in runs]
    velocity, force = np.concatenate([cycle[:, :: max(cycle.shape[1] // 400, 1)] for cycle in cycles], axis=1)
    cloud = axes.plot(velocity, force, ".", color="0.58", markersize=2.0, label="measured, last cycles", zorder=0)
    peaks = peak_velocity_points(runs)
    label = "measured at peak velocity"
    return [*cloud, *axes.plot(peaks.velocity.ravel(), peaks.force.ravel(), "o", label=label, **look)]


def force_velocity_family(table: ForceVelocityTable, *, page: bool = False) -> Figure:
    """Force over velocity of every setting of a force-velocity table, dark to light in the order of the settings.

    Arguments:
        table: of `bench.read_table`.
        page: an A4 page to print, with the forces in a table and what was decided below the curves.

    Raises:
        ValueError: something else.
    """
    _checks.instance("table", table, ForceVelocityTable, "be a force-velocity table", "Take `bench.read_table(path)`.")
    figure = _style.new_figure(*(_sheet.A4 if page else (9.5, 5.5)))
    axes, below = figure.subplots(2, height_ratios=(3, 2)) if page else (figure.subplots(), None)
    handles = []
    for index, curve in enumerate(table.curves):
        look = {"color": _style.graded(index, len(table.curves)), "label": _style.brief(curve.setting or table.name)}
        handles += axes.plot(np.asarray(curve.velocity), np.asarray(curve.force), "o-", markersize=4.0, **look)
    _style.dress(axes, _style.VELOCITY, _style.FORCE, f"Force over velocity: {table.name}", zero="xy")
    if below is None:
        _style.legend_beside(figure, handles, "setting" if len(handles) > 1 else "")
        return figure
    if len(handles) > 1:
        axes.legend(handles=handles, title="setting", frameon=False, fontsize="small")
    _write_table(below, table)
    _style.note_below(figure, table.notes)
    return figure


def _write_table(axes: Axes, table: ForceVelocityTable) -> None:
    """The forces as a printed table, in the units that are shown."""
    forces = table.table()
    axes.set_axis_off()
    axes.set_title(display().text(forces.title), loc="left", fontsize="medium")
    headings = [heading.replace(" at ", "\n").replace(" [", "\n[") for heading in forces.headings()]
    drawn = axes.table(cellText=forces.texts(), colLabels=headings, loc="upper center", edges="horizontal")
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(7.0)
    for (row, _), cell in drawn.get_celld().items():
        cell.set_height(0.15 if row == 0 else min(0.055, 0.85 / max(len(forces.rows), 1)))
        cell.set_edgecolor("0.85")


_CYCLES, _SAMPLES = 3, 400  # to settle, and in a cycle
_MOST_CURVES = 8


@eqx.filter_jit
def _response(free: FreeParameters, dt: jax.Array, x: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array]:
    def force(values: jax.Array) -> tuple[jax.Array, jax.Array]:
        forces = march(free.build(values), dt, x, v, 1)
        return forces, forces

    slopes, forces = jax.jacfwd(force, has_aux=True)(free.values)
    return forces, slopes * free.values[None, :]


def _loops(law: AbstractDamper, amplitude: float, frequencies: Sequence[float]) -> list[np.ndarray]:
    """Stroke, velocity, force, and its derivative by each number times this, in the last cycle at each frequency."""
    free = free_parameters(law)
    phase = 2 * np.pi * np.arange(_CYCLES * _SAMPLES + 1) / _SAMPLES
    rows = []
    for frequency in frequencies:
        x, v = amplitude * np.sin(phase), 2 * np.pi * frequency * amplitude * np.cos(phase)
        response = _response(free, *(jnp.asarray(a) for a in (1.0 / (frequency * _SAMPLES), x, v)))
        rows.append([np.asarray(a)[-_SAMPLES - 1 :] for a in (x, v, *response)])
    return [np.stack(column) for column in zip(*rows, strict=True)]


@of_known_numbers
def law_card(
    law: AbstractDamper,
    *,
    amplitude: float = 0.02,
    frequencies: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
    title: str = "",
) -> Figure:
    """Loops of a law over velocity and stroke at several frequencies, and the effect of each of its parameters.

    The effect is p ∂F/∂p, by automatic differentiation through the law and its states: the change of the force [N] for
    a change of the parameter by its own value, over the cycle of the highest frequency. A parameter with a flat curve
    cannot be identified from such a test; two parameters whose curves have the same shape cannot be distinguished.
    Parameters that are zero have no effect. Only the eight largest effects are drawn. Velocities outside the fitted
    range are shaded.

    Arguments:
        law: any law.
        amplitude: amplitude of the sines [m], zero to peak.
        frequencies: frequencies of the sines [Hz].
        title: above the picture; the classes of the law if it is left out.
    """
    check_module("law", law, (AbstractDamper,), "law_card(law)")
    _checks.positive("amplitude", amplitude)
    _checks.positive("frequencies", np.asarray(frequencies))
    stroke, velocity, force, change = _loops(without_fitted_ranges(law), float(amplitude), frequencies)
    figure = _style.new_figure(13.0, 3.9)
    over_velocity, over_stroke, effects = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15))
    named = np.linspace(0, len(frequencies) - 1, min(len(frequencies), _MOST_CURVES)).round()
    for index, frequency in enumerate(frequencies):
        label = f"{_style.short(frequency)} Hz" if index in named else "_nolegend_"
        look = {"color": _style.graded(index, len(frequencies)), "linewidth": 1.6}
        fitted_range.curve(over_velocity, law, velocity[index], force[index], **look)
        over_stroke.plot(1e3 * stroke[index], force[index], label=label, **look)
    fastest = int(np.argmax(frequencies))
    sizes = np.max(np.abs(change[fastest]), axis=0)
    drawn = [int(i) for i in np.argsort(-sizes, kind="stable")[:_MOST_CURVES] if sizes[i] > 0]
    names = free_parameters(law).names
    for number, i in enumerate(drawn):
        look = {"label": _style.in_words(names[i]), "linewidth": 1.4, **_style.line_style(number)}
        effects.plot(velocity[fastest], change[fastest][:, i], **look)
    left_out = int(np.count_nonzero(sizes)) - len(drawn)
    more = f", {left_out} more" if left_out else ""
    _style.dress(over_velocity, _style.VELOCITY, _style.FORCE, zero="xy")
    _style.dress(over_stroke, _style.STROKE, "force [N]", turns="y", zero="xy")
    speed = f"velocity [m/s]   (+ rebound), {frequencies[fastest]:g} Hz"
    _style.dress(effects, speed, "effect p ∂F/∂p [N]", zero="xy")
    reach = float(np.max(np.abs(velocity)))
    points = np.linspace(-reach, reach, 2001)
    shaded = fitted_range.shade(over_velocity, [law], points)
    fitted_range.shade(effects, [law], points, "_nolegend_")
    _style.legend_beside(figure, effects.get_legend_handles_labels()[0], f"effect of{more}")
    heading = f"loops of ±{1e3 * amplitude:g} mm at"
    _style.legend_beside(figure, [*over_stroke.get_legend_handles_labels()[0], *shaded], heading, "lower")
    figure.suptitle(title or _style.law_name(law), x=0.01, ha="left", fontsize="large", fontweight="bold")
    return figure

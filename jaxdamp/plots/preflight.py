"""Findings of a preflight: which is in which record."""

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._types import Figure
from jaxdamp.bench import Finding, Preflight
from jaxdamp.plots import _style


_SHADES = {"error": _style.BAD, "warning": _style.COLOURS[1], "note": _style.COLOURS[0]}  # worst first
_FEWEST = 3  # columns, of which a narrower picture would have too wide ones


def preflight(result: Preflight) -> Figure:
    """A row for each record with findings, a column for each kind of them, the worst first, coloured by severity.

    A cell has the size of the finding; of several of a kind the largest, and their number in brackets.

    Arguments:
        result: of `bench.preflight`.
    """
    from matplotlib.patches import Patch, Rectangle

    _checks.instance("result", result, Preflight, "be a preflight", "Take what `bench.preflight(runs)` gives.")
    worst_first = sorted(result.findings, key=lambda finding: list(_SHADES).index(finding.severity))
    names = list(dict.fromkeys(finding.name for finding in worst_first))
    records = [name for name in result.records if any(name in finding.records for finding in result.findings)]
    figure = _style.new_figure(4.5 + 1.0 * max(len(names), 2), 2.0 + 0.34 * len(records))
    axes = figure.subplots()
    cells: dict[tuple[int, int], list[Finding]] = {}
    for finding in result.findings:
        for record in finding.records:
            cells.setdefault((names.index(finding.name), records.index(record)), []).append(finding)
    for (x, y), findings in cells.items():
        worst = max(findings, key=lambda finding: abs(finding.size or 0.0))
        alpha = 0.25 + 0.2 * (worst.severity == "error")
        axes.add_patch(Rectangle((x - 0.46, y - 0.44), 0.92, 0.88, color=_SHADES[worst.severity], alpha=alpha))
        text = "" if worst.size is None else _size(worst)
        axes.text(x, y, text + f" ({len(findings)})" * (len(findings) > 1), ha="center", va="center", fontsize="small")
    axes.set_xticks(range(len(names)), names, rotation=30, ha="left")
    axes.set_yticks(range(len(records)), list(map(_style.brief, records)))
    axes.xaxis.tick_top()
    axes.set_xlim(-0.5, max(len(names), _FEWEST) - 0.5)
    axes.set_ylim(max(len(records), 1) - 0.5, -0.5)
    axes.set_xticks(np.arange(len(names) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(records) + 1) - 0.5, minor=True)
    axes.grid(True, which="minor", color="0.9", linewidth=0.8)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    clean = len(result.records) - len(records)
    _style.note_below(figure, [f"{clean} of {len(result.records)} records without findings."] * bool(clean))
    figure.suptitle(_style.said(result.summary), wrap=True)
    seen = [(word, colour) for word, colour in _SHADES.items() if any(f.severity == word for f in result.findings)]
    if seen:
        _style.legend_beside(figure, [Patch(color=colour, alpha=0.35, label=word) for word, colour in seen])
    else:
        axes.set_axis_off()
    return figure


def _size(finding: Finding) -> str:
    """The size of a finding in units for people, after E, W or i: not everyone can tell the colours."""
    sign = {"error": "E", "warning": "W"}.get(finding.severity, "i")
    size, unit = finding.size or 0.0, finding.unit
    if unit in ("", "–") and abs(size) < 1.0:
        size, unit = 100.0 * size, "%"
    for large, small in (("s", "ms"), ("m", "mm")):
        size, unit = (1e3 * size, small) if unit == large and abs(size) < 0.1 else (size, unit)
    shown = display().of(unit, signed=display().signed(finding.name))
    return f"{sign}  {_style.short(shown(size))} {shown.unit}"

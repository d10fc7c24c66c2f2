"""The roughness of a road: its spectrum between the classes, and segment by segment."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.metrics import RoughnessBySegment
from jaxdamp.plots import _style
from jaxdamp.roads import RoughnessAssessment, class_limits


def roughness_by_segment(roughness: RoughnessBySegment) -> Figure:
    """The international roughness index of each segment over the distance, and that of the whole profile.

    Arguments:
        roughness: of `metrics.roughness_by_segment`.
    """
    figure = _style.new_figure(8.0, 3.5)
    axes = figure.subplots()
    values, whole = 1e3 * np.asarray(roughness.segments), 1e3 * float(roughness.whole)
    bars = axes.bar(roughness.starts, values, roughness.lengths, align="edge", edgecolor="white", label="segment")
    line = axes.axhline(whole, color=_style.GREY, linestyle="--", label=f"whole profile, {whole:.3g} m/km")
    title = "Roughness by segment"
    if roughness.is_partial:
        title += f" (the last one {roughness.lengths[-1]:.4g} m)"
    _style.dress(axes, "distance [m]", "IRI [m/km]", title)
    _style.legend_beside(figure, [bars, line])
    return figure


def roughness_spectrum(assessment: RoughnessAssessment) -> Figure:
    """The displacement spectrum of a road over the spatial frequency, its straight line, and the classes of ISO 8608.

    Arguments:
        assessment: of `roads.assess_roughness`.
    """
    figure = _style.new_figure(8.5, 5.0)
    axes = figure.subplots()
    n, density = assessment.spatial_frequency, assessment.displacement_psd
    ends = np.array([n[0], n[-1]])
    line = assessment.roughness_psd * (ends / 0.1) ** -assessment.waviness
    handles = axes.loglog(n, density, "o-", color=_style.COLOURS[0], markersize=3.5, label="mean of each band")
    label = f"straight line, waviness {assessment.waviness:.2f}"
    handles += axes.loglog(ends, line, color=_style.COLOURS[1], label=label)
    low, high = axes.get_ylim()
    for name in "ABCDEFG":
        edge = class_limits(name)[1] * (ends / 0.1) ** -2.0
        if edge[0] > low and edge[1] < high:
            axes.loglog(ends, edge, color="0.8", linewidth=0.9, zorder=0)
            at, side = (1, "left") if edge[1] > low else (0, "right")
            shift = (3 if at else -3, -3)
            axes.annotate(name, (ends[at], edge[at]), shift, textcoords="offset points", color="0.5", ha=side)
    axes.set_ylim(low, high)
    _style.dress(axes, "spatial frequency [cycle/m]", "displacement PSD [m³]", f"Road of class {assessment.road_class}")
    _style.legend_beside(figure, handles, "grey: upper ends of the classes")
    return figure

"""The roughness of a road, segment by segment."""

from typing import TYPE_CHECKING

import numpy as np

from jaxdamp.metrics import RoughnessBySegment
from jaxdamp.plots import _style


if TYPE_CHECKING:
    import matplotlib.figure


def roughness_by_segment(roughness: RoughnessBySegment) -> "matplotlib.figure.Figure":
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

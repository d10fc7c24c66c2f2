"""The use of a damper during a ride: force over velocity, and the share of time at each velocity."""

from collections.abc import Mapping

import numpy as np

from jaxdamp import _checks, metrics
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.plots import _style, fitted_range
from jaxdamp.rig import quasi_static
from jaxdamp.simulation import Response


_BINS, _POINTS, _SHADE_POINTS = 41, 81, 2001


@of_known_numbers
def damper_use(responses: Response | Mapping[str, Response], *, damper: str | None = None) -> Figure:
    """Force over velocity during rides, with the quasi-static curve of the law, and histograms of the velocity.

    The histograms are the share of time and the share of dissipated energy in ranges of equal width; they show which
    part of the curve is important on this road. Velocities outside the fitted range of the laws are shaded.

    Arguments:
        responses: a response, or responses by name, of one kind of vehicle.
        damper: name of the damper, such as "front_damper"; the first if it is left out.

    Raises:
        ValueError: no response, an unknown damper, a vehicle without one.
    """
    responses = _style.by_name("responses", responses, Response, "a response", _style.SIMULATE)
    dampers: tuple[str, ...] = next(iter(responses.values())).dampers
    if not dampers:
        _checks.refuse("responses", "be of a vehicle with a damper", "of one without")
    damper = dampers[0] if damper is None else damper
    _checks.one_of("damper", damper, dampers)
    figure = _style.new_figure(12.0, 4.6)
    trace, time_share, energy_share = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 1.0))
    records = {name: _record(response, damper) for name, response in responses.items()}
    reach = 1.02 * max(float(np.max(np.abs(velocity))) for velocity, _ in records.values())
    edges = np.linspace(-reach, reach, _BINS + 1)
    middles, handles, gaps = 0.5 * (edges[1:] + edges[:-1]), [], []
    laws = {name: response.vehicle.frame().element(damper).law for name, response in responses.items()}
    styles = _style.ride_styles(list(laws))
    for name, (velocity, force) in records.items():
        style, law = styles[name], laws[name]
        held = np.linspace(velocity.min(), velocity.max(), _POINTS)
        trace.plot(velocity, force, color=style["color"], linewidth=0.5, alpha=0.5)
        curve = quasi_static(law, held)
        gaps += [f"{name or 'law'}: {curve.note}"] if curve.note else []
        force_held = np.asarray(curve.force)
        handles += fitted_range.curve(trace, law, held, force_held, label=_style.in_words(name) or "law", **style)
        shares = metrics.velocity_histogram(velocity, edges), metrics.dissipation_histogram(force, velocity, edges)
        for axes, share in zip((time_share, energy_share), shares, strict=True):
            axes.step(middles, 100.0 * np.asarray(share), where="mid", **style)
    reached = np.linspace(-reach, reach, _SHADE_POINTS)
    shaded = [fitted_range.shade(axes, laws.values(), reached) for axes in (trace, time_share, energy_share)]
    handles += shaded[0]
    words = f"{damper.replace('_', ' ').capitalize()}: law (thick) and its forces in the ride (thin)"
    _style.dress(trace, _style.VELOCITY, _style.FORCE, words)
    _style.cross(trace)
    _style.dress(time_share, "velocity [m/s]", "share of time [%]", f"Time, {reach / _BINS * 2:.2g} m/s a step")
    _style.dress(energy_share, "velocity [m/s]", "share of dissipated energy [%]", "Energy")
    if len(responses) > 1 or shaded[0]:
        _style.legend_above(figure, handles)
    _style.note_below(figure, gaps)
    return figure


def _record(response: Response, damper: str) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and force of a damper."""
    channels = response.channels
    return np.asarray(channels[f"{damper}_velocity"]), np.asarray(channels[f"{damper}_force"])

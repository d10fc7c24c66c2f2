"""A summary of a law: its loops, and the effect of each parameter."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges
from jaxdamp.parameters import FreeParameters, free_parameters
from jaxdamp.plots import _style, fitted_range
from jaxdamp.rig import march


_CYCLES, _SAMPLES = 3, 400  # to settle, and in a cycle
_MOST_CURVES = 8


class _Loops(NamedTuple):
    """Last cycles at all frequencies: arrays of shape (frequencies, samples), the effects with one axis more."""

    stroke: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    effects: np.ndarray  # derivative of the force by each number, times its value


@eqx.filter_jit
def _response(free: FreeParameters, dt: jax.Array, x: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array]:
    def force(values: jax.Array) -> tuple[jax.Array, jax.Array]:
        forces = march(free.build(values), dt, x, v, 1)
        return forces, forces

    slopes, forces = jax.jacfwd(force, has_aux=True)(free.values)
    return forces, slopes * free.values[None, :]


def _loops(law: AbstractDamper, amplitude: float, frequencies: Sequence[float]) -> _Loops:
    free = free_parameters(law)
    phase = 2 * np.pi * np.arange(_CYCLES * _SAMPLES + 1) / _SAMPLES
    rows = []
    for frequency in frequencies:
        x, v = amplitude * np.sin(phase), 2 * np.pi * frequency * amplitude * np.cos(phase)
        response = _response(free, *(jnp.asarray(a) for a in (1.0 / (frequency * _SAMPLES), x, v)))
        rows.append([np.asarray(a)[-_SAMPLES - 1 :] for a in (x, v, *response)])
    return _Loops(*(np.stack(column) for column in zip(*rows, strict=True)))


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
    loops = _loops(without_fitted_ranges(law), float(amplitude), frequencies)
    figure = _style.new_figure(13.0, 3.9)
    over_velocity, over_stroke, effects = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15))
    for index, frequency in enumerate(frequencies):
        look = {"color": _style.graded(index, len(frequencies)), "linewidth": 1.6}
        fitted_range.curve(over_velocity, law, loops.velocity[index], loops.force[index], **look)
        over_stroke.plot(1e3 * loops.stroke[index], loops.force[index], label=f"{frequency:g} Hz", **look)
    fastest = int(np.argmax(frequencies))
    sizes = np.max(np.abs(loops.effects[fastest]), axis=0)
    drawn = [int(i) for i in np.argsort(-sizes, kind="stable")[:_MOST_CURVES] if sizes[i] > 0]
    names = free_parameters(law).names
    for number, i in enumerate(drawn):
        curve = loops.effects[fastest][:, i]
        effects.plot(
            loops.velocity[fastest], curve, label=_style.in_words(names[i]), linewidth=1.4, **_style.line_style(number)
        )
    left_out = int(np.count_nonzero(sizes)) - len(drawn)
    more = f", {left_out} more" if left_out else ""
    _style.dress(over_velocity, _style.VELOCITY, _style.FORCE)
    _style.dress(over_stroke, _style.STROKE, "force [N]", turns="y")
    _style.dress(effects, f"velocity [m/s]   (+ rebound), {frequencies[fastest]:g} Hz", "effect p ∂F/∂p [N]")
    reach = float(np.max(np.abs(loops.velocity)))
    points = np.linspace(-reach, reach, 2001)
    shaded = fitted_range.shade(over_velocity, [law], points)
    fitted_range.shade(effects, [law], points, "_nolegend_")
    for axes in (over_velocity, over_stroke, effects):
        _style.cross(axes)
    _style.legend_beside(figure, effects.get_legend_handles_labels()[0], f"effect of{more}")
    heading = f"loops of ±{1e3 * amplitude:g} mm at"
    _style.legend_beside(figure, [*over_stroke.get_legend_handles_labels()[0], *shaded], heading, "lower")
    figure.suptitle(title or _style.law_name(law), x=0.01, ha="left", fontsize="large", fontweight="bold")
    return figure

"""The bias of a fit by noise of the measured stroke and velocity, which least squares of the force does not know.

Noise of an input does not average out: it flattens curves, since the law is evaluated at wrong velocities. As much
noise again, added to the records, moves the minimum by about as much as the noise that they contain already (SIMEX with
one step). The shift is estimated from the slope of the sum of squares, each perturbation being used with both signs.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.identify.estimates import Estimate
from jaxdamp.identify.problem import Problem, linearised
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.traces import Batch


DRAWS = 6  # perturbations, each with both signs


def input_noise_bias(problem: Problem, best: SearchEnd, input_noise: tuple[float, float]) -> Float[np.ndarray, " free"]:
    """Estimated bias of each free number, in its unit.

    Arguments:
        problem: a problem on bench records that was minimised.
        best: its minimum.
        input_noise: standard deviations of the stroke [m] and the velocity [m/s] of the records, as independent noise.
    """
    if np.shape(input_noise) != (2,):
        must = "be the standard deviations of stroke [m] and velocity [m/s]"
        _checks.refuse("input_noise", must, input_noise, "Write (1e-5, 0.002).")
    _checks.nonnegative("input_noise", np.array(input_noise, float))
    rng, values = np.random.default_rng(0), jnp.asarray(best.values)
    blocks = np.array([step * run.sampling_rate for step, run in zip(problem.sample_steps, problem.runs, strict=True)])
    deviations = [deviation / np.sqrt(blocks)[problem.owner] for deviation in input_noise]
    slope = np.zeros(best.values.size)
    for _ in range(DRAWS):
        noise = [deviation * rng.standard_normal(deviation.size) for deviation in deviations]
        for sign in (1.0, -1.0):
            residuals = _perturbed(problem, [sign * values for values in noise])
            residual, jacobian = linearised(problem.free, values, residuals)
            slope += np.asarray(jacobian).T @ np.asarray(residual)
    slope = slope / (2 * DRAWS) - best.jacobian.T @ best.residual
    norms = np.linalg.norm(best.jacobian, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    scaled = best.jacobian / scale
    return -np.linalg.lstsq(scaled.T @ scaled, slope / scale, rcond=1e-12)[0] / scale


def _perturbed(problem: Problem, noise: Sequence[np.ndarray]) -> tuple[Any, ...]:
    """The residuals with noise added to stroke and velocity."""
    parts, begin = [], 0
    for part in problem.residuals:
        size = part.used().size
        if isinstance(part, Batch):
            x, v = (values[begin : begin + size].reshape(part.stroke.shape) for values in noise)
            moved = (part.stroke + jnp.asarray(x), part.velocity + jnp.asarray(v))
            part = eqx.tree_at(lambda b: (b.stroke, b.velocity), part, moved)
        parts.append(part)
        begin += size
    return tuple(parts)


def on_bias(estimates: Sequence[Estimate]) -> list[str]:
    """A sentence on each parameter that the noise of stroke and velocity biases by more than its standard error."""
    return [
        f"Noise of stroke and velocity biases {e.name} by about {e.bias:+.2g} {e.unit}".rstrip()
        + f", {abs(e.bias) / e.standard_error:.2g} standard errors: filter the records, or average more cycles."
        for e in estimates
        if e.bias is not None and abs(e.bias) > e.standard_error
    ]

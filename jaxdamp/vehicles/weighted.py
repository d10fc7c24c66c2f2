"""Frequency weightings of ISO 2631-1 added to the state of a linearised vehicle."""

from collections.abc import Sequence

import jax.numpy as jnp
import jax.scipy.linalg

from jaxdamp import _checks
from jaxdamp.metrics import weighting_state_space
from jaxdamp.vehicles.linear import LinearVehicle


def with_weightings(linear: LinearVehicle, weightings: Sequence[tuple[str, str]]) -> LinearVehicle:
    """The linearised vehicle with added channels `weighted_…`: ẇ = A_w w + B_w y, output C_w w, for a channel y.

    `stationary_rms` then gives the weighted RMS of a white road, `frequency_response` the weighted response.

    Arguments:
        linear: result of `linearise`.
        weightings: pairs of a channel and a weighting, such as `[("sprung_acceleration", "Wk")]`.

    Raises:
        ValueError: an unknown channel or weighting.

    >>> from jaxdamp.vehicles import linearise, stationary_rms
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> weighted = with_weightings(linearise(quarter_car_000()), [("sprung_acceleration", "Wk")])
    >>> rms = stationary_rms(weighted, 3e-3)
    >>> [round(float(rms[name]), 3) for name in ("sprung_acceleration", "weighted_sprung_acceleration")]
    [1.6, 1.026]
    """
    for name, _ in weightings:
        _checks.one_of("channel", name, linear.channels)
    filters = [weighting_state_space(weighting) for _, weighting in weightings]
    picked = jnp.array([linear.channels.index(name) for name, _ in weightings], dtype=int)
    size, inner = linear.state_matrix.shape[0], sum(f.input_vector.size for f in filters)
    into = jax.scipy.linalg.block_diag(*[f.input_vector[:, None] for f in filters])
    out = jax.scipy.linalg.block_diag(*[f.output_vector[None, :] for f in filters])
    own = jax.scipy.linalg.block_diag(*[f.state_matrix for f in filters])
    above = jnp.concatenate([linear.state_matrix, jnp.zeros((size, inner))], axis=1)
    below = jnp.concatenate([into @ linear.output[picked], own], axis=1)
    unweighted = jnp.concatenate([linear.output, jnp.zeros((len(linear.channels), inner))], axis=1)
    weighted = jnp.concatenate([jnp.zeros((len(filters), size)), out], axis=1)
    wheels = linear.road_input.shape[1]
    nothing = jnp.zeros((len(filters), wheels))
    return LinearVehicle(
        jnp.concatenate([above, below]),
        jnp.concatenate([linear.road_input, into @ linear.road_feed[picked]]),
        jnp.concatenate([linear.road_rate_input, into @ linear.feed_through[picked]]),
        jnp.concatenate([unweighted, weighted]),
        jnp.concatenate([linear.road_feed, nothing]),
        jnp.concatenate([linear.feed_through, nothing]),
        linear.behind,
        linear.left,
        linear.coordinates,
        (*linear.channels, *[f"weighted_{name}" for name, _ in weightings]),
        linear.axles,
    )

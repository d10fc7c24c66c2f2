"""The error of a step, estimated: a stretch of the run driven with it and with half of it."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar
from jaxdamp._vectors import between
from jaxdamp.simulation.equations import Equations, RoadInput, StepState, road_rate, settled
from jaxdamp.vehicles import System


STRETCH = 2000  # steps that are driven twice, at most
ORDER = 2  # of the engine at kinks of laws, and of a road that is straight between instants
QUIET = 1e-9  # RMS of a channel, in its SI unit, below which it is taken for zero
SMALL = 1e-3  # share of the largest RMS of its unit below which a channel does not count


class StepError(NamedTuple):
    """The channel with the largest error, and the RMS of that error over the RMS of the channel."""

    channel: str
    error: float


def step_error(
    system: System,
    heights: Float[np.ndarray, "time wheels"],
    half: Callable[[], Float[Array, "fine wheels"]],
    dt: float,
    substeps: int,
    start: Float[Array, " n"] | None,
) -> StepError:
    """Estimate of the error of a run, from a comparison with half the step (Richardson).

    The roughest stretch of the road of up to 2000 steps is driven twice, with steps of dt on the heights at the
    instants and with steps of dt/2 on the heights at twice as many, so that what the instants miss of the road counts.
    An error that falls with the square of the step is 4/3 of the difference.

    Arguments:
        system: a vehicle whose numbers are known.
        heights: under the wheels at the instants [m].
        half: gives the heights at twice as many instants [m].
        dt: spacing of the instants [s].
        substeps: steps between two instants.
        start: the motion (q, q̇) at time zero; left out, at rest on the first height of the stretch.
    """
    count = heights.shape[0] - 1
    length = min(count, STRETCH)
    first = 0 if start is not None else _roughest(heights, length)
    fine = half()[2 * first : 2 * (first + length) + 1]
    coarse = jnp.asarray(heights)[first : first + length + 1]
    names = tuple(dict.fromkeys(m.channel for m in system.layout.metrics if m.statistic.name == "rms"))
    if start is None:
        start = settled(system, coarse[0])
        if not np.all(np.isfinite(np.asarray(start))):  # no equilibrium, which the run will say
            return StepError(names[0], 0.0)
    long, short = (
        np.asarray(_driven(system, _padded(z), start, jnp.asarray(step, float), jnp.asarray(substeps), names))[: len(z)]
        for z, step in ((coarse, dt), (fine, 0.5 * dt))
    )
    size, difference = (np.sqrt(np.mean(y * y, axis=0)) for y in (short, long - short[::2]))
    if not np.all(np.isfinite(difference)):
        return StepError(names[int(np.argmin(np.isfinite(difference)))], np.inf)
    units = [system.layout.units[name] for name in names]
    largest = {unit: max(s for s, u in zip(size, units, strict=True) if u == unit) for unit in units}
    floor = np.array([max(QUIET, SMALL * largest[unit]) for unit in units])
    errors = np.where(size > floor, difference / np.maximum(size, floor), 0.0) * 2**ORDER / (2**ORDER - 1)
    worst = int(np.argmax(errors))
    return StepError(names[worst], float(errors[worst]))


def _roughest(heights: Float[np.ndarray, "time wheels"], length: int) -> int:
    """Where the stretch of so many steps begins over which the road's rate is largest."""
    rough = np.concatenate([[0.0], np.cumsum(np.sum(np.diff(heights, axis=0) ** 2, axis=1))])
    return int(np.argmax(rough[length:] - rough[: rough.size - length]))


def _padded(heights: Float[Array, "time wheels"]) -> tuple[Float[Array, "padded wheels"], Array]:
    """Heights in an array of one length for all stretches, so that a vehicle is compiled once; the number of steps."""
    missing = 2 * STRETCH + 1 - heights.shape[0]
    return jnp.pad(heights, ((0, missing), (0, 0)), mode="edge"), jnp.asarray(heights.shape[0] - 1)


@compiled_for_loops
def _driven(
    system: System,
    road: tuple[Float[Array, "time wheels"], Array],
    start: Float[Array, " n"],
    dt: Scalar,
    substeps: Array,
    names: tuple[str, ...],
) -> Float[Array, "time channels"]:
    """Channels at the instants of a run, zero after its last step."""
    from jaxdamp.simulation.exponential import ExponentialStepper  # which asks for this estimate itself

    (heights, count), parts = road, substeps.astype(dt.dtype)
    system = system.passive()  # the jumps of a controller would be compared, not the step
    outputs, stepper = system.channels(names), ExponentialStepper(Equations(system), dt / parts)
    slopes = road_rate(heights, dt)

    def ground(i: Array) -> RoadInput:
        whole = jnp.minimum(i // substeps, heights.shape[0] - 2)
        share = (i - whole * substeps).astype(dt.dtype) / parts
        return RoadInput(*(between(a[whole], a[whole + 1], share) for a in (heights, slopes)))

    def step(i: Array, carry: tuple[StepState, Array]) -> tuple[StepState, Array]:
        now, gathered = carry
        now = stepper(now, ground(i), ground(i + 1))
        number = (i + substeps) // substeps  # the last of an interval is the instant's
        return now, gathered.at[number].set(values(now, ground(i + 1)))

    def values(now: StepState, at: RoadInput) -> Float[Array, " channels"]:
        return outputs(now.motion, now.force, at.height, at.rate)

    first = ground(jnp.zeros_like(count))
    now = stepper.start(start, first)
    gathered = jnp.zeros((heights.shape[0], len(names)), heights.dtype).at[0].set(values(now, first))
    return jax.lax.fori_loop(0, count * substeps, step, (now, gathered))[1]

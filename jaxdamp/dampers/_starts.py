"""Starting values of fits: from the samples of records, and further ones that may lead to another minimum."""

import dataclasses
import inspect
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np


class Reach(NamedTuple):
    """The extent of records.

    Attributes:
        stroke: half the range of the stroke [m].
        velocity: largest magnitude of the velocity [m/s].
    """

    stroke: float  # half the range [m]
    velocity: float  # largest magnitude [m/s]


def from_samples(make: Callable[..., Any], runs: Sequence[Any]) -> Any:
    """The law that a function makes from the samples of all records one after the other.

    The function gets velocity and force as its first two arguments, and `stroke` and `time` if it has arguments of
    these names.

    Arguments:
        make: function of velocity [m/s] and force [N], such as the `guess` of a law.
        runs: the records.
    """
    names = inspect.signature(make).parameters
    channels = ["velocity", "force", *(name for name in ("stroke", "time") if name in names)]
    velocity, force, *others = (np.concatenate([getattr(run, name) for run in runs]) for name in channels)
    return make(velocity, force, **dict(zip(channels[2:], others, strict=True)))


def starts_of_bends(law: Any, reach: Reach) -> list[dict[str, float]]:
    """A quarter and four times each positive parameter that may determine where the force curve bends.

    These are the parameters in m/s, m or s in which the force is not linear; the values are limited to between 1 % and
    100 % of the extent of the records.
    """
    spans = {"m/s": reach.velocity, "m": reach.stroke}
    starts = []
    for field in dataclasses.fields(law):
        declared = field.metadata.get("parameter")
        if declared is None or declared["unit"] not in ("m/s", "m", "s") or declared["linear"]:
            continue
        value = np.asarray(getattr(law, field.name))
        if value.ndim or not value > 0:
            continue
        span = spans.get(declared["unit"], np.inf)
        least = 0.0 if np.isinf(span) else 0.01 * span
        starts += [{field.name: float(np.clip(factor * value, least, span))} for factor in (0.25, 4.0)]
    return starts

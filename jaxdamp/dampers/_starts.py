"""Start values from which a fit may end in another minimum."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np


class Reach(NamedTuple):
    """How far records go."""

    stroke: float  # half the range [m]
    velocity: float  # largest magnitude [m/s]


def starts_of_bends(law: Any, reach: Reach) -> list[dict[str, float]]:
    """A quarter and four times each positive number of a law at which its force may bend, within the records.

    Such are the numbers in m/s, m or s in which the force is not linear; they are kept between a hundredth of the reach
    of the records and all of it.
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

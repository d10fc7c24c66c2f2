"""Every law inside every wrapper: it is taken and gives finite forces, or is refused in words."""

import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import (
    Bushing,
    FrequencySelective,
    Lag,
    Linear,
    MotionRatio,
    Scheduled,
    SeriesSpring,
    Spring,
    StrokeDependent,
    Sum,
    TemperatureScaled,
)

from .test_contract import FURTHER, LAWS


TAKING_ALL = {
    "scaled": lambda law: 0.7 * law,
    "sum": lambda law: Sum((law, Spring(1e3), law)),
    "motion ratio": lambda law: MotionRatio(law, 0.8),
    "another temperature": lambda law: TemperatureScaled(law, 313.15),
    "scheduled": lambda law: Scheduled((law, law), [0.0, 1.0], 0.4),
    "lag": lambda law: Lag(law, 0.004),
}
SERIES = {"series spring": lambda law: SeriesSpring(law, 5e5), "bushing": lambda law: Bushing(law, 2e6, 6e5, 800.0)}
MEMORYLESS = {
    "between strokes": lambda law: StrokeDependent((law, law), [-0.01, 0.01]),
    "frequency selective": lambda law: FrequencySelective(law, Linear(500.0), 0.03, 0.003),
}
REFUSALS = {"series": "answers the velocity at once", "memoryless": "be without states"}
TIME = 1e-3 * np.arange(25)
# rubber and laws need not slide in these: a law in series has to resist more the faster it moves
FALLING = {"slopes, falling"}


def taken(law, wrappers, refusal):
    """The law in each of the wrappers; none if it is refused, as all of them must then."""
    made = []
    for wrap in wrappers.values():
        try:
            made.append(wrap(law))
        except ValueError as error:
            assert refusal in str(error)
    assert len(made) in (0, len(wrappers))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LAWS if name not in FURTHER])
def test_forces_are_finite(name):
    law = LAWS[name]()
    wrapped = [wrap(law) for wrap in TAKING_ALL.values()]
    memoryless = taken(law, MEMORYLESS, REFUSALS["memoryless"])
    assert bool(memoryless) == (law.initial_state().size == 0)
    wrapped += memoryless
    if name not in FALLING:
        wrapped += taken(law, SERIES, REFUSALS["series"])
    stroke, velocity = 0.006 * np.sin(60.0 * TIME), 0.36 * np.cos(60.0 * TIME)
    force = np.asarray(respond(Sum(tuple(wrapped)), TIME, stroke, velocity))
    assert np.all(np.isfinite(force)) and np.ptp(force) > 1.0

"""The Fisher information that tests would give on the parameters of a law, before any of them is run."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.bench import BenchRun, Excitation
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import linearised
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters
from jaxdamp.rig import Rig


class Information(NamedTuple):
    """What tests say of the free parameters.

    Attributes:
        free: the free parameters.
        matrices: Fisher information of each test, in the units of the parameters.
        force: largest |F| in each test [N].
        power: mean F v of each test [W].
    """

    free: FreeParameters
    matrices: Float[np.ndarray, "tests free free"]
    force: Float[np.ndarray, " tests"]
    power: Float[np.ndarray, " tests"]


def information(
    law: AbstractDamper,
    tests: Sequence[Excitation],
    *,
    rig: Rig | None,
    freeze: Sequence[str],
    tie: Mapping[str, str] | None,
    sampling_rate: float,
    force_noise: float,
) -> Information:
    """What tests would say of the free parameters of a law on a machine, by the model that a fit would use.

    Arguments:
        law: the law, with the values that are expected.
        tests: the tests.
        rig: as in `fit`.
        freeze: as in `fit`.
        tie: as in `fit`.
        sampling_rate: of the records [Hz].
        force_noise: standard deviation of a sample of the force [N], as white noise.
    """
    runs = [_motion(test, number, sampling_rate) for number, test in enumerate(tests)]
    problem = prepare(law, runs, rig=rig, freeze=freeze, tie=tie)
    residual, jacobian = map(np.asarray, linearised(problem.free, problem.free.values, problem.residuals))
    batches = [part for part in problem.residuals if isinstance(part, Batch)]
    weight, measured, velocity = (
        np.concatenate([np.ravel(getattr(batch, name)) for batch in batches])
        for name in ("weight", "force", "velocity")
    )
    force = np.divide(residual, weight, out=np.zeros_like(residual), where=weight > 0) + measured
    rows = [np.flatnonzero(problem.used & (problem.owner == i)) for i in range(len(runs))]
    matrices = np.stack([jacobian[k].T @ jacobian[k] for k in rows]) / force_noise**2
    largest = np.array([np.max(np.abs(force[k])) for k in rows])
    power = np.array([np.mean(force[k] * velocity[k]) for k in rows])
    return Information(problem.free, matrices, largest, power)


def _motion(test: Excitation, number: int, sampling_rate: float) -> BenchRun:
    """A test as a record whose force does not matter."""
    time = np.arange(round(test.duration * sampling_rate)) / sampling_rate
    velocity = test.velocity(time)
    return BenchRun(f"{number}", time, test.stroke(time), velocity, velocity)

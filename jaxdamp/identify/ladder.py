"""The ladder: laws from plain to rich, each with a start taken from the records."""

import functools
from collections.abc import Iterable, Sequence

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.dampers import (
    AbstractDamper,
    AbstractMemoryless,
    Besinger,
    Bilinear,
    BoucWen,
    CoulombFriction,
    Lag,
    Linear,
    LuGre,
    PiecewiseLinear,
    Polynomial,
    PowerLaw,
    SegmentedPolynomial,
    SeriesSpring,
    Spring,
    Table,
)
from jaxdamp.identify.fitting import NUMERICAL
from jaxdamp.identify.laws import NAMED_LAWS
from jaxdamp.identify.starting import Start, started


def lag_time(runs: Sequence[BenchRun]) -> float:
    """Time [s] by which the force trails the velocity, from the phase of their fundamentals: tan(φ)/ω, the median."""
    times = []
    for run in runs:
        omega = 2 * np.pi * run.frequency
        turning = np.exp(-1j * omega * run.time) * np.hanning(len(run))
        lead = np.angle((run.velocity - run.velocity.mean()) @ turning / ((run.force - run.force.mean()) @ turning))
        if 0.0 < lead < 1.4:
            times.append(np.tan(lead) / omega)
    return float(np.clip(np.median(times) if times else 1e-3, 1e-4, 0.1))


def _friction(velocity: np.ndarray, force: np.ndarray) -> AbstractDamper:
    friction = CoulombFriction.guess(velocity, force)
    rest = force - float(friction.friction_force) * np.tanh(velocity / float(friction.friction_velocity))
    return Linear.guess(velocity, rest) + friction


def _rate(law: AbstractMemoryless, velocity: np.ndarray) -> float:
    """Secant slope [N s/m] at the RMS velocity."""
    v = float(np.sqrt(np.mean(velocity**2)))
    return float(law.force_velocity(v) - law.force_velocity(-v)) / (2 * v)


_MEMORYLESS = {
    "linear": Linear.guess,
    "bilinear": Bilinear.guess,
    "power_law": PowerLaw.guess,
    "polynomial": Polynomial.guess,
    "segmented_polynomial": SegmentedPolynomial.guess,
    "piecewise_linear": PiecewiseLinear.guess,
    "table": Table.guess,
    "besinger": Besinger.guess,
    "linear_friction": _friction,
}
LAWS = tuple(NAMED_LAWS)


def ladder_starts(names: Sequence[str] = LAWS) -> dict[str, Start]:
    """Laws of the ladder as functions of the records: each fit starts them anew from its own records.

    For `cross_validate`, where nothing of the record held out may leak into a start.

    Raises:
        ValueError: an unknown name.

    >>> list(ladder_starts(["linear", "besinger_lag"]))
    ['linear', 'besinger_lag']
    """
    names = [names] if isinstance(names, str) else names
    for name in names:
        _checks.one_of("law", name, LAWS)
    return {name: functools.partial(_start, name) for name in names}


def default_ladder(runs: Iterable[BenchRun], names: Sequence[str] = LAWS) -> dict[str, Start]:
    """Laws from plain to rich by name, each started from the records, ready for `compare` or `fit`.

    Memoryless: `linear`, `bilinear`, `power_law`, `polynomial` (degree 5), `segmented_polynomial` (paper 000),
    `piecewise_linear`, `table`, `besinger` (paper 001), `linear_friction` (with smooth Coulomb friction). With
    hysteresis: `besinger_lag`, `besinger_series_spring` (paper 001), `linear_friction_lag`, and for friction that gives
    before it slides, as in magnetorheological dampers, `bouc_wen` and `lugre_spring` (with a spring beside it).

    A law that cannot be started from these records is a function in its place, which raises the reason when a fit calls
    it; `compare` goes on with the others.

    Raises:
        ValueError: an unknown name.
    """
    runs = as_runs(runs, call="default_ladder(runs, names)")
    ladder: dict[str, Start] = {}
    for name, start in ladder_starts(names).items():
        try:
            ladder[name] = started(start, runs)
        except NUMERICAL as error:
            ladder[name] = functools.partial(_no_start, error)
    return ladder


def _no_start(error: Exception, runs: Sequence[BenchRun]) -> AbstractDamper:
    """The place of a start that could not be made."""
    del runs
    raise ValueError(f"No start can be made from these records: {error}") from error


def _start(name: str, runs: Sequence[BenchRun]) -> AbstractDamper:
    """The start of one law of the ladder."""
    velocity = np.concatenate([run.velocity for run in runs])
    force = np.concatenate([run.force for run in runs])
    if name in _MEMORYLESS:
        return _MEMORYLESS[name](velocity, force)
    if name == "linear_friction_lag":
        return Lag(_friction(velocity, force), lag_time(runs))
    if name == "bouc_wen":
        return BoucWen.guess(velocity, force)
    if name == "lugre_spring":
        stroke = np.concatenate([run.stroke for run in runs])
        return LuGre.guess(velocity, force) + Spring.guess(velocity, force, stroke)
    law, lag = Besinger.guess(velocity, force), lag_time(runs)
    if name == "besinger_lag":
        return Lag(law, lag)
    stiffness = max(_rate(law, velocity), 1.0) / lag
    deflection = float(np.sqrt(np.mean(force**2))) / stiffness
    return SeriesSpring(law, stiffness, 0.1 * stiffness / deflection**2)

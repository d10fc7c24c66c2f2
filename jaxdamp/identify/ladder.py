"""The ladder: laws from simple to complex, each with a start from the records."""

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
    Dahl,
    Lag,
    Linear,
    LuGre,
    PiecewiseLinear,
    Play,
    Polynomial,
    PowerLaw,
    SegmentedPolynomial,
    SeriesSpring,
    Spring,
    Table,
    ViscoPlastic,
)
from jaxdamp.identify.fitting import NUMERICAL
from jaxdamp.identify.laws import NAMED_LAWS
from jaxdamp.identify.learnt import LearntStart
from jaxdamp.identify.machine import OFFSET, Machine, lag_time, started_on
from jaxdamp.identify.starting import Start


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
_BESIDE_SPRING = {"lugre_spring": LuGre.guess, "visco_plastic_spring": ViscoPlastic.guess}
LEARNT = "neural_hysteresis_spring"
LAWS = tuple(name for name, law in NAMED_LAWS.items() if not law.optional)


def ladder_starts(names: Sequence[str] = LAWS) -> dict[str, Start]:
    """Laws of the ladder as functions of the records, which compute the start of each fit from its own records.

    For `cross_validate`, where the held-out record must not influence the start.

    Arguments:
        names: of the laws.

    Raises:
        ValueError: an unknown name.

    >>> list(ladder_starts(["linear", "besinger_lag"]))
    ['linear', 'besinger_lag']
    """
    names = [names] if isinstance(names, str) else names
    for name in names:
        _checks.one_of("law", name, tuple(NAMED_LAWS))
    return {name: LearntStart() if name == LEARNT else functools.partial(_start, name) for name in names}


def default_ladder(runs: Iterable[BenchRun], names: Sequence[str] = LAWS, *, rig: Machine = OFFSET) -> dict[str, Start]:
    """Laws from simple to complex by name, each with a start from the records, for `compare` or `fit`.

    Memoryless: `linear`, `bilinear`, `power_law`, `polynomial` (degree 5), `segmented_polynomial` (paper 000),
    `piecewise_linear`, `table`, `besinger` (paper 001), `linear_friction` (with smooth Coulomb friction). With
    hysteresis: `besinger_lag`, `besinger_series_spring` (paper 001), `linear_friction_lag`, and for friction with
    elastic deformation before sliding, as in magnetorheological dampers, `bouc_wen`, `lugre_spring` and
    `visco_plastic_spring` (with a parallel spring). `besinger_play` has a clearance in series, and `series_spring_dahl`
    a piecewise-linear law behind a spring, beside friction and a spring. Only if it is named:
    `neural_hysteresis_spring`, trained on the records (`LearntStart`).

    If a start cannot be computed from these records, the entry is a function that raises the reason when a fit calls
    it; `compare` continues with the other laws.

    Arguments:
        runs: records to start from.
        names: of the laws.
        rig: the test machine as in `compare`, whose gas force and offset the starts do not contain.

    Raises:
        ValueError: an unknown name.
    """
    runs = as_runs(runs, call="default_ladder(runs, names)")
    ladder: dict[str, Start] = {}
    for name, start in ladder_starts(names).items():
        if isinstance(start, LearntStart):
            ladder[name] = start  # its training is the work of the fit
            continue
        try:
            ladder[name] = started_on(start, runs, rig).law
        except NUMERICAL as error:
            ladder[name] = functools.partial(_no_start, error)
    return ladder


def _no_start(error: Exception, runs: Sequence[BenchRun]) -> AbstractDamper:
    """Replaces a start that could not be computed."""
    del runs
    raise ValueError(f"No start can be computed from these records: {error}") from error


def _start(name: str, runs: Sequence[BenchRun]) -> AbstractDamper:
    """The start of one law of the ladder."""
    velocity, force, stroke = (
        np.concatenate([getattr(run, channel) for run in runs]) for channel in ("velocity", "force", "stroke")
    )
    if name in _MEMORYLESS:
        return _MEMORYLESS[name](velocity, force)
    if name == "linear_friction_lag":
        return Lag(_friction(velocity, force), lag_time(runs))
    if name == "bouc_wen":
        return BoucWen.guess(velocity, force)
    if name in _BESIDE_SPRING:
        return _BESIDE_SPRING[name](velocity, force) + Spring.guess(velocity, force, stroke)
    if name == "series_spring_dahl":
        curve, friction = PiecewiseLinear.guess(velocity, force), Dahl.guess(velocity, 0.2 * force)
        spring = Spring.guess(velocity, force, stroke)
        return SeriesSpring(curve, _stiffness(curve, lag_time(runs), velocity)) + friction + spring
    law, lag = Besinger.guess(velocity, force), lag_time(runs)
    if name == "besinger_lag":
        return Lag(law, lag)
    stiffness = _stiffness(law, lag, velocity)
    deflection = float(np.sqrt(np.mean(force**2))) / stiffness
    if name == "besinger_play":
        return Play(law, stiffness, 0.5 * deflection)
    return SeriesSpring(law, stiffness, 0.1 * stiffness / deflection**2)


def _stiffness(law: AbstractMemoryless, lag: float, velocity: np.ndarray) -> float:
    """Stiffness [N/m] in series with which a law has this lag [s]."""
    return max(_rate(law, velocity), 1.0) / lag

"""The ladder of laws: their names, their starts, and starts that are learnt from the records."""

import functools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp import _checks, dampers
from jaxdamp._tables import Column, Table
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
    StrokeScaled,
    Thinned,
    ViscoPlastic,
)
from jaxdamp.identify.fitting import NUMERICAL
from jaxdamp.identify.machine import OFFSET, Machine, force_at, lag_time, started_on
from jaxdamp.identify.starting import LearntStart, Start


def _friction(velocity: np.ndarray, force: np.ndarray) -> AbstractDamper:
    friction = CoulombFriction.guess(velocity, force)
    without_friction = force - float(friction.friction_force) * np.tanh(velocity / float(friction.friction_velocity))
    return Linear.guess(velocity, without_friction) + friction


_MEMORYLESS = {
    "linear": Linear.guess,
    "bilinear": Bilinear.guess,
    "power_law": PowerLaw.guess,
    "polynomial": Polynomial.guess,
    "segmented_polynomial": SegmentedPolynomial.guess,
    "piecewise_linear": PiecewiseLinear.guess,
    "table": dampers.Table.guess,
    "besinger": Besinger.guess,
    "linear_friction": _friction,
}


def _thinned(velocity: np.ndarray, force: np.ndarray) -> AbstractDamper:
    """Half of the force is lost at the largest velocity, almost at once."""
    return Thinned(StrokeScaled(ViscoPlastic.guess(velocity, force)), float(np.max(np.abs(velocity))), RECOVERY)


_BESIDE_SPRING = {
    "lugre_spring": LuGre.guess,
    "visco_plastic_spring": ViscoPlastic.guess,
    "thinned_visco_plastic": _thinned,
}
LEARNT = "neural_hysteresis_spring"


class NamedLaw(NamedTuple):
    """A law that can be fitted by name.

    Attributes:
        hysteresis: whether the law has states.
        meaning: of the law, in words.
        optional: fitted only where it is asked for by name.
    """

    hysteresis: bool
    meaning: str
    optional: bool = False


NAMED_LAWS = {
    "linear": NamedLaw(False, "one damping coefficient"),
    "bilinear": NamedLaw(False, "one coefficient in rebound, one in compression"),
    "power_law": NamedLaw(False, "power of the velocity with an offset, on each side"),
    "polynomial": NamedLaw(False, "odd and even powers of the velocity, up to the fifth"),
    "segmented_polynomial": NamedLaw(False, "five polynomials that join, monotone"),
    "piecewise_linear": NamedLaw(False, "straight lines between knees"),
    "table": NamedLaw(False, "forces at fixed velocities, straight lines between them"),
    "besinger": NamedLaw(False, "smooth change from compression to rebound, with a blow-off valve"),
    "linear_friction": NamedLaw(False, "one coefficient and smooth Coulomb friction"),
    "besinger_lag": NamedLaw(True, "besinger behind a first-order lag"),
    "besinger_series_spring": NamedLaw(True, "besinger in series with a spring: mount, bushing or oil column"),
    "linear_friction_lag": NamedLaw(True, "linear_friction behind a first-order lag"),
    "bouc_wen": NamedLaw(True, "one coefficient, friction that gives before it slides, a spring"),
    "lugre_spring": NamedLaw(True, "friction that sticks, breaks away and slides, one coefficient, a spring"),
    "besinger_play": NamedLaw(True, "besinger behind a clearance: worn joint, loose mount, void in the oil"),
    "series_spring_dahl": NamedLaw(True, "piecewise_linear in series with a spring, elastic friction, a spring"),
    "visco_plastic_spring": NamedLaw(True, "concave viscous force, two yielding elements, a spring"),
    "thinned_visco_plastic": NamedLaw(
        True,
        "visco_plastic_spring whose force falls in motion and changes along the stroke; only by name",
        optional=True,
    ),
    "neural_hysteresis_spring": NamedLaw(
        True, "one coefficient, hysteresis learnt by a network, a spring; takes minutes, only by name", optional=True
    ),
}

LAWS = tuple(name for name, law in NAMED_LAWS.items() if not law.optional)
CURVES = ("bilinear", "besinger", "piecewise_linear")  # tried on all records
LAGGING, RUBBING = ("besinger_lag", "besinger_series_spring"), ("lugre_spring", "series_spring_dahl")
KNEES = 2  # on each side, of the curve in series_spring_dahl: with three, measured records leave more in doubt
RECOVERY = 0.02  # s, short: from 0.3 s fits of records without thinning end at worse minima
BINS = 30  # of the velocity, in which the halves of a stroke are compared
LOOP = 2e-3  # share of the squared force that is hysteresis, above which records show a loop
DRY = 0.5  # share of the loop that is within `SLOW` of the largest velocity: friction that gives before it slides
SLOW = 0.2


def suited_laws(runs: Iterable[BenchRun]) -> tuple[str, ...]:
    """A short ladder for these records: three curves over velocity, and three laws that a loop in them calls for.

    A loop is the difference of the forces at one velocity above and below mid-stroke. Records without one get two more
    curves and a law that a small lag would show in; a loop at all velocities gets laws with a lag, one that is widest
    at low velocity those with friction that gives before it slides; where neither prevails, one of each kind.

    Arguments:
        runs: one record or several.

    >>> from jaxdamp import bench
    >>> suited_laws(bench.VirtualDyno(Linear(1500.0)).run([bench.SineTest(0.02, 2.0)]))
    ('linear', 'bilinear', 'piecewise_linear', 'besinger', 'linear_friction', 'besinger_lag')
    """
    loop = slow = force = 0.0
    for run in as_runs(runs, call="suited_laws(runs)"):
        above = run.stroke > 0.5 * (run.stroke.max() + run.stroke.min())
        edges = np.linspace(run.velocity.min(), run.velocity.max(), BINS + 1)
        cell = np.clip(np.searchsorted(edges, run.velocity, side="right") - 1, 0, BINS - 1)
        counts = [np.bincount(cell[half], minlength=BINS) for half in (above, ~above)]
        sums = [np.bincount(cell[half], run.force[half], BINS) for half in (above, ~above)]
        over, under = (total / np.maximum(count, 1) for total, count in zip(sums, counts, strict=True))
        square = np.where(np.minimum(*counts) > 0, 0.25 * (over - under) ** 2, 0.0) * (counts[0] + counts[1])
        middle = np.abs(0.5 * (edges[1:] + edges[:-1])) < SLOW * run.peak_velocity
        share = float(np.sum(run.force**2))
        loop, slow, force = loop + square.sum() / share, slow + square[middle].sum() / share, force + 1.0
    if loop <= LOOP * force:
        chosen = {"linear", *CURVES, "linear_friction", LAGGING[0]}
    elif slow > DRY * loop:
        chosen = {*CURVES, *LAGGING, *RUBBING}  # a lag behind a digressive curve looks like friction
    else:
        chosen = {*CURVES, *LAGGING, RUBBING[1]}
    return tuple(name for name in LAWS if name in chosen)


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
    a piecewise-linear law behind a spring, beside friction and a spring. Only if they are named:
    `thinned_visco_plastic`, whose force also falls with the recent speed and changes along the stroke, and
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
        curve, friction = PiecewiseLinear.guess(velocity, force, KNEES), Dahl.guess(velocity, 0.2 * force)
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
    """Stiffness [N/m] in series with which a law, by its secant slope at the RMS velocity, has this lag [s]."""
    v = float(np.sqrt(np.mean(velocity**2)))
    return max((force_at(law, v) - force_at(law, -v)) / (2 * v), 1.0) / lag


def laws_table() -> Table:
    """The laws of `default_ladder`, from simple to complex: name, hysteresis, description."""
    columns = (Column("law"), Column("hysteresis"), Column("what it is"))
    rows = ((name, "yes" if law.hysteresis else "no", law.meaning) for name, law in NAMED_LAWS.items())
    return Table("Laws", columns, tuple(rows))

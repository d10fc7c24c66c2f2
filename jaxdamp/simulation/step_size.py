"""Whether a vehicle bears a step: it is divided, refused, or a warning states the estimated error."""

import inspect
import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp.simulation.stability import LARGEST, MOST, Need, Slopes, law_slopes, rounded_down, step_need
from jaxdamp.simulation.step_error import StepError, known, step_error
from jaxdamp.vehicles import System


LEAST_PER_PERIOD = 5.0  # instants a period of the fastest mode that follows the road; fewer are refused
ENOUGH_PER_PERIOD = 30.0  # from here on the error of a car on a road is below a percent, and is not estimated
FOLLOWS = 0.1  # share of the road's height that a mode takes at rest, from which on the road must resolve it
STEEP = 0.25  # share of a velocity's error that comes back through the travel, from which on the error is estimated
SAMPLES_PER_PERIOD = 3.0  # of a record of the road; the tyre of a real wheel smooths what lies between them
SAMPLES = 32  # in a run, from which on a road of samples is taken for a record, and not for a few straight pieces
WARNED, REFUSED = 0.01, 0.2  # estimated RMS of the error over the RMS of a channel
INSIDE = ("jaxdamp", "equinox", "jaxtyping", "beartype", "contextlib")  # modules that no user wrote
AIM = 0.005  # error to which the step that a warning names should lead


class CoarseStepWarning(UserWarning):
    """A run with a step so long that it shows in the results; the message states the estimated error."""


class FastestMode(NamedTuple):
    """The fastest mode that follows the road: its frequency [Hz] and the coordinate that moves most."""

    frequency: float
    coordinate: str


class RunCheck(NamedTuple):
    """A run before it is driven, and the checks that its steps must pass, on numbers that are known by then.

    Where numbers are traced nothing is known of them, and what needs them is left out. Ordinary cars at 1 ms pass
    without a run.

    Attributes:
        system: the vehicle.
        heights: under its wheels at the instants [m].
        half: gives the heights at twice as many instants [m].
        dt: spacing of the instants [s].
        start: the motion (q, q̇) at time zero, if it is not at rest on the road.
        grid: spacing of the samples that the road is made of [s], if it is not a formula.
    """

    system: System
    heights: Float[Array, "time wheels"]
    half: Callable[[], Float[Array, "fine wheels"]]
    dt: float
    start: Float[Array, " n"] | None = None
    grid: float | None = None

    def substeps(self, wanted: int | None) -> int:
        """Steps of the exponential engine between two instants, as many as the caller wants or the laws need.

        In this order:

        - the instants must give at least 5 points a period of the fastest mode that follows the road (wheel hop), or
          the run is refused: the road is straight between instants, whatever steps the engine takes;
        - the step is divided as the steepest law needs, up to 64 times, or the run is refused (`step_need`);
        - with fewer than 30 points a period, or a law that is steep for the step, the error is estimated by a
          comparison with half the step on a stretch of the run (`step_error`): above 1 % a warning states it, above
          20 % the run is refused.

        Beside that a record of the road with fewer than 3 samples a period of that mode is warned of.

        Raises:
            ValueError: a step that the vehicle cannot bear, with the one to write.
        """
        slopes, per_period = self._per_period()
        need = step_need(self.system, slopes, self.dt, most=MOST if wanted is None else np.inf)
        count = need.substeps if wanted is None else _allowed(wanted, need, self.dt)
        if per_period < ENOUGH_PER_PERIOD or need.by_travel > STEEP or count < need.substeps:
            self._judge_error(count)
        return count

    def road(self) -> None:
        """The same for engines that choose their own steps: what the instants miss of the road is judged alike."""
        slopes, per_period = self._per_period()
        if per_period < ENOUGH_PER_PERIOD:
            try:  # so many steps that only the road differs
                count = min(4 * step_need(self.system, slopes, self.dt).substeps, MOST)
            except ValueError:  # too steep for the engine that estimates the error
                return
            self._judge_error(count)

    def _per_period(self) -> tuple[list[Slopes], float]:
        """The slopes of the laws, and the instants in a period of the fastest mode that follows the road."""
        slopes = law_slopes(self.system, self.dt)
        mode = fastest_mode(self.system, [s.at_rest for s in slopes])
        if mode is None:
            return slopes, np.inf
        if 1.0 / (mode.frequency * self.dt) < LEAST_PER_PERIOD:
            _refuse_unresolved(mode, self.dt)
        if self.grid is not None and SAMPLES * self.grid < self.dt * self.heights.shape[0]:
            _warn_of_samples(mode, self.grid)
        return slopes, 1.0 / (mode.frequency * self.dt)

    def _judge_error(self, count: int) -> None:
        """Estimate the error, where all numbers are known, and judge it."""
        track, begin = _checks.concrete(self.heights), None if self.start is None else _checks.concrete(self.start)
        if track is not None and known(self.system) and (self.start is None) == (begin is None):
            _judge(step_error(self.system, track, self.half, self.dt, count, self.start), self.dt)


def _allowed(substeps: int, need: Need, dt: float) -> int:
    """The caller's number of substeps, refused where a law would blow up."""
    if substeps < LARGEST * need.substeps:  # stable up to a share of one
        remedy = f"The steepest law needs {need.substeps} in {dt:g} s: leave `substeps` out, or pass a shorter `dt`."
        _checks.refuse("substeps", "keep every law stable", substeps, remedy)
    return int(substeps)


def _judge(estimate: StepError, dt: float) -> None:
    """Warn of an error, or refuse a run that would mean nothing."""
    if estimate.error <= WARNED:
        return
    shorter = rounded_down(dt * max(AIM / estimate.error, 1e-6) ** 0.5)
    if estimate.error > REFUSED:
        said = f"{100 * estimate.error:.0f} %" if np.isfinite(estimate.error) else "without bound"
        must = f"be so short that the error stays below {100 * REFUSED:.0f} % of the RMS of every channel"
        value = (
            f"{dt:g} s, where that of `{estimate.channel}` is estimated at {said} by a comparison with half the step"
        )
        _checks.refuse("dt", must, value, f"Pass `dt={shorter:g}`.")
    _warn(
        f"A step of dt = {dt:g} s is coarse for this vehicle on this road: the error of `{estimate.channel}` is "
        f"estimated at {100 * estimate.error:.2g} % of its RMS, by a comparison with half the step. "
        f"`dt={shorter:g}` makes it less than 1 %."
    )


def _warn(text: str) -> None:
    """Warn at the line outside this package that asked for the run."""
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] in INSIDE:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, CoarseStepWarning, stacklevel=level)


def _refuse_unresolved(mode: FastestMode, dt: float) -> None:
    """Refuse instants too far apart for the fastest mode that follows the road."""
    longest = 1.0 / (LEAST_PER_PERIOD * mode.frequency)
    must = (
        f"be at most {longest:.3g} s, a fifth of the period of the fastest mode that follows the road "
        f"({mode.frequency:.4g} Hz, mostly `{mode.coordinate}`)"
    )
    advised = rounded_down(1.0 / (ENOUGH_PER_PERIOD * mode.frequency))
    remedy = (
        f"Pass `dt={advised:g}`; `substeps` do not help, as the road is straight between instants, and its kinks would "
        "shake this mode. If the mode is too fast to be meant, soften what stands on the road (`tyre_stiffness`)."
    )
    _checks.refuse("dt", must, f"{dt:g} s", remedy)


def _warn_of_samples(mode: FastestMode, grid: float) -> None:
    """Warn of a record of the road whose samples lie too far apart for the fastest mode that follows it."""
    per_period = 1.0 / (mode.frequency * grid)
    if per_period >= SAMPLES_PER_PERIOD:
        return
    finer = rounded_down(1.0 / (LEAST_PER_PERIOD * mode.frequency))
    _warn(
        f"The road's samples lie {grid:.4g} s apart, {per_period:.2g} to a period of the fastest mode that follows it "
        f"({mode.frequency:.4g} Hz, mostly `{mode.coordinate}`). It is straight between them, and its kinks shake this "
        f"mode whatever the step. Give it samples every {finer:g} s (a profile resampled by a smooth curve), or soften "
        "what stands on the road (`tyre_stiffness`)."
    )


def fastest_mode(system: System, stiffness: Sequence[float]) -> FastestMode | None:
    """The fastest undamped mode that takes part in following the road; none where numbers are traced.

    Of masses, linear springs and the slopes of the elements' forces by their deflection. On a road that has come to
    rest at a height of one a mode moves the coordinates by φ (φᵀ K_r)/ω²; those that move all of them by less than a
    tenth, such as a light mass between stiff springs, are not shaken by the road.
    """
    form = system.form
    parts = (form.mass, form.stiffness, form.road_stiffness, form.ports, form.port_road)
    numbers = [None if part is None else _checks.concrete(part) for part in parts]
    if any(number is None for number, part in zip(numbers, parts, strict=True) if part is not None):
        return None
    mass, springs, road, ports, standing = numbers
    assert mass is not None and springs is not None and road is not None and ports is not None
    if not np.all(np.isfinite(mass)) or np.any(np.linalg.eigvalsh(mass) <= 0.0):
        return None  # no vehicle: whoever drives it finds that its response is not finite
    slopes = np.nan_to_num(np.array(stiffness))[:, None]
    stiffened = springs + ports.T @ (slopes * ports)
    driven = road if standing is None else road + ports.T @ (slopes * standing)
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squares, shapes = np.linalg.eigh(root @ stiffened @ root.T)
    shapes = root.T @ shapes
    share = np.abs(shapes).max(axis=0) * np.abs(shapes.T @ driven).max(axis=1)
    follows = (squares > 0.0) & (share > FOLLOWS * squares)
    if not np.any(follows):
        return None
    fastest = int(np.flatnonzero(follows)[-1])
    return FastestMode(
        float(np.sqrt(squares[fastest]) / (2.0 * np.pi)),
        system.layout.coordinates[int(np.argmax(np.abs(shapes[:, fastest])))],
    )

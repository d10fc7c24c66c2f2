"""Whether a vehicle bears a step: it is divided, refused, or a warning states the estimated error."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._traced import at_compile_time, is_batched, row, rows
from jaxdamp._warned import warn
from jaxdamp.simulation.stability import LARGEST, MOST, KnownCar, Need, known_cars, rounded_down, step_need
from jaxdamp.simulation.step_error import StepError, step_error
from jaxdamp.vehicles import System


LEAST_PER_PERIOD = 5.0  # instants a period of the fastest mode that follows the road; fewer are refused
ENOUGH_PER_PERIOD = 30.0  # from here on the error of a car on a road is below a percent, and is not estimated
USUAL = 1e-3  # s between instants, which resolve a road for cars and trucks
FOLLOWS = 0.1  # share of the road's height that a mode takes at rest, from which on the road must resolve it
STEEP = 0.25  # share of a velocity's error that comes back through the travel, from which on the error is estimated
CONTACT = 0.05  # share that comes back through damping that begins along the stroke, from which on likewise
SAMPLES_PER_PERIOD = 3.0  # of a record of the road; the tyre of a real wheel smooths what lies between them
SAMPLES = 32  # in a run, from which on a road of samples is taken for a record, and not for a few straight pieces
WARNED, REFUSED = 0.01, 0.2  # estimated RMS of the error over the RMS of a channel
AIM = 0.005  # error to which the step that a warning names should lead


class CoarseStepWarning(UserWarning):
    """A run with a step so long that it shows in the results; the message states the estimated error."""


class TracedStepWarning(UserWarning):
    """A run whose numbers are not known while it is compiled; the message states what was assumed of its steps."""


class FastestMode(NamedTuple):
    """The fastest mode that follows the road: its frequency [Hz] and the coordinate that moves most."""

    frequency: float
    coordinate: str


class RunCheck(NamedTuple):
    """A run before it is driven, and the checks that its steps must pass.

    They look behind numbers that `jax.grad` and the like differentiate, and at all cars of a `jax.vmap`, of which the
    worst counts. Inside `jax.jit` and `jax.lax.scan` numbers are not known: a `TracedStepWarning` says what is assumed
    unless the caller has said how many substeps to take. Ordinary cars at 1 ms pass without a run.

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
        - with fewer than 30 points a period, a law that is steep for the step, or a stop with much damping, the error
          is estimated by a comparison with half the step on a stretch of the run (`step_error`): above 1 % a warning
          states it, above 20 % the run is refused.

        Beside that a record of the road with fewer than 3 samples a period of that mode is warned of.

        Raises:
            ValueError: a step that the vehicle cannot bear, with the one to write.
        """
        cars = known_cars(self.system, self.dt)
        if cars is None:
            if wanted is None:
                warn(_assumed(self.dt), TracedStepWarning)
            return wanted or 1
        per_period = self._per_period(cars)
        needs = [step_need(*car, self.dt, most=MOST if wanted is None else np.inf) for car in cars]
        most = max(needs, key=lambda need: need.substeps)
        count = most.substeps if wanted is None else _allowed(wanted, most, self.dt)
        suspects = {int(np.argmin(per_period))} if min(per_period) < ENOUGH_PER_PERIOD else set()
        for shares, most_of_it in (([n.by_travel for n in needs], STEEP), ([n.by_contact for n in needs], CONTACT)):
            suspects |= {int(np.argmax(shares))} if max(shares) > most_of_it else set()
        suspects |= {needs.index(most)} if count < most.substeps else set()
        self._judge_errors(suspects, len(cars), count)
        return count

    def road(self) -> None:
        """The same for engines that choose their own steps: what the instants miss of the road is judged alike."""
        cars = known_cars(self.system, self.dt)
        if cars is None:
            if self.dt > USUAL * (1 + 1e-9):
                warn(_unknown_vehicle(self.dt), TracedStepWarning)
            return
        per_period = self._per_period(cars)
        worst = int(np.argmin(per_period))
        if per_period[worst] < ENOUGH_PER_PERIOD:
            try:  # so many steps that only the road differs
                count = min(4 * step_need(*cars[worst], self.dt).substeps, MOST)
            except ValueError:  # too steep for the engine that estimates the error
                return
            self._judge_errors({worst}, len(cars), count)

    def _per_period(self, cars: Sequence[KnownCar]) -> list[float]:
        """The instants in a period of the fastest mode that follows the road, of each car."""
        modes = [fastest_mode(car.system, [s.at_rest for s in car.slopes]) for car in cars]
        fastest = max((mode for mode in modes if mode), key=lambda mode: mode.frequency, default=None)
        if fastest is not None and 1.0 / (fastest.frequency * self.dt) < LEAST_PER_PERIOD:
            _refuse_unresolved(fastest, self.dt)
        if fastest is not None and self.grid is not None and SAMPLES * self.grid < self.dt * self.heights.shape[0]:
            _warn_of_samples(fastest, self.grid)
        return [np.inf if mode is None else 1.0 / (mode.frequency * self.dt) for mode in modes]

    def _judge_errors(self, suspects: set[int], cars: int, count: int) -> None:
        """Estimate the error of these cars of a batch, and judge the largest."""
        if not suspects:
            return
        ride = self.system, self.heights, self.start
        with nullcontext() if is_batched(ride) else at_compile_time():
            if rows(ride) is None:
                warn(_unknown_road(self.dt), TracedStepWarning)
                return
            run = self.system, self.heights, self.half(), self.start
            runs = rows(run)
            assert runs is not None
            if len(runs[0]) != cars:  # the road is a batch of its own
                roughness = [np.sum(np.diff(row(run, runs, i)[1], axis=0) ** 2) for i in range(len(runs[0]))]
                suspects = {int(np.argmax(roughness))}
            arrays = [eqx.partition(row(run, runs, i), lambda leaf: isinstance(leaf, np.ndarray)) for i in suspects]
            chosen = [eqx.combine(jax.tree.map(jnp.asarray, values), static) for values, static in arrays]
            estimates = [
                step_error(system, np.asarray(heights), lambda fine=fine: fine, self.dt, count, start)
                for system, heights, fine, start in chosen
            ]
        _judge(max(estimates, key=lambda estimate: estimate.error), self.dt)


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
    warn(
        f"A step of dt = {dt:g} s is coarse for this vehicle on this road: the error of `{estimate.channel}` is "
        f"estimated at {100 * estimate.error:.2g} % of its RMS, by a comparison with half the step. "
        f"`dt={shorter:g}` makes it less than 1 %.",
        CoarseStepWarning,
    )


def _assumed(dt: float) -> str:
    return (
        "JAX is compiling this run (`jax.jit`, `jax.lax.scan`), and the numbers of its vehicle are not known: one step "
        f"from instant to instant (dt = {dt:g} s) is assumed and not checked. Friction and other steep laws need more, "
        "without which the result is wrong. Pass `substeps=`, as many as `simulation.substeps_needed(vehicle, dt)` "
        "says of the steepest vehicle outside the compiled function (`substeps=1` where it says 1), or make a `Ride` "
        "outside and call it inside."
    )


def _unknown_vehicle(dt: float) -> str:
    return (
        "JAX is compiling this run (`jax.jit`, `jax.lax.scan`), and the numbers of its vehicle are not known: whether "
        f"instants every {dt:g} s resolve the road for its fastest mode is not checked. Drive one such vehicle outside "
        "the compiled function, which checks it, or make a `Ride` outside and call it inside."
    )


def _unknown_road(dt: float) -> str:
    return (
        f"JAX is compiling this run and does not know its road, so that the error of a step of dt = {dt:g} s, which "
        "may be coarse for this vehicle, is not estimated. Compare with half the step, or make a `Ride` outside."
    )


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
    warn(
        f"The road's samples lie {grid:.4g} s apart, {per_period:.2g} to a period of the fastest mode that follows it "
        f"({mode.frequency:.4g} Hz, mostly `{mode.coordinate}`). It is straight between them, and its kinks shake this "
        f"mode whatever the step. Give it samples every {finer:g} s (a profile resampled by a smooth curve), or soften "
        "what stands on the road (`tyre_stiffness`).",
        CoarseStepWarning,
    )


def fastest_mode(system: System, stiffness: Sequence[float]) -> FastestMode | None:
    """The fastest undamped mode that takes part in following the road, of a vehicle whose numbers are known.

    Of masses, linear springs and the slopes of the elements' forces by their deflection. On a road that has come to
    rest at a height of one a mode moves the coordinates by φ (φᵀ K_r)/ω²; those that move all of them by less than a
    tenth, such as a light mass between stiff springs, are not shaken by the road.
    """
    form = system.form
    mass, springs, road, ports = map(np.asarray, (form.mass, form.stiffness, form.road_stiffness, form.ports))
    standing = None if form.port_road is None else np.asarray(form.port_road)
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

"""`minimise`: the best ride that the free parameters allow, by exact gradients."""

import warnings
from collections.abc import Callable, Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks, metrics
from jaxdamp._field_types import check_module
from jaxdamp._progress import Progress
from jaxdamp._types import Scalar
from jaxdamp.parameters import FreeParameters, free_parameters
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import CoarseStepWarning, Ride, moves_axles
from jaxdamp.tune.result import Change, TuneResult, V
from jaxdamp.vehicles import AbstractVehicle, RideMetric, linearise, stationary_rms, with_weightings


INSIDE = 1e-6  # share of its start by which a parameter stays off the ends of its domain
Measured = Callable[[AbstractVehicle], dict[str, Scalar]]


def minimise(
    metric: str,
    vehicle: V,
    road: AbstractRoad | WhiteRoad,
    *,
    over: Sequence[str] = ("damper*",),
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    limits: Mapping[str, float] | None = None,
    duration: float | None = None,
    dt: float = 1e-3,
    max_steps: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> TuneResult[V]:
    """Make a ride metric of a vehicle as small as its free parameters allow.

    Sequential quadratic programming with exact first derivatives, taken forward through every step of the simulation
    for all parameters at once. It finds a local optimum: start from a sensible vehicle.

    Arguments:
        metric: the name of a ride metric of the vehicle, such as `"rms_sprung_acceleration"`.
        vehicle: where to start.
        road: a road to drive over, the same in every step; or `roads.white(...)`, for the stationary response of the
            linearised vehicle, which has no peaks.
        over: the parameters to change, by path, last part or pattern; all of the damper by default.
        freeze: parameters among these to leave alone.
        bounds: extra limits `{parameter: (lower, upper)}` in its unit; the start must lie between them.
        limits: hard limits `{metric: largest value}` in the metric's unit, such as `{"working_space_peak": 0.1}`.
        duration: length of the run [s], as in `simulate`.
        dt: step [s], as in `simulate`.
        max_steps: of the search.
        progress: called with the number of the step and the metric after each step; a line in the terminal if it is
            left out.

    Returns:
        The tuned vehicle, all metrics before and after, and warnings: a search that does not end well, or a limit that
        cannot be met, says so there.

    Raises:
        ValueError: unknown metrics or parameters, a start outside its bounds.

    >>> from jaxdamp import roads, vehicles
    >>> result = minimise("rms_sprung_acceleration", vehicles.presets.quarter_car_000(), roads.white("C", 20.0))
    >>> round(float(result.vehicle.damper.rate), 1)
    4656.4
    """
    call = "minimise(metric, vehicle, road)"
    _checks.instance("metric", metric, str, "be the name of a ride metric", f"The call is `{call}`.")
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    check_module("road", road, (AbstractRoad, WhiteRoad), call)
    limits = dict(limits or {})
    chosen = chosen_metrics(vehicle, road, (metric, *limits))
    white = isinstance(road, WhiteRoad)
    free = free_parameters(vehicle, over=over, freeze=freeze, bounds=bounds)
    ride = stationary_ride(road, chosen) if white else driven_ride(vehicle, road, chosen, duration, dt, free)
    names = [m.name for m in chosen]
    table = _Table(ride, free, names)
    before, _ = table.at(np.asarray(free.values))
    if not np.all(np.isfinite(list(before.values()))):
        remedy = "`simulate` it on this road, which says what the step or the law lacks."
        _checks.refuse("vehicle", "have finite metrics to start from", f"{metric} = {before[metric]}", remedy)
    scale = np.array([abs(v) if v else 1.0 for v in np.asarray(free.values)])
    with Progress("Tuning") as shown:
        progress = progress or (lambda step, value: shown(f"step {step}, {metric} {value:.5g}"))
        values, history, message = _search(table, free, scale, metric, limits, before, max_steps, progress)
    after, slopes = table.at(values)
    lower, upper = free.limits()
    bounded = (values <= lower + 2 * INSIDE * scale) | (values >= upper - 2 * INSIDE * scale)
    units = [p.unit for p in free.chosen for _ in range(max(p.value.size, 1))]
    changes = tuple(
        Change(name, float(a), float(b), unit, "at a bound" if hit else "")
        for name, a, b, unit, hit in zip(free.names, free.values, values, units, bounded, strict=True)
    )
    over_limit = [n for n, top in limits.items() if after[n] > top * (1 + 1e-6)]
    tight = [n for n, top in limits.items() if after[n] > top * (1 - 1e-6)]
    left = _steepness(slopes, metric, tight, bounded, scale) / max(abs(after[metric]), 1e-300)
    converged = left < 1e-4 and not over_limit
    notes = [
        f"The limit {n} <= {limits[n]:.4g} is not met: {after[n]:.4g}. Loosen it, or free more." for n in over_limit
    ]
    notes += [f"{c.name} ended at a bound, {c.after:.5g} {c.unit}." for c in changes if c.note]
    if not converged and not over_limit:
        notes.append(f"The search ended before an optimum ({message}); the scaled gradient left is {left:.1e}.")
    tuned = free.build(jnp.asarray(values))
    if not isinstance(road, WhiteRoad):
        notes += _step_notes(vehicle, tuned, road, names, duration, dt)
    return TuneResult(
        tuned,
        vehicle,
        metric,
        changes,
        before,
        after,
        {m.name: m.unit(vehicle.units) for m in chosen},
        limits,
        tuple(notes),
        converged,
        tuple(history),
    )


def chosen_metrics(vehicle: AbstractVehicle, road: AbstractRoad | WhiteRoad, wanted: Sequence[str]) -> list[RideMetric]:
    """The ride metrics that are wanted, and all others that this kind of road gives without weighting or counting.

    A white road gives what follows from an RMS, so no peaks.
    """
    white, kinds = isinstance(road, WhiteRoad), metrics.STATISTICS
    known = [m for m in vehicle.ride_metrics if not white or kinds[m.statistic].of_rms]
    for name in wanted:
        _checks.one_of("metric", name, [m.name for m in known])
    still = [m.name for m in known if not kinds[m.statistic].differentiable]
    for name in wanted:
        if name in still:
            _checks.refuse("metric", "have a slope", f"{name!r}, a count", "Tune on the dynamic load coefficient.")
    others = [m for m in known if m.name not in still and not kinds[m.statistic].weighted]
    return [m for m in known if m in others or m.name in wanted]


def stationary_ride(road: WhiteRoad, chosen: Sequence[RideMetric]) -> Measured:
    """Ride metrics of the linearised vehicle on a white road."""
    weighted = list(dict.fromkeys(m.channel for m in chosen if metrics.STATISTICS[m.statistic].weighted))

    def ride(vehicle: AbstractVehicle) -> dict[str, Scalar]:
        linear, units = linearise(vehicle), vehicle.units
        if weighted:
            linear = with_weightings(linear, [(name, metrics.weighting_of(units[name])) for name in weighted])
        rms, found = stationary_rms(linear, road.velocity_psd, speed=road.speed), {}
        for m in chosen:
            statistic = metrics.STATISTICS[m.statistic]
            assert statistic.of_rms is not None
            found[m.name] = statistic.of_rms(rms[f"weighted_{m.channel}" if statistic.weighted else m.channel])
        return found

    return ride


def driven_ride(
    vehicle: AbstractVehicle,
    road: AbstractRoad,
    chosen: Sequence[RideMetric],
    duration: float | None = None,
    dt: float = 1e-3,
    free: FreeParameters | None = None,
) -> Measured:
    """Ride metrics of a run; the road is sampled once, which also checks the arguments, or for axles that move."""
    driven = Ride(vehicle, road, metrics=[m.name for m in chosen], duration=duration, dt=dt)
    if driven.road is not None and free is not None and moves_axles(free.build, free.values):
        return lambda vehicle: driven.on_axles_of(vehicle)()
    return lambda vehicle: eqx.tree_at(lambda ride: ride.vehicle, driven, vehicle)()


def _step_notes(
    start: AbstractVehicle,
    tuned: AbstractVehicle,
    road: AbstractRoad,
    names: Sequence[str],
    duration: float | None,
    dt: float,
) -> list[str]:
    """What the tuned vehicle says of the step, which was chosen for the start."""

    def substeps(vehicle: AbstractVehicle) -> int:
        return Ride(vehicle, road, metrics=names, duration=duration, dt=dt).substeps

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        taken = substeps(start)
        warnings.simplefilter("always", CoarseStepWarning)
        try:
            needed = substeps(tuned)
        except ValueError as error:
            return [f"The tuned vehicle does not bear the step of {dt:g} s. {error}"]
    notes = [str(warning.message) for warning in caught]
    if needed > taken:
        notes.append(
            f"The tuned laws need {needed} steps between two instants, and the search took {taken}: tune again from "
            "this result."
        )
    return notes


class _Table:
    """Metrics and their slopes at a point, computed together and kept for the last point asked for."""

    def __init__(self, ride: Measured, free: FreeParameters, names: Sequence[str]) -> None:
        self.names = list(names)

        @eqx.filter_jit
        def evaluate(free: FreeParameters, values: Array) -> tuple[Array, Array]:
            def measured(values: Array) -> tuple[Array, Array]:
                found = ride(free.build(values))
                stacked = jnp.stack([found[name] for name in self.names])
                return stacked, stacked

            slopes, found = jax.jacfwd(measured, has_aux=True)(values)
            return found, slopes

        self._evaluate = lambda values: evaluate(free, jnp.asarray(values))
        self._last: tuple[bytes, dict[str, float], dict[str, np.ndarray]] = (b"", {}, {})

    def at(self, values: Float[np.ndarray, " free"]) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Metrics, and their derivatives with respect to the physical values."""
        if self._last[0] != values.tobytes():
            found, slopes = (np.asarray(a) for a in self._evaluate(values))
            self._last = (
                values.tobytes(),
                {name: float(x) for name, x in zip(self.names, found, strict=True)},
                dict(zip(self.names, slopes, strict=True)),
            )
        return self._last[1], self._last[2]


def _search(
    table: _Table,
    free: FreeParameters,
    scale: np.ndarray,
    metric: str,
    limits: Mapping[str, float],
    before: Mapping[str, float],
    max_steps: int,
    progress: Callable[[int, float], None],
) -> tuple[np.ndarray, list[float], str]:
    """SLSQP in values divided by their start, objective divided by its start."""
    import scipy.optimize

    level = abs(before[metric]) or 1.0
    history: list[float] = []

    def note(u: np.ndarray) -> None:
        history.append(table.at(u * scale)[0][metric])
        progress(len(history), history[-1])

    constraints = [
        {
            "type": "ineq",
            "fun": lambda u, n=name, top=top: 1.0 - table.at(u * scale)[0][n] / top,
            "jac": lambda u, n=name, top=top: -table.at(u * scale)[1][n] * scale / top,
        }
        for name, top in limits.items()
    ]
    constraints += _orders(free, scale)
    lower, upper = free.limits()
    solved = scipy.optimize.minimize(
        lambda u: table.at(u * scale)[0][metric] / level,
        np.asarray(free.values) / scale,
        jac=lambda u: table.at(u * scale)[1][metric] * scale / level,
        method="SLSQP",
        bounds=scipy.optimize.Bounds(lower / scale + INSIDE, upper / scale - INSIDE, keep_feasible=True),  # type: ignore[arg-type]
        constraints=constraints,
        callback=note,
        options={"ftol": 1e-15, "maxiter": max_steps},
    )
    return np.asarray(solved.x) * scale, history, str(solved.message)


def _orders(free: FreeParameters, scale: np.ndarray) -> list[dict]:
    """Vectors that must increase stay in order."""
    orders, start = [], 0
    for p in free.chosen:
        size = max(p.value.size, 1)
        if p.domain.name.startswith("strictly increasing"):
            rows = np.zeros((size - 1, len(scale)))
            for i in range(size - 1):
                rows[i, start + i], rows[i, start + i + 1] = -scale[start + i], scale[start + i + 1]
            gap = 1e-6 * scale[start : start + size].max()
            orders.append({"type": "ineq", "fun": lambda u, r=rows, g=gap: r @ u - g, "jac": lambda u, r=rows: r})
        start += size
    return orders


def _steepness(
    slopes: Mapping[str, np.ndarray], metric: str, tight: Sequence[str], bounded: np.ndarray, scale: np.ndarray
) -> float:
    """Length of the scaled gradient that neither a bound nor an active limit holds back."""
    gradient = (slopes[metric] * scale)[~bounded]
    if tight and gradient.size:
        walls = np.stack([(slopes[name] * scale)[~bounded] for name in tight], axis=1)
        gradient = gradient - walls @ np.linalg.lstsq(walls, gradient, rcond=None)[0]
    return float(np.linalg.norm(gradient))

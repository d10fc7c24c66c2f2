"""`minimise`: tune the free parameters of a vehicle for a ride metric, by exact gradients."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._progress import Progress
from jaxdamp._status import Status
from jaxdamp.metrics import Metric, MetricValues, current_name
from jaxdamp.parameters import FreeParameters
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Ride, moves_axles
from jaxdamp.tune.objective import Function, objective_of
from jaxdamp.tune.range_notes import range_notes
from jaxdamp.tune.ranges import search_range
from jaxdamp.tune.result import TuneResult, V
from jaxdamp.tune.searching import Evaluator, Measured, active, limits_of, search
from jaxdamp.tune.step_notes import step_notes
from jaxdamp.tune.wording import bound_notes, changes_of, early_end
from jaxdamp.vehicles import AbstractVehicle


def minimise(
    metric: str | Metric | Function,
    vehicle: V,
    road: AbstractRoad | WhiteRoad,
    *,
    over: Sequence[str] | Mapping[str, Any] = ("damper*",),
    freeze: Sequence[str] = (),
    bounds: Mapping[str, Any] | None = None,
    tie: Mapping[str, str] | None = None,
    limits: Mapping[str, float] | None = None,
    metrics: Sequence[str | Metric] = (),
    duration: float | None = None,
    dt: float = 1e-3,
    max_steps: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> TuneResult[V]:
    """Minimise a ride metric of a vehicle over its free parameters.

    Sequential quadratic programming with exact first derivatives, computed in forward mode through the simulation for
    all parameters at once. It finds a local optimum, so start from a reasonable vehicle. The search itself is in double
    precision; a vehicle in single precision (see `jaxdamp.configure`) is tuned to about 0.1 % of its parameters.

    Every parameter has bounds, so that the result stays near a damper that can be built. The default bounds are:

    - numbers of one sign (rates, stiffnesses, forces, velocities, exponents, knots): one third to three times the
      start;
    - numbers of either sign (coefficients, offsets): −1 to 3 times the start;
    - zeros and weights of networks: their domain.

    Domains are always respected. A parameter that ends at a bound is named in the `warnings`: the optimum may be
    beyond.

    Arguments:
        metric: the name of a ride metric of the vehicle, such as `"rms_sprung_acceleration"`; a `metrics.Metric` of any
            channel; or a differentiable function of the metrics by name, such as
            `lambda m: m["rms_sprung_acceleration"] / 1.5 + m["dynamic_load_coefficient"] / 0.2`.
        vehicle: the vehicle to start from.
        road: a road for the simulation, the same in every step; or `roads.white(...)` for the stationary response of
            the linearised vehicle, which has no peaks.
        over: the parameters to change, by path, last part or pattern; all of the damper by default. A mapping
            `{parameter: (lower, upper)}` gives their bounds too, as `bounds` does.
        freeze: parameters among these to hold at their start.
        bounds: bounds `{parameter: (lower, upper)}` in the unit of the parameter, instead of the default ones; the
            start must be between them. None removes one bound or both: with `bounds={"*": None}` only the domains
            remain. If two names match a parameter, the later one counts.
        tie: parameters that take the values of others, such as `{"front.damper.*": "rear.damper.*"}`: one free value
            for each group (see `jaxdamp.parameters.free_parameters`).
        limits: hard limits `{metric: largest value}` in the metric's unit, such as
            `{"working_space_peak_to_peak": 0.1}`.
        metrics: further metrics, which the function and the limits can use by name.
        duration: length of the run [s], as in `simulate`.
        dt: step [s], as in `simulate`.
        max_steps: largest number of steps of the search.
        progress: called with the number of the step and the metric after each step; a line in the terminal if it is
            left out.

    Returns:
        The tuned vehicle, all metrics before and after, and warnings: about a search that did not converge, limits
        that cannot be satisfied, and dampers used outside the fitted range of their laws.

    Raises:
        ValueError: unknown metrics or parameters; bounds of a wrong shape, of a parameter that is not free, given in
            both places, or without the start between them.

    >>> from jaxdamp import roads, vehicles
    >>> result = minimise("rms_sprung_acceleration", vehicles.presets.quarter_car_000(), roads.white("C", 20.0))
    >>> round(float(result.vehicle.damper.rate), 1)
    4656.4
    >>> bounded = minimise("rms_sprung_acceleration", result.start, roads.white("C", 20.0), over={"rate": (1500, 4000)})
    >>> bounded.parameters[0].note
    'at its upper bound'
    """
    call = "minimise(metric, vehicle, road)"
    if not isinstance(metric, str | Metric) and not callable(metric):
        must = "be the name of a ride metric, a Metric, or a function of the metrics"
        _checks.refuse("metric", must, _checks.described(metric), f"The call is `{call}`.")
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    check_module("road", road, (AbstractRoad, WhiteRoad), call)
    if max_steps < 1:
        _checks.refuse("max_steps", "be 1 or more", max_steps)
    names = [m.name for m in (*vehicle.ride_metrics, *(m for m in metrics if isinstance(m, Metric)))]
    limits = {current_name(name, names): top for name, top in (limits or {}).items()}
    objective = objective_of(metric, vehicle, road, metrics, list(limits))
    white, name = isinstance(road, WhiteRoad), objective.name
    space = search_range(vehicle, over, freeze, bounds, tie)

    def ride_of(vehicle: AbstractVehicle) -> Ride:
        return Ride(vehicle, road, metrics=objective.metrics, duration=duration, dt=dt)

    measured = driven(ride_of(vehicle), space.free)
    evaluator = Evaluator(lambda vehicle: objective.of(measured(vehicle)), space.free, list(objective.units(vehicle)))
    before, _ = evaluator.at(space.start)
    if not np.all(np.isfinite(list(before.values()))):
        remedy = "Call `simulate` with this road; its error messages explain the cause."
        _checks.refuse("vehicle", "have finite metrics to start from", f"{name} = {before[name]}", remedy)
    with Progress("Tuning") as shown:
        progress = progress or (lambda step, value: shown(f"step {step}, {name} {value:.5g}"))
        scaled = limits_of(limits, before)
        ended = search(evaluator, space, name, scaled, max_steps, progress)
    after, _ = evaluator.at(ended.values)
    reached = active(scaled, after, evaluator.tolerance)
    missed = [name for name in reached if scaled[name].margin(after[name]) < -evaluator.tolerance.limit]
    changes = changes_of(space, ended.values)
    if missed:
        status = Status.LIMIT_NOT_MET
    elif ended.slope_left < evaluator.tolerance.slope:
        status = Status.CONVERGED
    else:
        status = Status.STEP_LIMIT if ended.out_of_steps else Status.NO_BETTER_STEP
    notes = [f"The limit {n} <= {limits[n]:.4g} is not met: {after[n]:.4g}. Relax it, or free more." for n in missed]
    notes += bound_notes(space, changes)
    if status in (Status.STEP_LIMIT, Status.NO_BETTER_STEP):
        notes.append(early_end(ended, max_steps))
    tuned = space.free.build(jnp.asarray(ended.values, space.free.values.dtype))
    coarse = [] if white else step_notes(vehicle, tuned, ride_of)
    notes += coarse
    if not any("does not bear" in note for note in coarse):
        notes += range_notes(vehicle, tuned, ride_of)
    units = objective.units(vehicle)
    return TuneResult(
        vehicle=tuned,
        start=vehicle,
        metric=name,
        parameters=changes,
        before=MetricValues.with_units(before, units),
        after=MetricValues.with_units(after, units),
        units=units,
        limits=limits,
        active_limits=reached,
        warnings=tuple(notes),
        status=status,
        history=ended.history,
        objective=objective,
    )


def driven(ride: Ride, free: FreeParameters) -> Measured:
    """A ride as a function of its vehicle; the road is sampled once, or again if parameters move the axles."""
    follows = ride.road is not None and moves_axles(free.build, free.values)
    return lambda vehicle: (ride.on_axles_of(vehicle) if follows else ride.of_vehicle(vehicle))()

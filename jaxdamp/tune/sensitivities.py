"""`sensitivity`: which parameters, and which velocities of the damper curve, a ride metric comes from."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias, TypedDict, TypeVar, Unpack, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._jacobian import with_jacobian
from jaxdamp._quickly import compiled_for_loops, compiled_quickly
from jaxdamp._settings import part, with_defaults
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Number, Scalar, ScalarLike, Vector
from jaxdamp.dampers import AbstractMemoryless
from jaxdamp.metrics import Metric
from jaxdamp.parameters import (
    FreeParameters,
    free_parameters,
    get,
    match_paths,
    matching,
    name_patterns,
    parameter,
    parameters,
    positive,
    real,
    setting,
)
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Ride
from jaxdamp.tune.measuring import Measurement
from jaxdamp.tune.objective import Function, Objective, goal_objective, objective_of
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.sensitivity_result import CurveSensitivity, Sensitivity
from jaxdamp.tune.settings import RUN, Free, Run
from jaxdamp.tune.shape import damper_paths, held_force
from jaxdamp.tune.task import is_white
from jaxdamp.vehicles import AbstractVehicle, ChannelKind


REACH = 3.0  # RMS values of the damper velocity up to which the curve is looked at
HATS = 12  # on each side
V = TypeVar("V", bound=AbstractVehicle)
MetricsOf: TypeAlias = Callable[[Array], Mapping[str, Scalar]]  # of the parameters, then the quantities of the road
GIVEN = (AbstractRoad, WhiteRoad, Scenarios)  # roads that are not made from quantities


class Curves(TypedDict, total=False):
    """Which force-velocity curves a sensitivity looks at, and where."""

    dampers: str | None
    reach: float | None
    hats: int


class SensitivitySettings(Free, Curves, Run, total=False):
    """All keywords of `sensitivity`: those of `Free`, `Curves` and `Run`, and further metrics."""

    metrics: Sequence[str | Metric]


DEFAULTS: SensitivitySettings = {
    "over": ("*",), "freeze": (), "dampers": "*damper", "reach": None, "hats": HATS, "metrics": (), **RUN
}  # fmt: skip


@of_known_numbers
@with_defaults(DEFAULTS)
def sensitivity(
    metric: str | Metric | Function | Sequence[str | Metric],
    vehicle: AbstractVehicle,
    road: Road | Scenarios | Callable[..., Road],
    *,
    quantities: Mapping[str, float] | None = None,
    second_order: bool = False,
    **settings: Unpack[SensitivitySettings],
) -> Sensitivity:
    """Exact derivatives of ride metrics by parameters, and by the force at each velocity of the damper curves.

    All derivatives are computed in one simulation, in forward mode. Those by the force at a velocity are derivatives by
    the height of a hat function that is added to the curve there: where on the curve comfort, travel and tyre load come
    from.

    Arguments:
        metric: one ride metric or several, by name, "comfort", "travel" or "grip", or as a `metrics.Metric`; or a
            function of metrics, as in `minimise`.
        vehicle: where the derivatives are taken.
        road: a road, `roads.white(...)`, or `Scenarios`, whose metrics are joined by their risk; with `quantities` a
            function of these that makes a road: `lambda speed: roads.iso8608("C", speed, seed=1)`.
        quantities: of the road by name, such as `{"speed": 20.0}`.
        second_order: also the second derivatives by the parameters: how flat an optimum is.
        settings: keywords, all optional: `over`, all parameters if left out, and `freeze`, as in `minimise`;
            `dampers`, the laws whose curves are looked at, by path or pattern, None for none, as on a white road;
            `reach`, the largest velocity of the curves [m/s], three times the largest RMS of a damper velocity if left
            out; `hats`, the number of velocities on each side, 12 if left out; `metrics`, further ones that a
            function can use by name; `duration`, `dt` and `engine` (see `Run`).

    Raises:
        ValueError: unknown metrics, parameters or dampers; metrics without derivative; quantities of a road that is no
            function of them.

    >>> from jaxdamp import roads, vehicles
    >>> car, road = vehicles.presets.quarter_car_000(), roads.white("C", 20.0)
    >>> result = sensitivity("rms_sprung_acceleration", car, road, over=["damper.rate", "sprung_mass"])
    >>> {name: round(float(value), 3) for name, value in result.elasticities("rms_sprung_acceleration").items()}
    {'sprung_mass': -0.648, 'damper.rate': -0.276}
    """
    wanted = list(metric) if isinstance(metric, Sequence) and not isinstance(metric, str) else [metric]
    given = dict(quantities or {})
    _check(wanted, vehicle, road, given)
    first, run = (road if isinstance(road, GIVEN) else road(**given)), part(settings, RUN)
    objective = _objective(wanted, vehicle, settings["metrics"], white=is_white(first))
    hatted, paths = _with_curves(vehicle, first, settings, run)
    of_vehicle, free = _free(vehicle, hatted, settings["over"], settings["freeze"])
    point = np.array([*np.asarray(free.values, float), *given.values()])
    measured = _measured(hatted, road, list(given), objective, free, run)
    names = [name for name in objective.units(vehicle) if name in objective.names]
    is_curve = np.array([is_hat(p.path, hatted) for p in free.owners] + [False] * len(given), bool)
    chosen = np.flatnonzero(~is_curve)
    units = [*(p.unit for p in of_vehicle.owners), *("m/s" if name == "speed" else "" for name in given)]
    compiled = compiled_quickly if is_white(first) else compiled_for_loops
    values, slopes, second = _derivatives(measured, names, point, chosen if second_order else None, compiled)
    return Sensitivity(
        values=dict(zip(names, values.tolist(), strict=True)),
        units={name: objective.units(vehicle)[name] for name in names},
        parameters=(*of_vehicle.names, *given),
        parameter_units=tuple(units),
        point=point[chosen],
        gradient=dict(zip(names, slopes[:, chosen], strict=True)),
        curves=_curve_parts(vehicle, hatted, paths, names, slopes[:, is_curve]),
        hessian=None if second is None else dict(zip(names, second, strict=True)),
    )


def _objective(
    wanted: Sequence[str | Metric | Function], vehicle: AbstractVehicle, more: Sequence[str | Metric], *, white: bool
) -> Objective:
    """The metrics that are wanted, and no others; of a function all that it may use."""
    further = [one.name for one in more if isinstance(one, Metric)]
    wanted = [goal_objective(one, vehicle, white=white, metrics=further) for one in wanted]
    objective = objective_of(wanted, vehicle, more, [], white=white)
    if objective.functions:
        return objective
    return objective._replace(metrics=tuple(m for m in objective.metrics if m.name in objective.names))


def _with_curves(
    vehicle: AbstractVehicle, road: Road | Scenarios, asked: SensitivitySettings, run: Run
) -> tuple[AbstractVehicle, list[str]]:
    """The vehicle with hats beside the laws whose curves are looked at, and the paths of these laws."""
    reach, hats = asked["reach"], asked["hats"]
    if hats < 1:
        _checks.refuse("hats", "be 1 or more", hats, f"{HATS} on each side of zero are usual.")
    if reach is not None:
        _checks.positive("reach", reach, "It is a velocity of the damper, such as 0.6 m/s.")
    if asked["dampers"] is None or is_white(road):
        return vehicle, []
    laws = damper_paths(vehicle)
    paths = matching(laws, asked["dampers"])
    if not paths:
        must = f"name a law of the vehicle ({', '.join(laws)})"
        _checks.refuse("dampers", must, repr(asked["dampers"]), "None for none.")
    reach = reach or _reach(vehicle, road, run)
    for path in paths:
        vehicle = with_hats(vehicle, path, reach, hats)
    return vehicle, paths


def _check(wanted: Sequence[object], vehicle: object, road: object, quantities: Mapping[str, float]) -> None:
    call = "sensitivity(metric, vehicle, road)"
    functions = [one for one in wanted if not isinstance(one, str | Metric)]
    if not wanted or (functions and (len(wanted) > 1 or not callable(functions[0]))):
        must = "be metrics by name, `Metric`s, or one function of metrics"
        _checks.refuse(
            "metric", must, _checks.described(wanted[0] if len(wanted) == 1 else wanted), f"The call is `{call}`."
        )
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    if quantities:
        remedy = "Write `lambda speed: roads.iso8608('C', speed, seed=1)`, and `quantities={'speed': 20.0}`."
        if not callable(road):
            _checks.refuse("road", f"be a function of {', '.join(quantities)}", _checks.described(road), remedy)
        try:
            inspect.signature(road).bind(**quantities)
        except TypeError as error:
            _checks.refuse("quantities", "be the arguments of `road`", f"{', '.join(quantities)}: {error}", remedy)
        _checks.finite("quantities", list(quantities.values()), remedy)
    elif not isinstance(road, Scenarios):
        check_module("road", road, (AbstractRoad, WhiteRoad), call)


def _reach(vehicle: AbstractVehicle, road: Road | Scenarios, run: Run) -> float:
    """Three times the largest RMS of a damper velocity [m/s]."""
    layout = vehicle.layout
    kinds = ChannelKind.DAMPER_VELOCITY, ChannelKind.TWIST_VELOCITY
    velocities = {m.channel for m in layout.metrics if layout.by_name[m.channel].kind in kinds}
    metrics = [Metric(channel, "rms") for channel in sorted(velocities)]
    if isinstance(road, Scenarios):
        peaks = road.with_risk("worst").ride(vehicle, metrics=metrics, **run)()
    else:
        peaks = Ride(vehicle, road, metrics=metrics, **run)()
    return REACH * max(float(value) for value in peaks.values())


def _free(
    vehicle: AbstractVehicle, hatted: AbstractVehicle, over: object, freeze: Sequence[str]
) -> tuple[FreeParameters, FreeParameters]:
    """The parameters of the vehicle, and the same of the vehicle with hats, with the forces of the hats."""
    of_vehicle = free_parameters(vehicle, over=name_patterns("over", over), freeze=freeze)
    paths = [p.path for p in parameters(vehicle, commands=True)]
    moved = [p.path for p in parameters(hatted, commands=True)]
    hats = [path for path in moved if is_hat(path, hatted)]
    places = dict(zip(paths, [path for path in moved if path not in hats], strict=True))
    exact = [places[path] for path in match_paths(paths, [p.path for p in of_vehicle.chosen])]
    return of_vehicle, free_parameters(hatted, over=[*exact, *hats])


def _measured(
    vehicle: AbstractVehicle,
    road: Road | Scenarios | Callable[..., Road],
    names: Sequence[str],
    objective: Objective,
    free: FreeParameters,
    run: Run,
) -> MetricsOf:
    """The metrics as a function of the parameters and of the quantities that a road is made from, if there are any."""
    if isinstance(road, GIVEN):
        fixed = Measurement(vehicle, road, objective, free, run=run)
        return lambda x: fixed(free.build(x))
    count = free.values.size

    def measured(x: Array) -> Mapping[str, Scalar]:
        on = road(**{name: x[count + i] for i, name in enumerate(names)})
        ride = Ride(vehicle, on, metrics=objective.metrics, **run)
        return objective.of(ride.of_vehicle(free.build(x[:count]))())

    return measured


def _derivatives(
    measured: MetricsOf,
    names: Sequence[str],
    point: np.ndarray,
    chosen: np.ndarray | None,
    compiled: Callable[..., Callable],
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The metrics, shape (names,), their derivatives, (names, numbers), and second ones, (names, chosen, chosen)."""
    start = jnp.asarray(point)

    def stacked(x: Array) -> Array:
        results = measured(x)
        return jnp.stack([results[name] for name in names])

    values, slopes = (np.asarray(a, float) for a in compiled(with_jacobian(stacked))(start))
    if chosen is None:
        return values, slopes, None
    twice = jax.jacfwd(jax.jacfwd(lambda part: stacked(start.at[chosen].set(part))))
    return values, slopes, np.asarray(compiled(twice)(start[chosen]), float)


def _curve_parts(
    vehicle: AbstractVehicle, hatted: AbstractVehicle, paths: Sequence[str], names: Sequence[str], slopes: np.ndarray
) -> dict[str, CurveSensitivity]:
    """The derivatives by the forces of each curve."""
    curves, begin = {}, 0
    for path in sorted(paths, key=damper_paths(vehicle).index):
        hats = get(hatted, path).terms[-1]
        end = begin + hats.forces.size
        velocities = np.asarray(hats.velocities, float)
        force = np.asarray(held_force(get(vehicle, path), jnp.asarray(velocities)), float)
        curves[path] = CurveSensitivity(velocities, force, dict(zip(names, slopes[:, begin:end], strict=True)))
        begin = end
    return curves


@final
class ForceHats(AbstractMemoryless):
    """A force that is linear between velocities at equal distances, zero at standstill, constant beyond the ends.

    Its derivative by one of its forces is the hat function around that velocity, exactly.
    """

    spacing: Number = setting("m/s", "spacing of the velocities", positive)
    forces: Vector = parameter("N", "forces at the velocities", real, linear=True)

    @property
    def velocities(self) -> Float[Array, " points"]:
        """The velocities [m/s]."""
        count = self.forces.size // 2
        steps = np.concatenate([np.arange(-count, 0), np.arange(1, count + 1)])
        return self.spacing * jnp.asarray(steps, self.forces.dtype)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        limit = self.forces.size // 2  # its slope by v is not used: it is that of forces of zero
        place = jnp.clip(v / self.spacing, -limit, limit)
        weights = jnp.maximum(1.0 - jnp.abs(place - self.velocities / self.spacing), 0.0)
        return jnp.sum(weights * self.forces)


def with_hats(vehicle: V, path: str, reach: float, count: int) -> V:
    """The vehicle with hats of zero force beside the law at a path."""
    hats = ForceHats(reach / count, np.zeros(2 * count))
    return eqx.tree_at(lambda car: get(car, path), vehicle, get(vehicle, path) + hats)


def is_hat(path: str, vehicle: AbstractVehicle) -> bool:
    """Whether a path is that of the forces of hats."""
    owner, _, name = path.rpartition(".")
    return name == "forces" and isinstance(get(vehicle, owner), ForceHats)

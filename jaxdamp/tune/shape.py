"""Constraints on the shape of the force-velocity curve of the dampers of a vehicle."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper, AbstractMemoryless, laws_inside
from jaxdamp.parameters import FreeParameters, get, matching, real
from jaxdamp.tune.limits import Limit, scaled
from jaxdamp.vehicles import AbstractVehicle


Curve = Float[Array, " points"]
HOLD = 1000  # steps of 1 ms at constant velocity, after which the states of a law count as settled
POINTS = 24  # slopes along a curve
INSIDE = 1e-3  # of the margin of a condition at the start, which is left


@final
@dataclasses.dataclass(frozen=True)
class Shape:
    """A constraint on the force-velocity curve at constant velocity; made by `slope`, `monotone`, `knee`, `ratio`."""

    name: str  # in words, such as "slope"
    unit: str  # of the numbers that are limited
    span: tuple[float, float] = dataclasses.field(compare=False)  # programs do not depend on it
    velocities: tuple[float, ...]  # at which the force is computed [m/s]
    numbers: Callable[[Curve, Curve], Array]  # those that are limited, from velocities and forces
    places: tuple[str, ...] = ("",)  # of the numbers, in words; empty for a single one
    dampers: str = "*"  # the laws, by their path in the vehicle or a pattern
    eased: bool = False  # whether a number that lies outside at the start may stay where it is

    def at(self, dampers: str) -> "Shape":
        """The same for some of the dampers of the vehicle only, such as `"front.*"`."""
        return dataclasses.replace(self, dampers=dampers)


@of_known_numbers
def slope(lower: float | None = None, upper: float | None = None, *, reach: float = 1.0) -> Shape:
    """Limits of the slope of the curve [N s/m].

    Arguments:
        lower: smallest slope; none if left out.
        upper: largest slope; none if left out.
        reach: the curve is looked at from −reach to reach [m/s], between points that are denser at low velocity.
    """
    _checks.positive("reach", reach)
    half = np.linspace(0.0, 1.0, POINTS // 2 + 1) ** 1.5 * reach
    velocities = np.concatenate([-half[:0:-1], half])
    places = tuple(f" at {0.5 * (a + b):.2g} m/s" for a, b in itertools.pairwise(velocities))
    span = _span(lower, upper)
    return Shape("slope", "N s/m", span, tuple(map(float, velocities)), _slopes, places)


@of_known_numbers
def monotone(*, reach: float = 1.0) -> Shape:
    """A force that never falls as the velocity grows: a slope of zero or more.

    Arguments:
        reach: largest magnitude of the velocities at which the slope is held [m/s].
    """
    return slope(0.0, reach=reach)


@of_known_numbers
def ratio(lower: float | None = None, upper: float | None = None, *, velocity: float) -> Shape:
    """Limits of the rebound force over the compression force at a velocity, both measured from standstill.

    Arguments:
        lower: smallest ratio; none if left out.
        upper: largest ratio; none if left out.
        velocity: at which the forces are compared [m/s].
    """
    _checks.positive("velocity", velocity)
    name = f"rebound/compression ratio at {velocity:g} m/s"
    return Shape(name, "", _span(lower, upper), (-velocity, 0.0, velocity), _ratio)


@of_known_numbers
def knee(lower: float | None = None, upper: float | None = None, *, side: str = "rebound", reach: float = 1.0) -> Shape:
    """Limits of the velocity of the knee [m/s], positive on both sides.

    The knee is the mean velocity at which the slope changes, each change weighted by its size: of a curve with one
    knee that is the knee itself, but for half the distance of the points, a fiftieth of the reach.

    Arguments:
        lower: smallest velocity; none if left out.
        upper: largest velocity; none if left out.
        side: `"rebound"` or `"compression"`.
        reach: up to which velocity the curve is looked at [m/s].
    """
    _checks.one_of("side", side, ["rebound", "compression"])
    _checks.positive("reach", reach)
    sign = 1.0 if side == "rebound" else -1.0
    velocities = sign * np.linspace(0.0, reach, 2 * POINTS + 1)
    return Shape(f"{side} knee", "m/s", _span(lower, upper), tuple(map(float, velocities)), _mean_bend)


# Functions of the module, so that programs of equal constraints are compiled once.


def _slopes(v: Curve, f: Curve) -> Array:
    return jnp.diff(f) / jnp.diff(v)


def _ratio(v: Curve, f: Curve) -> Array:
    del v
    return ((f[2] - f[1]) / (f[1] - f[0]))[None]


def _mean_bend(v: Curve, f: Curve) -> Array:
    bends = jnp.abs(jnp.diff(_slopes(v, f)))
    total = jnp.sum(bends)
    return (jnp.sum(bends * jnp.abs(v[1:-1])) / jnp.where(total > 0.0, total, 1.0))[None]


@final
class ShapeNumbers(NamedTuple):
    """The numbers that shape constraints and conditions of laws limit, as a function of the vehicle."""

    pairs: tuple[tuple[Shape, str], ...]  # each constraint with the path of a law
    conditions: tuple[tuple[str, str, int], ...] = ()  # name, path of a law, and number of its condition

    @classmethod
    def of(
        cls, vehicle: AbstractVehicle, shape: Sequence[Shape] | Shape | None, free: FreeParameters
    ) -> "ShapeNumbers":
        """Those of the laws of a vehicle that the constraints name; by default, free curves do not fall."""
        conditions = tuple(_conditions(vehicle, free))
        if shape is None:
            return cls(tuple(_rising(vehicle, free)), conditions)
        shapes = [shape] if isinstance(shape, Shape) else shape
        if not isinstance(shapes, Sequence) or isinstance(shapes, str):
            remedy = "Write `shape=[tune.monotone(), tune.slope(upper=5000.0)]`."
            _checks.refuse("shape", "be a constraint of `tune`, or a list", _checks.described(shapes), remedy)
        paths, pairs = damper_paths(vehicle), []
        for one in shapes:
            _checks.instance("shape", one, Shape, "be made by `tune.slope`, `monotone`, `knee` or `ratio`")
            chosen = matching(paths, one.dampers)
            if not chosen:
                _checks.refuse("shape", f"name a damper of the vehicle ({', '.join(paths)})", repr(one.dampers))
            pairs += [(one, path) for path in chosen]
        return cls(tuple(pairs), conditions)

    def __call__(self, vehicle: AbstractVehicle) -> dict[str, Scalar]:
        """The numbers by name."""
        numbers_by_name = {}
        for shape, path in self.pairs:
            velocities = jnp.asarray(shape.velocities)
            numbers = shape.numbers(velocities, held_force(get(vehicle, path), velocities))
            numbers_by_name |= dict(zip(_names(shape, path), numbers, strict=True))
        for name, path, number in self.conditions:
            law = get(vehicle, path)
            condition = law.conditions()[number]
            numbers_by_name[name] = jnp.min(getattr(law, condition.parameter) - condition.least)
        return numbers_by_name

    @property
    def names(self) -> list[str]:
        """The names of the numbers."""
        of_curves = [name for shape, path in self.pairs for name in _names(shape, path)]
        return of_curves + [name for name, *_ in self.conditions]

    def limits(self, start: Mapping[str, float]) -> list[Limit]:
        """The limits of the numbers; their distances are scaled by the largest number of the curve at the start."""
        limits = []
        for name, *_ in self.conditions:
            least = INSIDE * start[name]
            limits.append(Limit(name, name, least, math.inf, scaled(least, math.inf, start[name]), is_shape=True))
        for shape, path in self.pairs:
            names = _names(shape, path)
            size = scaled(*shape.span, max(abs(start[name]) for name in names))
            of, (lower, upper) = f"{shape.name} of {path}", shape.span
            for name in names:
                span = (min(lower, start[name]), max(upper, start[name])) if shape.eased else shape.span
                limits.append(Limit(name, of, *span, size, shape.unit, is_shape=True))
        return limits


def _conditions(vehicle: AbstractVehicle, free: FreeParameters) -> Iterator[tuple[str, str, int]]:
    """The conditions between parameters of laws of which some are free; no constructor takes a law beyond them."""
    for at, law in laws_inside(vehicle):
        if any(p.path.startswith(at) for p in free.chosen):
            for number, condition in enumerate(law.conditions()):
                yield f"{at}{condition.parameter} beyond {condition.formula}", at.removesuffix("."), number


def _rising(vehicle: AbstractVehicle, free: FreeParameters) -> Iterator[tuple[Shape, str]]:
    """That the force does not fall between the points of curves whose free numbers have either sign, such as tables.

    Without this a search finds curves that drive the motion, which no damper does. Where one falls at the start, it
    does not fall more steeply.
    """
    for at, law in laws_inside(vehicle):
        velocities = curve_velocities(law) if _moves_curve(law, at, free) else None
        if velocities is not None:
            places = tuple(f" at {0.5 * (a + b):.2g} m/s" for a, b in itertools.pairwise(velocities))
            span, points = (0.0, math.inf), tuple(map(float, velocities))
            yield Shape("slope", "N s/m", span, points, _slopes, places, eased=True), at.removesuffix(".")


def _moves_curve(law: AbstractDamper, path: str, free: FreeParameters) -> bool:
    """Whether numbers of a law of velocity alone are free that may have either sign."""
    moved = (p.path.startswith(path) and "." not in p.path.removeprefix(path) for p in free.chosen if p.domain == real)
    return isinstance(law, AbstractMemoryless) and any(moved)


def curve_velocities(law: AbstractDamper) -> Float[np.ndarray, " points"] | None:
    """The velocities [m/s] of the points of a curve, or some in its range; None of a law without such settings."""
    declared = {field.name: field.metadata.get("setting", {}).get("unit") for field in dataclasses.fields(law)}
    numbers = (np.asarray(getattr(law, name), float) for name, unit in declared.items() if unit == "m/s")
    points = next((values for values in numbers if values.ndim == 1), None)
    return points if points is None or points.size > 2 else np.linspace(points[0], points[-1], POINTS + 1)


def damper_paths(vehicle: AbstractVehicle) -> list[str]:
    """The paths of the outermost laws of a vehicle.

    Arguments:
        vehicle: the vehicle.
    """
    laws: list[str] = []
    for prefix, _ in laws_inside(vehicle):
        if not any(prefix.startswith(f"{path}.") for path in laws):
            laws.append(prefix.removesuffix("."))
    return laws


def held_force(law: AbstractDamper, velocities: Curve) -> Curve:
    """Force [N] at constant velocities after one second at stroke zero; differentiable in the law."""
    state = law.initial_state()
    if not state.size:
        return jax.vmap(lambda v: law.force(0.0, v, state))(velocities)
    zero, dt = jnp.zeros(()), jnp.asarray(1e-3)

    def settled(v: Scalar) -> Scalar:
        end = jax.lax.fori_loop(0, HOLD, lambda _, s: law.advance(zero, v, zero, v, s, dt), state)
        return law.force(zero, v, end)

    return jax.vmap(settled)(velocities)


def _names(shape: Shape, path: str) -> list[str]:
    return [f"{shape.name} of {path}{place}" for place in shape.places]


def _span(lower: float | None, upper: float | None) -> tuple[float, float]:
    span = (-math.inf if lower is None else float(lower), math.inf if upper is None else float(upper))
    if not span[0] < span[1] or span == (-math.inf, math.inf):
        _checks.refuse("lower", "be below `upper`, one of them given", f"{lower}, {upper}")
    return span

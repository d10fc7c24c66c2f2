"""A vehicle as a list of parts: its matrices, elements and static loads, and tyres that lift off."""

import dataclasses
import math
from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import ramp
from jaxdamp._matrices import solve
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers import AbstractDamper, AbstractStateless, AbstractWrapper, Sum, Traits
from jaxdamp.parameters import nonnegative, positive, setting
from jaxdamp.vehicles.parts import SPRUNG, Body, Element, Link, Place, Point, Wheel, matrix, prefixed
from jaxdamp.vehicles.port_form import PortForm, Ports


_WIDTH = 0.01
# What a tyre that can lift off still carries, as a share of its static load, where it would lose contact without the
# rounding of its load.
LOAD_AT_LIFT_OFF = _WIDTH * math.log(2.0)


@final
class LiftOff(AbstractStateless):
    """The correction of a linear tyre force for lift-off: a tyre can only push.

    With the linear tyre force L = k_t d + c_t ḋ [N], d = z_u − z_r [m], the contact force is N_c = r(W − L) ≥ 0, where
    W is the static load and r a smooth ramp of width w = 1 % of W. The tyre force is then F_t = W − N_c, and with r(u)
    = u + r(−u) its difference from the linear force is

        F(d, ḋ) = F_t − L = −r(L − W) + r(−W),

    whose last term makes F(0, 0) = 0 (it is 4e-44 W). On the road, at L < 0.8 W, F is below 1e-8 W; in the air F_t = W:
    the wheel falls freely. The ramp applies to spring and dashpot together, so the dashpot cannot pull either.

    >>> law = LiftOff(tyre_stiffness=200e3, tyre_damping=0.0, static_load=3000.0)
    >>> [round(float(200e3 * d + law.force_stroke_velocity(d, 0.0)), 3) for d in (-0.02, 0.0, 0.01, 0.05)]
    [-4000.0, 0.0, 2000.0, 3000.0]
    """

    tyre_stiffness: Number = setting("N/m", "vertical tyre stiffness", positive)
    tyre_damping: Number = setting("N s/m", "vertical tyre damping", nonnegative)
    static_load: Number = setting("N", "load of the wheel at rest", positive)
    width: Number = setting("", "share of the static load over which the contact ends", positive, default=_WIDTH)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] in addition to the linear tyre, at deflection x [m], positive in extension, and rate v [m/s]."""
        return self.beside(self.tyre_stiffness * x + self.tyre_damping * v)

    def beside(self, force: ScalarLike) -> Scalar:
        """Force [N] that must be added to the force of spring and dashpot so that the tyre never pulls."""
        width = self.width * self.static_load
        return ramp(-self.static_load, width) - ramp(force - self.static_load, width)

    def contact_force(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force between tyre and road [N], never negative."""
        linear = self.tyre_stiffness * x + self.tyre_damping * v
        return jnp.asarray(ramp(self.static_load - linear, self.width * self.static_load))


@final
class LiftOffWithLaws(AbstractWrapper):
    """The correction for lift-off of a wheel with laws between it and the road: their total force can only push.

    As `LiftOff`, with the sum of the linear force and the force D of the laws instead of the linear force,
    F = −r(L + D − W) + r(−W). The laws are computed here a second time, with the same states.

    A wheel without mass, as of a `TrackedHull`, exerts no force on the vehicle in the air. The stroke of its laws still
    follows the ground, so their own channels have no meaning in the air, and contact begins again when the total force
    becomes a push.
    """

    linear: LiftOff  # the correction for the linear spring and dashpot
    law: AbstractDamper  # the sum of the laws between wheel and road

    def inner_law(self) -> AbstractDamper:
        """The laws parallel to the tyre."""
        return self.law

    def traits(self) -> Traits:
        """Those of the laws, and of the tyre, whose contact force is nonlinear."""
        return super().traits()._replace(has_feed_through=True, stroke_dependent=True, stroke_dependent_at_rest=True)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        spring = self.linear.tyre_stiffness * x + self.linear.tyre_damping * v
        return self.linear.beside(spring + self.law.force(x, v, state))


STANDARD_GRAVITY = 9.80665  # m/s²


@final
class Frame(eqx.Module):
    """The parts of a vehicle: bodies, links between their points, wheels on the road, places of interest.

    Coordinates are in the order of the bodies, road inputs in that of the wheels, ports in that of the elements of
    links and then of wheels.

    Arguments:
        bodies: rigid bodies; names differ.
        links: springs, dashpots and laws between their points.
        wheels: points that stand on the road.
        places: further places where the acceleration is of interest.

    Raises:
        ValueError: two parts of one name, a point of an unknown body, no wheel.

    >>> body, wheel = Body("sprung", 300.0), Body("unsprung", 40.0)
    >>> suspension = Link("", body.at() - wheel.at(), stiffness=20e3)
    >>> frame = Frame((body, wheel), (suspension,), (Wheel("", wheel.at(), 180e3),))
    >>> frame.coordinates
    ('z_sprung', 'z_unsprung')
    """

    bodies: tuple[Body, ...]
    links: tuple[Link, ...]
    wheels: tuple[Wheel, ...]
    places: tuple[Place, ...] = ()

    def __check_init__(self) -> None:
        if not self.wheels or not self.bodies:
            _checks.refuse("wheels", "hold one or more, and `bodies` too", f"{len(self.wheels)} and {len(self.bodies)}")
        for kind, names in (
            ("bodies and places", [part.name for part in [*self.bodies, *self.places]]),
            ("wheels", [wheel.name for wheel in self.wheels]),
            ("links and wheels with elements", [part.name for part in self._parts if part.elements]),
            ("elements", [name for name, _, _ in self._elements()]),
        ):
            if len(set(names)) < len(names):
                _checks.refuse(kind, "have names that differ", names, "Channels are named after them.")
        points = [link.extension for link in self.links] + [wheel.point for wheel in self.wheels]
        for name in sorted(set().union(*[point.terms for point in points])):
            _checks.one_of("point", name, self.coordinates)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates q: heights `z_…` [m] and angles [rad]."""
        return tuple(name for body in self.bodies for name in body.masses)

    def body(self, name: str) -> Body:
        """The body of a name."""
        _checks.one_of("body", name, [body.name for body in self.bodies])
        return next(body for body in self.bodies if body.name == name)

    def place(self, place: Place) -> Point:
        """The point of a place of interest."""
        return self.body(place.body).at(place.ahead, place.left)

    @property
    def _parts(self) -> list[Link | Wheel]:
        return [*self.links, *self.wheels]

    def _elements(self) -> list[tuple[str, Link | Wheel, Element]]:
        return [(prefixed(part.name, e.name), part, e) for part in self._parts for e in part.elements]

    @property
    def element_names(self) -> tuple[str, ...]:
        """Name of the element at each port; those of tyres that can lift off come last."""
        lifting = [wheel.element_names[-1] for wheel in self.wheels if wheel.lifts]
        return (*[name for name, _, _ in self._elements()], *lifting)

    def elements(self, static_loads: Float[Array, " wheels"] | None = None) -> tuple[AbstractDamper, ...]:
        """The law at each port, for given static wheel loads [N]; they are computed if left out."""
        together = tuple(element.together for _, _, element in self._elements())
        if not any(wheel.lifts for wheel in self.wheels):
            return together
        loads = self.static_wheel_loads() if static_loads is None else static_loads
        return (
            *together,
            *[lift_off(wheel, load) for wheel, load in zip(self.wheels, loads, strict=True) if wheel.lifts],
        )

    def element(self, name: str) -> Element:
        """The element of a name, with the law of a single one of several equal ones."""
        elements = {key: element for key, _, element in self._elements()}
        _checks.one_of("name", name, elements)
        return elements[name]

    def extension(self, name: str) -> Point:
        """By what the element of a name is longer than at rest, on level ground."""
        part = next(part for key, part, _ in self._elements() if key == name)
        return part.extension if isinstance(part, Link) else part.point

    def lifting(self, lifts: bool = True) -> "Frame":
        """The same parts; if `lifts`, with tyres that can all lift off."""
        if not lifts:
            return self
        wheels = tuple(dataclasses.replace(wheel, lifts=True) for wheel in self.wheels)
        return Frame(self.bodies, self.links, wheels, self.places)

    def port_form(self) -> PortForm:
        """The matrices: of springs k with extensions R q − S z_r, K = Σ Rᵀ k R, K_r = Σ Rᵀ k S, K_g = Σ Sᵀ k S."""
        names, count = self.coordinates, len(self.links)
        rows = matrix([part.extension if isinstance(part, Link) else part.point for part in self._parts], names)
        on_road = np.eye(len(self._parts), len(self.wheels), -count)
        ports = [i for i, part in enumerate(self._parts) for _ in part.elements]
        ports += [count + i for i, wheel in enumerate(self.wheels) if wheel.lifts]
        masses: dict[str, Scalar] = reduce(or_, [body.masses for body in self.bodies])
        mass = jnp.diag(jnp.stack([masses[name] for name in names]))
        road = jnp.asarray(on_road, dtype=rows.dtype)
        rates = [jnp.stack([getattr(part, name) for part in self._parts]) for name in ("stiffness", "damping")]
        chosen = rows[np.array(ports, dtype=int)]
        chosen_road = jnp.asarray(on_road[ports], dtype=rows.dtype) if any(port >= count for port in ports) else None
        springs, dashpots = (rows.T * rate[None, :] for rate in rates)
        ground_springs, ground_dashpots = (road.T * rate[None, :] for rate in rates)
        of_motion = mass, springs @ rows, dashpots @ rows
        of_road = springs @ road, dashpots @ road, ground_springs @ road, ground_dashpots @ road
        return PortForm(*of_motion, *of_road, chosen, chosen_road)

    def static_wheel_loads(self, form: PortForm | None = None) -> Float[Array, " wheels"]:
        """Load of each wheel at rest on level ground [N], in the order of the wheels.

        If equilibrium determines the loads, these are they. With more wheels (statically indeterminate), the loads
        follow from springs that were all free of load on level ground: K_t q = −weight, where the tangent stiffness K_t
        includes the laws.

        Arguments:
            form: the matrices; computed if left out.
        """
        form = self.port_form() if form is None else form
        together = [element.together for _, _, element in self._elements()]
        standing = None if form.port_road is None else form.port_road[: len(together)]
        form = dataclasses.replace(form, ports=form.ports[: len(together)], port_road=standing)  # without lift-off
        heights = np.array([name in {f"z_{body.name}" for body in self.bodies} for name in self.coordinates])
        stiffness = tangent_stiffness(form, together, jnp.zeros(len(self.coordinates)))
        deflected = solve(stiffness, -jnp.diag(form.mass) * (STANDARD_GRAVITY * heights))
        tyres = jnp.stack([wheel.stiffness for wheel in self.wheels])
        loads = -tyres * (matrix([wheel.point for wheel in self.wheels], self.coordinates) @ deflected)
        direct = [i for i, (_, part, _) in enumerate(self._elements()) if isinstance(part, Wheel)]
        if direct and form.port_road is not None:
            slopes, _ = Ports(together).stiffness_and_damping(jnp.zeros(len(together)))
            loads = loads - form.port_road[np.array(direct)].T @ (slopes * (form.ports @ deflected))[np.array(direct)]
        return loads

    @property
    def axles(self) -> tuple[int, ...]:
        """Number of the axle of each wheel, from 0 in the order of the wheels."""
        return tuple(int(i) for i in np.cumsum([not wheel.beside for wheel in self.wheels]) - 1)

    @property
    def main_body(self) -> Body:
        """The body named "sprung", or the first."""
        return next((body for body in self.bodies if body.name == SPRUNG), self.bodies[0])


def lift_off(wheel: Wheel, static_load: Scalar) -> AbstractDamper:
    """The law that adds lift-off to a wheel, parallel to its spring, dashpot and laws."""
    linear = LiftOff(wheel.stiffness, wheel.damping, static_load)
    laws = tuple(element.together for element in wheel.elements)
    return LiftOffWithLaws(linear, Sum(laws)) if laws else linear


def tangent_stiffness(
    form: PortForm, laws: Sequence[AbstractDamper], position: Float[Array, " q"]
) -> Float[Array, "q q"]:
    """K + Pᵀ (∂F/∂x) P: the stiffness [N/m] with that of the laws at rest at a position on level ground.

    Arguments:
        form: of the vehicle.
        laws: at its ports.
        position: the coordinates [m, rad].
    """
    if not any(law.traits().stroke_dependent_at_rest for law in laws):
        return form.stiffness
    stiffness, _ = Ports(laws).stiffness_and_damping(form.ports @ position)
    return form.stiffness + (form.ports.T * stiffness[None, :]) @ form.ports

"""A vehicle as a list of parts, and its matrices, elements and static loads."""

import dataclasses
from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._matrices import solve
from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper, Sum
from jaxdamp.vehicles.lift_off import LiftOff, LiftOffWithLaws
from jaxdamp.vehicles.parts import SPRUNG, Body, Element, Link, Place, Wheel, prefixed
from jaxdamp.vehicles.points import Point, matrix
from jaxdamp.vehicles.port_form import PortForm, sum_springs
from jaxdamp.vehicles.ports import Ports


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
        own = tuple(element.together for _, _, element in self._elements())
        if not any(wheel.lifts for wheel in self.wheels):
            return own
        loads = self.static_wheel_loads() if static_loads is None else static_loads
        return (*own, *[lift_off(wheel, load) for wheel, load in zip(self.wheels, loads, strict=True) if wheel.lifts])

    def element(self, name: str) -> Element:
        """The element of a name, with the law of a single one of several equal ones."""
        elements = {key: element for key, _, element in self._elements()}
        _checks.one_of("name", name, elements)
        return elements[name]

    def lifting(self, lifts: bool = True) -> "Frame":
        """The same parts; if `lifts`, with tyres that can all lift off."""
        if not lifts:
            return self
        wheels = tuple(dataclasses.replace(wheel, lifts=True) for wheel in self.wheels)
        return Frame(self.bodies, self.links, wheels, self.places)

    def port_form(self) -> PortForm:
        """The matrices."""
        names, count = self.coordinates, len(self.links)
        rows = matrix([part.extension if isinstance(part, Link) else part.point for part in self._parts], names)
        on_road = np.eye(len(self._parts), len(self.wheels), -count)
        ports = [i for i, part in enumerate(self._parts) for _ in part.elements]
        ports += [count + i for i, wheel in enumerate(self.wheels) if wheel.lifts]
        masses: dict[str, Scalar] = reduce(or_, [body.masses for body in self.bodies])
        return sum_springs(
            jnp.diag(jnp.stack([masses[name] for name in names])),
            rows,
            jnp.asarray(on_road, dtype=rows.dtype),
            jnp.stack([part.stiffness for part in self._parts]),
            jnp.stack([part.damping for part in self._parts]),
            rows[np.array(ports, dtype=int)],
            jnp.asarray(on_road[ports], dtype=rows.dtype) if any(port >= count for port in ports) else None,
        )

    def static_wheel_loads(self, form: PortForm | None = None) -> Float[Array, " wheels"]:
        """Load of each wheel at rest on level ground [N], in the order of the wheels.

        If equilibrium determines the loads, these are they. With more wheels (statically indeterminate), the loads
        follow from springs that were all free of load on level ground: K_t q = −weight, where the tangent stiffness K_t
        includes the laws.

        Arguments:
            form: the matrices; computed if left out.
        """
        form = self.port_form() if form is None else form
        own = [element.together for _, _, element in self._elements()]
        standing = None if form.port_road is None else form.port_road[: len(own)]
        form = dataclasses.replace(form, ports=form.ports[: len(own)], port_road=standing)  # without lift-off
        heights = np.array([name in {f"z_{body.name}" for body in self.bodies} for name in self.coordinates])
        stiffness = tangent_stiffness(form, own, jnp.zeros(len(self.coordinates)))
        deflected = solve(stiffness, -jnp.diag(form.mass) * (STANDARD_GRAVITY * heights))
        tyres = jnp.stack([wheel.stiffness for wheel in self.wheels])
        loads = -tyres * (matrix([wheel.point for wheel in self.wheels], self.coordinates) @ deflected)
        direct = [i for i, (_, part, _) in enumerate(self._elements()) if isinstance(part, Wheel)]
        if direct and form.port_road is not None:
            slopes, _ = Ports(own).stiffness_and_damping(jnp.zeros(len(own)))
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
    """K + Pᵀ (∂F/∂x) P: the stiffness [N/m] with that of the laws at rest at a position on level ground."""
    if not any(law.traits().stroke_dependent_at_rest for law in laws):
        return form.stiffness
    stiffness, _ = Ports(laws).stiffness_and_damping(form.ports @ position)
    return form.stiffness + (form.ports.T * stiffness[None, :]) @ form.ports

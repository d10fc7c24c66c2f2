"""Critical damping of the dampers of a vehicle: of the body above them, and of the wheel below."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._field_types import check_module
from jaxdamp._limits import root
from jaxdamp._quickly import compiled_quickly
from jaxdamp._traced import behind
from jaxdamp._types import Scalar
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.equilibrium import rest_position
from jaxdamp.vehicles.frame import STANDARD_GRAVITY, Frame
from jaxdamp.vehicles.parts import Link, prefixed
from jaxdamp.vehicles.port_form import Ports
from jaxdamp.vehicles.system import System


class CriticalDamping(NamedTuple):
    """The rate of one damper at which a motion no longer oscillates; its rate divided by that is the damping ratio.

    Attributes:
        body: 2 √(k m) [N s/m], with the spring k below the body and the mass m of the body that rests on it.
        wheel: 2 √((k + k_t) m_w) [N s/m], of the wheel m_w between this spring and its tyre k_t.
    """

    body: Scalar
    wheel: Scalar


def critical_damping(vehicle: AbstractVehicle) -> dict[str, CriticalDamping]:
    """Critical damping of body and wheel for each damper between them, by its name.

    Body and wheel are taken for themselves, as single masses: the body with the mass that the wheel carries at rest,
    W/g − m_w for the static load W of the wheel; the wheel with the body at rest. Springs include laws that act by the
    stroke, with their slope in the static equilibrium, and are those at the wheel, as is the rate of the damper: with
    a `MotionRatio` that of the whole law. `modes` has the damping ratios of the coupled motions. Differentiable in
    every parameter.

    Dampers that are not the only link between a body and a wheel (of a solid axle, a cab, a seat) are left out; the
    main body itself is no wheel, also where it stands on its tyres (`TrackedHull`).

    Arguments:
        vehicle: any vehicle; a controller is ignored.

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> critical = critical_damping(quarter_car_000())["damper"]
    >>> round(float(critical.body)), round(float(critical.wheel))  # 2 √(60e3 · 1200), 2 √(280e3 · 125)
    (16971, 11832)
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), "critical_damping(vehicle)")
    frame, system = vehicle.frame(), vehicle.system()
    loads, springs = system.static_loads, _springs(frame, system)
    on_road = [{name for name in wheel.point.terms if name[:2] == "z_"} for wheel in frame.wheels]
    ends = [_ends(link, set().union(*on_road)) for link in frame.links]
    lower = [end for _, end in ends]
    pairs = {}
    for link, (above, end), spring in zip(frame.links, ends, springs, strict=True):
        wheels = [i for i, heights in enumerate(on_road) if end in heights]
        if not wheels or lower.count(end) > 1 or end == f"z_{frame.main_body.name}":
            continue
        mass, tyres = frame.body(end.removeprefix("z_")).mass, sum(frame.wheels[i].stiffness for i in wheels)
        carried = sum(loads[i] for i in wheels) / STANDARD_GRAVITY - mass
        shares = link.extension.terms
        upper, under = shares[above] ** 2, shares[end] ** 2  # one, unless points are scaled
        body, wheel = (root(upper * spring * carried) / upper, root((under * spring + tyres) * mass) / under)
        for element in link.elements:
            share = 2.0 / element.count
            pairs[prefixed(link.name, element.name)] = CriticalDamping(share * body, share * wheel)
    return pairs


def _springs(frame: Frame, system: System) -> list[Scalar]:
    """The stiffness of each link, with that of its laws in the static equilibrium [N/m]."""
    ends = np.cumsum([0, *(len(link.elements) for link in frame.links)])
    slopes = jnp.zeros(ends[-1])
    if any(law.traits().stroke_dependent_at_rest for law in system.laws[: ends[-1]]):
        slopes = _stiffness(system)
    return [link.stiffness + jnp.sum(slopes[ends[i] : ends[i + 1]]) for i, link in enumerate(frame.links)]


@compiled_quickly
def _stiffness(system: System) -> Float[Array, " ports"]:
    position = rest_position(system, jnp.zeros(system.form.road_stiffness.shape[1]))
    return Ports(system.laws).stiffness_and_damping(system.form.ports @ position)[0]


def _ends(link: Link, on_road: set[str]) -> tuple[str, str]:
    """The heights of the bodies above and below a link from a body without wheels; empty of other links."""
    heights = {name: share for name, share in link.extension.terms.items() if name[:2] == "z_"}
    if on_road.issuperset(heights):  # an anti-roll bar, whose shares may be traced
        return "", ""
    shares = {
        name: float(share if (concrete := behind(share)) is None else concrete) for name, share in heights.items()
    }
    above, below = ([name for name, share in shares.items() if share * side > 0.0] for side in (1.0, -1.0))
    return (above[0], below[0]) if len(above) == len(below) == 1 and above[0] not in on_road else ("", "")

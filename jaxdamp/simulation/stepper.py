"""One step of the fixed-step engine: linear part exact, element forces predicted and corrected.

Over a step the road runs straight and the element forces run on the parabola through the step before, so that masses
and springs are carried on exactly by the matrix exponential, however stiff the tyre. The forces at the end of the step
are first predicted from the motion under extrapolated forces, then corrected: third order in the step where laws are
smooth, second order at their kinks. It is an exponential Adams method with one correction (on these methods: Hochbruck
and Ostermann, Exponential integrators, Acta Numerica 2010).
"""

from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.simulation._vectors import (
    Matrix,
    Vector,
    between,
    minus,
    once,
    once_in_derivatives,
    plus,
    rows,
    scalars,
    times,
)
from jaxdamp.simulation.propagator import Propagator
from jaxdamp.vehicles import AbstractVehicle, Earlier, Ports, States


FOR_REVERSE = "needed by reverse derivatives"  # the rest of a step is cheap to repeat, or linear and not needed


class Ground(NamedTuple):
    """The road under the wheels at an instant: heights [m] and, where elements stand on it, their rates [m/s]."""

    height: Vector
    rate: Vector | None


class Now(NamedTuple):
    """A vehicle at an instant: motion (q, q̇), states and forces of its elements, and what they were a step before."""

    motion: Vector
    states: States
    force: Vector
    earlier_force: Vector
    earlier: Earlier


@final
class Stepper(eqx.Module):
    """What a step takes: the matrices of the linear part and the laws at the ports, in one of two layouts.

    Arguments:
        vehicle: any vehicle.
        dt: the step [s].
        apart: keep vectors as tuples of scalars.
        many: written for many cars side by side.
    """

    ports: Ports
    dt: Scalar
    phi: Matrix
    earlier_input: Matrix  # of the forces a step before, of those now, and of their correction
    force_input: Matrix
    correction: Matrix
    unit: Scalar | None  # one, which the compiler does not know
    road_held: Matrix
    road_ramp: Matrix
    deflection: Matrix  # of the ports, from the coordinates
    standing: Matrix | None  # from the heights of the road

    def __init__(self, vehicle: AbstractVehicle, dt: Scalar, *, apart: bool, many: bool = False) -> None:
        form = vehicle.port_form()
        exact, kept = Propagator.over(form, dt), rows if apart else (lambda matrix: matrix)
        self.unit = jnp.where(jnp.isnan(exact.phi[0, 0]), jnp.nan, 1.0) if many else None
        self.ports, self.dt = Ports(vehicle.elements(), apart=apart), dt
        self.phi, self.earlier_input = kept(exact.phi), kept(-exact.force_ramp)
        self.force_input = kept(exact.force_held + exact.force_ramp)
        self.correction = kept(exact.force_ramp + exact.force_bend)
        self.road_held, self.road_ramp = kept(exact.road_held), kept(exact.road_ramp)
        self.deflection = kept(form.ports)
        self.standing = None if form.port_road is None else kept(form.port_road)

    def at_rest(self, motion: Float[Array, " n"], ground: Ground) -> Now:
        """The beginning, with elements at rest."""
        x = scalars(motion) if isinstance(self.phi, tuple) else motion
        states = self.ports.initial()
        force = self.ports.force(*self.at_ports(x, ground), states)
        return Now(x, states, force, force, self.ports.first_earlier(states))

    def at_ports(self, x: Vector, ground: Ground) -> tuple[Vector, Vector]:
        """Deflections of the elements [m] and their rates [m/s]."""
        n = len(x) // 2
        deflection, rate = times(self.deflection, x[:n]), times(self.deflection, x[n:])
        if self.standing is not None and ground.rate is not None:
            deflection = minus(deflection, times(self.standing, ground.height))
            rate = minus(rate, times(self.standing, ground.rate))
        return checkpoint_name((deflection, rate), FOR_REVERSE)

    def __call__(self, now: Now, begin: Ground, end: Ground) -> Now:
        """A step later."""
        ports, rise = self.ports, minus(end.height, begin.height)
        driven = plus(times(self.road_held, begin.height), times(self.road_ramp, rise), times(self.phi, now.motion))
        driven = plus(driven, times(self.earlier_input, now.earlier_force))
        ahead = plus(driven, times(self.force_input, now.force))  # last, as this force is known last
        old, new = self.at_ports(now.motion, begin), self._reached(ahead, end)
        predicted = ports.force(*new, ports.predict(*old, *new, now.states, now.earlier, self.dt))
        missed = once(plus(minus(predicted, now.force), minus(now.earlier_force, now.force)), self.unit)
        motion = plus(ahead, times(self.correction, missed))
        new = self._reached(motion, end)
        states = ports.advance(*old, *new, now.states, self.dt)
        return Now(motion, states, ports.force(*new, states), now.force, ports.next_earlier(now.states, now.earlier))

    def _reached(self, x: Vector, ground: Ground) -> tuple[Vector, Vector]:
        deflection, rate = self.at_ports(x, ground)
        return once_in_derivatives(deflection, self.unit), once_in_derivatives(rate, self.unit)

    def over(self, now: Now, begin: Ground, end: Ground, substeps: int) -> Now:
        """So many equal steps later, over which the road is straight."""
        if substeps == 1:
            return self(now, begin, end)

        def at(share: Any) -> Ground:
            rate = None if begin.rate is None or end.rate is None else between(begin.rate, end.rate, share)
            return Ground(between(begin.height, end.height, share), rate)

        def step(i: Any, now: Now) -> Now:
            done = jnp.asarray(i, self.dt.dtype)
            return self(now, at(done / substeps), at((done + 1.0) / substeps))

        return jax.lax.fori_loop(0, substeps, step, now)

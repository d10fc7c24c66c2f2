"""The equations of motion of a vehicle, which every engine integrates, and its state at an instant."""

from collections.abc import Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array, Float, PyTree

from jaxdamp._types import Scalar, ScalarLike
from jaxdamp._vectors import Matrix, MemoryLayout, SmallVector, laid_out, minus, times
from jaxdamp.control import ControlLoop, ControlState
from jaxdamp.vehicles import Ports, States, System, rest_position


FOR_REVERSE = "needed by reverse derivatives"  # the rest of a step is cheap to repeat, or linear and not needed


class RoadInput(NamedTuple):
    """The road under the wheels at an instant: heights [m], and their rates [m/s] where they are needed.

    Attributes:
        height: [m, up], shape (wheels,).
        rate: [m/s], shape (wheels,); None where it is not needed.
    """

    height: SmallVector
    rate: SmallVector | None


class RoadEdges(NamedTuple):
    """The road one instant before the first and one after the last of a run that goes on [m], shape (wheels,).

    With them rates at the ends of a part are those of the whole; None where the run begins or ends for good.
    """

    before: Float[Array, " wheels"] | None = None
    after: Float[Array, " wheels"] | None = None


STRAIGHT = RoadEdges()  # as straight beyond the ends as beside them


class StepState(NamedTuple):
    """A vehicle at an instant: motion (q, q̇) in SI units, states and forces [N] of its elements.

    `memory` is what an engine of several steps remembers of the steps before, `control` where the controller is.

    Attributes:
        motion: q and q̇ in SI units, shape (n,).
        states: of the elements.
        force: of each element [N], positive when it resists extension.
    """

    motion: SmallVector
    states: States
    force: SmallVector
    memory: PyTree = None
    control: ControlState | None = None


@final
class Equations(eqx.Module):
    """ẋ = A x + B f + R z + S ż of the motion x = (q, q̇), with forces fᵢ = element i (deflection, rate, its states).

    Arguments:
        system: the vehicle.
        layout: how its vectors lie in memory.
    """

    system: System
    ports: Ports
    deflection: Matrix  # of the ports, from the coordinates
    road_deflection: Matrix | None  # from the heights of the road; None where no element stands on it
    layout: MemoryLayout = eqx.field(static=True)

    def __init__(self, system: System, layout: MemoryLayout = MemoryLayout.ARRAY) -> None:
        form = system.form
        control: ControlLoop | None = system.control
        laws = system.laws if control is None else control.laws(system.laws, control.present(system.laws))
        self.system, self.layout, self.ports = system, layout, Ports(laws, layout)
        self.deflection = laid_out(form.ports, layout)
        self.road_deflection = None if form.port_road is None else laid_out(form.port_road, layout)

    def at_ports(self, motion: SmallVector, road: RoadInput) -> tuple[SmallVector, SmallVector]:
        """Deflections of the elements [m] and their rates [m/s], positive in extension, shape (ports,)."""
        n = len(motion) // 2
        deflection, rate = times(self.deflection, motion[:n]), times(self.deflection, motion[n:])
        if self.road_deflection is not None and road.rate is not None:
            deflection = minus(deflection, times(self.road_deflection, road.height))
            rate = minus(rate, times(self.road_deflection, road.rate))
        return checkpoint_name((deflection, rate), FOR_REVERSE)

    def at(self, motion: SmallVector, states: States, road: RoadInput, memory: PyTree = None) -> StepState:
        """The vehicle in this motion, with the forces of its elements."""
        return StepState(motion, states, self.ports.force(*self.at_ports(motion, road), states), memory)

    def at_commands(self, commands: Sequence[Scalar]) -> "Equations":
        """The same with its dampers at these commands."""
        laws = self.system.control.laws(self.system.laws, tuple(commands))
        return eqx.tree_at(lambda equations: equations.ports, self, Ports(laws, self.layout))

    def at_rest(self, motion: Float[Array, " n"], road: RoadInput) -> StepState:
        """The beginning of a run, with elements at rest at the deflections of this motion."""
        motion = laid_out(motion, self.layout)
        return self.at(motion, self.ports.at_rest(self.at_ports(motion, road)[0]), road)

    def rates(self, motion: Float[Array, " n"], states: States, road: RoadInput) -> tuple[Float[Array, " n"], States]:
        """Time derivatives (q̇, q̈) of the motion and those of the states, for vectors that are arrays."""
        deflections = self.at_ports(motion, road)
        force = self.ports.force(*deflections, states)
        rates = self.system.motion(motion, force, road.height, road.rate)
        return rates, self.ports.state_rate(*deflections, states)


def settled(system: System, road: Float[Array, " wheels"]) -> Float[Array, " n"]:
    """The motion (q, q̇) of a vehicle at rest on these heights [m].

    Arguments:
        system: the vehicle.
        road: heights under the wheels [m, up], shape (wheels,).
    """
    position = rest_position(system, road)
    return jnp.concatenate([position, jnp.zeros_like(position)])


def road_rate(
    heights: Float[Array, "time wheels"], dt: ScalarLike, edges: RoadEdges = STRAIGHT
) -> Float[Array, "time wheels"]:
    """Rate of the heights at the instants [m/s]: the mean of the slopes before and after."""
    steps = jnp.diff(heights, axis=0) / dt
    first, last = steps[:1], steps[-1:]
    if edges.before is not None:
        first = 0.5 * (first + (heights[:1] - edges.before[None]) / dt)
    if edges.after is not None:
        last = 0.5 * (last + (edges.after[None] - heights[-1:]) / dt)
    return jnp.concatenate([first, 0.5 * (steps[1:] + steps[:-1]), last])

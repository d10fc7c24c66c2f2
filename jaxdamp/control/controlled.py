"""A vehicle whose dampers are commanded while it drives."""

import dataclasses
from collections.abc import Collection, Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._quickly import compiled_quickly
from jaxdamp._traced import behind
from jaxdamp._types import Number, Scalar
from jaxdamp.control.actuator import RateLimit
from jaxdamp.control.levels import forces_both_ways, laws_at_levels, scheduled_in, takes_command
from jaxdamp.control.loop import ControlLoop
from jaxdamp.control.policies import AbstractPolicy
from jaxdamp.control.sensors import Sensors
from jaxdamp.control.together import AbstractVehiclePolicy, EachDamper
from jaxdamp.parameters import nonnegative, parameter, positive, setting
from jaxdamp.vehicles import AbstractVehicle, Channel, ChannelKind, Frame, Layout, LinearMap, System, matrix


FAST = 1.0  # m/s, where levels differ that are alike in slow motion


@final
class Controlled(AbstractVehicle):
    """A vehicle with a controller: its dampers that take a command are set to a policy's demands, sample by sample.

    Every `period` the sensors are read and the policy of each damper demands a force; the command whose force comes
    nearest, at the present motion and state of the law, is applied after `delay` and held, and the actuator follows it
    with a first-order lag:

        u' = (u_target − u)/actuator_lag, within the `rate_limit`

    The sensors' filter is one of their own clock, the instants of the run: y += (1 − e^(−dt/sensor_lag)) (signal − y).
    `sensors` gives signals a noise, a bias, a resolution and a lag of their own, or computes them from others.

    Between two levels of a `Scheduled` law its force is taken as straight in the command, which it is where the law is
    linear in its parameters or its forces are blended; else the force misses the demand a little. Demand and command
    are channels, `{damper}_demand` [N] and `{damper}_command`: what the damper could not do is the difference of demand
    and `{damper}_force`. A policy demands the force of all equal dampers side by side (`damper_count`) together; both
    channels are those of one. Limits are rounded over a tenth of the range, and the quotient of force and velocity
    below the velocity `still`: sharper ones gain nothing, and make runs chaotic, so that their derivatives are useless.

    A run begins with the commands that the laws have. The order at an instant: the sensors see the vehicle just before,
    with forces under the old command; then the policy decides; then forces are those of the new command. With fixed
    steps the motion stays of third order through the jumps. Channels at a sampling instant are those just before it:
    without `actuator_lag`, RMS accelerations of policies that switch are 1 to 2 % off at 1 ms. Simulations, rides,
    sweeps and tunings take it as any vehicle; its parameters are those of the vehicle behind `car.`, and of the
    controller, such as `policy.gain`. What needs a law without a memory of the controller refuses it: white roads,
    linearisation, `Adaptive`. The controller alone is exported as C and FMU by
    `export.to_c(car, "controller.c", part="controller")`.

    Arguments:
        car: any vehicle, with one or more dampers whose law is or holds a `Scheduled` law.
        policy: of every such damper, each with its own states; or of all together (`AbstractVehiclePolicy`); or a
            mapping from the names of dampers (`front_damper`) to policies, and those without one keep their commands.
        period: between two samples [s], a whole number of steps of a run.
        delay: from a sample to its command [s], a whole number of steps.
        sensors: of every damper, or a mapping from names of dampers; exact if left out.
        rate_limit: of the actuators; none if left out.

    Raises:
        ValueError: no damper that takes a command, a name of no damper, a law whose force does not change at once with
            its command, as it stands behind a lag or a series spring whose state gives it; with `blend="force"`, each
            level has a state of its own; a damper between scaled points, whose ratio belongs into its law.

    >>> from jaxdamp import Ride, roads
    >>> from jaxdamp.control import Skyhook
    >>> from jaxdamp.dampers import Linear, Scheduled
    >>> from jaxdamp.vehicles import QuarterCar
    >>> damper = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.2)
    >>> car = QuarterCar(400.0, 50.0, 20e3, 250e3, damper)
    >>> ride = Ride(Controlled(car, Skyhook(3000.0)), roads.iso8608("C", speed=20.0, seed=1), duration=2.0)
    >>> values = ride({"policy.gain": 2000.0})
    """

    car: AbstractVehicle
    policy: AbstractPolicy | AbstractVehiclePolicy | dict[str, AbstractPolicy]
    actuator_lag: Number = parameter("s", "time constant of the actuator", nonnegative, default=0.0, adjustable=False)
    sensor_lag: Number = parameter("s", "time constant of the sensors", nonnegative, default=0.0, adjustable=False)
    still: Number = setting("m/s", "velocity below which force over velocity is rounded", positive, default=0.1)
    period: float = eqx.field(static=True, default=5e-3)
    delay: float = eqx.field(static=True, default=0.0)
    sensors: Sensors | dict[str, Sensors] | None = None
    rate_limit: RateLimit | None = None

    def __check_init__(self) -> None:
        _checks.instance("car", self.car, AbstractVehicle, "be a vehicle", "Put the damper into one.")
        if self.car.passive is not self.car:
            remedy = "Give the policies of all dampers to one: `policy={'front_damper': ..., 'rear_damper': ...}`."
            _checks.refuse("car", "have no controller yet", f"a {type(self.car).__name__}", remedy)
        _checks.positive("period", self.period)
        _checks.nonnegative("delay", self.delay)
        _checks.positive("still", self.still)
        must, such = "be a policy, or a dict of policies by names of dampers", "Such as `control.Skyhook()`."
        _checks.instance("policy", self.policy, (AbstractPolicy, AbstractVehiclePolicy, dict), must, such)
        forces = _forces_at_levels(self.car, self.still)
        if not forces:
            remedy = "Make its damper `dampers.Scheduled((soft, hard), levels=[0.0, 1.0], command=0.0)`."
            must = "have a damper with one `Scheduled` law, which takes a command"
            _checks.refuse("car", must, ", ".join(self.car.layout.ports), remedy)
        if isinstance(self.policy, dict):
            if not self.policy:
                _checks.refuse("policy", "hold a policy of one damper or more", self.policy, such)
            for name, policy in self.policy.items():
                _checks.one_of("policy", name, forces)
                _checks.instance(f"policy[{name!r}]", policy, AbstractPolicy, "be a policy", such)
        dampers, policy = self.commanded(list(forces))
        refuse_scaled(self.car.frame(), dampers)
        policy.sampled(self.period).initial_state(dampers)  # refuses what does not suit the vehicle or the period
        each = self.sensors if isinstance(self.sensors, dict) else {}
        for name in each:
            _checks.one_of("sensors", name, dampers)
        for one in each.values() or (self.sensors,):
            remedy = "Such as `control.Sensors(stroke=control.SignalSensor(noise=1e-4))`."
            _checks.instance("sensors", one, (Sensors, type(None)), "be `Sensors`, or a dict of them by damper", remedy)
        for name in dampers:
            concrete = _checks.concrete(forces[name])
            if concrete is not None and not np.any(np.ptp(concrete, axis=1)):
                must = "have a force that changes at once with its command"
                remedy = 'Blend the forces of its levels, `blend="force"`, or put its lag into `actuator_lag`.'
                always = f"one that is {concrete[0, 0]:g} N at {float(self.still):g} m/s always"
                _checks.refuse(name, must, always, remedy)

    def commanded(self, dampers: Sequence[str]) -> tuple[tuple[str, ...], AbstractVehiclePolicy]:
        """Which of these dampers are commanded, and the policy of all of them."""
        if isinstance(self.policy, AbstractVehiclePolicy):
            return tuple(dampers), self.policy
        each = dict.fromkeys(dampers, self.policy) if isinstance(self.policy, AbstractPolicy) else self.policy
        chosen = {name: each[name] for name in dampers if name in each}
        return tuple(chosen), EachDamper(chosen)

    def sensors_of(self, dampers: Sequence[str]) -> tuple[Sensors | None, ...]:
        """The sensors of each of these dampers."""
        each = self.sensors if isinstance(self.sensors, dict) else dict.fromkeys(dampers, self.sensors)
        return tuple(each.get(name) for name in dampers)

    @property
    def passive(self) -> AbstractVehicle:
        """The vehicle without the controller, its dampers at the commands that their laws have."""
        return self.car.passive

    def frame(self) -> Frame:
        """The parts of the vehicle."""
        return self.car.frame()

    @property
    def layout(self) -> Layout:
        """That of the vehicle, with the channels of command and demand of each damper."""
        layout = self.car.layout
        dampers, _ = self.commanded(list(_forces_at_levels(self.car, self.still)))
        return dataclasses.replace(layout, channels=(*layout.channels, *_channels(dampers, layout)))

    def system(self) -> System:
        """The assembled vehicle with its controller."""
        return _controlled_system(self, self.layout)


def refuse_scaled(frame: Frame, dampers: Sequence[str]) -> None:
    """Refuse dampers between scaled points: signals are heights of body and wheel, whose difference is the stroke."""
    heights = {f"z_{body.name}" for body in frame.bodies}
    for name in dampers:
        shares = [behind(share) for at, share in frame.extension(name).terms.items() if at in heights]
        if any(share is None or share.ndim for share in shares):  # traced
            continue
        numbers = np.array(shares)
        for end in (numbers[numbers > 0.0], numbers[numbers < 0.0]):
            if end.size and not np.isclose(np.sum(np.abs(end)), 1.0):
                must = "have the difference of the heights of its ends as stroke, which the controller's signals are of"
                remedy = "Leave the points unscaled and put the ratio into its law: `dampers.MotionRatio(law, ratio)`."
                _checks.refuse(name, must, f"one with {np.sum(np.abs(end)):g} times a height", remedy)


def _channels(dampers: Sequence[str], layout: Layout) -> list[Channel]:
    """The channels of control, commands before demands."""
    commands = [Channel(f"{d}_command", ChannelKind.COMMAND, d, f"command of {d}, in its unit") for d in dampers]
    of = {d: layout.by_name[f"{d}_force"].description.removeprefix("force of ") for d in dampers}
    words = "force that the controller demands of {}"
    return commands + [Channel(f"{d}_demand", ChannelKind.FORCE, d, words.format(of[d])) for d in dampers]


def _forces_at_levels(car: AbstractVehicle, velocity: Scalar) -> dict[str, Float[Array, "motions levels"]]:
    """Of each damper that takes a command, its forces at all levels, with the same states: at ± a velocity and fast."""
    forces = _by_damper(car, velocity)
    return {name: forces[name] for name in car.layout.ports if name in forces}  # JAX sorts them by name


@compiled_quickly
def _by_damper(car: AbstractVehicle, velocity: Scalar) -> dict[str, Float[Array, "motions levels"]]:
    forces = {}
    for name, law in zip(car.layout.ports, car.elements(), strict=True):
        if takes_command(law):
            motions = velocity, jnp.full_like(velocity, FAST)
            forces[name] = jnp.concatenate([forces_both_ways(laws_at_levels(law), v) for v in motions])
    return forces


def _repeated(frame: Frame, system: System, dampers: Sequence[str]) -> tuple[tuple[int, int], ...]:
    """The ports of lift-off of wheels that stand on a commanded damper, whose law they repeat, and its number."""
    pairs = []
    for wheel in (wheel for wheel in frame.wheels if wheel.lifts):
        commanded = [dampers.index(name) for name in wheel.element_names if name in dampers]
        if commanded:
            port = system.layout.ports.index(wheel.element_names[-1])
            if len(scheduled_in(system.laws[port])) > 1:
                must = "have one damper that takes a command at each wheel that lifts"
                _checks.refuse("car", must, f"several at {wheel.name!r}", "Let the wheel not lift.")
            pairs.append((port, commanded[0]))
    return tuple(pairs)


@compiled_quickly
def _controlled_system(vehicle: Controlled, layout: Layout) -> System:
    system, frame = vehicle.car.system(), vehicle.car.frame()
    takes = [name for name, law in zip(system.layout.ports, system.laws, strict=True) if takes_command(law)]
    dampers, policy = vehicle.commanded(takes)
    if not dampers:
        _checks.refuse("car", "have a damper that takes a command, for its controller", ", ".join(system.layout.ports))
    ports = tuple(system.layout.ports.index(name) for name in dampers)
    n, motion, outputs = len(system.layout.coordinates), system.motion, system.outputs
    body, pitch, roll, tyre, ground = rows_of(frame, system.form.ports[np.array(ports)])
    rates = (getattr(motion, name)[n:] for name in ("motion", "force", "road", "road_rate"))
    loop = ControlLoop(
        policy.sampled(vehicle.period),
        body,
        pitch,
        roll,
        tyre,
        ground,
        LinearMap(*(body @ rate for rate in rates)),
        vehicle.actuator_lag,
        vehicle.sensor_lag,
        vehicle.still,
        dampers,
        ports,
        vehicle.period,
        vehicle.delay,
        vehicle.sensors_of(dampers),
        vehicle.rate_limit,
        _repeated(frame, system, dampers),
    )
    more = 2 * len(ports)  # commands and demands stand behind the forces
    wide = LinearMap(
        *(jnp.pad(a, ((0, more), (0, 0))) for a in (outputs.motion, outputs.force, outputs.road, outputs.road_rate))
    )
    count = outputs.force.shape[0]
    one = jnp.array([1.0] * len(dampers) + [1.0 / frame.element(name).count for name in dampers])
    force = jnp.concatenate([wide.force, jnp.eye(count + more, more, -count) * one[None, :]], axis=1)
    outputs = dataclasses.replace(wide, force=force)
    return dataclasses.replace(system, layout=layout, outputs=outputs, control=loop)


def rows_of(frame: Frame, ports: Float[Array, "dampers q"]) -> tuple[Array, ...]:
    """What the sensors see of the coordinates: body above each damper, its pitch and roll, wheel and road below."""
    names = frame.coordinates
    body, pitch, roll, tyre = (jnp.zeros_like(ports) for _ in range(4))
    for part in frame.bodies:  # above a damper is the body that lengthens it when it rises
        place = names.index(f"z_{part.name}")
        above = ports[:, place : place + 1] > 0.0

        def of(coordinates: Collection[str], above: Array = above) -> Array:
            available = np.array([name in coordinates for name in names])
            return jnp.where(available[None, :] & above, ports, 0.0)

        turns = {turn.axis: {part.angle(turn.axis)} for turn in part.turns}
        body = body + of(part.masses)
        pitch, roll = pitch + of(turns.get("pitch", ())), roll + of(turns.get("roll", ()))
    columns = []
    for wheel in frame.wheels:  # below a damper is the wheel that shortens it when it rises
        row = matrix([wheel.point], names)[0]
        below = (jnp.count_nonzero(row) == 1) & ((ports @ row)[:, None] < 0.0)
        tyre = tyre + jnp.where(below, row[None, :], 0.0)
        columns.append(jnp.where(below, 1.0, 0.0))
    return body, pitch, roll, tyre, jnp.concatenate(columns, axis=1)

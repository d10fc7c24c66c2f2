"""A vehicle assembled for everything generic, and the same with linear laws."""

import dataclasses
import functools
import itertools
from collections.abc import Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp.dampers import AbstractDamper
from jaxdamp.metrics import Metric
from jaxdamp.vehicles.channels import Channel, ChannelKind, Measured, channels_of, ride_metrics_of, signals
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import matrix
from jaxdamp.vehicles.port_form import LinearMap, PortForm


@final
@dataclasses.dataclass(frozen=True)
class Layout:
    """The part of a vehicle that is independent of its parameter values.

    Arguments:
        coordinates: names of q.
        ports: names of the elements, those of tyres that can lift off last.
        wheels: names of the wheels.
        axles: number of the axle of each wheel, from 0.
        lifts: whether the tyre of each wheel can lift off.
        channels: all channels.
        metrics: the ride metrics.
    """

    coordinates: tuple[str, ...]
    ports: tuple[str, ...]
    wheels: tuple[str, ...]
    axles: tuple[int, ...]
    lifts: tuple[bool, ...]
    channels: tuple[Channel, ...]
    metrics: tuple[Metric, ...]

    @property
    def axle_names(self) -> tuple[str, ...]:
        """The common part of the wheel names of each axle, or the number of the axle."""
        words: dict[int, list[str]] = {}
        for axle, wheel in zip(self.axles, self.wheels, strict=True):
            parts = wheel.split("_")
            pairs = zip(words.get(axle, parts), parts, strict=False)
            words[axle] = [word for word, _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs)]
        return tuple("_".join(common) or f"number {axle + 1}" for axle, common in words.items())

    @functools.cached_property
    def by_name(self) -> dict[str, Channel]:
        """The channels by name."""
        return {channel.name: channel for channel in self.channels}

    @functools.cached_property
    def units(self) -> dict[str, str]:
        """Unit of each channel."""
        return {channel.name: channel.unit for channel in self.channels}

    def weighting(self, channel: str) -> str:
        """The weighting of ISO 2631-1 of a channel.

        Raises:
            ValueError: a channel that is not an acceleration.
        """
        weighting = self.by_name[channel].kind.weighting
        if weighting is None:
            _checks.refuse("channel", "be an acceleration, which ISO 2631-1 weights", f"{channel!r}")
        return weighting

    @functools.cached_property
    def numbers(self) -> dict[str, int]:
        """Index of each channel in the outputs."""
        return {channel.name: i for i, channel in enumerate(self.channels)}


def layout_of(frame: Frame, measured: Sequence[Measured]) -> Layout:
    """The layout of a vehicle of these parts, with its channels.

    Raises:
        ValueError: two channels of one name, as of a place named like a damper.
    """
    channels = tuple(channel for channel, _ in measured)
    by_name: dict[str, Channel] = {}
    for channel in channels:
        if (first := by_name.setdefault(channel.name, channel)) is not channel:
            both = f"{channel.name!r} of two: {first.description}; {channel.description}"
            must = "give each channel a name of its own"
            _checks.refuse("bodies, places, links and wheels", must, both, "Rename the place or the part.")
    return Layout(
        frame.coordinates,
        frame.element_names,
        tuple(wheel.name for wheel in frame.wheels),
        frame.axles,
        tuple(wheel.lifts for wheel in frame.wheels),
        channels,
        ride_metrics_of(frame, channels),
    )


@final
class System(eqx.Module):
    """An assembled vehicle: names, matrices, laws and outputs.

    Arguments:
        layout: names, kinds and places.
        form: matrices of masses, springs and dashpots, and geometry of the ports, in SI units.
        laws: the law at each port.
        static_loads: loads of the wheels at rest on level ground [N].
        motion: the rate ẋ of the motion x = (q, q̇).
        outputs: the channels of the layout; of a controlled vehicle they also take its commands and demands, which
            stand behind the forces.
        control: what commands its dampers (`control.ControlLoop`); None of a passive vehicle.
    """

    layout: Layout = eqx.field(static=True)
    form: PortForm
    laws: tuple[AbstractDamper, ...]
    static_loads: Float[Array, " wheels"]
    motion: LinearMap
    outputs: LinearMap
    control: PyTree = None

    def channels(self, names: Sequence[str]) -> LinearMap:
        """The outputs of these channels."""
        return self.outputs.of([self.layout.numbers[name] for name in names])

    def passive(self) -> "System":
        """The same without its controller."""
        outputs = dataclasses.replace(self.outputs, force=self.outputs.force[:, : len(self.laws)])
        return dataclasses.replace(self, outputs=outputs, control=None)


def assemble(frame: Frame) -> System:
    """The system of a vehicle of these parts."""
    measured, form = channels_of(frame), frame.port_form()
    layout, loads, motion = layout_of(frame, measured), frame.static_wheel_loads(form), form.first_order()
    sums = matrix([point for _, point in measured], signals(frame))
    return System(layout, form, frame.elements(loads), loads, motion, _outputs(layout, motion, sums, loads))


def _outputs(
    layout: Layout, motion: LinearMap, sums: Float[Array, "channels signals"], loads: Float[Array, " wheels"]
) -> LinearMap:
    """The channels, from their linear combinations of signals and the accelerations of the coordinates."""
    n, ports, wheels = len(layout.coordinates), len(layout.ports), len(layout.wheels)
    relative = [c.kind is ChannelKind.RELATIVE_TYRE_LOAD for c in layout.channels]
    divisor = [
        1 + layout.wheels.index(c.place) if is_relative else 0
        for c, is_relative in zip(layout.channels, relative, strict=True)
    ]
    shares = jnp.concatenate([jnp.ones(1), 1.0 / loads])[np.array(divisor)]
    ends = np.cumsum([2 * n, n, ports, wheels])
    of_motion, of_acceleration, *others = jnp.split(sums * shares[:, None], ends, axis=1)
    accelerations = (part[n:] for part in (motion.motion, motion.force, motion.road, motion.road_rate))
    return LinearMap(
        *(direct + of_acceleration @ by for direct, by in zip((of_motion, *others), accelerations, strict=True))
    )


@final
class LinearLaws(eqx.Module):
    """(f, ṡ) = constant + slopes (x, v, s): forces and rates of the states, from deflections, rates and states."""

    constant: Float[Array, " answers"]  # shape (laws + states,)
    slopes: Float[Array, "answers motions"]  # shape (laws + states, 2 laws + states)
    ports: tuple[int, ...] = eqx.field(static=True)  # the port of each law; several laws may share one


class StateSpaceOfVehicle(NamedTuple):
    """ẋ = A x + B z_r + E ż_r + a, channels C x + D z_r + F ż_r; x = (q, q̇, states of the laws)."""

    a: Float[Array, "n n"]
    b: Float[Array, "n wheels"]
    e: Float[Array, "n wheels"]
    c: Float[Array, "channels n"]
    d: Float[Array, "channels wheels"]
    f: Float[Array, "channels wheels"]
    constant: Float[Array, " n"]


class Motions(NamedTuple):
    """(x, v, s) of the laws = Z x + D z_r + F ż_r."""

    state: Float[Array, "motions n"]
    road: Float[Array, "motions wheels"]
    road_rate: Float[Array, "motions wheels"]


def motions_of(system: System, ports: Sequence[int], states: int) -> Motions:
    """Deflection, rate and states of laws at these ports."""
    form, chosen = system.form, np.array(ports, dtype=int)
    rows, wheels = form.ports[chosen], form.road_stiffness.shape[1]
    on_road = jnp.zeros((len(ports), wheels)) if form.port_road is None else form.port_road[chosen]
    n, none = rows.shape[1], jnp.zeros_like(rows)
    state = jnp.concatenate([jnp.concatenate([rows, none], axis=1), jnp.concatenate([none, rows], axis=1)])
    inner = jnp.concatenate([jnp.zeros((states, 2 * n)), jnp.eye(states)], axis=1)
    state = jnp.concatenate([jnp.concatenate([state, jnp.zeros((2 * len(ports), states))], axis=1), inner])
    quiet, nothing = jnp.zeros_like(on_road), jnp.zeros((states, wheels))
    return Motions(state, jnp.concatenate([-on_road, quiet, nothing]), jnp.concatenate([quiet, -on_road, nothing]))


def with_linear_laws(system: System, laws: LinearLaws) -> StateSpaceOfVehicle:
    """The equations of the vehicle with these laws in place of its own."""
    count = len(laws.ports)
    states = laws.constant.size - count
    moved = motions_of(system, laws.ports, states)
    of_state, of_road, of_rate = (laws.slopes @ part for part in moved)
    chosen = np.array(laws.ports, dtype=int)
    push, feel = system.motion.force[:, chosen], system.outputs.force[:, chosen]

    def rates(answers: Array) -> Array:
        return jnp.concatenate([push @ answers[:count], answers[count:]])

    wide = ((0, states), (0, states))
    return StateSpaceOfVehicle(
        jnp.pad(system.motion.motion, wide) + rates(of_state),
        jnp.pad(system.motion.road, (*wide[:1], (0, 0))) + rates(of_road),
        jnp.pad(system.motion.road_rate, (*wide[:1], (0, 0))) + rates(of_rate),
        jnp.pad(system.outputs.motion, ((0, 0), (0, states))) + feel @ of_state[:count],
        system.outputs.road + feel @ of_road[:count],
        system.outputs.road_rate + feel @ of_rate[:count],
        rates(laws.constant),
    )

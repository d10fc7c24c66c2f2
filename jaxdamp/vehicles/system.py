"""The assembled vehicle, which solvers, linear analysis and metrics use: matrices, laws and channels."""

import dataclasses
import functools
import itertools
from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp.dampers import AbstractDamper
from jaxdamp.metrics import Metric
from jaxdamp.vehicles.channels import Channel, ChannelKind, Measured, channels_of, signals
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import matrix
from jaxdamp.vehicles.port_form import LinearMap, PortForm
from jaxdamp.vehicles.ride_metrics import ride_metrics_of


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
            own = wheel.split("_")
            pairs = zip(words.get(axle, own), own, strict=False)
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
    """The layout of a vehicle of these parts, with its channels."""
    channels = tuple(channel for channel, _ in measured)
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
        outputs: the channels of the layout.
    """

    layout: Layout = eqx.field(static=True)
    form: PortForm
    laws: tuple[AbstractDamper, ...]
    static_loads: Float[Array, " wheels"]
    motion: LinearMap
    outputs: LinearMap

    def channels(self, names: Sequence[str]) -> LinearMap:
        """The outputs of these channels."""
        return self.outputs.of([self.layout.numbers[name] for name in names])


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
    divisor = [1 + layout.wheels.index(c.place) if own else 0 for c, own in zip(layout.channels, relative, strict=True)]
    shares = jnp.concatenate([jnp.ones(1), 1.0 / loads])[np.array(divisor)]
    ends = np.cumsum([2 * n, n, ports, wheels])
    of_motion, of_acceleration, *others = jnp.split(sums * shares[:, None], ends, axis=1)
    accelerations = (part[n:] for part in (motion.motion, motion.force, motion.road, motion.road_rate))
    return LinearMap(*(own + of_acceleration @ by for own, by in zip((of_motion, *others), accelerations, strict=True)))

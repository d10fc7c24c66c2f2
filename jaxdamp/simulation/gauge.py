"""What a ride measures as it goes: channels as linear outputs, ISO weightings as extra states, statistics gathered."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array

from jaxdamp._types import Scalar
from jaxdamp.metrics import STATISTICS, Kept, discrete_weighting, weighting_of
from jaxdamp.simulation._vectors import Matrix, Vector, plus, rows, scalars, times
from jaxdamp.simulation.stepper import FOR_REVERSE, Ground, Now
from jaxdamp.vehicles import AbstractVehicle, Instant, RideMetric


class Outputs(NamedTuple):
    """Channels as rows over motion, forces, heights and rates of the road: y = X x + F f + R r + S ṙ."""

    motion: Matrix
    force: Matrix
    road: Matrix
    road_rate: Matrix

    @classmethod
    def of(cls, vehicle: AbstractVehicle, names: Sequence[str], *, apart: bool) -> "Outputs":
        """The rows of these channels, as tuples of scalars or as arrays."""
        form = vehicle.port_form()
        system, n, wheels = form.first_order(), form.mass.shape[0], form.road_stiffness.shape[1]

        def channels(x: Array, force: Array, road: Array, rate: Array) -> Array:
            change = system.state_matrix @ x + system.port_input @ force + system.road_input @ road
            change = change + system.road_rate_input @ rate
            found = vehicle.channels(Instant(x[:n], x[n:], change[n:], road, rate, force))
            return jnp.stack([found[name] for name in names])

        level = jnp.zeros(wheels)
        at = jnp.zeros(2 * n), jnp.zeros(form.ports.shape[0]), level, level
        found = jax.jacfwd(channels, argnums=(0, 1, 2, 3))(*at)
        return cls(*map(rows, found)) if apart else cls(*found)

    def __call__(self, now: Now, ground: Ground) -> tuple[Scalar, ...]:
        """Their values; what the road gives is summed first, as it is the same for all cars."""
        given = times(self.road, ground.height)
        if ground.rate is not None:
            given = plus(given, times(self.road_rate, ground.rate))
        values = plus(given, times(self.motion, now.motion), times(self.force, now.force))
        return checkpoint_name(values if isinstance(values, tuple) else scalars(values), FOR_REVERSE)


class Filter(NamedTuple):
    """An ISO weighting over a step, as constants."""

    phi: np.ndarray
    held: np.ndarray
    ramp: np.ndarray
    output: np.ndarray

    def __call__(self, state: Vector, before: Scalar, after: Scalar) -> tuple[Scalar, ...]:
        """Its state a step later, for an input straight from before to after."""
        rise = after - before
        driven = zip(self.held, self.ramp, strict=True)
        pushes = [float(held) * before + float(ramp) * rise for held, ramp in driven]
        return tuple(_constant_dot(row, state, push) for row, push in zip(self.phi, pushes, strict=True))

    def of(self, state: Vector) -> Scalar:
        """Its output."""
        return _constant_dot(self.output, state, jnp.zeros_like(state[0]))


def _constant_dot(row: np.ndarray, vector: Vector, start: Scalar) -> Scalar:
    """Sum of products, without those that are zero."""
    for factor, entry in zip(row, vector, strict=True):
        start = start + float(factor) * entry if factor else start
    return start


class Gathered(NamedTuple):
    """What the loop carries beside the vehicle: the last channels, the states of weightings, the statistics."""

    channels: tuple[Scalar, ...]
    felt: tuple[tuple[Scalar, ...], ...]
    kept: tuple[Kept, ...]
    rest: tuple[Scalar, ...]  # channels that count from the static equilibrium, as they are there


class Gauge:
    """Which channels and weightings the metrics need, and how they are gathered."""

    def __init__(self, vehicle: AbstractVehicle, metrics: Sequence[RideMetric], dt: float, *, apart: bool) -> None:
        pairs = [name for m in metrics for name in (m.channel, m.by) if name]
        self.names, self.metrics, self.dt = list(dict.fromkeys(pairs)), metrics, dt
        self.from_rest = list(dict.fromkeys(m.channel for m in metrics if m.from_rest))
        self.outputs = Outputs.of(vehicle, self.names, apart=apart)
        felt = dict.fromkeys(m.channel for m in metrics if STATISTICS[m.statistic].weighted)
        units = vehicle.units
        self.weighted = {name: Filter(*discrete_weighting(weighting_of(units[name]), dt)) for name in felt}

    def begin(self, now: Now, ground: Ground) -> Gathered:
        """At the first instant, the vehicle in its static equilibrium and weightings at rest."""
        values = self.outputs(now, ground)
        still = tuple((jnp.zeros_like(values[0]),) * f.output.size for f in self.weighted.values())
        rest = tuple(values[self.names.index(name)] for name in self.from_rest)
        records = self._records(values, still, rest)
        return Gathered(values, still, tuple(STATISTICS[m.statistic].begin(y) for m, y in records), rest)

    def add(self, old: Gathered, now: Now, ground: Ground) -> Gathered:
        """One instant more."""
        values = self.outputs(now, ground)
        inputs = [(old.channels[i], values[i]) for i in map(self.names.index, self.weighted)]
        felt = tuple(f(s, *u) for f, s, u in zip(self.weighted.values(), old.felt, inputs, strict=True))
        pairs = zip(self._records(values, felt, old.rest), old.kept, strict=True)
        kept = tuple(STATISTICS[m.statistic].add(before, y) for (m, y), before in pairs)
        return Gathered(values, felt, kept, old.rest)

    def end(self, gathered: Gathered, count: int) -> dict[str, Scalar]:
        """The metrics of so many instants."""
        pairs = zip(self.metrics, gathered.kept, strict=True)
        return {m.name: STATISTICS[m.statistic].end(kept, count, self.dt) for m, kept in pairs}

    def _records(
        self, values: Sequence[Scalar], felt: Sequence[Vector], rest: Sequence[Scalar]
    ) -> list[tuple[RideMetric, Scalar]]:
        """The sample of each metric's record."""
        weighted = {name: f.of(s) for (name, f), s in zip(self.weighted.items(), felt, strict=True)}
        plain = dict(zip(self.names, values, strict=True))
        moved = {name: plain[name] - level for name, level in zip(self.from_rest, rest, strict=True)}

        def sample(m: RideMetric) -> Scalar:
            if m.from_rest:
                return moved[m.channel]
            return (weighted if STATISTICS[m.statistic].weighted else plain)[m.channel]

        return [(m, sample(m) * (plain[m.by] if m.by else 1.0)) for m in self.metrics]

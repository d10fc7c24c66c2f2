"""The metrics of a run, observed step by step: channels, ISO weightings as extra states, accumulators of statistics."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.ad_checkpoint import checkpoint_name

from jaxdamp._types import Scalar
from jaxdamp._vectors import Vector, scalars
from jaxdamp.metrics import STATISTICS, Kept, discrete_weighting
from jaxdamp.simulation.stepper import FOR_REVERSE, RoadInput, StepState
from jaxdamp.vehicles import RideMetric, System


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


class Accumulators(NamedTuple):
    """What the loop carries beside the vehicle: the last channels, the states of weightings, the statistics."""

    channels: tuple[Scalar, ...]
    weighting_states: tuple[tuple[Scalar, ...], ...]
    statistics: tuple[Kept, ...]
    rest: tuple[Scalar, ...]  # channels that count from the static equilibrium, as they are there


class MetricObserver:
    """Which channels and weightings the metrics need, and how they are gathered."""

    def __init__(self, system: System, metrics: Sequence[RideMetric], dt: float, *, apart: bool) -> None:
        pairs = [name for m in metrics for name in (m.channel, m.by) if name]
        self.names, self.metrics, self.dt = list(dict.fromkeys(pairs)), metrics, dt
        self.from_rest = list(dict.fromkeys(m.channel for m in metrics if m.from_rest))
        outputs = system.channels(self.names)
        self.outputs = outputs.scalars() if apart else outputs
        felt = dict.fromkeys(m.channel for m in metrics if STATISTICS[m.statistic].weighted)
        self.weighted = {name: Filter(*discrete_weighting(system.layout.weighting(name), dt)) for name in felt}

    def begin(self, now: StepState, ground: RoadInput) -> Accumulators:
        """At the first instant, the vehicle in its static equilibrium and weightings at rest."""
        values = self._values(now, ground)
        still = tuple((jnp.zeros_like(values[0]),) * f.output.size for f in self.weighted.values())
        rest = tuple(values[self.names.index(name)] for name in self.from_rest)
        records = self._records(values, still, rest)
        return Accumulators(values, still, tuple(STATISTICS[m.statistic].begin(y) for m, y in records), rest)

    def add(self, old: Accumulators, now: StepState, ground: RoadInput) -> Accumulators:
        """One instant more."""
        values = self._values(now, ground)
        inputs = [(old.channels[i], values[i]) for i in map(self.names.index, self.weighted)]
        felt = tuple(f(s, *u) for f, s, u in zip(self.weighted.values(), old.weighting_states, inputs, strict=True))
        pairs = zip(self._records(values, felt, old.rest), old.statistics, strict=True)
        kept = tuple(STATISTICS[m.statistic].add(before, y) for (m, y), before in pairs)
        return Accumulators(values, felt, kept, old.rest)

    def end(self, gathered: Accumulators, count: int) -> dict[str, Scalar]:
        """The metrics of so many instants."""
        pairs = zip(self.metrics, gathered.statistics, strict=True)
        return {m.name: STATISTICS[m.statistic].end(kept, count, self.dt) for m, kept in pairs}

    def _values(self, now: StepState, ground: RoadInput) -> tuple[Scalar, ...]:
        """The channels."""
        values = self.outputs(now.motion, now.force, ground.height, ground.rate)
        return checkpoint_name(values if isinstance(values, tuple) else scalars(values), FOR_REVERSE)

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

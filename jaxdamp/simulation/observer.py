"""What observes a run step by step: the recorder of channels, and metrics by accumulators of statistics."""

from collections.abc import Sequence
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array, Float, PyTree

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar, Signal
from jaxdamp._vectors import MemoryLayout, SmallVector, scalars
from jaxdamp.metrics import Gathered, Metric, discrete_weighting
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver, RunState
from jaxdamp.simulation.equations import FOR_REVERSE, Equations, RoadEdges, RoadInput, StepState, road_rate, settled
from jaxdamp.vehicles import States, System


class Saved(NamedTuple):
    """What is saved of a run, at the instants that are saved; the states of the laws, and the vehicle, at the end."""

    motion: Float[Array, "time n"]
    port_force: Float[Array, "time ports"]
    road: Float[Array, "time wheels"]
    road_rate: Float[Array, "time wheels"]
    final_state: list[Float[Array, " _state"]]
    last: StepState | None
    commands: Float[Array, "time commands"] | None  # of the dampers, then the demanded forces; None without control


@final
class Recorder(AbstractObserver):
    """Saves motion and states at one in `every` instants."""

    saves_motion = True

    def __init__(self, every: int) -> None:
        self.every = every

    def begin(self, now: StepState, road: RoadInput) -> tuple[()]:
        """Nothing is gathered."""
        return ()

    def add(self, gathered: tuple[()], now: StepState, road: RoadInput) -> tuple[()]:
        """Nothing is gathered."""
        return ()

    def saved(self, now: StepState, gathered: tuple[()]) -> tuple[SmallVector, States, Array | None]:
        """Motion, states and commands: forces follow from them, and a loop that does not save them has a small body."""
        return now.motion, now.states, None if now.control is None else jnp.stack(_of_control(now))


@compiled_for_loops
def recorded(
    engine: AbstractEngine,
    system: System,
    heights: Float[Array, "time wheels"],
    dt: Scalar,
    start: Float[Array, " n"] | RunState | None,
    every: int,
    edges: RoadEdges | None,
) -> tuple[Saved, PyTree]:
    """Motion (q, q̇) and element forces at every instant of the road, or every so many-th; what the engine says of it.

    From `start`, or settled and at rest on the road's first height. Elements that stand on the road take its rate as
    the mean of the slopes before and after an instant. Vectors are arrays, which are saved as they are.

    Arguments:
        engine: the engine with its step.
        system: the vehicle.
        heights: of the road under each wheel [m, up], shape (time, wheels).
        dt: step of the heights [s].
        start: q and q̇ at the beginning, shape (n,), or where an earlier run stopped; at rest if None.
        every: number of instants from one that is saved to the next.
        edges: the road beyond both ends of a run that goes on.
    """
    equations = Equations(system)
    start = settled(system, heights[0]) if start is None else start
    beyond = () if edges is None else (edges,)
    outcome = engine.run(equations, heights, dt, start, Recorder(every), *beyond)
    motion, states, commands = outcome.records
    heights, slopes = heights[::every], road_rate(heights, dt, *beyond)[::every]

    def force(motion: Array, states: States, height: Array, slope: Array, commands: Array | None) -> Array:
        now = equations if commands is None else equations.at_commands(scalars(commands[: commands.size // 2]))
        return now.at(motion, states, RoadInput(height, slope)).force

    forces = jax.vmap(force)(motion, states, heights, slopes, commands)
    return Saved(motion, forces, heights, slopes, outcome.states, outcome.last, commands), outcome.status


def _of_control(now: StepState) -> tuple[Scalar, ...]:
    """Commands and demanded forces at an instant, which stand behind the forces in the outputs of the vehicle."""
    return () if now.control is None else (*now.control.command, *now.control.demand)


class Filter(NamedTuple):
    """An ISO weighting over a step, as constants."""

    phi: np.ndarray
    held: np.ndarray
    ramp: np.ndarray
    output: np.ndarray

    def __call__(self, state: SmallVector, before: Scalar, after: Scalar) -> tuple[Scalar, ...]:
        """Its state a step later, for an input straight from before to after."""
        rise = after - before
        driven = zip(self.held, self.ramp, strict=True)
        pushes = [float(held) * before + float(ramp) * rise for held, ramp in driven]
        return tuple(_constant_dot(row, state, push) for row, push in zip(self.phi, pushes, strict=True))

    def of(self, state: SmallVector) -> Scalar:
        """Its output."""
        return _constant_dot(self.output, state, jnp.zeros_like(state[0]))


def _constant_dot(row: np.ndarray, vector: SmallVector, start: Scalar) -> Scalar:
    """Sum of products, without those that are zero."""
    for factor, entry in zip(row, vector, strict=True):
        start = start + float(factor) * entry if factor else start
    return start


class Accumulators(NamedTuple):
    """What the loop carries beside the vehicle: the last channels, the states of weightings, the statistics."""

    channels: tuple[Scalar, ...]  # where a metric is weighted
    weighting_states: tuple[tuple[Scalar, ...], ...]
    statistics: tuple[Gathered, ...]
    rest: tuple[Scalar, ...]  # channels that count from the static equilibrium, as they are there
    samples: tuple[Scalar, ...]  # of the metrics that need the whole record, at this instant
    instant: Scalar | None  # number of it, where a metric has a window; printed loops count by no whole numbers


@final
class MetricObserver(AbstractObserver):
    """Gathers metrics: which channels and weightings they need, and the accumulators of their statistics.

    Arguments:
        equations: of the vehicle.
        metrics: of its channels.
        dt: interval of the instants [s].
        count: number of the instants.
    """

    def __init__(self, equations: Equations, metrics: Sequence[Metric], dt: float, count: int) -> None:
        pairs = [name for m in metrics for name in (m.channel, m.by) if name]
        self.names, self.metrics, self.dt, self.count = list(dict.fromkeys(pairs)), metrics, dt, count
        self.from_rest = list(dict.fromkeys(m.channel for m in metrics if m.from_rest))
        self.windows = [m.samples(count, dt) for m in metrics]
        outputs = equations.system.channels(self.names)
        self.outputs = outputs if equations.layout is MemoryLayout.ARRAY else outputs.scalars()
        pairs = dict.fromkeys((m.channel, m.weighting) for m in metrics if m.weighting is not None)
        self.weighted = {pair: Filter(*discrete_weighting(pair[1], dt)) for pair in pairs}

    def begin(self, now: StepState, road: RoadInput) -> Accumulators:
        """At the first instant, the vehicle in its static equilibrium and weightings at rest."""
        values = self._values(now, road)
        still = tuple((jnp.zeros_like(values[0]),) * f.output.size for f in self.weighted.values())
        at_rest = tuple(values[self.names.index(name)] for name in self.from_rest)
        samples = self._samples(values, still, at_rest)
        gathered = tuple(m.statistic.begin(y) for m, y in zip(self.metrics, samples, strict=True))
        before = values if self.weighted else ()
        instant = jnp.zeros_like(samples[0]) if any(m.window for m in self.metrics) else None
        return Accumulators(before, still, gathered, at_rest, self._saved(samples), instant)

    def add(self, gathered: Accumulators, now: StepState, road: RoadInput) -> Accumulators:
        """One instant more."""
        values = self._values(now, road)
        inputs = [(gathered.channels[i], values[i]) for i in (self.names.index(name) for name, _ in self.weighted)]
        states = tuple(
            f(s, *u) for f, s, u in zip(self.weighted.values(), gathered.weighting_states, inputs, strict=True)
        )
        samples = self._samples(values, states, gathered.rest)
        instant = None if gathered.instant is None else gathered.instant + 1
        parts = zip(self.metrics, self.windows, gathered.statistics, samples, strict=True)
        statistics = tuple(_with_sample(*part, instant) for part in parts)
        return Accumulators(
            values if self.weighted else (), states, statistics, gathered.rest, self._saved(samples), instant
        )

    def saved(self, now: StepState, gathered: Accumulators) -> tuple[Scalar, ...]:
        """The samples of the metrics that need the whole record."""
        return gathered.samples

    def end(self, gathered: Accumulators, records: Sequence[Signal]) -> dict[str, Scalar]:
        """The metrics of the run.

        Arguments:
            gathered: at the last instant.
            records: what was saved of all instants.
        """
        values, saved = {}, iter(records)
        for m, (first, last), terms in zip(self.metrics, self.windows, gathered.statistics, strict=True):
            if m.statistic.needs_record:
                values[m.name] = m.statistic.of(next(saved)[first : last + 1], self.dt)
            else:
                values[m.name] = m.statistic.end(terms, last - first + 1, self.dt)
        return values

    def _values(self, now: StepState, road: RoadInput) -> tuple[Scalar, ...]:
        """The channels."""
        force, more = now.force, _of_control(now)
        if more:
            force = (*force, *more) if isinstance(force, tuple) else jnp.concatenate([force, jnp.stack(more)])
        values = self.outputs(now.motion, force, road.height, road.rate)
        return checkpoint_name(values if isinstance(values, tuple) else scalars(values), FOR_REVERSE)

    def _samples(
        self, values: Sequence[Scalar], weighting_states: Sequence[SmallVector], rest: Sequence[Scalar]
    ) -> list[Scalar]:
        """The sample of each metric's record."""
        plain = dict(zip(self.names, values, strict=True))
        pairs = zip(self.weighted.items(), weighting_states, strict=True)
        weighted = {pair: f.of(s) for (pair, f), s in pairs}
        moved = {name: plain[name] - level for name, level in zip(self.from_rest, rest, strict=True)}

        def sample(m: Metric) -> Scalar:
            if m.weighting is not None:
                return weighted[m.channel, m.weighting]
            return (moved if m.from_rest else plain)[m.channel]

        return [sample(m) * (plain[m.by] if m.by else 1.0) for m in self.metrics]

    def _saved(self, samples: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """The samples of metrics that need the whole record."""
        return tuple(y for m, y in zip(self.metrics, samples, strict=True) if m.statistic.needs_record)


def _with_sample(
    metric: Metric, window: tuple[int, int], before: Gathered, y: Scalar, instant: Scalar | None
) -> Gathered:
    """The terms of a metric with one sample more, if it lies in the window."""
    more = metric.statistic.add(before, y)
    if metric.window is None or instant is None:
        return more
    (first, last), start = window, metric.statistic.begin(y)
    inside = (jnp.where(instant <= last, new, old) for new, old in zip(more, before, strict=True))
    return tuple(jnp.where(instant <= first, new, old) for new, old in zip(start, inside, strict=True))

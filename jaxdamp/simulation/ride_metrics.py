"""Ride metrics and comfort of a response, or of a part of a run."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks, metrics
from jaxdamp._quickly import compiled_for_loops, compiled_quickly
from jaxdamp._tables import Compared, Table, comparison_table, percent_change
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp._vectors import scalars
from jaxdamp.metrics import Metric, MetricValues, Statistic
from jaxdamp.simulation.engine import FirstRows
from jaxdamp.simulation.equations import Equations, RoadInput, settled
from jaxdamp.vehicles import System


if TYPE_CHECKING:
    from jaxdamp.simulation.response import Response


class Comfort(NamedTuple):
    """An acceleration as ISO 2631-1 counts it: RMS and maximum in the unit of its channel, the dose times s^(1/4)."""

    weighted_rms: Scalar
    max_transient_value: Scalar
    vibration_dose_value: Scalar


def ride_metrics(response: "Response", names: Sequence[str | Metric] | None = None) -> dict[str, Scalar]:
    """The vehicle's ride metrics by name, or those wanted, over the run or the part of it that the response is.

    Weighted ones take heights by Wk and angles by We, exactly for accelerations straight from sample to sample; the
    ride starts from rest, so its mean counts. Differentiable but for peaks, which have the slope of one instant,
    and counts, which have none.

    Arguments:
        response: the run, or a part of it.
        names: names of ride metrics, or a `metrics.Metric` of any channel; all of the vehicle if left out.

    Raises:
        ValueError: a name that is no ride metric, or a window in a run whose times JAX traces.
    """
    chosen, dt = response.vehicle.chosen_metrics(names, "names"), response.dt

    def made() -> dict[str, Scalar]:
        signals = {metric.name: _signals(response, metric, dt) for metric in chosen}
        samples = {metric.name: (metric.statistic, _samples(response, metric, dt)) for metric in chosen}
        return _computed(signals, samples, dt)

    values = response.remembered(tuple(chosen), made)
    return MetricValues.with_units(values, {metric.name: metric.unit(response.units) for metric in chosen})


def comfort(response: "Response") -> dict[str, Comfort]:
    """Weighted RMS, largest second (MTVV) and VDV of every body, seat and place acceleration, by ISO 2631-1.

    Weighted as in `ride_metrics`. Differentiable but for the maximum. Less than a second has no MTVV, which is the RMS
    of one: NaN.

    Arguments:
        response: the run, or a part of it.
    """
    layout, dt = response.system.layout, response.dt
    names = dict.fromkeys(m.channel for m in layout.metrics if layout.by_name[m.channel].kind.weighting)

    def of(name: str) -> Comfort:
        signal = _weighted(response, name, layout.weighting(name), dt)
        return response.remembered((name, Comfort), lambda: _comfort(signal, dt))

    return {name: of(name) for name in names}


def _samples(response: "Response", metric: Metric, dt: float) -> tuple[int, int]:
    """Numbers of the first and the last instant that count."""
    time = _checks.concrete(response.time)
    if metric.window is None:
        return metric.samples(response.time.size, 1.0)
    if time is None:
        remedy = "Inside compiled code, take the metric from a `Ride`, or cut the channel."
        _checks.refuse(f"window of {metric.name!r}", "be asked of a run whose times are known", "traced", remedy)
    return metric.samples(time.size, dt, float(time[0]))


class _Signals(NamedTuple):
    """What a metric is of: the record, where it is at rest, and what it is multiplied by."""

    signal: Signal
    rest: Scalar | None
    by: Signal | None


def _signals(response: "Response", metric: Metric, dt: float) -> _Signals:
    channel, weighting = metric.channel, metric.weighting
    signal = response[channel] if weighting is None else _weighted(response, channel, weighting, dt)
    rest = _at_rest(response.run)[response.system.layout.numbers[channel]] if metric.from_rest else None
    return _Signals(signal, rest, response[metric.by] if metric.by else None)


@compiled_for_loops
def _computed(
    signals: dict[str, _Signals], chosen: dict[str, tuple[Statistic, tuple[int, int]]], dt: ScalarLike
) -> dict[str, Scalar]:
    """The values of statistics, each over its samples; one program for all vehicles and laws."""
    values = {}
    for name, (statistic, (first, last)) in chosen.items():
        signal, offset, by = signals[name]
        signal = signal if offset is None else signal - offset
        signal = signal if by is None else signal * by
        values[name] = statistic.of(signal[first : last + 1], dt)
    return values


@compiled_for_loops
def _comfort(weighted: Signal, dt: ScalarLike) -> Comfort:
    length, transient = (weighted.size + 0.01) * dt, jnp.asarray(jnp.nan, weighted.dtype)
    concrete = _checks.concrete(length)
    if concrete is None or concrete >= 1.0:  # a second is in it, as far as is known
        transient = jnp.where(length < 1.0, transient, metrics.max_transient_value(weighted, dt, None))
    return Comfort(metrics.rms(weighted), transient, metrics.vibration_dose_value(weighted, dt, None))


def _weighted(response: "Response", channel: str, weighting: str, dt: float) -> Signal:
    """An acceleration weighted by ISO 2631-1 from the start of the run."""

    def made() -> Signal:
        if response.begin is None:
            return metrics.weighted_signal(response[channel], dt, weighting, method="step", remove_mean=False)
        whole = _weighted(response.run, channel, weighting, dt)
        return _cut(whole, response.begin, response.time.size)

    return response.remembered((channel, weighting), made)


_cut = jax.jit(jax.lax.dynamic_slice_in_dim, static_argnums=2)  # in one program


def first_rows(run: "Response") -> FirstRows:
    """The heights and rates of the road and the commands with which a run began, or the one that it goes on with."""

    def first(rows: Float[Array, "time _"]) -> Float[ArrayLike, " _"]:
        concrete = _checks.concrete(rows)
        return rows[0] if concrete is None else concrete[0].copy()

    commands = None if run.commands is None else first(run.commands)
    return run.first or (first(run.road), first(run.road_rate), commands)


def _at_rest(run: "Response") -> tuple[Scalar, ...]:
    """The channels in the static equilibrium on the first heights of a run, as a `Ride` begins."""
    return run.remembered("at rest", lambda: _channels_at_rest(run.system, *first_rows(run)))


@compiled_quickly
def _channels_at_rest(
    system: System,
    road: Float[ArrayLike, " wheels"],
    road_rate: Float[ArrayLike, " wheels"],
    commands: Float[ArrayLike, " commands"] | None,
) -> tuple[Scalar, ...]:
    ground, equations = RoadInput(jnp.asarray(road), jnp.asarray(road_rate)), Equations(system)
    now = equations.at_rest(settled(system, ground.height), ground)
    force = now.force
    if commands is not None:
        given = jnp.asarray(commands)
        acting = equations.at_commands(scalars(given[: given.size // 2]))
        force = jnp.concatenate([acting.at(now.motion, now.states, ground).force, given])
    return tuple(system.outputs(now.motion, force, *ground))


@of_known_numbers
def metrics_table(responses: "Mapping[str, Response]") -> Table:
    """The ride metrics of responses by name, of one kind of vehicle, and the change from the first to the last.

    A metric that may be negative, such as a mean, has no change in percent.

    Arguments:
        responses: by name, of one kind of vehicle.
    """
    first = next(iter(responses.values()))
    values = [response.metrics() for response in responses.values()]
    signed = {m.name for m in first.vehicle.ride_metrics if m.statistic.signed}
    rows = []
    for name, unit in first.metric_units().items():
        numbers = [float(of[name]) for of in values]
        change = None if name in signed else percent_change(numbers[0], numbers[-1])
        rows.append(Compared(name, unit, numbers, change))
    return comparison_table("Ride metrics", "metric", tuple(responses), rows)


@of_known_numbers
def comfort_table(responses: "Mapping[str, Response]") -> Table:
    """Comfort by ISO 2631-1 of every acceleration, of responses by name, and the change from the first to the last.

    Arguments:
        responses: by name, of one kind of vehicle.
    """
    first = next(iter(responses.values()))
    comforts = [response.comfort() for response in responses.values()]
    rows = []
    for channel in comforts[0]:
        for name, unit in comfort_units(first.units[channel]).items():
            numbers = [float(getattr(of[channel], name)) for of in comforts]
            words = f"{channel} {name.replace('_', ' ')}"
            rows.append(Compared(words, unit, numbers, percent_change(numbers[0], numbers[-1])))
    return comparison_table("Comfort by ISO 2631-1 (Wk, angles We)", "what", tuple(responses), rows)


def comfort_units(unit: str) -> dict[str, str]:
    """Units of the numbers of comfort, from that of the acceleration."""
    dose = f"{unit.removesuffix('s^2')}s^1.75"
    return {"weighted_rms": unit, "max_transient_value": unit, "vibration_dose_value": dose}

"""What a vehicle did on a road: motion, forces, channels with units, energy, ride metrics."""

import dataclasses
import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks, metrics
from jaxdamp._tables import Table, with_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.dampers import RangeUse
from jaxdamp.metrics import Metric, MetricValues
from jaxdamp.simulation.equations import settled
from jaxdamp.simulation.notes import tyres_in_tension
from jaxdamp.simulation.range_notes import range_sentences, range_uses
from jaxdamp.simulation.tables import comfort_table, comfort_units, metrics_table
from jaxdamp.simulation.wheels import AxleTiming
from jaxdamp.vehicles import AbstractVehicle, LinearMap, System


if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


class Comfort(NamedTuple):
    """An acceleration as ISO 2631-1 counts it: RMS and maximum in the unit of its channel, the dose times s^(1/4)."""

    weighted_rms: Scalar
    max_transient_value: Scalar
    vibration_dose_value: Scalar


def _middle(values: Array) -> Array:
    """Mean over each step."""
    return 0.5 * (values[1:] + values[:-1])


_COMPUTED: dict[int, dict[str, Signal]] = {}  # channels of living responses: a module has no place but its fields


@jax.jit
def _channel(
    outputs: LinearMap,
    number: Array,
    motion: Float[Array, "time n"],
    port_force: Float[Array, "time ports"],
    road: Float[Array, "time wheels"],
    road_rate: Float[Array, "time wheels"],
) -> Signal:
    """One channel over time."""
    row = jax.tree.map(lambda matrix: matrix[number][None], outputs)
    return jax.vmap(row)(motion, port_force, road, road_rate)[:, 0]


@final
class Response(eqx.Module):
    """The response of a vehicle to a road, at uniformly spaced instants.

    The road's rate is the mean of its slopes before and after an instant. `axle_timing`, printed with the response,
    says when each axle met the road.

    `response["sprung_acceleration"]` is a channel; `response.units` lists them, `response.descriptions` says what each
    one is, and `response.notes` what to know beside the numbers. `response.between(1.0, 3.0)` is a part of the run.

    Attributes:
        vehicle: the vehicle.
        system: the assembled vehicle.
        time: uniform instants [s], shape (time,).
        motion: q and q̇ in SI units, shape (time, n).
        port_force: force of each element [N], positive when it resists extension, shape (time, ports).
        road, road_rate: heights under the wheels [m, up] and their rates [m/s], shape (time, wheels).
        final_state: states of each element at the end.
        axle_timing: when each axle met the road.
        whole: the response that this one is a part of, and the number of its first instant there.
        begin: start of the statistics of this part.
    """

    vehicle: AbstractVehicle
    system: System
    time: Signal
    motion: Float[Array, "time n"]
    port_force: Float[Array, "time ports"]
    road: Float[Array, "time wheels"]
    road_rate: Float[Array, "time wheels"]
    final_state: list[Float[Array, " _state"]]
    axle_timing: AxleTiming
    whole: Any = None  # the response that this one is a part of, and the number of its first instant there
    begin: Any = None

    def __repr__(self) -> str:
        name, time = type(self.vehicle).__name__, _checks.concrete(self.time)
        several = "" if self.axle_timing.kind == "one axle" else f"; {self.axle_timing}"
        length = ""
        if time is not None and time.ndim == 1:
            begins = "over" if self.whole is None else f"from {time[0]:g} to"
            length = f" {begins} {time[-1]:g} s, {time.size} instants"
        return f"Response of a {name}{length}, {len(self.units)} channels{several}"

    @property
    def notes(self) -> tuple[str, ...]:
        """Tyres that pulled on the road, dampers that left the fitted range of their laws; empty while JAX traces."""
        if _checks.concrete(self.motion) is None:
            return ()
        tyres = tyres_in_tension(self.system, np.asarray(self.time), self.__getitem__)
        return (*tyres, *range_sentences(self.range_use()))

    @property
    def descriptions(self) -> dict[str, str]:
        """What each channel is, its positive direction, and of how many dampers or wheels it is."""
        return self.vehicle.descriptions

    @property
    def dampers(self) -> tuple[str, ...]:
        """Names of the dampers, such as "damper" or "front_damper"."""
        return tuple(name for name in self.vehicle.frame().element_names if f"{name}_velocity" in self.units)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel."""
        return dict(self.system.layout.units)

    @property
    def channels(self) -> dict[str, Signal]:
        """All channels by name; each is computed once."""
        return {name: self[name] for name in self.system.layout.units}

    def __getitem__(self, channel: str) -> Signal:
        numbers, computed = self.system.layout.numbers, _COMPUTED.get(id(self), {})
        _checks.one_of("channel", channel, numbers)
        if channel in computed:
            return computed[channel]
        number = jnp.asarray(numbers[channel])
        values = _channel(self.system.outputs, number, self.motion, self.port_force, self.road, self.road_rate)
        if _checks.concrete(values) is not None:  # a traced one belongs to one program
            if id(self) not in _COMPUTED:
                weakref.finalize(self, _COMPUTED.pop, id(self))
            _COMPUTED.setdefault(id(self), {})[channel] = values
        return values

    def metrics(self, names: Sequence[str | Metric] | None = None) -> dict[str, Scalar]:
        """The vehicle's ride metrics by name, or those wanted, over the run or the part of it that this is.

        Wanted are names of ride metrics, or a `metrics.Metric` of any channel.

        Weighted ones take heights by Wk and angles by We, exactly for accelerations straight from sample to sample; the
        ride starts from rest, so its mean counts. Differentiable but for peaks, which have the slope of one instant,
        and counts, which have none.
        """
        chosen, dt = self.vehicle.chosen_metrics(names, "names"), self._dt()
        values = self._metrics([(m, self._samples_of(m, dt)) for m in chosen], dt)
        return MetricValues.with_units(values, {m.name: m.unit(self.units) for m in chosen})

    def _samples_of(self, metric: Metric, dt: ScalarLike) -> tuple[int, int]:
        """Numbers of the first and the last instant that count."""
        time = _checks.concrete(self.time)
        if metric.window is None:
            return metric.samples(self.time.size, 1.0)
        if time is None:
            remedy = "Inside compiled code, take the metric from a `Ride`, or cut the channel."
            _checks.refuse(f"window of {metric.name!r}", "be asked of a run whose times are known", "traced", remedy)
        return metric.samples(time.size, float(dt), float(time[0]))

    @eqx.filter_jit
    def _metrics(self, chosen: Sequence[tuple[Metric, tuple[int, int]]], dt: ScalarLike) -> dict[str, Scalar]:
        found = {}
        pairs = {(m.channel, m.weighting) for m, _ in chosen if m.weighting is not None}
        weighted = {(channel, own): self._weighted(channel, own, dt) for channel, own in sorted(pairs)}
        rest = self._at_rest() if any(m.from_rest for m, _ in chosen) else jnp.zeros(0)
        for m, (first, last) in chosen:
            record = self[m.channel] if m.weighting is None else weighted[m.channel, m.weighting]
            record = record - rest[self.system.layout.numbers[m.channel]] if m.from_rest else record
            record = record * self[m.by] if m.by else record
            found[m.name] = m.statistic.of(record[first : last + 1], dt)
        return found

    def metric_units(self) -> dict[str, str]:
        """Unit of each ride metric."""
        return {m.name: m.unit(self.units) for m in self.system.layout.metrics}

    def _dt(self) -> ScalarLike:
        """Spacing of the instants, as a plain number where it is known: then filters are made by NumPy."""
        time = (self if self.whole is None else self.whole).time
        known = _checks.concrete(time)
        return time[1] - time[0] if known is None else float(known[1] - known[0])

    def _weighted(self, name: str, weighting: str, dt: ScalarLike) -> Signal:
        """An acceleration weighted by ISO 2631-1 from the start of the run."""
        run = self if self.whole is None else self.whole
        weighted = metrics.weighted_signal(run[name], dt, weighting, method="step", remove_mean=False)
        return weighted if self.whole is None else jax.lax.dynamic_slice_in_dim(weighted, self.begin, self.time.size)

    def _at_rest(self) -> Float[Array, " channels"]:
        """The channels in the static equilibrium on the first heights of the run, forces left out."""
        road = (self if self.whole is None else self.whole).road[0]
        return self.system.outputs(settled(self.system, road), jnp.zeros(len(self.system.laws)), road, None)

    def between(self, start: float, stop: float) -> "Response":
        """The part of the run from `start` to `stop` [s], both instants included, with the times of the run.

        Its channels, metrics, comfort, energy balance and pictures are of that part. Weightings still run from the
        start of the run, and displacements still count from the static equilibrium on its first heights. The states of
        the laws at the end of a part are known only where it ends with the run; else `final_state` is NaN.

        >>> from jaxdamp import roads, simulate, vehicles
        >>> bump = roads.cosine_bump(0.05, start=0.5, duration=0.25)
        >>> response = simulate(vehicles.presets.quarter_car_000(), bump, duration=2.0)
        >>> float(response.between(0.0, 0.4).metrics()["peak_sprung_acceleration"]) < 1e-9
        True

        Raises:
            ValueError: a part outside the run, or of fewer than two instants; a run that JAX traces.
        """
        time = _checks.concrete(self.time)
        if time is None:
            remedy = "Inside compiled code, cut the channels by the numbers of their instants."
            _checks.refuse("between", "be asked of a run whose times are known", "traced", remedy)
        slack = 0.01 * float(time[1] - time[0])
        inside = np.flatnonzero((time >= start - slack) & (time <= stop + slack))
        if start < time[0] - slack or stop > time[-1] + slack or inside.size < 2:
            must = f"be two instants or more of the run, {time[0]:g} to {time[-1]:g} s"
            _checks.refuse("start, stop", must, f"{start:g} and {stop:g}")
        part, last = slice(inside[0], inside[-1] + 1), inside[-1] + 1 == time.size
        states = [state if last else jnp.full_like(state, jnp.nan) for state in self.final_state]
        arrays = {name: getattr(self, name)[part] for name in ("time", "motion", "port_force", "road", "road_rate")}
        whole = self if self.whole is None else self.whole
        begin = jnp.asarray(inside[0] + (0 if self.whole is None else self.begin))
        return dataclasses.replace(self, **arrays, final_state=states, whole=whole, begin=begin)

    def comfort(self) -> dict[str, Comfort]:
        """Weighted RMS, largest second (MTVV) and VDV of every body, seat and place acceleration, by ISO 2631-1.

        Weighted as in `metrics`. Differentiable but for the maximum.
        """
        return self._comfort(self._dt())

    @eqx.filter_jit
    def _comfort(self, dt: ScalarLike) -> dict[str, Comfort]:
        found = {}
        layout = self.system.layout
        for name in dict.fromkeys(m.channel for m in layout.metrics if layout.by_name[m.channel].kind.weighting):
            weighted = self._weighted(name, layout.weighting(name), dt)
            transient = metrics.max_transient_value(weighted, dt, None)
            dose = metrics.vibration_dose_value(weighted, dt, None)
            found[name] = Comfort(metrics.rms(weighted), transient, dose)
        return found

    @eqx.filter_jit
    def energy_balance(self) -> dict[str, Scalar]:
        """Where the energy that the road put in has gone [J].

        `road_work` = `stored` (in masses and linear springs, at the end less at the start) + `absorbed` (by the laws;
        springs among them give it back later, dampers do not: `absorbed_by` takes them apart) + `dashpots` (linear
        ones, as in the tyre), up to `error`, which falls with the square of the step. All integrals by the trapezoid
        rule. Heights count from static equilibrium, so that weight and static loads do no work.
        """
        form, n = self.system.form, len(self.system.layout.coordinates)
        q, rate, dt = self.motion[:, :n], self.motion[:, n:], jnp.diff(self.time)
        slope = jnp.diff(self.road, axis=0) / dt[:, None]

        def stored(i: int) -> Scalar:
            spring = 0.5 * form.stiffness @ q[i] - form.road_stiffness @ self.road[i]
            ground = 0.5 * self.road[i] @ form.ground_stiffness @ self.road[i]
            return 0.5 * rate[i] @ form.mass @ rate[i] + q[i] @ spring + ground

        push = self.road @ form.ground_stiffness - q @ form.road_stiffness
        if form.port_road is not None:
            push = push - self.port_force @ form.port_road
        towed = _middle(rate) @ form.road_damping
        rolled = slope @ form.ground_damping
        road_work = jnp.sum((_middle(push) + rolled - towed) * slope * dt[:, None])
        dashpots = _middle(jnp.sum((rate @ form.damping) * rate, axis=1))
        dashed = jnp.sum((dashpots + jnp.sum((rolled - 2.0 * towed) * slope, axis=1)) * dt)
        absorbed = sum(self.absorbed_by().values(), jnp.zeros(()))
        change = stored(-1) - stored(0)
        parts = {"road_work": road_work, "stored": change, "absorbed": absorbed, "dashpots": dashed}
        return parts | {"error": road_work - change - absorbed - dashed}

    @eqx.filter_jit
    def absorbed_by(self) -> dict[str, Scalar]:
        """Energy that each element has taken in [J], ∫ F ė dt, by its name.

        Where an element is several dampers that act together, it is that of all; force and power channels are of one.
        """
        form, n = self.system.form, len(self.system.layout.coordinates)
        dt = jnp.diff(self.time)
        moved = _middle(self.port_force * (self.motion[:, n:] @ form.ports.T))
        if form.port_road is not None:
            slope = jnp.diff(self.road, axis=0) / dt[:, None]
            moved = moved - _middle(self.port_force) * (slope @ form.port_road.T)
        taken = jnp.sum(moved * dt[:, None], axis=0)
        return dict(zip(self.system.layout.ports, taken, strict=True))

    def range_use(self) -> dict[str, list[RangeUse]]:
        """What each damper did beside the range that its law was fitted to; only of laws that have one."""
        return range_uses(self.vehicle, self.system.form, self.motion, self.road, self.road_rate, self.port_force)

    def table(self) -> Table:
        """The ride metrics with units. `simulation.metrics_table({"before": ..., "after": ...})` compares several."""
        return metrics_table({"value": self})

    def comfort_table(self) -> Table:
        """Comfort by ISO 2631-1 of every acceleration, with units."""
        return comfort_table({"value": self})

    @of_known_numbers
    def to_dict(self) -> dict[str, Any]:
        """Metrics, comfort, energies and notes of the run, ready for JSON; numbers that are not finite are None."""
        values, comfort = self.metrics(), self.comfort()
        return {
            "vehicle": type(self.vehicle).__name__,
            "start": with_unit(self.time[0], "s"),
            "end": with_unit(self.time[-1], "s"),
            "axles": str(self.axle_timing),
            "metrics": {name: with_unit(values[name], unit) for name, unit in self.metric_units().items()},
            "comfort": {
                channel: {
                    name: with_unit(getattr(numbers, name), unit)
                    for name, unit in comfort_units(self.units[channel]).items()
                }
                for channel, numbers in comfort.items()
            },
            "energy_balance": {name: with_unit(value, "J") for name, value in self.energy_balance().items()},
            "notes": list(self.notes),
        }

    def plot(self, **options: Any) -> "Figure":
        """Channels over time and the spectrum of the first (`plots.ride`)."""
        from jaxdamp.plots import ride

        return ride(self, **options)

    def to_xarray(self) -> "xarray.Dataset":
        """All channels as an `xarray.Dataset` over time, with units."""
        import xarray

        channels = {
            name: ("time", np.asarray(values), {"units": self.units[name], "description": self.descriptions[name]})
            for name, values in self.channels.items()
        }
        times = {"time": ("time", np.asarray(self.time), {"units": "s"})}
        return xarray.Dataset(channels, times, {"axles": str(self.axle_timing)})

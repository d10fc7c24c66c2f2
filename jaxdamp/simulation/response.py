"""What a vehicle did on a road: motion, forces, channels with units."""

import dataclasses
import os
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxdamp import _checks
from jaxdamp._guesses import Elsewhere
from jaxdamp._results import AbstractResult, plotted
from jaxdamp._tables import Contents, Table, with_unit
from jaxdamp._traced import is_traced
from jaxdamp._types import Dataset, Figure, Scalar, Signal
from jaxdamp.dampers import RangeUse
from jaxdamp.metrics import Metric
from jaxdamp.simulation.energy import absorbed_by, energy_balance
from jaxdamp.simulation.engine import FirstRows
from jaxdamp.simulation.notes import (
    Delivery,
    beyond_strokes,
    commands_at_limits,
    deliveries,
    jumps_counted_late,
    range_sentences,
    range_uses,
    tyres_in_tension,
    without_motion,
)
from jaxdamp.simulation.ride_metrics import Comfort, comfort, comfort_table, comfort_units, metrics_table, ride_metrics
from jaxdamp.simulation.wheels import AxleTiming
from jaxdamp.vehicles import AbstractVehicle, LinearMap, System


T = TypeVar("T")


@jax.tree_util.register_pytree_node_class
class _Remembered(dict[Hashable, PyTree]):
    """What was computed of one response. It holds no leaf: another response begins without any."""

    def tree_flatten(self) -> tuple[tuple[()], None]:
        return (), None

    @classmethod
    def tree_unflatten(cls, aux: None, leaves: Sequence[object]) -> "_Remembered":
        return cls()


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


@jax.jit(static_argnames="part")
def _rows(arrays: dict[str, Array], part: tuple[int, int]) -> dict[str, Array]:
    """The rows from one to another of each array."""
    return {name: array[slice(*part)] for name, array in arrays.items()}


@final
class Response(eqx.Module, AbstractResult):
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
        dt: spacing of the instants [s].
        every: of how many instants of the run one is saved.
        commands: of the dampers, then the demanded forces [N], shape (time, commands); None without a controller.
        first: heights and rates of the road and commands where the run began that this one goes on with; else None.
        whole: the run that this response is a part of; None for a run.
        begin: number of the first instant of this part in the run.
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
    dt: float = eqx.field(static=True, repr=False)
    every: int = eqx.field(static=True, repr=False)
    commands: Float[Array, "time commands"] | None
    first: FirstRows | None
    whole: "Response | None" = None
    begin: Int[Array, ""] | None = None
    histogram = Elsewhere("`jaxdamp.metrics.velocity_histogram(response['damper_velocity'], edges)`")
    _computed: _Remembered = eqx.field(init=False, repr=False, default_factory=_Remembered)

    @property
    def run(self) -> "Response":
        """The run that this response is a part of, or itself."""
        return self if self.whole is None else self.whole

    def __repr__(self) -> str:
        name, time = type(self.vehicle).__name__, _checks.concrete(self.time)
        several = "" if self.axle_timing.kind == "one axle" else f"; {self.axle_timing}"
        length = ""
        if time is not None and time.ndim == 1:
            begins = "over" if self.whole is None else f"from {time[0]:g} to"
            length = f" {begins} {time[-1]:g} s, {time.size} instants"
        return f"Response of a {name}{length}, {len(self.units)} channels{several}"

    @property
    def summary(self) -> str:
        """Vehicle, length and number of channels."""
        return repr(self)

    @property
    def notes(self) -> tuple[str, ...]:
        """Tyres that pulled, dampers beyond the range or strokes of their laws, commands at limits or jumps, no motion.

        Empty while JAX traces.
        """
        if _checks.concrete(self.motion) is None:
            return ()
        tyres = tyres_in_tension(self.system, np.asarray(self.time), self.__getitem__)
        limits = ()
        if self.commands is not None:
            run = self.system, self.dt, self.every, np.asarray(self.commands)
            limits = (*commands_at_limits(*run), *jumps_counted_late(*run, self.__getitem__))
        moved = np.asarray(self.motion), np.asarray(self.road)
        beyond = beyond_strokes(self.system, *moved)
        return (*without_motion(*moved), *tyres, *beyond, *range_sentences(self.range_use()), *limits)

    warnings = notes

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
        numbers = self.system.layout.numbers
        _checks.one_of("channel", channel, numbers)

        def made() -> Signal:
            force = self.port_force
            if self.commands is not None:
                force = jnp.concatenate([force, self.commands], axis=-1)
            number = np.asarray(numbers[channel])
            return _channel(self.system.outputs, number, self.motion, force, self.road, self.road_rate)

        return self.remembered(channel, made)

    def remembered(self, key: Hashable, make: Callable[[], T]) -> T:
        """What `make` computes of this response, once for each key; not kept while JAX traces: it is of one program."""
        if key in self._computed:
            return self._computed[key]
        made = make()
        return made if is_traced(made) else self._computed.setdefault(key, made)

    def metrics(self, names: Sequence[str | Metric] | None = None) -> dict[str, Scalar]:
        """The vehicle's ride metrics by name, or those wanted, over the run or the part of it that this is.

        Wanted are names of ride metrics, or a `metrics.Metric` of any channel; see `simulation.ride_metrics`.
        """
        return ride_metrics(self, names)

    def metric_units(self) -> dict[str, str]:
        """Unit of each ride metric."""
        return {m.name: m.unit(self.units) for m in self.system.layout.metrics}

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
        slack = 0.01 * self.dt + float(np.finfo(time.dtype).eps * time[-1])  # to which instants are rounded
        inside = np.flatnonzero((time >= start - slack) & (time <= stop + slack))
        if start < time[0] - slack or stop > time[-1] + slack or inside.size < 2:
            must = f"be two instants or more of the run, {time[0]:g} to {time[-1]:g} s"
            _checks.refuse("start, stop", must, f"{start:g} and {stop:g}")
        part, last = (int(inside[0]), int(inside[-1]) + 1), inside[-1] + 1 == time.size
        if part == (0, time.size):
            return self
        states = [state if last else jnp.full_like(state, jnp.nan) for state in self.final_state]
        names = ("time", "motion", "port_force", "road", "road_rate", "commands")
        arrays = _rows({name: values for name in names if (values := getattr(self, name)) is not None}, part)
        begin = jnp.asarray(inside[0] + (0 if self.begin is None else self.begin))
        return dataclasses.replace(self, **arrays, final_state=states, whole=self.run, begin=begin)

    def comfort(self) -> dict[str, Comfort]:
        """Weighted RMS, MTVV and VDV of every body, seat and place acceleration: `simulation.comfort`."""
        return comfort(self)

    def energy_balance(self) -> dict[str, Scalar]:
        """Where the energy that the road put in has gone [J]: `simulation.energy_balance`."""
        return energy_balance(self)

    def absorbed_by(self) -> dict[str, Scalar]:
        """Energy that each element has taken in [J], by its name: `simulation.absorbed_by`."""
        return absorbed_by(self)

    def delivered(self) -> dict[str, Delivery]:
        """What each damper under a controller gave of the force demanded of it; empty without a controller.

        `share` of the demanded force, and the share of the time in which the demand was `resisting` the motion at all.
        A demand is that of the last sample, and its command comes later by delay and lag.
        """
        return deliveries(self.__getitem__, [name for name in self.dampers if f"{name}_demand" in self.units])

    def range_use(self) -> dict[str, list[RangeUse]]:
        """What each damper did beside the range that its law was fitted to; only of laws that have one."""
        return range_uses(self.vehicle, self.system.form, self.motion, self.road, self.road_rate, self.port_force)

    def table(self) -> Table:
        """The ride metrics with units. `simulation.metrics_table({"before": ..., "after": ...})` compares several."""
        return metrics_table({"value": self})

    def comfort_table(self) -> Table:
        """Comfort by ISO 2631-1 of every acceleration, with units."""
        return comfort_table({"value": self})

    def content(self) -> Contents:
        """Metrics, comfort, energies and notes of the run, ready for JSON; numbers that are not finite are None."""
        values, comfort = self.metrics(), self.comfort()
        return {
            "notes": list(self.notes),
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
        }

    def plot(self, kind: str = "ride", **options: object) -> Figure:
        """Channels over time and the spectrum of the first, or the sheet of the ride.

        Arguments:
            kind: "ride" (`plots.ride`), or "sheet" for one A4 page (`plots.ride_sheet`).
            options: of that function.
        """
        from jaxdamp.plots import ride, ride_sheet

        return plotted(kind, {"ride": ride, "sheet": ride_sheet}, self, **options)

    def animate(self, path: str | os.PathLike[str], *, before: "Response | None" = None, title: str = "") -> Path:
        """Write a page in which the vehicle moves over its road, with the forces at its dampers (`plots.animation`).

        Arguments:
            path: the file to write, NAME.html.
            before: another response at the same instants, shown beside this one.
            title: of the page; made from the vehicle if left out.
        """
        from jaxdamp.plots import animation

        return animation(self if before is None else {"before": before, "after": self}, path, title=title)

    def to_xarray(self) -> Dataset:
        """All channels as an `xarray.Dataset` over time, with units."""
        import xarray

        channels = {
            name: ("time", np.asarray(values), {"units": self.units[name], "description": self.descriptions[name]})
            for name, values in self.channels.items()
        }
        times = {"time": ("time", np.asarray(self.time), {"units": "s"})}
        return xarray.Dataset(channels, times, {"axles": str(self.axle_timing)})

"""The evaluation of records: every measurement, as tables, plain data and pictures."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError
from jaxdamp._results import AbstractResult
from jaxdamp._tables import Cell, Column, Compared, Table, comparison_table, percent_change, plain
from jaxdamp.bench.analysis import FoldedCycles, as_records, fold_cycles
from jaxdamp.bench.contradictions import same_motion
from jaxdamp.bench.evaluation import curve
from jaxdamp.bench.evaluation.limits import Limit, LimitCheck
from jaxdamp.bench.evaluation.measurements import Measurement, at_velocity, measured, record_measurements
from jaxdamp.bench.evaluation.separation import GasAndFriction, separate_gas_and_friction
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.settings import by_number, settings_apart


if TYPE_CHECKING:
    import matplotlib.figure


WINDOW = 0.05  # share of a stated velocity within which samples, or records, count as taken at it
_PEAKS = ("rebound velocity", "rebound force", "compression velocity", "compression force", "rebound/compression ratio")
_MIDDLE = ("mid-stroke rebound force", "mid-stroke compression force")
_LOOPS = ("mean force", "static force", "energy per cycle", "equivalent damping", "hysteresis area", "hysteresis width")
TABLES = {"peak_forces": (*_PEAKS, *_MIDDLE), "loops": _LOOPS}


@final
@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(AbstractResult):
    """What records say of a damper at one setting or several.

    Attributes:
        measurements: all of them; `get` finds one.
        settings: the records of each setting, in the order of the table.
        cycles: the steady cycles of each record, by its name.
        gas_and_friction: of the slowest record of each setting.
        velocities: at which forces are stated [m/s].
        method: how these were found.
        notes: what could not be evaluated, and why.
    """

    measurements: tuple[Measurement, ...]
    settings: Mapping[str, tuple[BenchRun, ...]]
    cycles: Mapping[str, FoldedCycles]
    gas_and_friction: Mapping[str, GasAndFriction]
    velocities: tuple[float, ...]
    method: str
    notes: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """`notes`: what could not be evaluated, and why."""
        return self.notes

    @property
    def summary(self) -> str:
        """Numbers of records and of settings."""
        return f"{len(self.runs)} records at {len(self.settings)} settings, forces by {self.method}."

    @property
    def runs(self) -> tuple[BenchRun, ...]:
        """The records evaluated."""
        return tuple(run for runs in self.settings.values() for run in runs)

    def get(
        self, quantity: str, *, setting: str | None = None, record: str | None = None, velocity: float | None = None
    ) -> Measurement:
        """One measurement by its quantity and, where there are several, its setting, record or velocity [m/s].

        Without `record` and `velocity` it is that of the setting, or of the only record.

        Raises:
            ValueError: none fits, or several do.
        """
        fitting = [
            m
            for m in self.measurements
            if m.quantity == quantity
            and setting in (None, m.setting)
            and record in (None, m.record)
            and at_velocity(m, velocity)
        ]
        if not fitting:
            _checks.one_of("quantity", quantity, dict.fromkeys(m.quantity for m in self.measurements))
        if len(fitting) != 1:
            asked = f"{quantity!r}, setting {setting!r}, record {record!r}, velocity {velocity!r}"
            _checks.refuse("quantity", "name one measurement", f"{asked}, of which there are {len(fitting)}")
        return fitting[0]

    def table(self) -> Table:
        """Forces at the stated velocities, and their ratio, a column for each setting."""
        rows = [(q, v) for q in ("rebound force", "compression force", "rebound/compression ratio")
                for v in self.velocities]  # fmt: skip
        chosen = [(f"{quantity} at {v:.4g} m/s", quantity, v) for quantity, v in rows]
        return self._by_setting(f"Forces at stated velocities ({self.method})", chosen)

    def settings_table(self) -> Table:
        """Gas force, friction, rates and knees, a column for each setting."""
        of_records = {quantity for quantities in TABLES.values() for quantity in quantities}
        others = dict.fromkeys(m.quantity for m in self.measurements if m.quantity not in of_records)
        return self._by_setting("Gas force, friction and rates", [(name, name, None) for name in others])

    def _by_setting(self, title: str, rows: Sequence[tuple[str, str, float | None]]) -> Table:
        """Quantities (name, quantity, velocity) with a column for each setting and the change over them."""
        chosen = [m for m in self.measurements if m.velocity is not None or m.record]
        cells = {(m.quantity, m.velocity, m.setting): m.cell for m in chosen}
        units = {m.quantity: m.unit for m in self.measurements}
        compared = []
        for name, quantity, velocity in rows:
            values = [cells.get((quantity, velocity, setting)) for setting in self.settings]
            numbers = [value for value in values if isinstance(value, float)]
            change = percent_change(numbers[0], numbers[-1]) if len(numbers) == len(values) else None
            if numbers:
                compared.append(Compared(name, units[quantity], values, change))
        return comparison_table(title, "quantity", [name or "value" for name in self.settings], compared)

    def tables(self) -> dict[str, Table]:
        """All tables by name: velocities, settings, peak forces and loops of records, repeats, and all in one list."""
        tables = {"velocities": self.table(), "settings": self.settings_table()}
        titles = {"peak_forces": "Forces of each record", "loops": "Loops of each record"}
        tables |= {name: self._records_table(titles[name], quantities) for name, quantities in TABLES.items()}
        repeats = self._repeats_table()
        return tables | ({"repeats": repeats} if repeats.rows else {}) | {"measurements": self._list()}

    def _records_table(self, title: str, quantities: Sequence[str]) -> Table:
        """A row for each record, a column for each quantity, with the scatter over cycles."""
        several = len(self.settings) > 1
        measurements = {(m.record, m.quantity): m for m in self.measurements if m.record and m.velocity is None}
        units = {m.quantity: m.unit for m in self.measurements}
        columns = [Column("record"), *([Column("setting")] if several else []), Column("cycles", spec="d")]
        columns += [Column(quantity, units[quantity]) for quantity in quantities]
        rows = []
        for setting, runs in self.settings.items():
            for run in runs:
                start: tuple[Cell, ...] = (run.name, setting) if several else (run.name,)
                cells = tuple(measurements[run.name, quantity].cell for quantity in quantities)
                rows.append((*start, len(self.cycles[run.name].periods), *cells))
        return Table(f"{title}, mean ± scatter over cycles", tuple(columns), tuple(rows))

    def _repeats_table(self) -> Table:
        """Quantities of records that repeat a motion at one setting, with the scatter over these records."""
        columns = (Column("records"), Column("quantity"), Column("unit"), Column("mean"), Column("scatter"))
        rows = []
        for runs in self.settings.values():
            for group in _repeats(runs):
                if len(group) > 1:
                    names = ", ".join(run.name for run in group)
                    for quantity in (*_PEAKS, *_LOOPS):
                        each = [self.get(quantity, record=run.name) for run in group]
                        value, scatter, _ = measured(np.array([m.value for m in each]))
                        rows.append((names, quantity, each[0].unit, value, scatter))
        return Table("Repeated records, scatter over the records", columns, tuple(rows))

    def _list(self) -> Table:
        """One row for each measurement, for files."""
        columns = (Column("setting"), Column("record"), Column("quantity"), Column("velocity", "m/s"))
        columns += (Column("unit"), Column("value"), Column("scatter", spec=".2g"), Column("count", spec="d"))
        columns += (Column("uncertainty", spec=".2g"),)
        rows = ((m.setting, m.record, m.quantity, m.velocity, m.unit, m.value, m.scatter, m.count, m.uncertainty)
                for m in self.measurements)  # fmt: skip
        return Table("All measurements", columns, tuple(rows))

    def check(self, limits: Iterable[Limit]) -> LimitCheck:
        """Which measurements lie within limits; see `bench.read_limits`."""
        return LimitCheck.of(self.measurements, limits)

    def content(self) -> dict[str, Any]:
        """All measurements as plain data."""
        return {"method": self.method, "notes": list(self.notes), "measurements": plain(self._list().records())}

    def plot(
        self, baseline: "Evaluation | None" = None, limits: LimitCheck | None = None
    ) -> "matplotlib.figure.Figure":
        """Mean loops over velocity, stroke, acceleration and time, and forces over velocity, over a baseline."""
        from jaxdamp import plots

        return plots.evaluation(self, baseline, limits)

    def __repr__(self) -> str:
        return "\n\n".join([*(str(t) for name, t in self.tables().items() if name != "measurements"), *self.notes])


def evaluate(
    runs: BenchRun | Iterable[BenchRun],
    *,
    velocities: Sequence[float] | None = None,
    method: str | None = None,
    window: float = WINDOW,
    by: Callable[[BenchRun], Any] | None = None,
) -> Evaluation:
    """Evaluate records as dampers are bought and sold, every figure with its scatter over cycles or repeats.

    Arguments:
        runs: one record or several.
        velocities: at which forces are stated [m/s]; those of `OEM_VELOCITIES` that the records reach, if left out.
        method: "interpolation" between the peak forces of records; "window": of the records whose peak velocity is
            within `window` of the stated one; "loop": on the continuous loop of the fastest record. Interpolation
            where every setting has two records or more of different peak velocity, the loop elsewhere, if left out.
        window: share of the stated velocity.
        by: gives the setting of a record; its command, if left out. Where records without a command contradict one
            another again and again, they are told apart by what they state or by their names, or not pooled at all,
            and the notes say so.

    Raises:
        ValueError: no record, none with a full cycle, a velocity that is not positive.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear
    >>> dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=2.0)
    >>> evaluation = bench.evaluate(dyno.run([bench.SineTest(0.02, f) for f in (0.5, 1.0, 3.0)]))
    >>> ratio = evaluation.get("rebound/compression ratio", velocity=0.131)
    >>> print(f"{ratio.value:.2f}")
    2.17
    """
    _check_options(velocities, method, window)
    chosen = as_records(runs, "evaluate(runs)")
    cyclic = [run for run in chosen if run.cycles]
    if not cyclic:
        _checks.refuse("runs", "hold a record with a full cycle", ", ".join(run.name for run in chosen))
    settings, notes = _by_settings(cyclic, by)
    notes += _notes(chosen)
    cycles = {run.name: fold_cycles(run) for run in cyclic}
    method = _usual_method(settings) if method is None else method
    measurements: list[Measurement] = []
    gas: dict[str, GasAndFriction] = {}
    for name, group in settings.items():
        slowest = min(group, key=lambda run: run.peak_velocity)
        measurements += _of_setting(name, group, cycles, velocities, method, window)
        try:
            gas[name] = separate_gas_and_friction(slowest)
        except ArgumentError as error:
            notes.append(f"Gas force and friction were not separated. {error}")
        else:
            measurements += [replace(m, setting=name) for m in gas[name].measurements if np.isfinite(m.value)]
            notes += [f"{slowest.name}: {gas[name].note}"] if gas[name].note else []
    stated = tuple(sorted({m.velocity for m in measurements if m.velocity is not None}))
    return Evaluation(tuple(measurements), settings, cycles, gas, stated, method, tuple(notes))


def _check_options(velocities: Sequence[float] | None, method: str | None, window: float) -> None:
    if method is not None:
        _checks.one_of("method", method, curve.METHODS)
    _checks.positive("window", window)
    for velocity in velocities or ():
        _checks.positive("velocities", velocity, "The direction is in the quantity.")


def _usual_method(settings: Mapping[str, Sequence[BenchRun]]) -> str:
    """Interpolation where every setting has motions of different peak velocity, the loop elsewhere."""
    return "interpolation" if all(len(_repeats(runs)) > 1 for runs in settings.values()) else "loop"


def _of_setting(
    name: str,
    runs: Sequence[BenchRun],
    cycles: Mapping[str, FoldedCycles],
    velocities: Sequence[float] | None,
    method: str,
    window: float,
) -> list[Measurement]:
    """The figures of the records at one setting, its forces at the stated velocities, its rates and knees."""
    of_records = [m for run in runs for m in record_measurements(cycles[run.name], name, run.name)]
    peaks = {direction: _peak_forces(runs, of_records, direction) for direction in curve.DIRECTIONS}
    fastest = max(runs, key=lambda run: run.peak_velocity).name
    at_velocities = _at_velocities(velocities, peaks, cycles[fastest], name, method, window)
    return [*of_records, *at_velocities, *curve.rates_and_knees(cycles[fastest], name, fastest)]


def _notes(runs: Sequence[BenchRun]) -> list[str]:
    """What is not evaluated, and what belongs to no place in the damper."""
    return [f"{run.name} has no full cycle: it is not evaluated." for run in runs if not run.cycles] + [
        f"{run.name}: the stroke was integrated from the velocity, so that forces at mid-stroke and gas force belong "
        "to the middle of the motion, wherever in the damper that is."
        for run in runs
        if run.cycles and run.stroke_is_integrated
    ]


def _by_settings(
    runs: Sequence[BenchRun], by: Callable[[BenchRun], Any] | None
) -> tuple[dict[str, tuple[BenchRun, ...]], list[str]]:
    """The records of each setting, and a sentence where they are told apart by what they state or by their names."""
    notes: list[str] = []
    if by is None and all(run.command is None for run in runs):
        apart, sentence = settings_apart(runs)
        notes += [sentence] if sentence else []
        if apart:
            runs, by = sorted(runs, key=lambda run: by_number(apart[run.name])), lambda run: apart[run.name]
    if by is None:
        runs = sorted(runs, key=_command)
    settings: dict[str, tuple[BenchRun, ...]] = {}
    for run in runs:
        name = _setting(run, by)
        settings[name] = (*settings.get(name, ()), run)
    return settings, notes


def _setting(run: BenchRun, by: Callable[[BenchRun], Any] | None) -> str:
    if by is not None:
        return str(by(run))
    return "" if run.command is None else f"{run.command:g}"


def _command(run: BenchRun) -> float:
    """Records without a command before those with one, these in its order."""
    return -np.inf if run.command is None else run.command


def _repeats(runs: Sequence[BenchRun]) -> list[list[BenchRun]]:
    """Records of the same motion side by side."""
    groups: list[list[BenchRun]] = []
    for run in runs:
        group = next((group for group in groups if same_motion(group[0], run)), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return groups


def _peak_forces(runs: Sequence[BenchRun], of_records: Sequence[Measurement], direction: str) -> list[curve.PeakForce]:
    """Force at the peak velocity of a direction, one for each motion: repeated records are averaged."""
    by = {(m.record, m.quantity): m for m in of_records}
    peaks = []
    for group in _repeats(runs):
        velocity = np.array([abs(by[run.name, f"{direction} velocity"].value) for run in group])
        forces = [by[run.name, f"{direction} force"] for run in group]
        value, between, count = measured(np.array([m.value for m in forces]))
        within = [m.scatter for m in forces if m.scatter is not None]
        parts = ([] if between is None else [between]) + (
            [float(np.sqrt(np.mean(np.square(within))))] if within else []
        )
        if count and np.isfinite(velocity).all():
            scatter = float(np.linalg.norm(parts)) if parts else None
            peaks.append(curve.PeakForce(float(velocity.mean()), value, scatter))
    return peaks


def _at_velocities(
    velocities: Sequence[float] | None,
    peaks: Mapping[str, Sequence[curve.PeakForce]],
    fastest: FoldedCycles,
    setting: str,
    method: str,
    window: float,
) -> list[Measurement]:
    """Forces and their ratio at the stated velocities; without any stated, at those that the records reach."""
    measurements = []
    for velocity in curve.OEM_VELOCITIES if velocities is None else velocities:
        forces = {}
        for direction, sign in curve.DIRECTIONS.items():
            if method == "loop":
                forces[direction] = curve.on_loop(fastest, sign, velocity, window)
            elif method == "window":
                forces[direction] = curve.in_window(peaks[direction], velocity, window)
            else:
                forces[direction] = curve.interpolated(peaks[direction], velocity)
        values = [force[0] for force in forces.values()]
        if velocities is None and not np.isfinite(values).any():
            continue
        more = {"setting": setting, "velocity": float(velocity)}
        measurements += [Measurement(f"{name} force", "N", *force, **more) for name, force in forces.items()]
        measurements.append(Measurement("rebound/compression ratio", "", *_ratio(*forces.values()), **more))
    return measurements


def _ratio(
    one: tuple[float, float | None, int], other: tuple[float, float | None, int]
) -> tuple[float, float | None, int]:
    """Ratio of the magnitudes of two forces; their scatters taken as independent."""
    if not other[0]:
        return float("nan"), None, 0
    value = abs(one[0] / other[0])
    has_scatter = one[1] is not None and other[1] is not None and one[0] != 0.0
    scatter = float(value * np.hypot((one[1] or 0.0) / one[0], (other[1] or 0.0) / other[0])) if has_scatter else None
    return value, scatter, min(one[2], other[2])

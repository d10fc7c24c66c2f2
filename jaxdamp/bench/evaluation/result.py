"""The evaluation of records, as tables, plain data and pictures."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, plotted
from jaxdamp._tables import Cell, Column, Compared, Contents, Table, comparison_table, percent_change, plain
from jaxdamp._types import Figure
from jaxdamp.bench.analysis import FoldedCycles
from jaxdamp.bench.contradictions import repeats
from jaxdamp.bench.evaluation.curve import WINDOW, Forces, Measurement, at_velocity, measured
from jaxdamp.bench.evaluation.limits import Limit, LimitCheck
from jaxdamp.bench.evaluation.separation import GasAndFriction
from jaxdamp.bench.runs import BenchRun


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
        window: share of a stated velocity within which samples, or records, count as taken at it.
    """

    measurements: tuple[Measurement, ...]
    settings: Mapping[str, tuple[BenchRun, ...]]
    cycles: Mapping[str, FoldedCycles]
    gas_and_friction: Mapping[str, GasAndFriction]
    velocities: tuple[float, ...]
    method: str
    notes: tuple[str, ...] = ()
    window: float = WINDOW

    @property
    def warnings(self) -> tuple[str, ...]:
        """`notes`: what could not be evaluated, and why."""
        return self.notes

    @property
    def summary(self) -> str:
        """Numbers of records and of settings."""
        runs, settings = len(self.runs), len(self.settings)
        of_each = f"{runs} record{'s' * (runs != 1)} at {settings} setting{'s' * (settings != 1)}"
        return f"{of_each}, forces by {self.method}."

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
        again = self._repeats_table()
        return tables | ({"repeats": again} if again.rows else {}) | {"measurements": self._list()}

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
            for group in repeats(runs):
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
        """Which measurements lie within limits; see `bench.read_limits`.

        Forces are evaluated at the velocities of the limits too, as at those given to `bench.evaluate`.
        """
        limits, measurements = tuple(limits), [*self.measurements]
        forces = Forces(self.settings, self.cycles, self.method, self.window)
        wanted = dict.fromkeys(limit.velocity for limit in limits if limit.velocity is not None)
        for name in self.settings:
            of_setting = [m for m in self.measurements if m.setting == name]
            missing = [velocity for velocity in wanted if not any(at_velocity(m, velocity) for m in of_setting)]
            measurements += forces.at(missing, name, self.measurements)
        return LimitCheck.of(measurements, limits, forces.span(self.measurements)[2])

    def content(self) -> Contents:
        """All measurements as plain data."""
        return {"method": self.method, "notes": list(self.notes), "measurements": plain(self._list().records())}

    def plot(self, kind: str = "cycles", **options: object) -> Figure:
        """Mean loops over velocity, stroke, acceleration and time, and forces over velocity; or the damper's sheet.

        Arguments:
            kind: "cycles" (`plots.evaluation`), or "sheet" for one A4 page (`plots.damper_sheet`).
            options: of that function, such as `baseline` and `limits`.
        """
        from jaxdamp import plots

        return plotted(kind, {"cycles": plots.evaluation, "sheet": plots.damper_sheet}, self, **options)

    def __repr__(self) -> str:
        return "\n\n".join([*(str(t) for name, t in self.tables().items() if name != "measurements"), *self.notes])

"""A page on a vehicle fitted to records of its motion: parameters, channels, what the records cannot show."""

from collections.abc import Sequence
from typing import Unpack

import numpy as np

from jaxdamp import plots
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column, Table
from jaxdamp._words import class_words, first_upper
from jaxdamp.bench import RideRecord
from jaxdamp.identify import VehicleComparison, VehicleFit, without_machine
from jaxdamp.parameters import get
from jaxdamp.report.benches import records_table
from jaxdamp.report.fits import failure_sentences
from jaxdamp.report.page import PAGE, Page, Report


@with_defaults(PAGE, title="Vehicle fitted to records of its motion")
def vehicle_fit_report(result: VehicleFit, *, remarks: Sequence[str] | None = None, **page: Unpack[Page]) -> Report:
    """A page on the fit of a vehicle.

    Arguments:
        result: of `identify.fit(vehicle, records)`.
        remarks: on the records; their notes if left out.
        page: `title`, `folder` and `attempts`, all optional (see `Page`).

    >>> from jaxdamp import identify, report, roads, vehicles
    >>> car = vehicles.presets.quarter_car_mathworks()
    >>> sweep = roads.sweep_sine(0.7, 14.0, duration=3.0, velocity_amplitude=0.15)
    >>> record = identify.virtual_ride(car, sweep, {"stroke": 1e-4}, sampling_rate=200.0)
    >>> page = report.vehicle_fit_report(identify.fit(car, record, over=["rate", "*_mass"], dt=5e-3))
    >>> "may all be larger by one factor" in page.to_html()  # page.write("vehicle.html")
    False
    """
    report = Report(**page)
    report.verdict(_summary(result))
    _add_fit(report, result, remarks)
    return report


@with_defaults(PAGE, title="Vehicles fitted to records of their motion")
def vehicle_comparison_report(
    comparison: VehicleComparison,
    *,
    remarks: Sequence[str] | None = None,
    **page: Unpack[Page],
) -> Report:
    """A page on the fits of several vehicles: the recommended one, why, and its fit.

    Arguments:
        comparison: of `identify.compare(vehicles, records)`.
        remarks: on the records; their notes if left out.
        page: `title`, `folder` and `attempts`, all optional (see `Page`).
    """
    report = Report(**page)
    best = comparison.best
    report.verdict(*comparison.verdict)
    report.heading("How good the vehicles are")
    report.table(comparison.table())
    report.points(failure_sentences(comparison))
    report.picture(comparison.plot, "Errors of the vehicles", "ladder.png")
    report.table(best.scores_table())
    report.heading(f"The recommended vehicle: {best.name}")
    report.text(_summary(best.result))
    _add_fit(report, best.result, remarks)
    for rung in comparison.rungs:
        if rung is not best:
            report.heading(rung.name)
            report.table(rung.result.table())
            report.points(rung.result.warnings)
    return report


def _add_fit(report: Report, result: VehicleFit, remarks: Sequence[str] | None) -> None:
    """The sections on one fitted vehicle."""
    report.heading("Warnings")
    report.points(result.warnings)
    if not result.warnings:
        report.text("None: the search converged, all free numbers are determined, and the residuals look like noise.")
    report.heading("Parameters")
    report.table(result.table())
    report.text(
        "The 95 % interval holds if the vehicle and its sensors have no further effects than"
        " those fitted; correlated residuals are accounted for by a factor on the standard errors,"
        f" here {result.inflation:.3g}."
    )
    report.heading("How well the channels are explained")
    report.text("Fit: 100 % is perfect, 0 % is no better than the mean of the channel.")
    report.table(result.scores_table())
    for number, record in enumerate(result.records):
        name = "channels.png" if len(result.records) == 1 else f"channels_{number + 1}.png"
        caption = f"{record.name}: measured and fitted channels, and their difference"
        report.picture(lambda name=record.name: plots.vehicle_fit(result, name), caption, name)
    report.heading("Records")
    report.table(ride_records_table(result.records))
    report.points([f"{r.name}: {note}" for r in result.records for note in r.notes] if remarks is None else remarks)
    for path, runs in result.bench.items():
        report.heading(f"Bench records of {path}")
        report.table(records_table(runs))
        law, reach = get(result.vehicle, path), max(run.peak_velocity for run in runs)
        report.picture(
            lambda law=law, runs=runs, path=path, reach=reach: plots.force_velocity(
                {path: law}, np.linspace(-reach, reach, 201), runs=without_machine(result.rig, runs)
            ),
            f"Force over velocity of {path}, beside its bench records without what the machine adds",
            f"{path.replace('.', '_')}_force_velocity.png",
        )


def ride_records_table(records: Sequence[RideRecord]) -> Table:
    """Records of a vehicle with their length, sampling rate, input and channels.

    Arguments:
        records: of `bench.read_rides`, or virtual ones.
    """
    columns = [Column("record"), Column("length", "s", ".4g"), Column("sampling", "Hz", ".6g"), Column("wheels")]
    columns += [Column("moved by"), Column("measured")]
    rows = []
    for record in records:
        span = float(np.max(np.ptp(record.road, axis=0)))
        moved = f"{1e3 * span:.3g} mm" if record.driven_by == "heights" else f"{span:.4g} N"
        measured = ", ".join(record.channels)
        rows.append((record.name, len(record) * record.dt, 1.0 / record.dt, record.wheels, moved, measured))
    return Table("Records (heights and accelerations positive up, travels in extension)", tuple(columns), tuple(rows))


def _summary(result: VehicleFit) -> str:
    """What was fitted, in two sentences."""
    count, free = len(result.records), len(result.parameters)
    benches = sum(map(len, result.bench.values()))
    also = f" and {benches} bench records" if benches else ""
    held = f" {', '.join(result.held)} is held at its start." if result.held else ""
    return (
        f"{first_upper(class_words(result.vehicle))}: {free} free numbers from"
        f" {count} record{'s' * (count > 1)} of its motion"
        f"{also}; {result.worst}.{held}"
    )

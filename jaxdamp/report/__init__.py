"""Pages of results of fits, rides and tunings: one self-contained HTML file with tables and pictures.

- Pages: `bench_report(evaluation, preflight)`, `fit_report(comparison)`, `vehicle_fit_report(result)`,
  `ride_report(responses)`, `tuning_report(result)`; each gives a `Report`, to which more can be added before
  `write(path)`.
- Your own page: `Report`, with the sections `add_fits` and `add_tuning`.
- Tables of these pages: `records_table`, `ride_records_table`, `ride_tables`, `fitted_range_table`, `range_use_table`.
"""

from jaxdamp._tables import Column, Table
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.benches import bench_report
from jaxdamp.report.fits import (
    add_fits,
    failure_sentences,
    fit_report,
    fitted_velocities,
    parameters_of,
    records_table,
)
from jaxdamp.report.page import Report
from jaxdamp.report.ranges import fitted_range_table, range_use_table
from jaxdamp.report.rides import axles_sentence, notes_of, ride_report, ride_tables
from jaxdamp.report.sweeps import sweep_report
from jaxdamp.report.tunings import add_tuning, tuning_report
from jaxdamp.report.vehicle_fits import ride_records_table, vehicle_fit_report


__all__ = [
    "Attempts",
    "Column",
    "Report",
    "Table",
    "add_fits",
    "add_tuning",
    "axles_sentence",
    "bench_report",
    "failure_sentences",
    "fit_report",
    "fitted_range_table",
    "fitted_velocities",
    "notes_of",
    "parameters_of",
    "range_use_table",
    "records_table",
    "ride_records_table",
    "ride_report",
    "ride_tables",
    "sweep_report",
    "tuning_report",
    "vehicle_fit_report",
]

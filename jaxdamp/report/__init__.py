"""Pages of results: one self-contained HTML file with the verdict in words, tables, pictures and versions.

- Pages: `bench_report(evaluation, preflight)`, `fit_report(comparison)`, `vehicle_fit_report(result)`,
  `ride_report(responses)`, `tuning_report(result)`, `chain_report(comparison, rides, tuned)` of the whole chain,
  `sweep_report(data)`, `result_report(result)` of any result; each gives a `Report`, to which more can
  be added before `write(path)`.
- Your own page: `Report`, with the sections `add_records`, `add_evaluation`, `add_fits`, `add_rides`, `add_tuning`.
- Tables of these pages: `records_table`, `ride_records_table`, `ride_tables`, `fitted_range_table`, `range_use_table`.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp._tables import Column, Table
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.benches import add_evaluation, baseline_table, bench_report, law_evaluation
from jaxdamp.report.chains import chain_report
from jaxdamp.report.fits import (
    add_fits,
    add_other_fits,
    failure_sentences,
    fit_report,
    fit_verdict,
    fitted_velocities,
    parameters_of,
)
from jaxdamp.report.page import Report
from jaxdamp.report.ranges import fitted_range_table, range_use_table
from jaxdamp.report.records import add_records, records_table
from jaxdamp.report.results import result_report
from jaxdamp.report.rides import (
    add_rides,
    axles_sentence,
    notes_of,
    ride_report,
    ride_tables,
    ride_verdict,
)
from jaxdamp.report.sweeps import sweep_report
from jaxdamp.report.tunings import add_tuning, tuning_report
from jaxdamp.report.vehicle_fits import ride_records_table, vehicle_fit_report


__all__ = [
    "Attempts",
    "Column",
    "Report",
    "Table",
    "add_evaluation",
    "add_fits",
    "add_other_fits",
    "add_records",
    "add_rides",
    "add_tuning",
    "axles_sentence",
    "baseline_table",
    "bench_report",
    "chain_report",
    "failure_sentences",
    "fit_report",
    "fit_verdict",
    "fitted_range_table",
    "fitted_velocities",
    "law_evaluation",
    "notes_of",
    "parameters_of",
    "range_use_table",
    "records_table",
    "result_report",
    "ride_records_table",
    "ride_report",
    "ride_tables",
    "ride_verdict",
    "sweep_report",
    "tuning_report",
    "vehicle_fit_report",
]

answer_guesses(__name__, __all__)

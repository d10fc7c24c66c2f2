"""Pages of results: one self-contained HTML file with the verdict in words, tables, pictures and versions.

- Pages: `bench_report(evaluation, preflight)`, `fit_report(comparison)`, `vehicle_fit_report(result)`,
  `vehicle_comparison_report(comparison)`, `ride_report(responses)`, `tuning_report(result)`,
  `chain_report(comparison, rides, tuned)` of the whole chain, `sweep_report(data)`, `result_report(result)` of any
  result; each gives a `Report`, to which more can be added before `write(path)`.
- Your own page: `Report`, with the sections `add_records`, `add_evaluation`, `add_fits`, `add_rides`, `add_tuning`.
- Tables of these pages: `records_table`, `ride_records_table`, `ride_tables`, `fitted_range_table`, `range_use_table`.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp._tables import Column as Column, Table
from jaxdamp.report.benches import (
    add_evaluation as add_evaluation,
    add_records as add_records,
    baseline_table as baseline_table,
    bench_report,
    bench_verdict as bench_verdict,
    fitted_range_table as fitted_range_table,
    law_evaluation as law_evaluation,
    range_use_table as range_use_table,
    records_table as records_table,
    table_report as table_report,
)
from jaxdamp.report.chains import FitPart as FitPart, chain_report, result_report
from jaxdamp.report.fits import (
    FitPage as FitPage,
    add_fits as add_fits,
    add_other_fits as add_other_fits,
    failure_sentences as failure_sentences,
    fit_report,
    fit_verdict as fit_verdict,
    fitted_velocities as fitted_velocities,
    parameters_of as parameters_of,
)
from jaxdamp.report.page import Attempts as Attempts, Page as Page, Report
from jaxdamp.report.rides import (
    add_rides as add_rides,
    axles_sentence as axles_sentence,
    notes_of as notes_of,
    ride_report,
    ride_tables as ride_tables,
    ride_verdict as ride_verdict,
)
from jaxdamp.report.sweeps import (
    MOST_POINTS as MOST_POINTS,
    best_points as best_points,
    points_table as points_table,
    sweep_report,
)
from jaxdamp.report.tunings import add_tuning as add_tuning, tuning_report
from jaxdamp.report.vehicle_fits import (
    ride_records_table as ride_records_table,
    vehicle_comparison_report,
    vehicle_fit_report,
)


__all__ = [
    "Report",
    "Table",
    "bench_report",
    "chain_report",
    "fit_report",
    "result_report",
    "ride_report",
    "sweep_report",
    "tuning_report",
    "vehicle_comparison_report",
    "vehicle_fit_report",
]

answer_guesses(__name__, __all__)

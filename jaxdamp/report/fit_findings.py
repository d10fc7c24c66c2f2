"""Sections of a page on a fit: what the test machine adds, doubts in words, records predicted by fits without them."""

import numpy as np

from jaxdamp.identify import CrossValidation, FitResult, rounded
from jaxdamp.parameters import parameters
from jaxdamp.report.page import Report


def machine_sentences(result: FitResult) -> tuple[str, ...]:
    """What the test machine adds to the force, and what it was taken not to add."""
    if result.rig is None:
        return ("No test machine was fitted: all of the measured force counts as the damper's.",)
    machine = {e.name.removeprefix("rig."): e for e in result.parameters if e.name.startswith("rig.")}
    texts = [(name, *rounded(e.value, e.standard_error), e.unit) for name, e in machine.items()]
    fitted = [f"{name.replace('_', ' ')} {value} ± {error} {unit}".rstrip() for name, value, error, unit in texts]
    absent = [p.path.replace("_", " ") for p in parameters(result.rig) if not np.any(np.asarray(p.value))]
    return (
        f"Fitted together with the law, as effects of the test machine: {', '.join(fitted) or 'none that was free'}.",
        f"Taken as absent: {', '.join(absent)}. An absent effect that the residual shows is named below.",
    )


def add_findings(report: Report, result: FitResult) -> None:
    """The test machine and the warnings of a fit; without warnings, what that means."""
    report.text(*machine_sentences(result))
    report.points(result.warnings)
    if not result.warnings:
        report.text(
            "No warnings: the search converged, the records determine every number, no effect of the machine that was"
            " left out shows in the residual, and the intervals need no correction for correlated residuals."
        )


def add_validation(report: Report, validation: CrossValidation) -> None:
    """Each record, predicted by a fit to the others."""
    report.heading("Records predicted by fits without them")
    report.text(
        f"Each record was left out once and predicted by {validation.best} fitted to the others: mean fit"
        f" {validation.fit_percent(validation.best):.1f} %, RMSE {validation.rmse(validation.best):.1f} N."
    )
    report.table(validation.record_table())

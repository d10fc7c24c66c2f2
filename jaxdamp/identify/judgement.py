"""What a user should know before trusting fitted numbers."""

from collections.abc import Sequence

import numpy as np
import scipy.stats
from jaxtyping import Float

from jaxdamp.identify.result import Estimate
from jaxdamp.identify.uncertainty import Uncertainty
from jaxdamp.parameters import FreeParameters


WEAK = 0.5  # standard error, relative to the value or to the force, above which a parameter is not identifiable
PRESSING = 3.0  # standard errors beyond an edge from which the data truly press against it
ALIKE = 0.5  # correlation of neighbouring residuals above which the law misses something


def judge(
    free: FreeParameters,
    values: Float[np.ndarray, " free"],
    known: Uncertainty,
    sides: Float[np.ndarray, " free"],
    effect: Float[np.ndarray, " free"],
    dof: int,
) -> tuple[Estimate, ...]:
    """Values with standard errors, 95 % intervals by Student's t within the domain, and what is wrong with them.

    A parameter is "not identifiable" where no error is finite, or where its standard error is more than half of it. A
    number that may have either sign is measured by its force instead: its standard error must not change the force by
    more than half its RMS. One that ended at zero, where its domain ends, is "not identifiable" too if the data cannot
    tell it from zero, and "at a bound" if they press beyond.

    Arguments:
        free: the free parameters.
        values: their values.
        known: their covariance.
        sides: which lie on an edge, as `coordinates.edges` gives them.
        effect: RMS force that one unit of each makes, relative to the RMS of the measured force.
        dof: degrees of freedom of the residual.
    """
    lower, upper = free.limits()
    reach = float(scipy.stats.t.ppf(0.975, dof))
    owners = [p for p in free.chosen for _ in range(p.value.size)]
    rows = []
    for i, (name, p) in enumerate(zip(free.names, owners, strict=True)):
        value, error = float(values[i]), float(np.sqrt(known.covariance[i, i]))
        if sides[i]:
            free_to_zero = p.domain.steps is None and sides[i] < 0 and lower[i] == 0 and np.isinf(upper[i])
            unpressed = free_to_zero and abs(known.beyond[i]) < PRESSING
            note = "not identifiable" if unpressed or not np.isfinite(error) else "at a bound"
        else:
            signed = lower[i] < 0 < upper[i]
            share = (
                error * effect[i] if signed and np.isfinite(error) else error / max(abs(value), np.finfo(float).tiny)
            )
            note = "" if share <= WEAK else "not identifiable"
        interval = (max(value - reach * error, float(lower[i])), min(value + reach * error, float(upper[i])))
        rows.append(Estimate(name, value, p.unit, error, interval, p.meaning, note))
    return tuple(rows)


def warn(
    estimates: Sequence[Estimate], failure: str, residual: Float[np.ndarray, " samples"], noise_estimated: bool
) -> list[str]:
    """Sentences on a failed search, on parameters at bounds or not identifiable, and on residuals that are no noise.

    Arguments:
        estimates: the parameters.
        failure: why the search did not converge, empty if it did.
        residual: the weighted residual, record by record.
        noise_estimated: whether the standard errors were made from the residual.
    """
    notes = []
    if failure:
        notes.append(f"The search did not converge: {failure} Try another start, bounds, or fewer free parameters.")
    for e in estimates:
        unit = f" {e.unit}" if e.unit else ""
        if e.note == "at a bound":
            notes.append(f"{e.name} = {e.value:.4g}{unit} is at a bound: the data press beyond it.")
        elif e.note == "not identifiable":
            notes.append(
                f"{e.name} is not identifiable from these records ({e.value:.3g} ± {e.standard_error:.2g}{unit}):"
                " freeze it or add records that excite it."
            )
    centred = residual - residual.mean()
    memory = float(centred[1:] @ centred[:-1] / (centred @ centred)) if residual.size > 2 and centred.any() else 0.0
    if memory > ALIKE and noise_estimated:
        factor = np.sqrt((1 + memory) / (1 - memory)) if memory < 1 else np.inf
        notes.append(
            f"Neighbouring residuals are alike (correlation {memory:.2f}): the law misses something systematic, and"
            f" standard errors, which assume independent noise, are too small by about {factor:.0f} times."
        )
    return notes

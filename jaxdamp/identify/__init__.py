"""From bench records to a damper law: `fit` one law, `compare` many, and say how well the records determine them."""

from jaxdamp.identify.comparing import Comparison, compare, fit_each
from jaxdamp.identify.cross_validation import CrossValidation, cross_validate
from jaxdamp.identify.estimates import Estimate, rounded
from jaxdamp.identify.fitting import fit
from jaxdamp.identify.ladder import LAWS, default_ladder
from jaxdamp.identify.laws import NAMED_LAWS, NamedLaw, laws_table
from jaxdamp.identify.residual import ErrorShares, error_shares
from jaxdamp.identify.result import FitResult, Score, fit_percent
from jaxdamp.identify.rungs import Failure, Rung
from jaxdamp.identify.training import Training, train


__all__ = [
    "LAWS",
    "NAMED_LAWS",
    "Comparison",
    "CrossValidation",
    "ErrorShares",
    "Estimate",
    "Failure",
    "FitResult",
    "NamedLaw",
    "Rung",
    "Score",
    "Training",
    "compare",
    "cross_validate",
    "default_ladder",
    "error_shares",
    "fit",
    "fit_each",
    "fit_percent",
    "laws_table",
    "rounded",
    "train",
]

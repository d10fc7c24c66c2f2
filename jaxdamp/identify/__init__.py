"""From bench records to a damper law: `fit` one law, `compare` many, and say how well the records determine them."""

from jaxdamp.identify.comparing import Comparison, Failure, Rung, compare, fit_each
from jaxdamp.identify.cross_validation import CrossValidation, cross_validate
from jaxdamp.identify.fitting import fit
from jaxdamp.identify.ladder import LAWS, default_ladder
from jaxdamp.identify.result import Estimate, FitResult, Score, fit_percent, rounded
from jaxdamp.identify.training import Training, train


__all__ = [
    "LAWS",
    "Comparison",
    "CrossValidation",
    "Estimate",
    "Failure",
    "FitResult",
    "Rung",
    "Score",
    "Training",
    "compare",
    "cross_validate",
    "default_ladder",
    "fit",
    "fit_each",
    "fit_percent",
    "rounded",
    "train",
]

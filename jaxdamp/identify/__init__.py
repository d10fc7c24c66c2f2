"""From bench records to a damper law: `fit` one law, `compare` many, and say how well the records determine them."""

from jaxdamp._status import Status
from jaxdamp.identify.comparing import Comparison, Failure, Rung, compare, fit_each
from jaxdamp.identify.cross_validation import CrossValidation, cross_validate
from jaxdamp.identify.fitting import fit, solve
from jaxdamp.identify.judging import judge
from jaxdamp.identify.ladder import LAWS, default_ladder, ladder_starts
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import AbstractResiduals, Problem
from jaxdamp.identify.result import Estimate, FitResult, Score, fit_percent, rounded
from jaxdamp.identify.training import Training, train


__all__ = [
    "LAWS",
    "AbstractResiduals",
    "Comparison",
    "CrossValidation",
    "Estimate",
    "Failure",
    "FitResult",
    "Problem",
    "Rung",
    "Score",
    "Status",
    "Training",
    "compare",
    "cross_validate",
    "default_ladder",
    "fit",
    "fit_each",
    "fit_percent",
    "judge",
    "ladder_starts",
    "prepare",
    "rounded",
    "solve",
    "train",
]

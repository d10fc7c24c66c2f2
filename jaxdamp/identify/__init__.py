"""From bench records to a damper law: `fit` one law, `compare` many, and say how well the records determine them."""

from jaxdamp._guesses import answer_guesses
from jaxdamp._status import Status
from jaxdamp.identify.bayes import Posterior, Spread
from jaxdamp.identify.comparing import Comparison, compare, fit_each
from jaxdamp.identify.cross_validation import CrossValidation, cross_validate
from jaxdamp.identify.design_goal import MachineLimits
from jaxdamp.identify.designing import ExperimentDesign, design_experiment, extent
from jaxdamp.identify.estimates import Estimate, rounded
from jaxdamp.identify.fitting import fit, solve
from jaxdamp.identify.judging import judge
from jaxdamp.identify.ladder import (
    LAWS,
    NAMED_LAWS,
    LearntStart,
    NamedLaw,
    default_ladder,
    ladder_starts,
    laws_table,
    suited_laws as suited_laws,
)
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.machine import OFFSET, machine_names, without_machine
from jaxdamp.identify.many import fit_many
from jaxdamp.identify.many_result import ManyFits
from jaxdamp.identify.model import InitialMotion, VehicleTest
from jaxdamp.identify.predicting import ErrorShares, Score, error_shares, fit_percent, predict_runs
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import AbstractResiduals, Problem
from jaxdamp.identify.profile import ProfileCurve
from jaxdamp.identify.propagation import Band, Evidence, Propagated
from jaxdamp.identify.record_sensitivity import RecordSensitivity
from jaxdamp.identify.result import Fit
from jaxdamp.identify.rungs import Failure, Rung
from jaxdamp.identify.scheduling import LeftOutSetting, ScheduledFit, fit_scheduled
from jaxdamp.identify.targets import TargetFit, fit_targets
from jaxdamp.identify.training import Training, train
from jaxdamp.identify.vehicle_fitting import fit_vehicle
from jaxdamp.identify.vehicle_residuals import virtual_ride
from jaxdamp.identify.vehicle_result import ChannelScore, VehicleFit


__all__ = [
    "LAWS",
    "NAMED_LAWS",
    "OFFSET",
    "AbstractResiduals",
    "Band",
    "ChannelScore",
    "Comparison",
    "CrossValidation",
    "ErrorShares",
    "Estimate",
    "Evidence",
    "ExperimentDesign",
    "Failure",
    "Fit",
    "FitResult",
    "InitialMotion",
    "LearntStart",
    "LeftOutSetting",
    "MachineLimits",
    "ManyFits",
    "NamedLaw",
    "Posterior",
    "Problem",
    "ProfileCurve",
    "Propagated",
    "RecordSensitivity",
    "Rung",
    "ScheduledFit",
    "Score",
    "Spread",
    "Status",
    "TargetFit",
    "Training",
    "VehicleFit",
    "VehicleTest",
    "compare",
    "cross_validate",
    "default_ladder",
    "design_experiment",
    "error_shares",
    "extent",
    "fit",
    "fit_each",
    "fit_many",
    "fit_percent",
    "fit_scheduled",
    "fit_targets",
    "fit_vehicle",
    "judge",
    "ladder_starts",
    "laws_table",
    "machine_names",
    "predict_runs",
    "prepare",
    "rounded",
    "solve",
    "train",
    "virtual_ride",
    "without_machine",
]
__shared__ = ["suited_laws"]

answer_guesses(__name__, __all__)

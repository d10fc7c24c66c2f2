"""From bench records to a damper law: `fit` one law, `compare` many, and say how well the records determine them."""

from jaxdamp._guesses import answer_guesses
from jaxdamp._status import Status
from jaxdamp.identify.bayes import Posterior as Posterior, Spread as Spread
from jaxdamp.identify.comparing import Comparison as Comparison, compare, fit_each as fit_each
from jaxdamp.identify.control_charts import AbstractChart as AbstractChart, Cusum, Ewma, Shewhart
from jaxdamp.identify.cross_validation import CrossValidation as CrossValidation, cross_validate
from jaxdamp.identify.design_candidates import MachineLimits, extent as extent
from jaxdamp.identify.designing import ExperimentDesign as ExperimentDesign, design_experiment
from jaxdamp.identify.estimates import Estimate as Estimate, rounded as rounded
from jaxdamp.identify.fitting import fit, solve
from jaxdamp.identify.judging import judge
from jaxdamp.identify.ladder import (
    LAWS as LAWS,
    NAMED_LAWS as NAMED_LAWS,
    LearntStart,
    NamedLaw as NamedLaw,
    default_ladder,
    ladder_starts,
    laws_table as laws_table,
    suited_laws as suited_laws,
)
from jaxdamp.identify.law_result import FitResult as FitResult
from jaxdamp.identify.line import ControlCharts as ControlCharts, control_charts
from jaxdamp.identify.machine import (
    OFFSET as OFFSET,
    machine_names as machine_names,
    without_machine as without_machine,
)
from jaxdamp.identify.many import fit_many
from jaxdamp.identify.many_result import ManyFits as ManyFits
from jaxdamp.identify.model import InitialMotion as InitialMotion, VehicleTest as VehicleTest
from jaxdamp.identify.predicting import (
    ErrorShares as ErrorShares,
    Score as Score,
    error_shares,
    fit_percent,
    predict_runs as predict_runs,
)
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.profile import ProfileCurve as ProfileCurve
from jaxdamp.identify.propagation import Band as Band, Evidence as Evidence, Propagated as Propagated
from jaxdamp.identify.record_sensitivity import RecordSensitivity as RecordSensitivity
from jaxdamp.identify.residuals import AbstractResiduals as AbstractResiduals
from jaxdamp.identify.result import Fit as Fit
from jaxdamp.identify.rungs import Failure as Failure, Rung as Rung
from jaxdamp.identify.scheduling import LeftOutSetting as LeftOutSetting, ScheduledFit as ScheduledFit, fit_scheduled
from jaxdamp.identify.settings import (
    FitSettings,
    Free as Free,
    Records as Records,
    Search as Search,
    TargetSettings as TargetSettings,
    VehicleSettings as VehicleSettings,
)
from jaxdamp.identify.targets import TargetFit as TargetFit, fit_targets
from jaxdamp.identify.training import Training as Training, train
from jaxdamp.identify.vehicle_comparing import (
    VehicleComparison as VehicleComparison,
    VehicleRung as VehicleRung,
    fit_each_vehicle as fit_each_vehicle,
)
from jaxdamp.identify.vehicle_fitting import fit_vehicle
from jaxdamp.identify.vehicle_ladder import FORMS as FORMS, friction_ladder
from jaxdamp.identify.vehicle_residuals import virtual_ride
from jaxdamp.identify.vehicle_result import ChannelScore as ChannelScore, VehicleFit as VehicleFit


__all__ = [
    "Cusum",
    "Ewma",
    "FitSettings",
    "LearntStart",
    "MachineLimits",
    "Problem",
    "Shewhart",
    "Status",
    "compare",
    "control_charts",
    "cross_validate",
    "default_ladder",
    "design_experiment",
    "error_shares",
    "fit",
    "fit_many",
    "fit_percent",
    "fit_scheduled",
    "fit_targets",
    "fit_vehicle",
    "friction_ladder",
    "judge",
    "ladder_starts",
    "prepare",
    "solve",
    "train",
    "virtual_ride",
]

answer_guesses(__name__, __all__)

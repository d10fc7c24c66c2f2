"""Tuning of vehicles for ride metrics.

- `minimise`: the best free parameters, within bounds, limits and shape constraints; `rescore` on other roads.
- `robust`: a tuning over scenarios, with the cost of tolerances; `tolerance_effects` of any vehicle.
- `sensitivity`: which parameters, and which velocities of the damper curve, a metric comes from.
- `Scenarios`: roads and conditions of the vehicle, in place of one road.
- `Targets`, `smooth_peak`, `smooth_settling`: objectives.
- `slope`, `monotone`, `ratio`, `knee`: constraints on the shape of the force-velocity curve.
- `pareto`: fronts of two or three metrics; `hypervolume`.
- `limit_spans`: limits as they are written, as pairs of numbers.
- `compare_dampers`: differences between dampers with error bars; `valving`: a mono-tube damper for a wanted force.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp._status import Status
from jaxdamp.tune.comparison import DamperComparison, Difference
from jaxdamp.tune.decisions import FittedLaw, compare_dampers
from jaxdamp.tune.front import ParetoFront, hypervolume
from jaxdamp.tune.limits import limit_spans
from jaxdamp.tune.minimising import minimise
from jaxdamp.tune.objective import Targets, smooth_peak, smooth_settling
from jaxdamp.tune.pareto_search import pareto
from jaxdamp.tune.rescoring import Rescore, rescore
from jaxdamp.tune.result import Attempt, Change, ScenarioValues, TuneResult
from jaxdamp.tune.risk import CVaR
from jaxdamp.tune.robust_tuning import RobustResult, robust
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.scenarios import Condition, Scenario, Scenarios, samples, tolerances
from jaxdamp.tune.sensitivities import sensitivity
from jaxdamp.tune.sensitivity_result import CurveSensitivity, Sensitivity
from jaxdamp.tune.settings import Design, Run, Search
from jaxdamp.tune.shape import Shape, damper_paths, knee, monotone, ratio, slope
from jaxdamp.tune.spectra import Spectrum
from jaxdamp.tune.tolerance import ToleranceEffect, tolerance_effects
from jaxdamp.tune.valving_result import OutOfReach, ValveParameter, ValvingResult
from jaxdamp.tune.valving_search import valving
from jaxdamp.tune.verdict import Outcome


__all__ = [
    "Attempt",
    "CVaR",
    "Change",
    "Condition",
    "CurveSensitivity",
    "DamperComparison",
    "Design",
    "Difference",
    "FittedLaw",
    "OutOfReach",
    "Outcome",
    "ParetoFront",
    "Rescore",
    "RobustResult",
    "Run",
    "Scenario",
    "ScenarioRide",
    "ScenarioValues",
    "Scenarios",
    "Search",
    "Sensitivity",
    "Shape",
    "Spectrum",
    "Status",
    "Targets",
    "ToleranceEffect",
    "TuneResult",
    "ValveParameter",
    "ValvingResult",
    "compare_dampers",
    "damper_paths",
    "hypervolume",
    "knee",
    "limit_spans",
    "minimise",
    "monotone",
    "pareto",
    "ratio",
    "rescore",
    "robust",
    "samples",
    "sensitivity",
    "slope",
    "smooth_peak",
    "smooth_settling",
    "tolerance_effects",
    "tolerances",
    "valving",
]

answer_guesses(__name__, __all__)

"""Tuning of vehicles for ride metrics.

- `minimise`: the best free parameters, within bounds, limits and shape constraints; `rescore` on other roads.
- `robust`: a tuning over scenarios, with the cost of tolerances; `tolerance_effects` of any vehicle.
- `sensitivity`: which parameters, and which velocities of the damper curve, a metric comes from.
- `Design`, `Run`, `Search`: keywords of all of them, to be kept for several calls.
- `Choice`: the values that can be built: clicks, springs and shims of a catalogue.
- `Scenarios`: roads and conditions of the vehicle, in place of one road.
- `Targets`, `smooth_peak`, `smooth_settling`: objectives.
- `slope`, `monotone`, `ratio`, `knee`: constraints on the shape of the force-velocity curve.
- `pareto`: fronts of two or three metrics; `hypervolume`.
- `limit_spans`: limits as they are written, as pairs of numbers.
- `compare_dampers`: differences between dampers with error bars; `valving`: a mono-tube damper for a wanted force.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp._status import Status as Status
from jaxdamp.tune.decisions import DamperComparison as DamperComparison, compare_dampers
from jaxdamp.tune.front import ParetoFront as ParetoFront, hypervolume as hypervolume
from jaxdamp.tune.limits import Limits as Limits, half_interval as half_interval, limit_spans as limit_spans
from jaxdamp.tune.minimising import minimise
from jaxdamp.tune.objective import Targets, goal_limits as goal_limits
from jaxdamp.tune.pareto_search import pareto
from jaxdamp.tune.ranges import Choice
from jaxdamp.tune.rescoring import Rescore as Rescore, rescore
from jaxdamp.tune.result import TuneResult as TuneResult
from jaxdamp.tune.risk import CVaR
from jaxdamp.tune.robust_tuning import robust, tolerance_effects
from jaxdamp.tune.scenarios import Condition, Scenarios, samples, tolerances
from jaxdamp.tune.sensitivities import sensitivity
from jaxdamp.tune.sensitivity_result import Sensitivity as Sensitivity
from jaxdamp.tune.settings import Design, Run, Search
from jaxdamp.tune.shape import damper_paths as damper_paths, knee, monotone, ratio, slope
from jaxdamp.tune.smooth import smooth_peak, smooth_settling
from jaxdamp.tune.valving_result import ValvingResult as ValvingResult
from jaxdamp.tune.valving_search import valving
from jaxdamp.tune.verdict import Outcome as Outcome, change_in_percent as change_in_percent


__all__ = [
    "CVaR",
    "Choice",
    "Condition",
    "Design",
    "Run",
    "Scenarios",
    "Search",
    "Targets",
    "compare_dampers",
    "knee",
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

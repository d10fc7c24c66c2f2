"""Pictures of fits, laws, rides and tunings. Each function returns its matplotlib `Figure` and shows nothing.

Save one with `figure.savefig("fit.png", dpi=150)`; in a notebook it is shown as the value of a cell. No function
touches pyplot or its global state, and matplotlib is loaded by the first call only.
"""

from jaxdamp.plots.cards import law_card
from jaxdamp.plots.changes import tuning
from jaxdamp.plots.curves import force_velocity
from jaxdamp.plots.damper_use import damper_use
from jaxdamp.plots.decisions import damper_comparison
from jaxdamp.plots.errors import ladder
from jaxdamp.plots.evaluation import evaluation, gas_and_friction, limit_check
from jaxdamp.plots.experiments import experiment
from jaxdamp.plots.fronts import pareto
from jaxdamp.plots.history import training_history
from jaxdamp.plots.loops import fit_loops
from jaxdamp.plots.many_values import many_fits, posterior, rescore, targets
from jaxdamp.plots.modes import modes
from jaxdamp.plots.preflight import preflight
from jaxdamp.plots.profiles import profile
from jaxdamp.plots.records import records
from jaxdamp.plots.rides import ride
from jaxdamp.plots.roughness import roughness_by_segment, roughness_spectrum
from jaxdamp.plots.sensitivities import record_sensitivity, sensitivity
from jaxdamp.plots.sweeps import sweep
from jaxdamp.plots.validation import cross_validation
from jaxdamp.plots.valve_choice import valving
from jaxdamp.plots.vehicle_fit import vehicle_fit


__all__ = [
    "cross_validation",
    "damper_comparison",
    "damper_use",
    "evaluation",
    "experiment",
    "fit_loops",
    "force_velocity",
    "gas_and_friction",
    "ladder",
    "law_card",
    "limit_check",
    "many_fits",
    "modes",
    "pareto",
    "posterior",
    "preflight",
    "profile",
    "record_sensitivity",
    "records",
    "rescore",
    "ride",
    "roughness_by_segment",
    "roughness_spectrum",
    "sensitivity",
    "sweep",
    "targets",
    "training_history",
    "tuning",
    "valving",
    "vehicle_fit",
]

"""Pictures of fits, laws, rides and tunings. Each function returns its matplotlib `Figure` and shows nothing.

Save one with `figure.savefig("fit.png", dpi=150)`; in a notebook it is shown as the value of a cell. No function
touches pyplot or its global state, and matplotlib is loaded by the first call only. Figures of your own look alike with
`matplotlib.pyplot.style.use(plots.STYLE)` and `**plots.ROLES["before"]`.
"""

from jaxdamp.plots._style import ROLES, STYLE
from jaxdamp.plots.animation import animation as animation
from jaxdamp.plots.curves import force_velocity, force_velocity_family as force_velocity_family, law_card
from jaxdamp.plots.damper_sheet import damper_sheet as damper_sheet
from jaxdamp.plots.damping import damping_ratio
from jaxdamp.plots.errors import (
    cross_validation as cross_validation,
    experiment as experiment,
    ladder,
    profile as profile,
    training_history as training_history,
)
from jaxdamp.plots.evaluation import (
    evaluation,
    gas_and_friction as gas_and_friction,
    limit_check as limit_check,
    records,
)
from jaxdamp.plots.frequency import (
    dynamic_stiffness as dynamic_stiffness,
    harmonic_response as harmonic_response,
    modes,
    roughness_by_segment as roughness_by_segment,
    roughness_spectrum as roughness_spectrum,
)
from jaxdamp.plots.loops import fit_loops as fit_loops, loops_by_law as loops_by_law, vehicle_fit as vehicle_fit
from jaxdamp.plots.many_values import (
    control_charts as control_charts,
    damper_comparison as damper_comparison,
    many_fits as many_fits,
    posterior as posterior,
    rescore as rescore,
    sweep_summary as sweep_summary,
    targets as targets,
)
from jaxdamp.plots.preflight import preflight
from jaxdamp.plots.ride_sheet import ride_sheet as ride_sheet
from jaxdamp.plots.rides import damper_use, ride
from jaxdamp.plots.sensitivities import record_sensitivity as record_sensitivity, sensitivity, valving
from jaxdamp.plots.sweeps import sweep
from jaxdamp.plots.tunings import pareto, tuning


__all__ = [
    "ROLES",
    "STYLE",
    "damper_use",
    "damping_ratio",
    "evaluation",
    "force_velocity",
    "ladder",
    "law_card",
    "modes",
    "pareto",
    "preflight",
    "records",
    "ride",
    "sensitivity",
    "sweep",
    "tuning",
    "valving",
]

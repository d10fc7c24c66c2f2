"""What a response says of itself in words: one function for each kind of note, a sentence for each thing to know."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jaxdamp._types import Signal
from jaxdamp.vehicles import AbstractVehicle
from jaxdamp.vehicles.parts import prefixed


def tyres_in_tension(
    vehicle: AbstractVehicle, time: Float[np.ndarray, " time"], channels: Mapping[str, Signal]
) -> tuple[str, ...]:
    """Linear tyres that pulled on the road, how far below zero their load went, and when."""
    notes = []
    for wheel, static in zip(vehicle.frame().wheels, np.asarray(vehicle.static_wheel_loads()), strict=True):
        load = static + np.asarray(channels[prefixed(wheel.name, "dynamic_tyre_load")])
        worst = int(np.argmin(load))
        if static > 0.0 and not wheel.lifts and load[worst] < -1e-3 * static:
            called = f"The {wheel.name.replace('_', ' ')} tyre" if wheel.name else "The tyre"
            share = 100.0 * float(np.mean(load < 0.0))
            notes.append(
                f"{called} pulled on the road in {share:.2g} % of the run: its load fell to {load[worst] / 1e3:.3g} kN "
                f"at {time[worst]:.3f} s (static {static / 1e3:.3g} kN). A linear tyre does not let go; "
                "give the vehicle `tyre_lifts=True` if it can leave the road."
            )
    return tuple(notes)

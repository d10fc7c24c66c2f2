"""What a response says of itself in words: one function for each kind of note, a sentence for each thing to know."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jaxdamp._types import Signal
from jaxdamp.vehicles import AbstractVehicle, prefixed


LEAST = 1e-3  # of the static load, by which a load must be below zero


def tyres_in_tension(
    vehicle: AbstractVehicle, time: Float[np.ndarray, " time"], channels: Mapping[str, Signal]
) -> tuple[str, ...]:
    """Linear tyres that pulled on the road: how far below zero their load went, when, and for how long."""
    pulled = []
    for wheel, static in zip(vehicle.frame().wheels, np.asarray(vehicle.static_wheel_loads()), strict=True):
        load = static + np.asarray(channels[prefixed(wheel.name, "dynamic_tyre_load")])
        worst = int(np.argmin(load))
        if static > 0.0 and not wheel.lifts and load[worst] < -LEAST * static:
            share = 100.0 * float(np.mean(load < 0.0))
            pulled.append(
                f"{wheel.name.replace('_', ' ') + ' ' if wheel.name else ''}{load[worst] / 1e3:.3g} kN at "
                f"{time[worst]:.3f} s (static load {static / 1e3:.3g} kN, below zero in {share:.2g} % of the run)"
            )
    if not pulled:
        return ()
    remedy = "Pass `tyre_lifts=True` to the vehicle if its wheels can leave the road."
    return (f"Wheel loads fell below zero, as linear tyres pull on the road: {'; '.join(pulled)}. {remedy}",)

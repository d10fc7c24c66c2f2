"""A controller as a word of the command line."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from jaxdamp import _checks, control
from jaxdamp.cli.vehicle_words import read_module
from jaxdamp.dampers import AbstractDamper, takes_command
from jaxdamp.vehicles import AbstractVehicle


def _preview(gain: float, delay: float, skyhook: float = 3000.0) -> control.Preview:
    """Preview over skyhook at every damper."""
    return control.Preview(control.Skyhook(skyhook), [gain], delay)


Policy: TypeAlias = control.AbstractPolicy | control.AbstractVehiclePolicy
POLICIES: dict[str, Callable[..., Policy]] = {
    "skyhook": control.Skyhook,
    "band-skyhook": control.BandSkyhook,
    "modal-skyhook": control.ModalSkyhook,
    "groundhook": control.Groundhook,
    "hybrid": control.HybridHook,
    "acceleration-driven": control.AccelerationDriven,
    "power-driven": control.PowerDriven,
    "state-feedback": control.StateFeedback,
    "preview": _preview,
}


@dataclass(frozen=True)
class Controlling:
    """How the dampers are commanded while they drive.

    Arguments:
        controller: a policy and its numbers, such as skyhook:gain=3000 (skyhook, band-skyhook, modal-skyhook,
            groundhook, hybrid, acceleration-driven, power-driven, state-feedback, preview, lqr), or the
            controller.json of a tuning; the law must take a command. The baseline of a ride, if none is given, is the
            same law at its own command.
        period: between two samples of the controller [s]; 5 ms if left out.
        delay: from a sample to its command [s]; 0 if left out.
        actuator_lag: time constant of the valve or the coil [s]; 0 if left out.
        sensor_lag: time constant of the sensors [s]; 0 if left out.
    """

    controller: str | None = None
    period: float | None = None
    delay: float | None = None
    actuator_lag: float | None = None
    sensor_lag: float | None = None

    def of(self, car: AbstractVehicle, law: AbstractDamper | None) -> AbstractVehicle:
        """The vehicle with a law, or its own, under the controller; itself if there is none."""
        given = {name: getattr(self, name) for name in ("period", "delay", "actuator_lag", "sensor_lag")}
        times = {name: value for name, value in given.items() if value is not None}
        if self.controller is None:
            for name, value in times.items():
                _checks.refuse(name, "be given with --controller, whose it is", value, "Or leave it out.")
            return car
        laws = car.elements() if law is None else (law,)
        if not any(map(takes_command, laws)):
            remedy = "Give the vehicle a law that does: jaxdamp fit makes one of records at several commands."
            must, named = "set the command of a damper that takes one", ", ".join(type(one).__name__ for one in laws)
            _checks.refuse("controller", must, f"{self.controller} beside {named}", remedy)
        policy = parse_policy(self.controller, car)
        return control.Controlled(car, policy, **times)


def parse_policy(word: str, car: AbstractVehicle) -> Policy:
    """The policy that a word means, such as "hybrid:gain=3000,share=0.7", or the file of one.

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> parse_policy("skyhook:gain=2000", quarter_car_000())
    Skyhook(gain=2000.0, lead=0.0)
    """
    if word.endswith(".json"):
        kinds = (control.AbstractPolicy, control.AbstractVehiclePolicy)
        return read_module("controller", Path(word), kinds, "a policy", "`jaxdamp tune --controller` writes it.")
    policies = POLICIES | {"lqr": functools.partial(control.lqr, car)}
    name, _, numbers_text = word.partition(":")
    _checks.one_of("controller", name, policies)
    try:
        pairs = [part.split("=") for part in numbers_text.split(",") if part]
        numbers = {key.strip(): float(value) for key, value in pairs}
    except ValueError:
        _checks.refuse("controller", "read like skyhook:gain=3000,lead=0.01", repr(word))
    if len(numbers) < len(pairs):
        _checks.refuse("controller", "give each number once", repr(word))
    fields = inspect.signature(policies[name]).parameters
    for key in numbers:
        _checks.one_of("controller", key, fields)
    missing = [key for key, field in fields.items() if field.default is field.empty and key not in numbers]
    if missing:
        remedy = f"Write {name}:{','.join(f'{key}=NUMBER' for key in missing)}."
        _checks.refuse("controller", f"have a {' and a '.join(missing)}", repr(word), remedy)
    return policies[name](**numbers)

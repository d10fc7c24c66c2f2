"""A controller as a word of the command line."""

from dataclasses import dataclass

from jaxdamp import _checks, control
from jaxdamp.dampers import AbstractDamper, takes_command
from jaxdamp.vehicles import AbstractVehicle


POLICIES: dict[str, type[control.AbstractPolicy]] = {
    "skyhook": control.Skyhook,
    "groundhook": control.Groundhook,
    "hybrid": control.Hybrid,
    "acceleration-driven": control.AccelerationDriven,
    "power-driven": control.PowerDriven,
    "state-feedback": control.StateFeedback,
}


@dataclass(frozen=True)
class Controlling:
    """How the dampers are commanded while they drive.

    Arguments:
        controller: a policy and its numbers, such as skyhook:gain=3000 (skyhook, groundhook, hybrid,
            acceleration-driven, power-driven, state-feedback); the law must take a command. The baseline, if none is
            given, is the same law at its own command.
        period: between two samples of the controller [s].
        delay: from a sample to its command [s].
        actuator_lag: time constant of the valve or the coil [s].
        sensor_lag: time constant of the sensors [s].
    """

    controller: str | None = None
    period: float = 5e-3
    delay: float = 0.0
    actuator_lag: float = 0.0
    sensor_lag: float = 0.0

    def of(self, car: AbstractVehicle, law: AbstractDamper) -> AbstractVehicle:
        """The vehicle with a law under the controller; itself if there is none."""
        if self.controller is None:
            return car
        if not takes_command(law):
            remedy = "The law that jaxdamp fit makes of records at several commands does."
            _checks.refuse("law", "take a command, which --controller sets", type(law).__name__, remedy)
        lags = {"actuator_lag": self.actuator_lag, "sensor_lag": self.sensor_lag}
        return control.Controlled(car, parse_policy(self.controller), **lags, period=self.period, delay=self.delay)


def parse_policy(word: str) -> control.AbstractPolicy:
    """The policy that a word means, such as "hybrid:gain=3000,share=0.7".

    >>> parse_policy("skyhook:gain=2000")
    Skyhook(gain=2000.0, lead=0.0)
    """
    name, _, rest = word.partition(":")
    _checks.one_of("controller", name, POLICIES)
    try:
        pairs = (part.split("=") for part in rest.split(",") if part)
        numbers = {key.strip(): float(value) for key, value in pairs}
    except ValueError:
        _checks.refuse("controller", "read like skyhook:gain=3000,lead=0.01", repr(word))
    fields = list(POLICIES[name].__dataclass_fields__)
    for key in numbers:
        _checks.one_of("controller", key, fields)
    if name == "power-driven" and "stiffness" not in numbers:
        remedy = "Write power-driven:stiffness=20000, the rate of the suspension spring [N/m]."
        _checks.refuse("controller", "have a stiffness", repr(word), remedy)
    return POLICIES[name](**numbers)

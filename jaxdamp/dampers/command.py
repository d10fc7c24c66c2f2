"""Laws that take a command: a voltage, a coil current, the click of an adjuster."""

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._traced import is_traced
from jaxdamp._types import ScalarLike
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.inside import command_paths
from jaxdamp.dampers.range_use import range_use, sentence, warn_outside
from jaxdamp.parameters import as_float, checked, with_values


def takes_command(law: AbstractDamper) -> bool:
    """Whether the law or a law inside has a command.

    Arguments:
        law: the damper law.
    """
    return bool(command_paths(law))


def with_command(law: AbstractDamper, command: ScalarLike) -> AbstractDamper:
    """The same law at another command, in the law itself and in all laws inside.

    Arguments:
        law: the damper law.
        command: coil current, voltage or clicks, in the unit of the law's command.

    >>> from jaxdamp.dampers import Lag, ModifiedBoucWen
    >>> law = with_command(Lag(ModifiedBoucWen.prototype(), 0.002), 1.5)
    >>> float(law.law.voltage)
    1.5

    A command outside the range of the fitted records gives an `OutsideFittedRangeWarning`; one outside the levels of a
    `Scheduled` law is refused (inside compiled code the nearest level is used).

    Raises:
        ValueError: a law without a command; a command outside its domain.
    """
    check_module("law", law, (AbstractDamper,), "with_command(law, command)")
    paths = command_paths(law)
    if not paths:
        remedy = "`ModifiedBoucWen` takes a voltage; `Scheduled` makes any law depend on a command."
        _checks.refuse("law", "take a command", f"{law}, which takes none", remedy)
    value = as_float(command)
    changed = checked(with_values(law, dict.fromkeys(paths, value)))
    if not is_traced(changed):
        uses = [use for use in range_use(changed, Motion()) if use.quantity == "command"]
        warn_outside([sentence(type(law).__name__, uses)])
    return changed

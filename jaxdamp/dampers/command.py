"""Laws that take a command: a voltage, a coil current, the click of an adjuster."""

import numpy as np
from jaxtyping import ArrayLike

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._traced import is_traced
from jaxdamp._types import ScalarLike
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.inside import command_paths
from jaxdamp.dampers.range_use import range_use, sentence, warn_outside
from jaxdamp.dampers.scheduled import Scheduled
from jaxdamp.parameters import as_float, checked, modules_inside, with_values


TAKING = "`ModifiedBoucWen` takes a voltage; `Scheduled` makes any law depend on a command."
NOISE = 0.05  # of the range of the levels, up to which a measured command may lie outside


def takes_command(law: AbstractDamper) -> bool:
    """Whether the law or a law inside has a command.

    Arguments:
        law: the damper law.
    """
    return bool(command_paths(law))


def at_command(law: AbstractDamper, command: ScalarLike) -> AbstractDamper:
    """`with_command` without its checks, for use inside compiled functions.

    Arguments:
        law: a law that takes a command.
        command: in the unit of the law's command; beyond the levels of a `Scheduled` law the nearest level is used.
    """
    return with_values(law, dict.fromkeys(command_paths(law), as_float(command)))


def check_commands(argument: str, law: AbstractDamper, commands: ArrayLike) -> None:
    """Refuse commands that a law cannot have, or cannot be expected to have; warn of those outside its fitted range.

    Noise up to a twentieth of the range of the levels of a `Scheduled` law beyond the outer ones is taken as them.

    Arguments:
        argument: its name in messages.
        law: the damper law.
        commands: in the unit of the law's command, of any shape; traced ones cannot be checked.

    Raises:
        ValueError: a law without a command; commands that are not finite, or outside of the levels or the domain.
    """
    if not takes_command(law):
        _checks.refuse(argument, "be left out beside a law that takes none", repr(law), TAKING)
    concrete = _checks.concrete(commands)
    if concrete is None:
        return
    _checks.finite(argument, concrete)
    lowest, highest = float(concrete.min()), float(concrete.max())
    for levels in [_checks.concrete(s.levels) for _, s in modules_inside(law) if isinstance(s, Scheduled)]:
        if levels is None:
            continue
        slack = NOISE * (levels[-1] - levels[0])
        if lowest < levels[0] - slack or highest > levels[-1] + slack:
            must = f"stay between the levels {levels[0]:g} and {levels[-1]:g} of the law"
            given = f"{lowest:g}" if lowest == highest else f"from {lowest:g} to {highest:g}"
            _checks.refuse(argument, must, given, "Or add a law at a level further out.")
        lowest, highest = (float(np.clip(end, levels[0], levels[-1])) for end in (lowest, highest))
    for end in (lowest, highest):
        with_command(law, end)


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
        _checks.refuse("law", "take a command", f"{law}, which takes none", TAKING)
    value = as_float(command)
    changed = checked(with_values(law, dict.fromkeys(paths, value)))
    if not is_traced(changed):
        uses = [use for use in range_use(changed, Motion()) if use.quantity == "command"]
        warn_outside([sentence(type(law).__name__, uses)])
    return changed

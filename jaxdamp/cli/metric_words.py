"""What metrics, limits, bounds and axes are called on the command line."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp.report import GOALS, goal_metrics
from jaxdamp.vehicles import AbstractVehicle


GRIP = "+10%"  # how much more a tyre load may vary after a tuning, by default


def metric_names(option: str, word: str, vehicle: AbstractVehicle, *, white: bool) -> list[str]:
    """The ride metrics that a word means: comfort, travel, grip, or the name of one.

    Comfort is the weighted RMS acceleration of the body; travel the working space of every suspension, peak to peak, on
    a white road its RMS; grip the RMS variation of the load of every tyre.

    Raises:
        ValueError: a word that is neither.
    """
    layout = vehicle.layout
    if word not in GOALS:
        _checks.one_of(option, word, [*GOALS, *(m.name for m in layout.metrics)])
        return [word]
    return goal_metrics(layout, word, white=white)


def objective_word(word: str, vehicle: AbstractVehicle, *, white: bool) -> str | Callable[[Mapping[str, Any]], Any]:
    """The metric to minimise; of several, their mean."""
    names = metric_names("minimise", word, vehicle, white=white)
    if len(names) == 1:
        return names[0]

    def mean_of_all(m: Mapping[str, Any]) -> Any:
        return sum(m[name] for name in names) / len(names)

    mean_of_all.__name__ = word
    return mean_of_all


def limit_words(texts: Sequence[str], vehicle: AbstractVehicle, *, white: bool) -> dict[str, Any]:
    """The limits of "travel=0.1", "maximum_x=-0.1:0.2" or "grip=+10%"; a word that means several metrics limits each.

    "grip=none" is no limit.
    """
    found = {}
    for word, value in pairs("limit", texts):
        for name in metric_names("limit", word, vehicle, white=white):
            if value != "none":
                lower, upper = limit_span(value)
                found[name] = upper if lower is None else (lower, upper)
    return found


def default_limits(
    texts: Sequence[str], goal: str, vehicle: AbstractVehicle, *, white: bool
) -> tuple[dict[str, str], str]:
    """The limit of grip that a tuning has by default, and a sentence that says so.

    There is none where grip is minimised, or where the limits name grip or one of its metrics.
    """
    grip = metric_names("limit", "grip", vehicle, white=white)
    named = {word for word, _ in pairs("limit", texts)} | {goal}
    if named & {"grip", *grip}:
        return {}, ""
    words = f"Limited by default: grip (RMS variation of each tyre load) to {GRIP} of the start"
    return dict.fromkeys(grip, GRIP), f"{words}; --limit grip=none removes it."


def pairs(option: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    """What "a=1,b=2" assigns, also from several texts.

    >>> pairs("limit", ["travel=0.1,grip=900", "comfort=1"])
    [('travel', '0.1'), ('grip', '900'), ('comfort', '1')]
    """
    found = []
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not value:
            _checks.refuse(option, "read like NAME=VALUE", repr(part))
        if name in (known for known, _ in found):
            _checks.refuse(option, "name each thing once", f"twice {name!r}")
        found.append((name, value))
    return found


def limit_span(text: str) -> tuple[float | str | None, float | str | None]:
    """The ends of a limit, each a number or relative to the start.

    >>> limit_span("+10%"), limit_span("0.05:+20%")
    ((None, '+10%'), (0.05, '+20%'))
    """
    parts = [part.strip() for part in text.split(":")]
    if not any(part.endswith("%") for part in parts) or len(parts) > 2:
        return span("limit", text)
    ends = [part if part.endswith("%") else span("limit", part)[1] if part else None for part in parts]
    return (None, ends[0]) if len(ends) == 1 else (ends[0], ends[1])


def span(option: str, text: str) -> tuple[float | None, float | None]:
    """The ends of "0.1" (an upper one alone), "0.05:0.1" or "0.05:".

    >>> span("limit", "0.05:"), span("limit", "3")
    ((0.05, None), (None, 3.0))
    """
    ends = text.split(":")
    try:
        numbers = [float(end) if end.strip() else None for end in ends]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2) or not any(number is not None for number in numbers):
        _checks.refuse(option, "be a number, or two as LOWER:UPPER", repr(text))
    return (None, numbers[0]) if len(numbers) == 1 else (numbers[0], numbers[1])


def axis_words(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """The axes of a sweep: "damper.rate=1000:8000:15" are 15 values, "sprung_mass=1000;1200" two.

    >>> {name: values.tolist() for name, values in axis_words(["rate=1000:2000:3", "mass=1;2"]).items()}
    {'rate': [1000.0, 1500.0, 2000.0], 'mass': [1.0, 2.0]}
    """
    found = {}
    for name, text in pairs("over", texts):
        parts = text.split(":")
        try:
            if len(parts) == 3:
                found[name] = np.linspace(float(parts[0]), float(parts[1]), int(parts[2]))
            else:
                found[name] = np.array([float(number) for number in text.split(";")])
        except ValueError:
            _checks.refuse("over", "read like NAME=FIRST:LAST:COUNT or NAME=A;B;C", f"{name}={text}")
        if not found[name].size:
            _checks.refuse("over", "have one value or more on each axis", f"{name}={text}")
    if not found:
        _checks.refuse("over", "name one axis or more", "none", "Write --over damper.rate=1000:8000:15.")
    return found

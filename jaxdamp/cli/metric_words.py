"""What metrics, limits, bounds and axes are called on the command line."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp.report import GOALS, goal_metrics
from jaxdamp.vehicles import AbstractVehicle


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
    """The limits of "travel=0.1" or "maximum_x=-0.1:0.2"; a word that means several metrics limits each."""
    found = {}
    for word, value in pairs("limit", texts):
        for name in metric_names("limit", word, vehicle, white=white):
            lower, upper = span("limit", value)
            found[name] = upper if lower is None else (lower, upper)
    return found


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

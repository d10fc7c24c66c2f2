"""Limits of ride metrics and of parameters as a shop writes them: in SI, or in a unit of its own."""

from collections.abc import Iterable, Mapping

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._tables import typeset_unit
from jaxdamp.bench import ratio
from jaxdamp.cli.words import Axis, Bound, Limit, quantity
from jaxdamp.parameters import match_paths, named_parameters
from jaxdamp.vehicles import AbstractVehicle


GRAVITY = {"g": "g_0"}  # of accelerations, where it is no gram


def in_si(limits: Mapping[str, Limit], car: AbstractVehicle, *, white: bool) -> tuple[dict[str, Limit], list[str]]:
    """Limits by short name or ride metric with their ends in SI; and what they are, where that is not as written."""
    units, limits_in_si, said = {m.name: m.unit(car.units) for m in car.ride_metrics}, dict[str, Limit](), list[str]()
    for word, span in limits.items():
        _checks.one_of("limit", word, car.metric_words)
        unit = units.get(car.goal_metrics(word, white=white)[0], "")
        ends = span if isinstance(span, tuple) else (None, span)
        si = (_in_si("limit", word, ends[0], unit), _in_si("limit", word, ends[1], unit))
        limits_in_si[word] = si if isinstance(span, tuple) else si[1]
        shown, numbers = display().of(unit), [end for end in si if isinstance(end, float)]
        if numbers and (si != ends or shown.unit != unit):
            text = " to ".join(f"{shown(number):.4g}" for number in numbers)
            said.append(f"Limit of {word}: {text} {typeset_unit(shown.unit)}".rstrip())
    return limits_in_si, said


def bounds_in_si(bounds: Mapping[str, tuple[Bound, Bound]], models: Iterable[object]) -> dict[str, tuple[Bound, ...]]:
    """Bounds of parameters by path, last part or pattern, with their ends in SI."""
    with_unit = [name for name, span in bounds.items() if any(isinstance(end, str) for end in span)]
    of = {name: unit_of(name, bounds, *models) for name in with_unit}
    return {name: tuple(_in_si("bound", name, end, of.get(name, "")) for end in span) for name, span in bounds.items()}


def unit_of(name: str, names: Iterable[str], *models: object) -> str:
    """The unit of the first parameter that one of these names means."""
    units = {p.path: p.unit for model in models for p in named_parameters(model, names)}
    return units[match_paths(list(units), [name])[0]]


def axes_in_si(over: Mapping[str, Axis], car: AbstractVehicle) -> dict[str, np.ndarray]:
    """The axes of a sweep by path, last part or pattern, in SI."""
    axes = dict[str, np.ndarray]()
    for name, (values, written) in over.items():
        unit = unit_of(name, over, car) if written else ""
        factor = ratio(written, unit) if written else 1.0
        if factor is None:
            _checks.refuse("over", f"be in a unit of {name}, such as {unit or 'none'}", repr(written))
        axes[name] = factor * values
    return axes


def _in_si(option: str, word: str, end: Bound, unit: str) -> Bound:
    """One end: a number in SI, or as it is if it is none or relative."""
    stated = quantity(end) if isinstance(end, str) else None
    if stated is None:
        return end
    number, written = stated
    factor = ratio(GRAVITY.get(written, written) if unit == "m/s^2" else written, unit) if unit else None
    if factor is None:
        _checks.refuse(option, f"be in a unit of {word}, such as {unit or 'none'}", repr(end))
    return number * factor

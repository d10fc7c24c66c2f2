"""Points of a sweep at which a parameter of a module is outside its domain."""

import dataclasses
from collections.abc import Callable, Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxdamp.parameters import Domain, DomainOf, get, match_parameters, named_parameters


Columns = Mapping[str, np.ndarray]


def outside_domains(tree: PyTree, columns: Columns) -> np.ndarray:
    """The reason why a law or a vehicle refuses each of many points; an empty text for allowed points.

    Arguments:
        tree: a law, a vehicle or any module.
        columns: a number for each point by parameter (names as in `jaxdamp.parameters.replace`), all equally long.
            Vector parameters are not checked.

    Returns:
        Texts, one for each point, such as "damper.rate must be positive [N s/m]".

    >>> from jaxdamp.dampers import Linear
    >>> print(*outside_domains(Linear(1500.0), {"rate": np.array([-1.0, 2000.0])}), sep=";")
    rate must be positive [N s/m];
    """
    every = named_parameters(tree, columns)
    of_path = {p.path: p for p in every}
    named = {path: np.asarray(column) for name, column in columns.items() for path in match_parameters(every, [name])}
    by_path = {path: column for path, column in named.items() if of_path[path].value.ndim == 0}
    reasons = np.full(len(next(iter(named.values()))), "", dtype=object)
    for path, column in by_path.items():
        p, (owner, _, name) = of_path[path], path.rpartition(".")
        if name not in _domains_by_value(get(tree, owner)):  # which follows from the other values of its module
            unit = f" [{p.unit}]" if p.unit else ""
            reasons[(reasons == "") & ~_inside(p.domain, column)] = f"{path} must be {p.domain.name}{unit}"
    for prefix in dict.fromkeys(above for path in by_path for above in _above(path)):
        start = f"{prefix}." if prefix else ""
        below = {path.removeprefix(start): c for path, c in by_path.items() if path.startswith(start)}
        _judge_together(get(tree, prefix), start, below, reasons)
    return reasons


def _inside(domain: Domain, column: np.ndarray) -> np.ndarray:
    """Which numbers a domain contains."""
    if domain.contains(column):
        return np.ones(len(column), bool)
    values, places = np.unique(column, return_inverse=True)
    return np.array([domain.contains(np.asarray(value)) for value in values], bool)[places]


def _above(path: str) -> list[str]:
    """The modules that a parameter lies in, the outermost, with an empty path, first."""
    parts = path.split(".")
    return [".".join(parts[:count]) for count in range(len(parts))]


def _domains_by_value(module: PyTree) -> dict[str, Callable[[PyTree], Domain]]:
    """The domains that are functions of the module, by field."""
    fields = dataclasses.fields(module) if dataclasses.is_dataclass(module) else ()
    declared = {f.name: f.metadata.get("parameter") or f.metadata.get("setting") or {} for f in fields}
    domains: dict[str, DomainOf | None] = {name: has.get("domain") for name, has in declared.items()}
    return {name: domain for name, domain in domains.items() if callable(domain) and not isinstance(domain, Domain)}


def _judge_together(module: PyTree, start: str, below: Columns, reasons: np.ndarray) -> None:
    """Enter what is wrong between several values of one module: each different combination is looked at once.

    Conditions of a module stand in a `__check_init__` of its class and never pass what is not a number. One that takes
    NaN everywhere does not look at these values, and is not asked again.
    """
    check = type(module).__dict__.get("__check_init__")
    varying = _domains_by_value(module)
    place = _Placed(module, list(below))
    if check is not None and not _refusal(check, place.at(np.full(len(below), np.nan))):
        check = None
    if check is None and not varying:
        return
    left = np.flatnonzero(reasons == "")
    rows, places = np.unique(np.stack([c[left] for c in below.values()], axis=1), axis=0, return_inverse=True)
    verdicts = np.full(len(rows), "", dtype=object)
    for i, row in enumerate(rows):
        changed = place.at(row)
        domains = {name: domain(changed) for name, domain in varying.items()}
        wrong = [name for name, domain in domains.items() if not domain.contains(np.asarray(get(changed, name)))]
        if wrong:
            verdicts[i] = f"{start}{wrong[0]} must be {domains[wrong[0]].name}"
        elif check is not None:
            verdicts[i] = _refusal(check, changed)
    reasons[left] = verdicts[places.ravel()]


def _refusal(check: Callable[[PyTree], object], module: PyTree) -> str:
    """What a check says, without the value; nothing if it passes."""
    try:
        check(module)
    except ValueError as error:
        return str(error).partition(", but is ")[0].removeprefix("Argument ").replace("`", "")
    return ""


class _Placed:
    """A module with places to set values at, quickly and without checks."""

    def __init__(self, module: PyTree, paths: list[str]) -> None:
        marks = [object() for _ in paths]
        leaves, self._tree = jax.tree.flatten(eqx.tree_at(lambda m: [get(m, path) for path in paths], module, marks))
        self._leaves = leaves
        self._places = [next(i for i, leaf in enumerate(leaves) if leaf is mark) for mark in marks]

    def at(self, values: np.ndarray) -> PyTree:
        """The module with these values."""
        leaves = list(self._leaves)
        for place, value in zip(self._places, values, strict=True):
            leaves[place] = jnp.asarray(value)
        return jax.tree.unflatten(self._tree, leaves)

"""Parameters: a value with its unit, its physical domain and one line of meaning, declared beside the field.

    class Linear(AbstractMemoryless):
        rate: Scalar = parameter("N s/m", "damping coefficient", positive)

Fits, tables, plot labels and reports all read that one declaration. A *path* such as `"damper.terms.0.rate"` names a
parameter inside a composition. Freezing and extra bounds are arguments of a fit or of a tuning, never of the law.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._domains import (
    Domain,
    around_zero,
    ends,
    increasing,
    increasing_negative,
    interval,
    nonnegative,
    ordered_interval,
    positive,
    real,
    weight,
)
from jaxdamp._field_types import check_field_types


__all__ = [
    "Domain",
    "FreeParameters",
    "Parameter",
    "around_zero",
    "as_float",
    "check_invariants",
    "check_parameters",
    "ends",
    "free_parameters",
    "get",
    "increasing",
    "increasing_negative",
    "interval",
    "match_paths",
    "name_patterns",
    "nonnegative",
    "ordered_interval",
    "parameter",
    "parameters",
    "positive",
    "readable",
    "real",
    "replace",
    "setting",
    "weight",
]


def as_float(value: Any, name: str = "value") -> Array:
    """A JAX array of the default float type; arrays that are floating already keep their type.

    Raises:
        ValueError: something that is no number, under the name of its argument.
    """
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        return value
    if value is None or isinstance(value, str | bytes | type | eqx.Module):
        _checks.refuse(name, "be a number", _checks.described(value))
    try:
        return jnp.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        if isinstance(value, list | tuple | dict | set | np.ndarray):
            raise ValueError(f"Argument `{name}` must be numbers, but is {value!r}: {error}") from error
        raise


def parameter(
    unit: str, meaning: str, domain: Domain | Callable[[Any], Domain] = real, *, linear: bool = False, **field: Any
) -> Any:
    """Declare a field of an equinox module to be a parameter.

    Arguments:
        unit: SI unit in words that pint reads, `""` for a pure number.
        meaning: one line for tables and labels.
        domain: the values it may take; a function of the instance where that depends on a setting.
        linear: the law's force is linear in all its parameters marked so, so that a fit has a closed form.
        field: passed on to `equinox.field`, such as `default=0.0`.
    """
    return _number("parameter", {"unit": unit, "meaning": meaning, "domain": domain, "linear": linear}, field)


def setting(unit: str, meaning: str, domain: Domain = real, *, command: bool = False, **field: Any) -> Any:
    """Declare a field that is a number with a unit but never changed by a fit or a tuning, such as a knee width.

    A `command` is set from outside, run by run, such as a coil current (`dampers.with_command`).
    """
    return _number("setting", {"unit": unit, "meaning": meaning, "domain": domain, "command": command}, field)


def _number(kind: str, declared: dict[str, Any], options: dict[str, Any]) -> Any:
    """A field that makes arrays of numbers, and names itself where it is given something else."""

    def convert(value: Any) -> Array:
        return as_float(value, made.name)

    made = eqx.field(converter=convert, metadata={kind: declared}, **options)
    return made


class Parameter(eqx.Module):
    """One parameter of a tree, as `parameters` lists it."""

    path: str = eqx.field(static=True)
    value: Any
    unit: str = eqx.field(static=True)
    meaning: str = eqx.field(static=True)
    domain: Domain = eqx.field(static=True)
    linear: bool = eqx.field(static=True)


def parameters(tree: Any, prefix: str = "") -> list[Parameter]:
    """All parameters of a law, vehicle or any other module, depth first in the order of their fields.

    >>> from jaxdamp.dampers import Lag, Linear
    >>> [(p.path, p.unit, float(p.value)) for p in parameters(Lag(Linear(1500.0), lag_time=0.004))]
    [('law.rate', 'N s/m', 1500.0), ('lag_time', 's', 0.004)]
    """
    found = []
    if isinstance(tree, tuple | list):
        for index, item in enumerate(tree):
            found += parameters(item, f"{prefix}{index}.")
    elif isinstance(tree, eqx.Module):
        for field in dataclasses.fields(tree):
            value = getattr(tree, field.name)
            declared = field.metadata.get("parameter")
            if declared is None:
                found += parameters(value, f"{prefix}{field.name}.")
            else:
                domain = declared["domain"]
                domain = domain if isinstance(domain, Domain) else domain(tree)
                found.append(
                    Parameter(
                        prefix + field.name, value, declared["unit"], declared["meaning"], domain, declared["linear"]
                    )
                )
    return found


def check_parameters(module: eqx.Module) -> None:
    """Refuse fields of another kind than their annotation and values outside their domain (traced values pass).

    Modules call it in `__check_init__`.
    """
    check_field_types(module)
    for field in dataclasses.fields(module):
        declared = field.metadata.get("parameter") or field.metadata.get("setting")
        value = _checks.concrete(getattr(module, field.name)) if declared else None
        if declared is None or value is None:
            continue
        argument = f"{type(module).__name__}.{field.name}"
        _checks.finite(argument, value)
        domain = declared["domain"]
        domain = domain if isinstance(domain, Domain) else domain(module)
        if not domain.contains(value):
            unit = f" [{declared['unit']}]" if declared["unit"] else ""
            _checks.refuse(argument, f"be {domain.name}{unit}", value, f"It is the {declared['meaning']}.")


def readable(module: eqx.Module) -> str:
    """The module as a line with its numbers: `Lag(law=Linear(rate=1500.0), lag_time=0.004)`."""

    def text(value: Any) -> str:
        if isinstance(value, tuple | list):
            return f"({', '.join(map(text, value))}{',' if len(value) == 1 else ''})"
        if isinstance(value, jax.Array | np.ndarray):
            numbers = _checks.concrete(value)
            return eqx.tree_pformat(value) if numbers is None or numbers.size > 50 else repr(numbers.tolist())
        return repr(value)

    fields = [f"{field.name}={text(getattr(module, field.name))}" for field in dataclasses.fields(module) if field.repr]
    return f"{type(module).__name__}({', '.join(fields)})"


def get(tree: Any, path: str) -> Any:
    """The value at a path such as `"damper.terms.0.rate"`."""
    for part in path.split(".") if path else []:
        tree = tree[int(part)] if isinstance(tree, tuple | list) else getattr(tree, part)
    return tree


def replace(tree: Any, values: Mapping[str, Any]) -> Any:
    """The same tree with other values at the given paths (last parts and patterns as in `free_parameters`).

    Values outside their domain are refused, and so is what a module on the path refuses when it is built: a condition
    between several of its parameters, or one that a wrapper puts on the law inside.

    >>> from jaxdamp.dampers import Linear
    >>> float(replace(Linear(1500.0), {"rate": 2000.0}).rate)
    2000.0
    """
    known = [p.path for p in parameters(tree)]
    chosen = {path: as_float(value) for name, value in values.items() for path in match_paths(known, [name])}
    changed = eqx.tree_at(lambda t: [get(t, path) for path in chosen], tree, list(chosen.values()))
    for place in _places(chosen):
        check_invariants(get(changed, place))
    return changed


def _places(paths: Iterable[str]) -> list[str]:
    """The paths of all modules that hold these parameters, innermost first."""
    held = {".".join(parts[:count]) for parts in (path.split(".") for path in paths) for count in range(len(parts))}
    return sorted(held, key=lambda place: (-len(place.split(".")), place == "", place))


def check_invariants(module: Any) -> None:
    """Run the checks that a module's constructor runs, for one whose values were replaced.

    Those of the base classes come first, so that a value outside its domain is named before what follows from it.
    """
    for kind in reversed(type(module).__mro__):
        if "__check_init__" in kind.__dict__:
            kind.__dict__["__check_init__"](module)


def match_paths(known: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The known paths that patterns name: exactly, by their last part, or with `*`."""
    chosen = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        hits = [p for p in known if fnmatchcase(p, pattern)] or [p for p in known if fnmatchcase(p, f"*.{pattern}")]
        if not hits:
            near = get_close_matches(pattern, list(known) + [p.rsplit(".", 1)[-1] for p in known], 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"No parameter is named {pattern!r}: {hint}The parameters are {', '.join(known)}.")
        chosen += [p for p in hits if p not in chosen]
    return [p for p in known if p in chosen]


def name_patterns(argument: str, names: Any) -> list[str]:
    """Names or patterns of parameters as a list.

    Raises:
        ValueError: anything else, such as a mapping to values, which would be ignored.
    """
    if isinstance(names, Mapping):
        remedy = "It takes no values: set those by `jaxdamp.parameters.replace`, and ranges by `bounds`."
        _checks.refuse(argument, "be names of parameters", repr(names), remedy)
    listed = [names] if isinstance(names, str) else list(names) if isinstance(names, Iterable) else None
    if listed is None or not all(isinstance(name, str) for name in listed):
        remedy = "Write ['damper.rate'], or a pattern such as ['damper.*_rate']."
        _checks.refuse(argument, "be names of parameters", repr(names), remedy)
    return listed


class FreeParameters(eqx.Module):
    """The free parameters of a tree as one vector, and back.

    Made by `free_parameters`. `values` are physical, `raw` are unconstrained; both are flat vectors in the order of
    `names` (one name for each number: `"slopes[2]"` for an element of a vector).
    """

    tree: Any
    chosen: tuple[Parameter, ...]
    scales: tuple[Array, ...]

    @property
    def names(self) -> list[str]:
        """One name for each number."""
        return [p.path if p.value.ndim == 0 else f"{p.path}[{i}]" for p in self.chosen for i in range(p.value.size)]

    @property
    def values(self) -> Float[Array, " free"]:
        """The physical values as one vector."""
        return jnp.concatenate([jnp.ravel(p.value) for p in self.chosen])

    @property
    def raw(self) -> Float[Array, " free"]:
        """The unconstrained values as one vector."""
        return jnp.concatenate(
            [jnp.ravel(p.domain.to_raw(p.value, s)) for p, s in zip(self.chosen, self.scales, strict=True)]
        )

    def _split(self, vector: Array) -> list[Array]:
        ends = np.cumsum([p.value.size for p in self.chosen])[:-1]
        pieces = jnp.split(vector, ends)
        return [piece.reshape(p.value.shape) for piece, p in zip(pieces, self.chosen, strict=True)]

    def physical(self, raw: Float[Array, " free"]) -> Float[Array, " free"]:
        """Unconstrained vector to physical vector."""
        pieces = zip(self.chosen, self.scales, self._split(raw), strict=True)
        return jnp.concatenate([jnp.ravel(p.domain.from_raw(piece, s)) for p, s, piece in pieces])

    def build(self, values: Float[Array, " free"]) -> Any:
        """The tree with these physical values."""
        paths = [p.path for p in self.chosen]
        return eqx.tree_at(lambda t: [get(t, p) for p in paths], self.tree, self._split(values))

    def started_at(self, values: Float[np.ndarray, " free"]) -> "FreeParameters":
        """The same parameters with other values to start from."""
        ends = np.cumsum([p.value.size for p in self.chosen])[:-1]
        pieces = zip(self.chosen, np.split(values, ends), strict=True)
        placed = [jnp.asarray(piece.reshape(p.value.shape), p.value.dtype) for p, piece in pieces]
        chosen = tuple(eqx.tree_at(lambda p: p.value, p, piece) for p, piece in zip(self.chosen, placed, strict=True))
        tree = eqx.tree_at(lambda t: [get(t, p.path) for p in chosen], self.tree, placed)
        return FreeParameters(tree, chosen, tuple(_scale(p) for p in chosen))

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limit of each number, as its domain or an extra bound gives them."""
        lower = np.concatenate([np.full(p.value.size, p.domain.lower) for p in self.chosen])
        upper = np.concatenate([np.full(p.value.size, p.domain.upper) for p in self.chosen])
        return lower, upper


def _scale(p: Parameter) -> Array:
    value = jax.lax.stop_gradient(p.value)
    if p.domain.steps is not None:
        value = p.domain.steps(value)
    magnitude = jnp.abs(value)
    largest = jnp.max(magnitude, initial=0.0)
    floor = jnp.maximum(1e-3 * largest, jnp.finfo(value.dtype).tiny)
    return jnp.where(magnitude > floor, magnitude, jnp.where(largest == 0, 1.0, largest))


def _limits_by_path(
    known: Sequence[str], free: Sequence[str], bounds: Mapping[str, Any]
) -> dict[str, tuple[float, float]]:
    """Extra limits by path, checked. Of two names for one parameter the later counts."""
    if not isinstance(bounds, Mapping):
        _checks.refuse("bounds", "be a mapping as {'rate': (1000.0, 5000.0)}", repr(bounds))
    limits = {}
    for name, pair in bounds.items():
        if np.shape(pair) != (2,) or not np.all(np.isfinite(pair)) or not pair[0] < pair[1]:
            remedy = "A side that should stay open gets a number that is never reached."
            _checks.refuse(f"bounds[{name!r}]", "be two finite numbers in increasing order", pair, remedy)
        named = match_paths(known, [name])
        if free and not set(named) & set(free):
            remedy = "Take it out of `freeze`, or leave out its bounds: what stays as it is needs none."
            _checks.refuse(f"bounds[{name!r}]", "bound a parameter that is free", "one that is not", remedy)
        limits |= dict.fromkeys(named, (float(pair[0]), float(pair[1])))
    return limits


def free_parameters(
    tree: Any,
    *,
    over: Sequence[str] | None = None,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> FreeParameters:
    """Choose the parameters that a fit or a tuning may change.

    Arguments:
        tree: a law, a vehicle or any module.
        over: paths, last parts of paths or patterns with `*`; all parameters if not given.
        freeze: the same, to be left as they are.
        bounds: extra limits `{path: (lower, upper)}` in the parameter's unit.

    Raises:
        ValueError: a name that fits no parameter; nothing left to change; bounds of a parameter that is not free, or of
            a wrong shape; a start value outside its bounds; a mapping where names belong.
    """
    all_parameters = parameters(tree)
    known = [p.path for p in all_parameters]
    keep = match_paths(known, name_patterns("over", over)) if over is not None else known
    frozen = match_paths(known, name_patterns("freeze", freeze))
    limits = _limits_by_path(known, [path for path in keep if path not in frozen], bounds or {})
    chosen = []
    for p in all_parameters:
        if p.path not in keep or p.path in frozen:
            continue
        if p.path in limits:
            lower, upper = limits[p.path]
            limited = interval if p.domain.steps is None else ordered_interval
            domain = limited(max(lower, p.domain.lower), min(upper, p.domain.upper))
            value = np.asarray(p.value)
            if not np.all((value > domain.lower) & (value < domain.upper)):
                remedy = "Start inside the bounds or widen them."
                _checks.refuse(p.path, f"start strictly {domain.name} [{p.unit}]", value, remedy)
            p = Parameter(p.path, p.value, p.unit, p.meaning, domain, p.linear)
        chosen.append(p)
    if not chosen:
        raise ValueError(f"All parameters are frozen, nothing is left to change: {', '.join(known)}.")
    return FreeParameters(tree, tuple(chosen), tuple(_scale(p) for p in chosen))

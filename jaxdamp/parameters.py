"""Parameters: a value with its unit, its physical domain and one line of meaning, declared beside the field.

    class Linear(AbstractMemoryless):
        rate: Scalar = parameter("N s/m", "damping coefficient", positive)

Fits, tables, plot labels and reports all read that one declaration. A *path* such as `"damper.terms.0.rate"` names a
parameter inside a composition. Freezing and extra bounds are arguments of a fit or of a tuning, never of the law.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks


@dataclasses.dataclass(frozen=True)
class Domain:
    """The values a parameter may take, and a smooth one-to-one map to them from the whole real line.

    `from_raw(raw, scale)` and `to_raw(value, scale)` are inverse to each other; `scale` is a typical magnitude, so
    that a raw step of one is a step of about the size of the parameter.
    """

    name: str
    contains: Callable[[np.ndarray], bool]
    from_raw: Callable[[Array, Array], Array]
    to_raw: Callable[[Array, Array], Array]
    lower: float = -np.inf
    upper: float = np.inf


def _inverse_softplus(y: Array) -> Array:
    return jnp.where(y > 30.0, y, jnp.log(jnp.expm1(jnp.minimum(y, 30.0))))


def _positive_to_raw(value: Array, scale: Array) -> Array:
    return _inverse_softplus(jnp.maximum(value / scale, 1e-12))


def _increasing_from_raw(raw: Array, scale: Array) -> Array:
    steps = jnp.concatenate([scale[:1] * raw[:1], scale[1:] * jax.nn.softplus(raw[1:])])
    return jnp.cumsum(steps)


def _increasing_to_raw(value: Array, scale: Array) -> Array:
    return jnp.concatenate([value[:1] / scale[:1], _inverse_softplus(jnp.diff(value) / scale[1:])])


def _increasing_from_raw_positive(raw: Array, scale: Array) -> Array:
    return jnp.cumsum(scale * jax.nn.softplus(raw))


def _increasing_to_raw_positive(value: Array, scale: Array) -> Array:
    return _inverse_softplus(jnp.diff(value, prepend=jnp.zeros(1, value.dtype)) / scale)


real = Domain("real", lambda a: True, lambda raw, scale: scale * raw, lambda value, scale: value / scale)
positive = Domain(
    "positive",
    lambda a: bool(np.all(a > 0)),
    lambda raw, scale: scale * jax.nn.softplus(raw),
    _positive_to_raw,
    lower=0.0,
)
# A value of exactly zero has no raw counterpart: a search from there starts at a hundredth of the scale.
nonnegative = dataclasses.replace(
    positive,
    name="not negative",
    contains=lambda a: bool(np.all(a >= 0)),
    to_raw=lambda value, scale: _inverse_softplus(jnp.maximum(value / scale, 1e-2)),
)
increasing = Domain(
    "strictly increasing", lambda a: bool(np.all(np.diff(a) > 0)), _increasing_from_raw, _increasing_to_raw
)
increasing_negative = Domain(
    "strictly increasing and negative",
    lambda a: bool(np.all(np.diff(a) > 0) and np.all(a < 0)),
    lambda raw, scale: -_increasing_from_raw_positive(raw, scale)[::-1],
    lambda value, scale: _increasing_to_raw_positive(-value[::-1], scale),
    upper=0.0,
)


@functools.lru_cache
def interval(lower: float, upper: float) -> Domain:
    """The open interval between two finite numbers (scaled logistic map)."""
    if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper):
        raise ValueError(f"Bounds must be two finite numbers in increasing order, but are ({lower}, {upper}).")
    width = upper - lower

    def to_raw(value: Array, scale: Array) -> Array:
        del scale
        share = jnp.clip((value - lower) / width, 1e-9, 1 - 1e-9)
        return jnp.log(share / (1 - share))

    return Domain(
        f"between {lower:g} and {upper:g}",
        lambda a: bool(np.all((a >= lower) & (a <= upper))),
        lambda raw, scale: lower + width * jax.nn.sigmoid(raw),
        to_raw,
        lower,
        upper,
    )


def as_float(value: Any) -> Array:
    """A JAX array of the default float type; arrays that are floating already keep their type."""
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        return value
    return jnp.asarray(value, dtype=float)


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
    metadata = {"unit": unit, "meaning": meaning, "domain": domain, "linear": linear}
    return eqx.field(converter=as_float, metadata={"parameter": metadata}, **field)


def setting(unit: str, meaning: str, domain: Domain = real, **field: Any) -> Any:
    """Declare a field that is a number with a unit but never changed by a fit or a tuning, such as a knee width."""
    metadata = {"unit": unit, "meaning": meaning, "domain": domain}
    return eqx.field(converter=as_float, metadata={"setting": metadata}, **field)


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
    """Refuse values outside their domain; called by modules in `__check_init__` (traced values pass)."""
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


def get(tree: Any, path: str) -> Any:
    """The value at a path such as `"damper.terms.0.rate"`."""
    for part in path.split("."):
        tree = tree[int(part)] if isinstance(tree, tuple | list) else getattr(tree, part)
    return tree


def replace(tree: Any, values: Mapping[str, Any]) -> Any:
    """The same tree with other values at the given paths.

    >>> from jaxdamp.dampers import Linear
    >>> float(replace(Linear(1500.0), {"rate": 2000.0}).rate)
    2000.0
    """
    known = [p.path for p in parameters(tree)]
    for path in values:
        match_paths(known, [path])
    paths = list(values)
    return eqx.tree_at(lambda t: [get(t, p) for p in paths], tree, [as_float(values[p]) for p in paths])


def match_paths(known: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The known paths that patterns name: exactly, by their last part, or with `*`."""
    chosen = []
    for pattern in patterns:
        hits = [p for p in known if fnmatchcase(p, pattern)] or [p for p in known if fnmatchcase(p, f"*.{pattern}")]
        if not hits:
            near = get_close_matches(pattern, list(known) + [p.rsplit(".", 1)[-1] for p in known], 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"No parameter is named {pattern!r}: {hint}The parameters are {', '.join(known)}.")
        chosen += [p for p in hits if p not in chosen]
    return [p for p in known if p in chosen]


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
        return [
            p.path if p.value.ndim == 0 else f"{p.path}[{i}]" for p in self.chosen for i in range(max(p.value.size, 1))
        ]

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

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limit of each number, as its domain or an extra bound gives them."""
        lower = np.concatenate([np.full(p.value.size, p.domain.lower) for p in self.chosen])
        upper = np.concatenate([np.full(p.value.size, p.domain.upper) for p in self.chosen])
        return lower, upper


def _scale(p: Parameter) -> Array:
    value = jax.lax.stop_gradient(p.value)
    if p.domain.name.startswith("strictly increasing"):
        value = jnp.diff(value, prepend=jnp.zeros(1, value.dtype))
    magnitude = jnp.abs(value)
    floor = jnp.maximum(1e-3 * jnp.max(magnitude, initial=0.0), jnp.finfo(value.dtype).tiny)
    return jnp.where(magnitude > floor, magnitude, jnp.where(jnp.all(magnitude == 0), 1.0, jnp.max(magnitude)))


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
        ValueError: a name that fits no parameter; nothing left to change; a start value outside its bounds.
    """
    all_parameters = parameters(tree)
    known = [p.path for p in all_parameters]
    keep = match_paths(known, over) if over is not None else known
    frozen = match_paths(known, freeze)
    limits: dict[str, tuple[float, float]] = {}
    for name, pair in (bounds or {}).items():
        for path in match_paths(known, [name]):
            limits[path] = pair
    chosen = []
    for p in all_parameters:
        if p.path not in keep or p.path in frozen:
            continue
        if p.path in limits:
            lower, upper = limits[p.path]
            domain = interval(max(lower, p.domain.lower), min(upper, p.domain.upper))
            value = np.asarray(p.value)
            if not np.all((value > domain.lower) & (value < domain.upper)):
                remedy = "Start inside the bounds or widen them."
                _checks.refuse(p.path, f"start strictly {domain.name} [{p.unit}]", value, remedy)
            p = Parameter(p.path, p.value, p.unit, p.meaning, domain, p.linear)
        chosen.append(p)
    if not chosen:
        raise ValueError(f"All parameters are frozen, nothing is left to change: {', '.join(known)}.")
    return FreeParameters(tree, tuple(chosen), tuple(_scale(p) for p in chosen))

"""The free parameters of a fit or a tuning as one vector; ties are parameters that share one value."""

import dataclasses
import re
from collections.abc import Collection, Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp.parameters._declaration import Parameter
from jaxdamp.parameters._domains import interval, ordered_interval
from jaxdamp.parameters._paths import (
    BY_NAME,
    check_by_name,
    expression,
    match_parameters,
    match_paths,
    name_patterns,
    named_parameters,
    with_values,
)


INSIDE = 0.02  # of the width of bounds, by which a start is moved inside


def resolve_ties(
    parameters: Sequence[Parameter], tie: Mapping[str, str] | None, *, move: bool = False
) -> dict[str, str]:
    """The path whose value each tied parameter takes.

    Arguments:
        parameters: all parameters of the tree.
        tie: names or patterns of the parameters that follow, each with the name or pattern of those they follow; what a
            `*` or `**` stands for must be the same on both sides. A name without `*` may lead several parameters.
        move: whether the values of partners may differ, as those of a start.

    Raises:
        ValueError: names that fit no parameter or no partner; a parameter tied twice or in a circle; partners of
            another unit, shape or domain, or with another value to start from.
    """
    by_path, leaders = {p.path: p for p in parameters}, {}
    for follower, leader in (tie or {}).items():
        candidates = match_paths(list(by_path), [leader])
        for path in match_paths(list(by_path), [follower]):
            partner = _partner(path, follower, leader, candidates)
            if partner == path:
                continue
            if leaders.setdefault(path, partner) != partner:
                remedy = f"It is tied to {leaders[path]} already."
                _checks.refuse(f"tie[{follower!r}]", f"tie {path} once", f"tied to {partner} too", remedy)
            _check_alike(f"tie[{follower!r}]", by_path[path], by_path[partner], values=not move)
    return {path: _last(path, leaders) for path in leaders}


def _wildcards(pattern: str, path: str) -> tuple[str, ...] | None:
    """What each `*` of a pattern stands for in a path that it matches, as a whole or by its last parts."""
    inner = expression(pattern)
    match = re.fullmatch(inner, path) or re.fullmatch(rf"(?:.*\.)?{inner}", path)
    return match and match.groups()


def _partner(path: str, follower: str, leader: str, candidates: Sequence[str]) -> str:
    """The parameter that one of the followers takes its value from."""
    chosen = candidates
    if "*" in leader:
        chosen = [c for c in candidates if _wildcards(leader, c) == _wildcards(follower, path)]
    if len(chosen) != 1:
        matches = f"{len(chosen)} of them, {', '.join(chosen)}" if chosen else "none"
        remedy = f"{BY_NAME['tie'][1]} The parameters that {leader!r} names are {', '.join(candidates)}."
        _checks.refuse(f"tie[{follower!r}]", f"name one parameter that {path} takes its value from", matches, remedy)
    return chosen[0]


def _check_alike(argument: str, follower: Parameter, leader: Parameter, *, values: bool) -> None:
    """Refuse to tie parameters that cannot have one value, or (`values`) that start from different ones."""

    def kind(p: Parameter) -> str:
        size = "one number" if p.value.ndim == 0 else f"numbers in shape {p.value.shape}"
        return f"{size}, {p.domain.name}" + f" [{p.unit}]" * bool(p.unit)

    if kind(follower) != kind(leader):
        both = f"{follower.path} is {kind(follower)}; {leader.path} is {kind(leader)}"
        _checks.refuse(argument, "tie parameters of one kind", f"of two: {both}")
    own: list[PyTree] = [_checks.concrete(p.value) for p in (follower, leader)]
    if values and not any(value is None for value in own) and not np.array_equal(*own):
        both = f"{follower.path} = {own[0]} and {leader.path} = {own[1]}"
        remedy = f"Set them equal first, with `jaxdamp.parameters.replace(..., {{{follower.path!r}: ...}})`."
        _checks.refuse(argument, "tie parameters that start from one value", f"of two: {both}", remedy)


def _last(path: str, leaders: Mapping[str, str]) -> str:
    """The end of a chain of ties."""
    seen = [path]
    while seen[-1] in leaders:
        seen.append(leaders[seen[-1]])
        if seen[-1] in seen[:-1]:
            _checks.refuse("tie", "not lead back to its own start", " -> ".join(seen), BY_NAME["tie"][1])
    return seen[-1]


class FreeParameters(eqx.Module):
    """The free parameters of a tree as one vector of physical values, from `free_parameters`.

    Attributes:
        tree: the law, vehicle or other module, with the values to start from.
        chosen: the free parameters in the order of the vector; of a group of tied ones, the one that the others follow.
        ties: tied parameters, each as (path, path that it takes its value from).
    """

    tree: PyTree
    chosen: tuple[Parameter, ...]
    ties: tuple[tuple[str, str], ...] = eqx.field(static=True, default=())

    @property
    def names(self) -> list[str]:
        """One name for each number: `"slopes[2]"` for an element of a vector."""
        return [name for p in self.chosen for name in _numbered(p.path, p)]

    @property
    def owners(self) -> list[Parameter]:
        """The parameter that each number belongs to."""
        return [p for p in self.chosen for _ in range(p.value.size)]

    @property
    def followers(self) -> list[tuple[str, ...]]:
        """The names of the numbers that are tied to each number."""
        tied = [[_numbered(path, p) for path, leader in self.ties if leader == p.path] for p in self.chosen]
        return [
            tuple(names[i] for names in group)
            for p, group in zip(self.chosen, tied, strict=True)
            for i in range(p.value.size)
        ]

    @property
    def values(self) -> Float[Array, " free"]:
        """The physical values as one vector."""
        if any(isinstance(p.value, Tracer) for p in self.chosen):
            return jnp.concatenate([jnp.ravel(p.value) for p in self.chosen])
        values = np.concatenate([np.ravel(p.value) for p in self.chosen])  # an operation of JAX would be compiled
        return jnp.asarray(values, values.dtype)

    def split(self, vector: Array | np.ndarray) -> list[PyTree]:
        """A vector of numbers cut into the shapes of the parameters."""
        ends = np.cumsum([p.value.size for p in self.chosen])[:-1]
        on_host = not isinstance(vector, Tracer)  # whose operations JAX would compile
        pieces = (np if on_host else jnp).split(np.asarray(vector) if on_host else vector, ends)
        shaped = [piece.reshape(p.value.shape) for piece, p in zip(pieces, self.chosen, strict=True)]
        return shaped if not isinstance(vector, Array) or not on_host else [jnp.asarray(a, a.dtype) for a in shaped]

    def build(self, values: Float[Array, " free"]) -> PyTree:
        """The tree with these physical values, unchecked."""
        return self._placed(self.split(values))

    def _placed(self, pieces: list[PyTree]) -> PyTree:
        by_path = {p.path: piece for p, piece in zip(self.chosen, pieces, strict=True)}
        return with_values(self.tree, by_path | {path: by_path[leader] for path, leader in self.ties})

    def started_at(self, values: Float[np.ndarray, " free"]) -> "FreeParameters":
        """The same parameters with other values to start from."""
        pairs = list(zip(self.chosen, self.split(values), strict=True))
        pieces = [jnp.asarray(piece, p.value.dtype) for p, piece in pairs]
        chosen = tuple(eqx.tree_at(lambda p: p.value, p, a) for (p, _), a in zip(pairs, pieces, strict=True))
        return FreeParameters(self._placed(pieces), chosen, self.ties)

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limit of each number, as its domain or an extra bound gives them."""
        return np.array([p.domain.lower for p in self.owners]), np.array([p.domain.upper for p in self.owners])


def _numbered(path: str, p: Parameter) -> list[str]:
    """A name for each number of a parameter."""
    return [path] if p.value.ndim == 0 else [f"{path}[{i}]" for i in range(p.value.size)]


def free_parameters(
    tree: object,
    *,
    over: Sequence[str] | None = None,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    move: bool = False,
) -> FreeParameters:
    """Choose the parameters that a fit or a tuning may change.

    Arguments:
        tree: a law, a vehicle or any module.
        over: paths, last parts of paths or patterns with `*` and `**` (`match_paths`); all parameters if not given. A
            command (a coil current, a click) is free only by its own name, as in `"**.command"`.
        freeze: names of parameters to hold at their values.
        bounds: extra limits `{path: (lower, upper)}` in the parameter's unit.
        tie: parameters that take the values of others, as `{"front.damper.**": "rear.damper.**"}`; `*` and `**` stand
            for the same text on both sides. A group of tied parameters is one free value: it is free if `over` names
            one of them, frozen if `freeze` names one of them, and the bounds of one apply to all.
        move: whether values outside their bounds, and tied ones that differ, are moved there instead of being refused,
            as those of a start.

    Raises:
        ValueError: a name that fits no parameter; nothing left to change; bounds of a parameter that is not free, or of
            a wrong shape; a start value outside its bounds; a mapping instead of names; ties of parameters that
            differ in unit, shape, domain or start value.

    >>> from jaxdamp.vehicles.presets import half_car_002
    >>> from jaxdamp.dampers import Linear
    >>> free_parameters(half_car_002(Linear(1000.0)), over=["rate"], tie={"front.*.rate": "rear.*.rate"}).names
    ['rear.damper.rate']
    """
    check_by_name("bounds", bounds)
    check_by_name("tie", tie)
    _checks.untraced("bounds", dict(bounds or {}), "Give plain numbers, which are known before a program is compiled.")
    names = ["**"] if over is None else name_patterns("over", over)
    all_parameters = _known(tree, names, tie)
    every_path = [p.path for p in all_parameters]
    if not every_path:
        remedy = "Declare its numbers by `parameter(unit, meaning)`; the weights of a network are trained by optax."
        _checks.refuse("law", "have parameters", f"a {type(tree).__name__} without", remedy)
    keep = match_parameters(all_parameters, names)
    frozen = match_paths(every_path, name_patterns("freeze", freeze))
    leaders = resolve_ties(all_parameters, tie, move=move)

    def group(paths: Sequence[str]) -> set[str]:
        return {leaders.get(path, path) for path in paths}

    free = group(keep) - group(frozen)
    limits = limits_by_path(every_path, free, leaders, bounds or {})
    linear = free - {leader for path, leader in leaders.items() if not all_parameters[every_path.index(path)].linear}
    chosen = [
        dataclasses.replace(p, domain=_limited(p, limits.get(p.path), move=move), linear=p.linear and p.path in linear)
        for p in all_parameters
        if p.path in free
    ]
    if not chosen:
        raise ValueError(f"All parameters are frozen, nothing is left to change: {', '.join(every_path)}.")
    begun = FreeParameters(tree, tuple(chosen), tuple(pair for pair in leaders.items() if pair[1] in free))
    return _moved_inside(begun, limits, move=move)


def _moved_inside(free: FreeParameters, bounded: Collection[str], *, move: bool) -> FreeParameters:
    """The same, values with bounds a little inside; an ordered vector that is not inside is spread over them."""
    if not move or not (bounded or free.ties):
        return free
    (lower, upper), values = free.limits(), np.array(free.values, float)
    width = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    least, most = lower + INSIDE * width, upper - INSIDE * width
    outside, begin = ~((values > lower) & (values < upper)), 0
    for p in free.chosen:
        here = slice(begin, begin := begin + p.value.size)
        outside[here] &= p.path in bounded
        if p.domain.ordered and np.any(outside[here]):
            values[here] = np.linspace(least[here][0], most[here][0], p.value.size)
    return free.started_at(np.where(outside, np.clip(values, least, most), values))


def _known(tree: object, names: Sequence[str], tie: Mapping[str, str] | None) -> list[Parameter]:
    """All parameters, and the commands that are named or tied."""
    return named_parameters(tree, [*names, *(tie or {}), *(tie or {}).values()])


def limits_by_path(
    paths: Sequence[str],
    free: Collection[str],
    leaders: Mapping[str, str],
    bounds: Mapping[str, tuple[float, float]],
) -> dict[str, tuple[float, float]]:
    """Extra limits by path, checked. If two names match a parameter, the later one counts.

    Arguments:
        paths: all paths.
        free: those that may change; a bound of another one is refused.
        leaders: the path whose value each tied parameter takes.
        bounds: a lower and an upper limit by name or pattern.
    """
    limits = {}
    for name, pair in bounds.items():
        ends = np.asarray(pair)
        numbers = ends.shape == (2,) and ends.dtype.kind in "iuf" and np.all(np.isfinite(ends))
        if not numbers or not pair[0] < pair[1]:
            remedy = "For a side without a limit, give a number that is never reached."
            _checks.refuse(f"bounds[{name!r}]", "be two finite numbers in increasing order", pair, remedy)
        named = [leaders.get(path, path) for path in match_paths(paths, [name])]
        if free and not {*free} & set(named):
            remedy = "Remove it from `freeze`, or leave out its bounds: frozen parameters need none."
            _checks.refuse(f"bounds[{name!r}]", "bound a parameter that is free", "one that is not", remedy)
        limits |= dict.fromkeys(named, (float(pair[0]), float(pair[1])))
    return limits


def _limited(p: Parameter, limits: tuple[float, float] | None, *, move: bool) -> PyTree:
    """The domain of a parameter within extra limits."""
    if limits is None:
        return p.domain
    value, ends = np.asarray(p.value), (max(limits[0], p.domain.lower), min(limits[1], p.domain.upper))
    least, most = np.array(ends, value.dtype)  # may be one number in its precision
    if not least < most:
        must, remedy = f"leave a range where {p.path} is {p.domain.name}", "Widen them, or `freeze` it instead."
        _checks.refuse(f"bounds[{p.path!r}]", must, limits, remedy)
    limited = ordered_interval if p.domain.ordered else interval
    domain = limited(*ends)
    if not move and not np.all((value > domain.lower) & (value < domain.upper)):
        remedy = "Start inside the bounds or widen them."
        _checks.refuse(p.path, f"start strictly {domain.name} [{p.unit}]", value, remedy)
    return domain

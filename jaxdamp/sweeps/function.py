"""What a function may say of itself to a sweep, and its trace: a program of arrays with a fingerprint."""

import functools
import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from typing import NamedTuple, Protocol, final, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal
from jaxtyping import Array, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import Mode, choose_mode, value_and_jacobian
from jaxdamp._types import Scalar
from jaxdamp._warned import warn
from jaxdamp.sweeps.axes import PARAMETER, POINT


PointFunction = Callable[[dict[str, Scalar]], Mapping[str, Array]]
Gradients = bool | Mode


@runtime_checkable
class HasUnits(Protocol):
    """A function that labels its results."""

    @property
    def units(self) -> Mapping[str, str]:
        """Units of results and axes by name."""
        ...


@runtime_checkable
class HasLanes(Protocol):
    """A function that knows its best batch."""

    @property
    def lanes(self) -> int:
        """How many points a CPU core computes best side by side."""
        ...


@runtime_checkable
class HasDerivatives(Protocol):
    """A function that not all derivatives may pass."""

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """The modes of differentiation that pass in a sweep; both pass a function that does not say."""
        ...


@runtime_checkable
class HasSideBySide(Protocol):
    """A function with a form for many points at a time."""

    def side_by_side(self) -> PointFunction:
        """That form, which is compiled in its place."""
        ...


@runtime_checkable
class HasSequence(Protocol):
    """A function whose program of one point compiles in a fraction of the time of that of many."""

    @property
    def sequential_points(self) -> int:
        """Up to how many points a CPU has sooner one after the other."""
        ...


@runtime_checkable
class HasReach(Protocol):
    """A function with a form for points all over a range."""

    def reaching(self, columns: Mapping[str, np.ndarray]) -> PointFunction:
        """The form for points among or between these values of the axes."""
        ...


@runtime_checkable
class HasPrinted(Protocol):
    """A function whose loop can be printed as C, which is faster."""

    def printed_side_by_side(self) -> PointFunction | None:
        """That form, for sweeps without derivatives; None if XLA is to compile it in any case."""
        ...

    @property
    def is_printed(self) -> bool:
        """Whether it has that form already."""
        ...


@runtime_checkable
class HasDomain(Protocol):
    """A function that not all points have."""

    def out_of_domain(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Why each of many points cannot be computed: a text for each, empty where it can."""
        ...


class SweepFunction(
    HasUnits, HasLanes, HasDerivatives, HasSideBySide, HasSequence, HasReach, HasPrinted, HasDomain, Protocol
):
    """A function that says all of it, as `jaxdamp.Ride` does."""

    def __call__(self, point: dict[str, Scalar]) -> Mapping[str, Array]:
        """The results by name at a point."""
        ...


def chosen_mode(
    function: object, gradients: bool | Mode, inputs: int, results: int, *, reversible: bool
) -> Mode | None:
    """The mode of differentiation: the one asked for, or the cheaper of those that pass; None for values alone.

    Raises:
        ValueError: a mode that the function does not pass.
    """
    if gradients is False:
        return None
    passing = function.derivatives if isinstance(function, HasDerivatives) else ("forward", "reverse")
    if not passing:
        remedy = (
            "Let a `Ride` have another engine, `simulation.Exponential()` or `simulation.Adaptive(mode='forward')`."
        )
        _checks.refuse("gradients", f"be left out for {function!r}, which passes none in a sweep", gradients, remedy)
    if gradients is not True:
        if gradients not in passing:
            remedy = f"Pass `gradients={passing[0]!r}`."
            _checks.refuse("gradients", f"be a mode that passes through {function!r}", repr(gradients), remedy)
        return gradients
    mode = choose_mode(inputs, results) if reversible else "forward"
    return mode if mode in passing else passing[0]


RESERVED = (POINT, PARAMETER, "failed", "reason", "done")


@final
class StaticPart:
    """A function without its arrays: `static.build(arrays)` gives it back. Equal parts compile to the same code."""

    def __init__(self, function: PyTree) -> None:
        leaves, self._tree = jax.tree.flatten(function)
        self._others = tuple(None if _is_array(leaf) else leaf for leaf in leaves)
        self._places = tuple(i for i, leaf in enumerate(leaves) if _is_array(leaf))
        self._key: object = (self._tree, self._places, tuple((type(leaf), leaf) for leaf in self._others))
        try:
            hash(self._key)
        except TypeError:  # what cannot be compared is compiled anew
            self._key = id(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StaticPart) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def build(self, arrays: list[Array]) -> Callable[[dict[str, Array]], PyTree]:
        """The function."""
        leaves = list(self._others)
        for place, array in zip(self._places, arrays, strict=True):
            leaves[place] = array
        return jax.tree.unflatten(self._tree, leaves)


def _is_array(leaf: object) -> bool:
    return isinstance(leaf, jax.Array) or (isinstance(leaf, np.ndarray) and leaf.dtype.kind in "biufc")


class Traced(NamedTuple):
    """A function of named axes, traced for one point."""

    static: StaticPart
    arrays: list[Array]
    axes: tuple[str, ...]
    results: dict[str, jax.ShapeDtypeStruct]  # of one point, derivatives among them
    slopes: dict[str, str]  # name of the derivative of each result that is differentiated
    mode: Mode | None
    fingerprint: Callable[[], str]


def number_type() -> np.dtype:
    """The default floating type of JAX, in which points are computed."""
    return jnp.zeros(()).dtype


def trace(function: Callable[[dict[str, Array]], PyTree], axes: list[str], gradients: bool | Mode) -> Traced:
    """Trace a function for one point and check what it returns.

    Raises:
        ValueError: the function asks for an axis that is not there, or returns no named numbers.
    """
    static = StaticPart(function)
    arrays = [leaf for leaf in jax.tree.leaves(function) if _is_array(leaf)]
    point = dict.fromkeys(axes, jax.ShapeDtypeStruct((), number_type()))

    order: list[str] = []  # of the results, which JAX sorts

    def one(arrays: list[Array], point: dict[str, Array]) -> dict[str, Array]:
        results = _named(static.build(arrays)(point), axes)
        order[:] = results
        return results

    try:
        jaxpr, shapes = jax.make_jaxpr(one, return_shape=True)(arrays, point)
    except KeyError as error:
        message = _unknown_axis(error, axes)
        if not message:
            raise
        raise ValueError(message) from error
    _warn_of_unused(jaxpr.jaxpr, axes)
    shapes = {name: shapes[name] for name in order}
    smooth = [name for name, s in shapes.items() if s.shape == () and jnp.issubdtype(s.dtype, jnp.floating)]
    slopes = {name: f"d_{name}" for name in smooth} if gradients else {}
    reversible = gradients is not True or not _loops_without_end(jaxpr)
    mode = chosen_mode(function, gradients, len(axes), len(slopes), reversible=reversible)
    results = _with_slopes(shapes, slopes, axes)
    return Traced(static, arrays, tuple(axes), results, slopes, mode, functools.partial(_fingerprint, jaxpr, arrays))


def _with_slopes(
    shapes: Mapping[str, jax.ShapeDtypeStruct], slopes: Mapping[str, str], axes: list[str]
) -> dict[str, jax.ShapeDtypeStruct]:
    """The results of one point as they are stored, and their derivatives."""
    results = {name: jax.ShapeDtypeStruct(s.shape, _stored(s.dtype)) for name, s in shapes.items()}
    for name, slope in slopes.items():
        if slope in results or slope in axes:
            _checks.refuse("function", f"leave the name {slope!r} to the derivative of {name!r}", "one that uses it")
        results[slope] = jax.ShapeDtypeStruct((len(axes),), results[name].dtype)
    return results


def _unknown_axis(error: KeyError, axes: list[str]) -> str:
    """What is wrong if the function asked for an axis that is not there; empty for another error."""
    wanted = error.args[0] if error.args else None
    if not isinstance(wanted, str) or wanted in axes:
        return ""
    near = get_close_matches(wanted, axes, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return f"The function asks for {wanted!r}, but the axes are {_listed(axes)}.{hint}"


def evaluate(traced: Traced, arrays: list[Array], lanes: dict[str, Array]) -> dict[str, Array]:
    """Results and derivatives of points side by side; of one point without a batch."""
    function, axes = traced.static.build(arrays), list(traced.axes)

    def one(point: dict[str, Array]) -> dict[str, Array]:
        return _named(function(point), axes)

    alone = all(column.shape == (1,) for column in lanes.values())
    computed, points = (one, {name: column[0] for name, column in lanes.items()}) if alone else (jax.vmap(one), lanes)
    if traced.mode is None:
        values = computed(points)
    else:
        values, slopes = value_and_jacobian(computed, points, traced.mode, of=traced.slopes)
        values |= {d: jnp.stack([slopes[name][axis] for axis in axes], axis=-1) for name, d in traced.slopes.items()}
    stored = {name: values[name].astype(result.dtype) for name, result in traced.results.items()}
    return {name: value[None] for name, value in stored.items()} if alone else stored


def _stored(dtype: object) -> np.dtype:
    """Results are of single or double precision."""
    return np.dtype(dtype) if dtype in (np.float32, np.float64) else number_type()


def _named(returned: object, axes: list[str]) -> dict[str, Array]:
    """The results as arrays by name, checked."""
    if not isinstance(returned, Mapping) or not returned:
        remedy = "Write `return {'rms': ...}`; of a `Response`, return `response.metrics()`."
        _checks.refuse(
            "function", "return a mapping from names to numbers", f"one that returns {type(returned)}", remedy
        )
    results = {}
    for name, value in returned.items():
        if not isinstance(name, str) or not name or "/" in name or name in (*RESERVED, *axes):
            taken = _listed([*RESERVED, *axes])
            _checks.refuse("function", f"return names without '/' other than {taken}", f"one that returns {name!r}")
        try:
            results[name] = jnp.asarray(value)
        except (TypeError, ValueError):
            remedy = "Give each number a name of its own."
            _checks.refuse("function", f"return numbers, also as {name!r}", f"one that returns {type(value)}", remedy)
        if not any(jnp.issubdtype(results[name].dtype, kind) for kind in (jnp.floating, jnp.integer, jnp.bool_)):
            remedy = "Return the real and the imaginary part, or the magnitude, by names of their own."
            _checks.refuse("function", f"return real numbers, also as {name!r}", results[name].dtype, remedy)
    return results


def _listed(names: list[str]) -> str:
    return ", ".join(map(repr, names))


def _warn_of_unused(jaxpr: Jaxpr, axes: list[str]) -> None:
    used = {id(v) for eqn in jaxpr.eqns for v in eqn.invars} | {id(v) for v in jaxpr.outvars}
    # entries of a mapping are traced in the order of their names, after the arrays
    inputs = zip(sorted(axes), jaxpr.invars[len(jaxpr.invars) - len(axes) :], strict=True)
    idle = [name for name, variable in inputs if id(variable) not in used]
    if idle:
        plural = "axes" if len(idle) > 1 else "axis"
        message = (
            f"The function does not use the {plural} {_listed(idle)}: no result changes along it. Is the name right?"
        )
        warn(message)


def _loops_without_end(jaxpr: ClosedJaxpr | Jaxpr) -> bool:
    """Whether it has `while` loops, which cannot be differentiated in reverse unless a rule of their own says how."""
    plain = jaxpr.jaxpr if isinstance(jaxpr, ClosedJaxpr) else jaxpr
    eqns = [eqn for eqn in plain.eqns if not eqn.primitive.name.startswith("custom_")]
    return any(eqn.primitive.name == "while" or any(map(_loops_without_end, _inside(eqn))) for eqn in eqns)


def _fingerprint(jaxpr: ClosedJaxpr, arrays: list[Array]) -> str:
    """A hash of what the function computes, which is the same in every process."""
    digest = hashlib.sha256(re.sub(r"0x[0-9a-f]+", "", str(jaxpr)).encode())
    for array in [*arrays, *_constants(jaxpr)]:
        if isinstance(array, jax.Array) and jnp.issubdtype(array.dtype, jax.dtypes.prng_key):
            array = jax.random.key_data(array)
        plain = np.asarray(array)
        digest.update(f"{plain.dtype}{plain.shape}".encode() + plain.tobytes())
    return digest.hexdigest()


def _constants(jaxpr: ClosedJaxpr | Jaxpr) -> Iterator[Array]:
    """All constants of a program: its text shows only the small ones."""
    if isinstance(jaxpr, ClosedJaxpr):
        yield from jaxpr.consts
        jaxpr = jaxpr.jaxpr
    for eqn in jaxpr.eqns:
        yield from (v.val for v in eqn.invars if isinstance(v, Literal))
        for inner in _inside(eqn):
            yield from _constants(inner)


def _inside(eqn: JaxprEqn) -> Iterator[ClosedJaxpr | Jaxpr]:
    """The programs that an operation calls."""
    for value in eqn.params.values():
        values = value if isinstance(value, tuple | list) else (value,)
        yield from (inner for inner in values if isinstance(inner, ClosedJaxpr | Jaxpr))

"""The values that parameters may take, each set with a smooth one-to-one map to it from the whole real line."""

import dataclasses
import functools
from collections.abc import Callable
from types import ModuleType
from typing import SupportsIndex, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdamp import _checks


Numbers: TypeAlias = PyTree  # arrays of JAX or NumPy, as the arguments are


@dataclasses.dataclass(frozen=True)
class Domain:
    """The values a parameter may take, and a smooth one-to-one map to them from the whole real line.

    `from_raw(raw, scale)` and `to_raw(value, scale)` are inverse to each other; `scale` is a typical magnitude, so
    that a raw step of one is a step of about the size of the parameter. `steps` is for ordered vectors: the steps from
    one number to the next, which are scaled in place of the numbers. Their maps compute NumPy arrays by NumPy, since
    JAX would compile each operation, and `slopes(raw, scale)` is the derivative of `from_raw`, of NumPy arrays.

    Attributes:
        name: in words, such as "positive".
        contains: whether an array of values lies inside.
        lower: limit below; −∞ if there is none.
        upper: limit above; ∞ if there is none.
        remade: function and arguments that return this domain again, for one that is not in a module by its name.
    """

    name: str
    contains: Callable[[np.ndarray], bool]
    from_raw: Callable[[Numbers, Numbers], Numbers]
    to_raw: Callable[[Numbers, Numbers], Numbers]
    lower: float = -np.inf
    upper: float = np.inf
    steps: Callable[[Numbers], Numbers] | None = None
    slopes: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    remade: tuple[Callable[..., "Domain"], tuple[float, ...]] | None = dataclasses.field(default=None, repr=False)

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[object, ...]:
        """Pickled by name or by ends: its copy is the domain itself, so that nothing is compiled anew for it."""
        own = next((name for name, value in globals().items() if value is self), None)
        return own or self.remade or super().__reduce_ex__(protocol)

    @property
    def ordered(self) -> bool:
        """Whether it is a domain of increasing vectors."""
        return self.steps is not None


def _library(array: object) -> ModuleType:
    return np if isinstance(array, np.ndarray | np.generic) else jnp


def _softplus(raw: Numbers) -> Numbers:
    return _library(raw).logaddexp(raw, 0.0)


def _sigmoid(raw: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * raw))


def _inverse_softplus(y: Numbers) -> Numbers:
    xp = _library(y)
    with np.errstate(divide="ignore"):  # minus infinity at the end of the domain
        return xp.where(y > 30.0, y, xp.log(xp.expm1(xp.minimum(y, 30.0))))


def _steps_up(value: Numbers) -> Numbers:
    xp = _library(value)
    return xp.diff(value, prepend=xp.zeros(1, value.dtype))


def _steps_to_zero(value: Numbers) -> Numbers:
    xp = _library(value)
    return xp.diff(value, append=xp.zeros(1, value.dtype))


def _increasing_from_raw(raw: Numbers, scale: Numbers) -> Numbers:
    xp = _library(raw)
    return xp.cumsum(xp.concatenate([scale[:1] * raw[:1], scale[1:] * _softplus(raw[1:])]))


def _increasing_slopes(raw: np.ndarray, scale: np.ndarray) -> np.ndarray:
    return np.tril(np.ones((raw.size, raw.size))) * np.append(scale[:1], scale[1:] * _sigmoid(raw[1:]))


def _increasing_to_raw(value: Numbers, scale: Numbers) -> Numbers:
    xp = _library(value)
    return xp.concatenate([value[:1] / scale[:1], _inverse_softplus(xp.diff(value) / scale[1:])])


def _increasing_from_raw_positive(raw: Numbers, scale: Numbers) -> Numbers:
    return _library(raw).cumsum(scale * _softplus(raw))


def _increasing_to_raw_positive(value: Numbers, scale: Numbers) -> Numbers:
    return _inverse_softplus(_steps_up(value) / scale)


real = Domain("real", lambda a: True, lambda raw, scale: scale * raw, lambda value, scale: value / scale)
# Weights of a network: their initial magnitude is not a scale for their changes.
weight = dataclasses.replace(real, from_raw=lambda raw, scale: raw, to_raw=lambda value, scale: value)
positive = Domain(
    "positive",
    lambda a: bool(np.all(a > 0)),
    lambda raw, scale: scale * jax.nn.softplus(raw),
    lambda value, scale: _inverse_softplus(jnp.maximum(value / scale, 1e-12)),
    lower=0.0,
)
# Zero belongs to this domain, so the map is a square: it reaches zero at a finite raw value, unlike softplus. At
# exactly zero the square has no slope and a search could not leave it, so a search starts slightly above.
nonnegative = Domain(
    "not negative",
    lambda a: bool(np.all(a >= 0)),
    lambda raw, scale: scale * raw * raw,
    lambda value, scale: jnp.sqrt(jnp.maximum(value / scale, 1e-2)),
    lower=0.0,
)
increasing = Domain(
    "strictly increasing",
    lambda a: bool(np.all(np.diff(a) > 0)),
    _increasing_from_raw,
    _increasing_to_raw,
    steps=_steps_up,
    slopes=_increasing_slopes,
)
increasing_negative = Domain(
    "strictly increasing and negative",
    lambda a: bool(np.all(np.diff(a) > 0) and np.all(a < 0)),
    lambda raw, scale: -_increasing_from_raw_positive(raw[::-1], scale[::-1])[::-1],
    lambda value, scale: _increasing_to_raw_positive(-value[::-1], scale[::-1])[::-1],
    upper=0.0,
    steps=_steps_to_zero,
    slopes=lambda raw, scale: -np.triu(np.ones((raw.size, raw.size))) * (scale * _sigmoid(raw)),
)
# For settings that are the two ends of a range.
ends = dataclasses.replace(
    increasing,
    name="a low and a high end",
    contains=lambda a: a.shape == (2,) and bool(a[0] < a[1]),
)
around_zero = dataclasses.replace(
    increasing,
    name="a low and a high end with zero between them",
    contains=lambda a: a.shape == (2,) and bool(a[0] < a[1] and a[0] <= 0 <= a[1]),
)


def _logit(share: Array) -> Array:
    share = jnp.clip(share, 1e-9, 1 - 1e-9)
    return jnp.log(share / (1 - share))


def _gap_shares(raw: Numbers) -> Numbers:
    """The shares that the gaps have of the range, a softmax."""
    xp = _library(raw)
    raw = xp.concatenate([raw, xp.zeros(1, raw.dtype)])
    size = xp.exp(raw - jax.lax.stop_gradient(raw).max() if xp is jnp else raw - raw.max())
    return size / size.sum()


def _ordered_shares(raw: Numbers) -> Numbers:
    return _library(raw).cumsum(_gap_shares(raw))[:-1]


def _slopes_of_ordered_shares(raw: np.ndarray) -> np.ndarray:
    gaps = _gap_shares(raw)[:-1]
    return (np.tril(np.ones((raw.size, raw.size))) - np.cumsum(gaps)[:, None]) * gaps


def _raw_of_ordered_shares(shares: Numbers) -> Numbers:
    xp = _library(shares)
    zero, one = xp.zeros(1, shares.dtype), xp.ones(1, shares.dtype)
    gaps = xp.maximum(xp.diff(shares, prepend=zero, append=one), 1e-12)
    return xp.log(gaps[:-1] / gaps[-1])


def interval(lower: float, upper: float) -> Domain:
    """Numbers between two finite ones (scaled logistic map).

    Arguments:
        lower: lower end, in the unit of the parameter.
        upper: upper end.
    """
    return _between(_checks.plain_number("lower", lower), _checks.plain_number("upper", upper), ordered=False)


def ordered_interval(lower: float, upper: float) -> Domain:
    """Increasing numbers between two finite ones: their gaps are the shares of a softmax.

    Arguments:
        lower: lower end, in the unit of the parameter.
        upper: upper end.
    """
    return _between(_checks.plain_number("lower", lower), _checks.plain_number("upper", upper), ordered=True)


@functools.cache  # the same domain for the same ends: what holds it compiles once
def _between(lower: float, upper: float, *, ordered: bool) -> Domain:
    """A domain between two finite numbers, from the map of raw numbers to shares of the range (0 to 1) and back."""
    if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper):
        raise ValueError(f"Bounds must be two finite numbers in increasing order, but are ({lower}, {upper}).")
    width = upper - lower
    share_of, raw_of = (_ordered_shares, _raw_of_ordered_shares) if ordered else (jax.nn.sigmoid, _logit)

    def contains(a: np.ndarray) -> bool:
        return bool(np.all((a >= lower) & (a <= upper))) and not (ordered and np.any(np.diff(a) <= 0))

    return Domain(
        f"{'strictly increasing ' * ordered}between {lower:g} and {upper:g}",
        contains,
        lambda raw, scale: lower + width * share_of(raw),
        lambda value, scale: raw_of((value - lower) / width),
        lower,
        upper,
        _steps_up if ordered else None,
        (lambda raw, scale: width * _slopes_of_ordered_shares(raw)) if ordered else None,
        (ordered_interval if ordered else interval, (lower, upper)),
    )

"""What a function may say of itself to a sweep: each is a protocol of one member, and a function has what it needs."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from jaxdamp import _checks
from jaxdamp._jacobian import Mode, choose_mode


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

    def side_by_side(self) -> Callable[[dict[str, Any]], Any]:
        """That form, which is compiled in its place."""
        ...


@runtime_checkable
class HasPrinted(Protocol):
    """A function whose loop can be printed as C, which may be faster."""

    def printed_side_by_side(self) -> Callable[[dict[str, Any]], Any] | None:
        """That form, for long sweeps without derivatives on processors; None if XLA is to compile it in any case."""
        ...


@runtime_checkable
class HasDomain(Protocol):
    """A function that not all points have."""

    def out_of_domain(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Why each of many points cannot be computed: a text for each, empty where it can."""
        ...


class SweepFunction(HasUnits, HasLanes, HasDerivatives, HasSideBySide, HasPrinted, HasDomain, Protocol):
    """A function that says all of it, as `jaxdamp.Ride` does."""

    def __call__(self, point: Mapping[str, Any]) -> Mapping[str, Any]:
        """The results by name at a point."""
        ...


def chosen_mode(function: Any, gradients: bool | Mode, inputs: int, results: int, *, reversible: bool) -> Mode | None:
    """The mode of differentiation: the one asked for, or the cheaper of those that pass; None for values alone.

    Arguments:
        function: which may have `derivatives`.
        gradients: as in `sweep`.
        inputs: number of the axes.
        results: number of the results that are differentiated.
        reversible: whether no loop of unknown length stands in the way of reverse derivatives.

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

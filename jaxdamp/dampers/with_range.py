"""A law together with the range of the records that it was fitted to."""

from typing import TypeVar

from jaxdamp import _checks
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.fitted_range import UNITS, FittedRange, Limits, RangeNote


L = TypeVar("L")


def with_fitted_range(law: L, fitted_to: FittedRange | None = None, **limits: Limits) -> L:
    """The same law with the range of the records that it was fitted to, instead of any previous range.

    `identify.fit` and `train` do this; state the range yourself for a law with parameters from another source. Laws
    inside have their own ranges. Simulations with the law then report by how much it is used outside the range.

    The range is no array of the law: a law with a range has the same structure as one without, and `jax.tree.map` of
    several laws returns that of the first. A law that a compiled function (`jax.jit`, `jax.lax.scan`) returns has none.

    Arguments:
        law: any law.
        fitted_to: the range; or give the limits by name.
        limits: as `FittedRange` takes them, such as `velocity=(-0.5, 0.5)`.

    Raises:
        ValueError: something that is not a law; neither a range nor limits, or both; an unknown quantity;
            limits out of order.

    >>> from jaxdamp.dampers import Linear
    >>> with_fitted_range(Linear(1500.0), velocity=(-0.5, 0.9)).fitted_to.words()
    'velocity −0.5 to 0.9 m/s'
    """
    if not isinstance(law, AbstractDamper):
        _checks.refuse("law", "be a damper law", f"a {type(law).__name__}", "For a vehicle, set it for its dampers.")
    for name in limits:
        _checks.one_of("limits", name, UNITS)
    if (fitted_to is None) == (not limits):
        remedy = "Write for example `with_fitted_range(law, velocity=(-0.5, 0.5))`."
        _checks.refuse("fitted_to", "be given, or limits by name, and not both", repr(fitted_to), remedy)
    changed = object.__new__(type(law))
    for name, value in (vars(law) | {"range_note": RangeNote(fitted_to or FittedRange(**limits))}).items():
        object.__setattr__(changed, name, value)
    return changed

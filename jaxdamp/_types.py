"""Array types with meaning. Shapes are checked at run time in the tests only."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jax import Array
from jaxtyping import ArrayLike, Float


if TYPE_CHECKING:
    import matplotlib.artist
    import matplotlib.axes
    import matplotlib.container
    import matplotlib.figure
    import xarray

Scalar = Float[Array, ""]
State = Float[Array, " state"]
Signal = Float[Array, " time"]
VectorLike = Float[Array, " _"] | Float[np.ndarray, " _"] | Sequence[float]
Value: TypeAlias = ArrayLike | Sequence[float | int]  # of a parameter
Point: TypeAlias = Mapping[str, Value]  # by path
SignalLike = Float[Array, " time"] | Float[np.ndarray, " time"]

# Names of packages that are imported late, for annotations: texts at run time.
Axes: TypeAlias = "matplotlib.axes.Axes"
Artist: TypeAlias = "matplotlib.artist.Artist | matplotlib.container.Container"
Figure: TypeAlias = "matplotlib.figure.Figure"
DataArray: TypeAlias = "xarray.DataArray"
Dataset: TypeAlias = "xarray.Dataset"

# Any number goes in as a scalar. Fields of modules: the constructor takes numbers and sequences, the converter of the
# field makes arrays of them, which is what type checkers read from the descriptors.
if TYPE_CHECKING:
    ScalarLike: TypeAlias = float | Array

    class Number:
        """A field for one number."""

        def __get__(self, instance: object, owner: object = None) -> Array: ...
        def __set__(self, instance: object, value: ArrayLike) -> None: ...

    class Vector:
        """A field for numbers in a row."""

        def __get__(self, instance: object, owner: object = None) -> Array: ...
        def __set__(self, instance: object, value: ArrayLike | Sequence[float] | Sequence[Array]) -> None: ...

    class Matrix:
        """A field for rows of numbers."""

        def __get__(self, instance: object, owner: object = None) -> Array: ...
        def __set__(self, instance: object, value: ArrayLike | Sequence[Sequence[float]]) -> None: ...
else:
    ScalarLike = Float[ArrayLike, ""]
    Number = Scalar
    Vector = Float[Array, " _"]
    Matrix = Float[Array, "_ _"]

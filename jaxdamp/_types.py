"""Array types with meaning. Shapes are checked at run time in the tests only."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jax import Array
from jaxtyping import ArrayLike, Float


Scalar = Float[Array, ""]
State = Float[Array, " state"]
Signal = Float[Array, " time"]
VectorLike = Float[Array, " _"] | Float[np.ndarray, " _"] | Sequence[float]
SignalLike = Float[Array, " time"] | Float[np.ndarray, " time"]

# Any number goes in as a scalar. Parameters of modules: the field's converter makes numbers and sequences arrays.
if TYPE_CHECKING:
    ScalarLike: TypeAlias = Any
    Number: TypeAlias = Any
    Vector: TypeAlias = Any
    Matrix: TypeAlias = Any
else:
    ScalarLike = Float[ArrayLike, ""]
    Number = Scalar
    Vector = Float[Array, " _"]
    Matrix = Float[Array, "_ _"]

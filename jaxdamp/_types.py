"""Array types with meaning. Shapes are checked at run time in the tests only."""

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jax import Array
from jaxtyping import ArrayLike, Float


Scalar = Float[Array, ""]
ScalarLike = Float[ArrayLike, ""]
State = Float[Array, " state"]
Signal = Float[Array, " time"]
SignalLike = Float[Array, " time"] | Float[np.ndarray, " time"]

# Parameters of modules: any number or sequence goes in, the field's converter makes it an array.
if TYPE_CHECKING:
    Number: TypeAlias = Any
    Vector: TypeAlias = Any
else:
    Number = Scalar
    Vector = Float[Array, " _"]

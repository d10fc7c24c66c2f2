"""Array types with meaning. Shapes are checked at run time in the tests only."""

import numpy as np
from jax import Array
from jaxtyping import ArrayLike, Float


Scalar = Float[Array, ""]
ScalarLike = Float[ArrayLike, ""]
State = Float[Array, " state"]
Signal = Float[Array, " time"]
SignalLike = Float[Array, " time"] | Float[np.ndarray, " time"]

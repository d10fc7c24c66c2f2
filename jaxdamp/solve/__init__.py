"""Solvers of the whole library in the vocabulary of optimistix, with a batch axis, from the host or inside JAX.

- `BoundedLevenbergMarquardt`: bounded nonlinear least squares.
- `SequentialQuadratic`: constrained minimisation of one or several objectives, many searches side by side.
"""

from jaxdamp.solve.constrained import Evaluation, Region, Scaling, SearchState as SearchState, SequentialQuadratic
from jaxdamp.solve.damped_steps import Linearisation
from jaxdamp.solve.least_squares import (
    BoundedLevenbergMarquardt,
    ImplicitWithinBounds,
    SearchLanes as SearchLanes,
    least_squares_on_host,
)


__all__ = [
    "BoundedLevenbergMarquardt",
    "Evaluation",
    "ImplicitWithinBounds",
    "Linearisation",
    "Region",
    "Scaling",
    "SequentialQuadratic",
    "least_squares_on_host",
]

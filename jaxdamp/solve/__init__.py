"""Solvers of the whole library, with a batch axis.

- `SequentialQuadratic`: constrained minimisation of one or several objectives, many searches side by side.
"""

from jaxdamp.solve.constrained import Evaluation, Region, Scaling, SearchState, SequentialQuadratic


__all__ = ["Evaluation", "Region", "Scaling", "SearchState", "SequentialQuadratic"]

"""What a function depends on, from its trace."""

from collections.abc import Callable

import jax
from jax.extend.core import Var
from jaxtyping import PyTree


def depends(function: Callable[[PyTree], PyTree], values: PyTree) -> bool:
    """Whether the result of a function depends on its argument; a call inside counts as depending on all of its inputs.

    Arguments:
        function: of one argument, a tree of arrays.
        values: an argument of this structure.
    """
    traced = jax.make_jaxpr(function)(values).jaxpr
    reached = set(traced.invars)
    for equation in traced.eqns:
        if any(isinstance(variable, Var) and variable in reached for variable in equation.invars):
            reached.update(equation.outvars)
    return any(isinstance(variable, Var) and variable in reached for variable in traced.outvars)

"""Solvers in the vocabulary of optimistix: bounded least squares, from a loop on the host or inside a JAX program."""

from jaxdamp.solve.damped_steps import Linearisation
from jaxdamp.solve.least_squares import BoundedLevenbergMarquardt, ImplicitWithinBounds
from jaxdamp.solve.on_host import SearchLanes, least_squares_on_host


__all__ = [
    "BoundedLevenbergMarquardt",
    "ImplicitWithinBounds",
    "Linearisation",
    "SearchLanes",
    "least_squares_on_host",
]

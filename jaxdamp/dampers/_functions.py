"""Functions inside laws, such as the activation of a network, by their names: JAX pickles few of its own."""

import dataclasses
import inspect
from collections.abc import Callable
from importlib import import_module
from typing import TypeVar

import jax


Law = TypeVar("Law")


@dataclasses.dataclass(frozen=True)
class NamedFunction:
    """A public function of JAX, or the default of an argument of a class of equinox, in a file."""

    module: str
    name: str
    argument: str = ""

    def function(self) -> Callable[..., object]:
        """The function itself."""
        there = getattr(import_module(self.module), self.name)
        return inspect.signature(there).parameters[self.argument].default if self.argument else there


_PLACES = [NamedFunction("equinox.nn", "MLP", argument) for argument in ("activation", "final_activation")]


def by_name(leaf: object) -> object:
    """A public function of JAX or a default of equinox as its name; anything else as it is."""
    if not callable(leaf):
        return leaf
    of_jax = [NamedFunction(place, getattr(leaf, "__name__", "")) for place in ("jax.nn", "jax.numpy", "jax.lax")]
    places = [place for place in of_jax if hasattr(import_module(place.module), place.name)]
    return next((place for place in (*places, *_PLACES) if place.function() is leaf), leaf)


def with_functions(law: Law) -> Law:
    """The law with functions in place of their names."""
    return jax.tree.map(lambda leaf: leaf.function() if isinstance(leaf, NamedFunction) else leaf, law)

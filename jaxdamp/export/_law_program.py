"""A law as functions of its numbers, which are printed in other languages."""

import dataclasses
import re
import unicodedata
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdamp import _checks
from jaxdamp.codegen import Program, Symbols, lower, symbols
from jaxdamp.dampers import AbstractDamper, Condition, laws_inside
from jaxdamp.parameters import Domain, domain_of, modules_inside, with_values


# Words that C, C++ and JavaScript keep for themselves and that a field could have as its name.
_RESERVED = frozenset(
    "auto bool case catch char class const default delete do double else enum export extern float for function goto if "
    "import inline int let long new operator private register return short signed sizeof static struct switch template "
    "this throw true typedef typeof union unsigned using var void volatile while".split()
)


@dataclasses.dataclass(frozen=True)
class LawNumber:
    """A parameter or a setting of a law."""

    path: str  # as in `jaxdamp.parameters`
    name: str  # the path as an identifier of C and JavaScript
    unit: str  # SI unit
    meaning: str  # one line
    domain: Domain  # the allowed values
    value: np.ndarray  # the numbers of the law
    kind: str  # "parameter", "setting", or "command", which is set from outside


def law_numbers(law: eqx.Module) -> list[LawNumber]:
    """All parameters and settings of a law or a vehicle but empty ones, its own before those of laws inside."""
    numbers = []
    for prefix, module in modules_inside(law):
        for field in dataclasses.fields(module):
            declared = field.metadata.get("parameter") or field.metadata.get("setting")
            if declared is None:
                continue
            value = _checks.concrete(getattr(module, field.name))
            path, domain = prefix + field.name, domain_of(declared, module)
            if value is None:
                _checks.refuse("law", "have known values", f"traced in {path}", "Export it outside `jax.jit`.")
            _checks.finite(path, value)
            if not value.size:
                continue
            kind = "command" if declared.get("command") else "setting" if "setting" in field.metadata else "parameter"
            about = declared["unit"], declared["meaning"], domain
            numbers.append(LawNumber(path, identifier(path), *about, np.asarray(value, float), kind))
    by_name: dict[str, str] = {}
    for number in numbers:
        if (other := by_name.setdefault(number.name, number.path)) != number.path:
            must = "have parameters whose names differ in their ASCII letters, as those of C do"
            _checks.refuse("law", must, f"one with {other} and {number.path}", "Give one of them another name.")
    return numbers


def identifier(path: str) -> str:
    """A path, a class or the name of a file as an identifier; letters lose their accents, Greek ones are spelled.

    >>> identifier("law.terms.0.rate"), identifier("default"), identifier("Dämpfer 2"), identifier("減衰")
    ('law_terms_0_rate', 'default_', 'Dampfer_2', 'law')
    >>> identifier("law.η"), identifier("Ω_max")
    ('law_eta', 'Omega_max')
    """
    plain = (c for c in unicodedata.normalize("NFKD", path) if not unicodedata.combining(c))
    name = re.sub(r"\W", "_", "".join(map(_spelled, plain)), flags=re.ASCII)
    if not name.strip("_") and name != path:
        return "law"
    return f"{name}_" if name in _RESERVED or not name else f"_{name}" if name[0].isdigit() else name


def _spelled(letter: str) -> str:
    """The name of a Greek letter; any other as it is."""
    greek = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER.* (\w+)", unicodedata.name(letter, ""))
    return letter if greek is None else greek[2].lower() if greek[1] == "SMALL" else greek[2].title()


class AbstractProgram:
    """A law or a vehicle whose functions can be printed.

    Arguments:
        model: the law or the vehicle.
        dtype: the type of all numbers, "float64" or "float32".
        member: what the language writes between `p` and the name of a number: "->" in C, "." in JavaScript.

    Attributes:
        numbers: its parameters and settings.
        sampled: whether it jumps at the samples of a controller.
    """

    sampled = False

    def __init__(self, model: eqx.Module, dtype: str = "float64", member: str = "->") -> None:
        _checks.one_of("precision", dtype, ("float64", "float32"))
        self._model, self.dtype, self.member = model, dtype, member
        self.numbers = law_numbers(model)

    def model_of(self, values: Sequence[Array]) -> Any:
        """The model with other numbers, in the order of `numbers`."""
        model = jax.tree.map(lambda a: jnp.asarray(a, self.dtype) if eqx.is_inexact_array(a) else a, self._model)
        return with_values(model, {n.path: value for n, value in zip(self.numbers, values, strict=True)})

    def values(self, owner: str = "p") -> PyTree[Symbols]:
        """All numbers, as members of an object of the program."""
        return [symbols(f"{owner}{self.member}{n.name}", n.value.shape, self.dtype) for n in self.numbers]

    @cached_property
    def margins(self) -> Program:
        """`margins(p)`: by how much each condition between parameters holds, in the order of `conditions`."""

        def margins(values: list[Array]) -> list[Array]:
            model = self.model_of(values)
            return [jnp.min(getattr(owner, c.parameter) - c.least) for _, owner, c in self._conditions(model)]

        return lower(margins, self.values())

    @property
    def conditions(self) -> list[str]:
        """The conditions between parameters in words."""
        each = self._conditions(self._model)
        return [f"{path}{c.parameter} must be greater than {c.formula}. {c.reason}" for path, _, c in each]

    def _conditions(self, model: eqx.Module) -> list[tuple[str, AbstractDamper, Condition]]:
        """Every condition between parameters, with the law that it is about and its path."""
        inside = ((path, law) for path, law in laws_inside(model) if law.has_conditions())
        return [(path, law, c) for path, law in inside for c in law.conditions()]

    def _symbols(self, name: str) -> Symbols:
        return symbols(name, (), self.dtype)


class LawProgram(AbstractProgram):
    """A law whose functions can be printed.

    Attributes:
        states: the number of its states.
    """

    def __init__(self, law: AbstractDamper, dtype: str = "float64", member: str = "->") -> None:
        super().__init__(law, dtype, member)
        self.law, self.states = law, int(law.initial_state().size)

    @cached_property
    def force(self) -> Program:
        """`force(p, x, v, state)`."""
        return lower(self._force, *self._point())

    @cached_property
    def advance(self) -> Program:
        """`advance(p, x0, v0, x1, v1, dt, state)`: the states after the step."""
        return lower(self._advance, *self._step())

    @cached_property
    def state_rate(self) -> Program:
        """`state_rate(p, x, v, state)`."""
        return lower(self._state_rate, *self._point())

    @cached_property
    def initial_state(self) -> Program:
        """`initial_state(p, x)`: the states at rest."""
        return lower(lambda values, x: self.model_of(values).state_at_rest(x), self.values(), self._symbols("x"))

    @cached_property
    def force_derivative(self) -> Program:
        """The change of the force for changes `dp->...`, `dx`, `dv`, `dstate` of its arguments."""
        return self._derivative(self._force, self._point(), self._point("d"))

    @cached_property
    def state_rate_derivative(self) -> Program:
        """The change of the rate of the states for changes of the arguments of `state_rate`."""
        return self._derivative(self._state_rate, self._point(), self._point("d"))

    @cached_property
    def advance_derivative(self) -> Program:
        """The change of the states after a step for changes of its arguments but the duration."""
        arguments, changes = self._step(), self._step("d")
        arguments, changes = (arguments[:-2], arguments[-1]), (changes[:-2], changes[-1])

        def derivative(point: tuple[PyTree, Array], change: tuple[PyTree, Array], dt: Array) -> Array:
            def after(first: PyTree, state: Array) -> Array:
                values, x0, v0, x1, v1 = first
                return self._advance(values, x0, v0, x1, v1, dt, state)

            return jax.jvp(after, point, change)[1]

        return lower(derivative, arguments, changes, self._symbols("dt"))

    def _derivative(self, function: Callable, arguments: tuple, changes: tuple) -> Program:
        return lower(lambda point, change: jax.jvp(function, point, change)[1], arguments, changes)

    def _force(self, values: list[Array], x: Array, v: Array, state: Array) -> Array:
        return self.model_of(values).force(x, v, state)

    def _state_rate(self, values: list[Array], x: Array, v: Array, state: Array) -> Array:
        return self.model_of(values).state_rate(x, v, state)

    def _advance(
        self, values: list[Array], x0: Array, v0: Array, x1: Array, v1: Array, dt: Array, state: Array
    ) -> Array:
        return self.model_of(values).advance(x0, v0, x1, v1, state, dt)

    def _point(self, d: str = "") -> tuple[PyTree[Symbols], ...]:
        return self.values(f"{d}p"), self._symbols(f"{d}x"), self._symbols(f"{d}v"), self._state(d)

    def _step(self, d: str = "") -> tuple[PyTree[Symbols], ...]:
        names = (f"{d}{name}" for name in ("x0", "v0", "x1", "v1"))
        return self.values(f"{d}p"), *map(self._symbols, names), self._symbols("dt"), self._state(d)

    def _state(self, d: str) -> Symbols:
        return symbols(f"{d}state", (self.states,), self.dtype)

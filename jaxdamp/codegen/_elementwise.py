"""Primitives of JAX that compute each number of their result from one number of each operand."""

from collections.abc import Callable

import numpy as np

from jaxdamp.codegen._jaxprs import Equation
from jaxdamp.codegen._program import Atom, Atoms, Writer, array_of, constant


# Operations of the program have the names of the primitives.
SAME_NAME = frozenset(
    "add sub mul div rem pow neg abs sign max min lt le gt ge eq ne and or xor not nextafter "
    "exp exp2 expm1 log log1p log2 sqrt cbrt sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh "
    "erf erfc floor ceil is_finite".split()
)
OTHER_NAME = {"add_any": "add"}
UNCHANGED = frozenset({"stop_gradient", "copy", "copy_p", "name", "optimization_barrier", "pvary", "reshard"})

Of = Callable[..., Atom]  # writes an operation on numbers
Rule = Callable[[Writer, Equation, list[Atoms]], list[Atoms]]


def of_each(function: Callable[..., Atom]) -> Rule:
    """The rule of a primitive by what it gives for every number, operands of one number being repeated.

    The function is given `of`, which writes an operation on numbers, the equation, and a number of each operand.
    """

    def rule(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
        def of(operation: str, *atoms: Atom, dtype: str = equation.dtype) -> Atom:
            return writer.define(operation, atoms, dtype)

        spread = [np.broadcast_to(operand, equation.shape) for operand in operands]
        return [array_of(equation.shape, lambda at: function(of, equation, *(operand[at] for operand in spread)))]

    return rule


@of_each
def _operation(of: Of, equation: Equation, *atoms: Atom) -> Atom:
    return of(OTHER_NAME.get(equation.name, equation.name), *atoms)


@of_each
def _integer_power(of: Of, equation: Equation, base: Atom) -> Atom:
    exponent = equation.parameters["y"]
    one = result = constant(1, equation.dtype)

    def times(a: Atom, b: Atom) -> Atom:
        return b if a == one else of("mul", a, b)

    left = abs(exponent)
    while left:
        result = times(result, base) if left & 1 else result
        left >>= 1
        base = times(base, base) if left else base
    return result if exponent >= 0 else of("div", one, result)


@of_each
def _logistic(of: Of, equation: Equation, a: Atom) -> Atom:
    one = constant(1, equation.dtype)
    return of("div", one, of("add", one, of("exp", of("neg", a))))


@of_each
def _one_minus_square(of: Of, equation: Equation, a: Atom) -> Atom:
    """1 − x² of JAX 0.12, (1 + x) (1 − x) as there."""
    one = constant(1, equation.dtype)
    return of("mul", of("add", one, a), of("sub", one, a))


@of_each
def _polynomial(of: Of, equation: Equation, a: Atom, *coefficients: Atom) -> Atom:
    """A polynomial of JAX 0.12, the lowest coefficient first, by Horner's rule."""
    *lower, result = coefficients
    for coefficient in reversed(lower):
        result = of("add", of("mul", result, a), coefficient)
    return result


@of_each
def _select(of: Of, equation: Equation, which: Atom, *cases: Atom) -> Atom:
    """`select_n(which, case 0, case 1, ...)`, of which most have two cases."""
    result = cases[0]
    for i, case in enumerate(cases[1:], start=1):
        chosen = which if which.dtype == "bool" else of("eq", which, constant(i, which.dtype), dtype="bool")
        result = case if case == result else of("select", chosen, case, result)
    return result


@of_each
def _convert(of: Of, equation: Equation, a: Atom) -> Atom:
    return a if a.dtype == equation.dtype else of("convert", a)


@of_each
def _round(of: Of, equation: Equation, a: Atom) -> Atom:
    return of("round_half_even" if int(equation.parameters["rounding_method"]) == 1 else "round_half_away", a)


RULES: dict[str, Rule] = {
    **dict.fromkeys(SAME_NAME | set(OTHER_NAME), _operation),
    **dict.fromkeys(UNCHANGED, lambda writer, e, operands: operands),
    "square": of_each(lambda of, equation, a: of("mul", a, a)),
    "integer_pow": _integer_power,
    "rsqrt": of_each(lambda of, equation, a: of("div", constant(1, equation.dtype), of("sqrt", a))),
    "logistic": _logistic,
    "one_minus_square": _one_minus_square,
    "polynomial": _polynomial,
    "select_n": _select,
    "clamp": of_each(lambda of, equation, low, a, high: of("min", of("max", a, low), high)),
    "convert_element_type": _convert,
    "round": _round,
}

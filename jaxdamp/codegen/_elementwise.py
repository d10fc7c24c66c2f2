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

Rule = Callable[[Writer, Equation, list[Atoms]], list[Atoms]]


def of_each(function: Callable[..., Atom]) -> Rule:
    """The rule of a primitive by what it gives for every number, operands of one number being repeated."""

    def rule(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
        spread = [np.broadcast_to(operand, equation.shape) for operand in operands]
        return [array_of(equation.shape, lambda at: function(writer, equation, *(operand[at] for operand in spread)))]

    return rule


@of_each
def _operation(writer: Writer, equation: Equation, *atoms: Atom) -> Atom:
    return writer.define(OTHER_NAME.get(equation.name, equation.name), atoms, equation.dtype)


@of_each
def _integer_power(writer: Writer, equation: Equation, base: Atom) -> Atom:
    exponent, dtype = equation.parameters["y"], equation.dtype
    one = result = constant(1, dtype)

    def times(a: Atom, b: Atom) -> Atom:
        return b if a == one else writer.define("mul", (a, b), dtype)

    left = abs(exponent)
    while left:
        result = times(result, base) if left & 1 else result
        left >>= 1
        base = times(base, base) if left else base
    return result if exponent >= 0 else writer.define("div", (one, result), dtype)


@of_each
def _reciprocal_root(writer: Writer, equation: Equation, a: Atom) -> Atom:
    dtype = equation.dtype
    return writer.define("div", (constant(1, dtype), writer.define("sqrt", (a,), dtype)), dtype)


@of_each
def _logistic(writer: Writer, equation: Equation, a: Atom) -> Atom:
    dtype = equation.dtype
    one, power = constant(1, dtype), writer.define("exp", (writer.define("neg", (a,), dtype),), dtype)
    return writer.define("div", (one, writer.define("add", (one, power), dtype)), dtype)


@of_each
def _one_minus_square(writer: Writer, equation: Equation, a: Atom) -> Atom:
    """1 − x² of JAX 0.12, (1 + x) (1 − x) as there."""
    dtype = equation.dtype
    one = constant(1, dtype)
    factors = writer.define("add", (one, a), dtype), writer.define("sub", (one, a), dtype)
    return writer.define("mul", factors, dtype)


@of_each
def _polynomial(writer: Writer, equation: Equation, a: Atom, *coefficients: Atom) -> Atom:
    """A polynomial of JAX 0.12, the lowest coefficient first, by Horner's rule."""
    *lower, result = coefficients
    for coefficient in reversed(lower):
        product = writer.define("mul", (result, a), equation.dtype)
        result = writer.define("add", (product, coefficient), equation.dtype)
    return result


@of_each
def _select(writer: Writer, equation: Equation, which: Atom, *cases: Atom) -> Atom:
    """`select_n(which, case 0, case 1, ...)`, of which most have two cases."""
    result = cases[0]
    for i, case in enumerate(cases[1:], start=1):
        if which.dtype == "bool":
            chosen = which
        else:
            chosen = writer.define("eq", (which, constant(i, which.dtype)), "bool")
        result = case if case == result else writer.define("select", (chosen, case, result), equation.dtype)
    return result


@of_each
def _clamp(writer: Writer, equation: Equation, low: Atom, a: Atom, high: Atom) -> Atom:
    return writer.define("min", (writer.define("max", (a, low), equation.dtype), high), equation.dtype)


@of_each
def _convert(writer: Writer, equation: Equation, a: Atom) -> Atom:
    return a if a.dtype == equation.dtype else writer.define("convert", (a,), equation.dtype)


@of_each
def _round(writer: Writer, equation: Equation, a: Atom) -> Atom:
    operation = "round_half_even" if int(equation.parameters["rounding_method"]) == 1 else "round_half_away"
    return writer.define(operation, (a,), equation.dtype)


RULES: dict[str, Rule] = {
    **dict.fromkeys(SAME_NAME | set(OTHER_NAME), _operation),
    **dict.fromkeys(UNCHANGED, lambda writer, e, operands: operands),
    "square": of_each(lambda writer, equation, a: writer.define("mul", (a, a), equation.dtype)),
    "integer_pow": _integer_power,
    "rsqrt": _reciprocal_root,
    "logistic": _logistic,
    "one_minus_square": _one_minus_square,
    "polynomial": _polynomial,
    "select_n": _select,
    "clamp": _clamp,
    "convert_element_type": _convert,
    "round": _round,
}

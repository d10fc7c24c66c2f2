"""Primitives of JAX that compute each number of their result from one number of each operand."""

from collections.abc import Callable

import numpy as np

from jaxdamp.codegen._jaxprs import Equation
from jaxdamp.codegen._program import Atom, Atoms, Writer, constant


# Operations of the program have the names of the primitives.
SAME_NAME = frozenset(
    "add sub mul div rem pow neg abs sign max min lt le gt ge eq ne and or xor not nextafter "
    "exp exp2 expm1 log log1p log2 sqrt cbrt sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh "
    "erf erfc floor ceil is_finite".split()
)
OTHER_NAME = {"add_any": "add"}
UNCHANGED = frozenset({"stop_gradient", "copy", "copy_p", "name", "optimization_barrier", "pvary", "reshard"})

Rule = Callable[[Writer, Equation, list[Atoms]], list[Atoms]]


def each(function: Callable[..., Atom], equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """The function of every number, operands of one number being repeated."""
    result = np.empty(equation.shape, object)
    spread = [np.broadcast_to(operand, equation.shape) for operand in operands]
    for index in np.ndindex(*equation.shape):
        result[index] = function(*(operand[index] for operand in spread))
    return [result]


def elementwise(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """A primitive that is one operation."""
    operation = OTHER_NAME.get(equation.name, equation.name)
    return each(lambda *atoms: writer.define(operation, atoms, equation.dtype), equation, operands)


def _integer_power(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    exponent, dtype = equation.parameters["y"], equation.dtype
    one = constant(1, dtype)

    def times(a: Atom, b: Atom) -> Atom:
        return b if a == one else writer.define("mul", (a, b), dtype)

    def power(base: Atom) -> Atom:
        result, left = one, abs(exponent)
        while left:
            result = times(result, base) if left & 1 else result
            left >>= 1
            base = times(base, base) if left else base
        return result if exponent >= 0 else writer.define("div", (one, result), dtype)

    return each(power, equation, operands)


def _reciprocal_root(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    dtype = equation.dtype

    def reciprocal_root(a: Atom) -> Atom:
        return writer.define("div", (constant(1, dtype), writer.define("sqrt", (a,), dtype)), dtype)

    return each(reciprocal_root, equation, operands)


def _logistic(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    dtype = equation.dtype
    one = constant(1, dtype)

    def logistic(a: Atom) -> Atom:
        power = writer.define("exp", (writer.define("neg", (a,), dtype),), dtype)
        return writer.define("div", (one, writer.define("add", (one, power), dtype)), dtype)

    return each(logistic, equation, operands)


def _one_minus_square(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """1 − x² of JAX 0.12, (1 + x) (1 − x) as there."""
    dtype = equation.dtype
    one = constant(1, dtype)

    def one_minus_square(a: Atom) -> Atom:
        factors = writer.define("add", (one, a), dtype), writer.define("sub", (one, a), dtype)
        return writer.define("mul", factors, dtype)

    return each(one_minus_square, equation, operands)


def _polynomial(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """A polynomial of JAX 0.12, the lowest coefficient first, by Horner's rule."""
    dtype = equation.dtype

    def polynomial(a: Atom, *coefficients: Atom) -> Atom:
        *lower, result = coefficients
        for coefficient in reversed(lower):
            result = writer.define("add", (writer.define("mul", (result, a), dtype), coefficient), dtype)
        return result

    return each(polynomial, equation, operands)


def _select(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """`select_n(which, case 0, case 1, ...)`, of which most have two cases."""

    def select(which: Atom, *cases: Atom) -> Atom:
        result = cases[0]
        for i, case in enumerate(cases[1:], start=1):
            if which.dtype == "bool":
                chosen = which
            else:
                chosen = writer.define("eq", (which, constant(i, which.dtype)), "bool")
            result = case if case == result else writer.define("select", (chosen, case, result), equation.dtype)
        return result

    return each(select, equation, operands)


def _clamp(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    def clamp(low: Atom, a: Atom, high: Atom) -> Atom:
        return writer.define("min", (writer.define("max", (a, low), equation.dtype), high), equation.dtype)

    return each(clamp, equation, operands)


def _convert(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    def convert(a: Atom) -> Atom:
        return a if a.dtype == equation.dtype else writer.define("convert", (a,), equation.dtype)

    return each(convert, equation, operands)


def _round(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    operation = "round_half_even" if int(equation.parameters["rounding_method"]) == 1 else "round_half_away"
    return each(lambda a: writer.define(operation, (a,), equation.dtype), equation, operands)


RULES: dict[str, Rule] = {
    **dict.fromkeys(SAME_NAME | set(OTHER_NAME), elementwise),
    **dict.fromkeys(UNCHANGED, lambda writer, e, operands: operands),
    "square": lambda writer, e, operands: each(lambda a: writer.define("mul", (a, a), e.dtype), e, operands),
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

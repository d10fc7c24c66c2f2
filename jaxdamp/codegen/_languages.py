"""Scalar programs as text: C (C99 that is C++ too) and JavaScript."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, NoReturn

from jaxdamp.codegen._branches import in_branches
from jaxdamp.codegen._program import (
    Assign,
    Atom,
    Branch,
    Constant,
    Declare,
    Define,
    Leave,
    Loop,
    Statement,
    Table,
    Variable,
    names,
    names_in,
)


# In both languages; entries that differ stand with the language.
_INFIX = {
    **{"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "gt": ">", "ge": ">="},
    **{"and": "&", "or": "|", "xor": "^"},
}
_LOGICAL = {"and": "&&", "or": "||", "xor": "!="}
_TEMPLATES = {
    "copy": "{0}",
    "neg": "-{0}",
    "select": "{0} ? {1} : {2}",
    "look_up": "{0}[{1}]",
    "sign": "{0} > 0 ? 1 : {0} < 0 ? -1 : {0}",
    "max": "{0} > {1} ? {0} : {1}",
    "min": "{0} < {1} ? {0} : {1}",
}
# NaN of either operand is the result, as in JAX
_OF_FLOATS = {
    "max": "{0} > {1} || {0} != {0} ? {0} : {1}",
    "min": "{0} < {1} || {0} != {0} ? {0} : {1}",
}
FUNCTIONS = frozenset(
    "exp expm1 log log1p log2 sqrt cbrt pow sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh "
    "floor ceil".split()
)


class PrintedFunction(NamedTuple):
    """What a function is printed from.

    Attributes:
        head: the text before the opening brace.
        inputs: the names of its arguments.
        statements: what it computes.
        outputs: texts that values are assigned to at the end, with the values.
        returned: the value that it returns, if any.
    """

    head: str
    inputs: Sequence[str]
    statements: list[Statement]
    outputs: Sequence[tuple[str, Atom]] = ()
    returned: Atom | None = None


class AbstractLanguage(ABC):
    """How statements and operations are written."""

    name: str
    equal: tuple[str, str]

    def function(self, printed: PrintedFunction) -> str:
        """The text of a function."""
        results = names([*(value for _, value in printed.outputs), printed.returned])
        statements = in_branches(printed.statements, (), results)
        lines = [f"{printed.head} {{", *self._unused(printed), *self.lines(statements, 1)]
        targets = {text for text, _ in printed.outputs}
        after: list[str] = []
        for number, (text, value) in enumerate(printed.outputs):
            shown = self.atom(value)
            if shown == text:
                continue
            if shown in targets:  # an input that is assigned to may still be read by another output
                copy = Variable(f"before{number}", value.dtype)
                lines += self.lines([Define(copy, "copy", (value,))], 1)
                shown = copy.name
            after.append(f"    {text} = {shown};")
        lines += after
        if printed.returned is not None:
            lines.append(f"    return {self.atom(printed.returned)};")
        return "\n".join([*lines, "}", ""])

    def lines(self, statements: Iterable[Statement], depth: int) -> Iterator[str]:
        """The lines of a block."""
        space = "    " * depth
        for statement in statements:
            if isinstance(statement, Loop):
                yield f"{space}for (;;) {{"
                yield from self.lines(statement.body, depth + 1)
                yield f"{space}}}"
            elif isinstance(statement, Branch):
                yield from self._branch(statement, depth)
            else:
                yield space + self._line(statement)

    def _branch(self, branch: Branch, depth: int) -> Iterator[str]:
        """Cases below the first are the first, those above the last are the last, as JAX limits them."""
        space, case = "    " * depth, self.atom(branch.case)
        last = len(branch.bodies) - 1
        cases = [
            (f"if ({case} {'==' if i else '<='} {i}) " if i < last else "", b) for i, b in enumerate(branch.bodies)
        ]
        if branch.case.dtype == "bool" and last == 1:
            no, yes = branch.bodies
            cases = [(f"if ({case}) ", yes), ("", no)] if yes else [(f"if (!{case}) ", no), ("", yes)]
            cases = [each for each in cases if each[1]]
        for number, (test, body) in enumerate(cases):
            yield f"{space}{'} else ' if number else ''}{test}{{"
            yield from self.lines(body, depth + 1)
        if cases:
            yield f"{space}}}"

    def _line(self, statement: Statement) -> str:
        if isinstance(statement, Define):
            texts = [self.atom(operand) for operand in statement.operands]
            dtypes = [operand.dtype for operand in statement.operands]
            expression = self.expression(statement.operation, texts, dtypes, statement.target.dtype)
            return f"{self.constant_of(statement.target.dtype)}{statement.target.name} = {expression};"
        if isinstance(statement, Leave):
            return f"if (!{self.atom(statement.unless)}) break;"
        if isinstance(statement, Assign):
            place = "" if statement.index is None else f"[{self.atom(statement.index)}]"
            return f"{statement.target.name}{place} = {self.atom(statement.value)};"
        if isinstance(statement, Table):
            return self.table(statement)
        assert isinstance(statement, Declare)
        return self.declaration(statement)

    def atom(self, atom: Atom) -> str:
        """A variable or a number."""
        return atom.name if isinstance(atom, Variable) else self.number(atom)

    def expression(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str:
        """An operation on operands that are names or numbers."""
        if operation in FUNCTIONS and dtype.startswith("float"):
            return f"{self.call(operation, dtype)}({', '.join(texts)})"
        if operation in _LOGICAL and dtypes[0] == "bool":
            return f"{texts[0]} {_LOGICAL[operation]} {texts[1]}"
        if operation in ("eq", "ne"):
            return f"{texts[0]} {self.equal[operation == 'ne']} {texts[1]}"
        if operation == "not":
            return f"!{texts[0]}" if dtype == "bool" else f"~{texts[0]}"
        text = self.own(operation, texts, dtypes, dtype)
        if text is not None:
            return text
        if operation in _INFIX:
            return f"{texts[0]} {_INFIX[operation]} {texts[1]}"
        templates = _TEMPLATES | (_OF_FLOATS if dtype.startswith("float") else {})
        if operation in templates:
            return templates[operation].format(*texts)
        self.refuse(operation)

    def refuse(self, operation: str) -> NoReturn:
        """Refuse what the language has not."""
        raise NotImplementedError(f"{self.name} has no {operation!r}. Write the function with other operations.")

    @abstractmethod
    def number(self, atom: Constant) -> str:
        """A number as text."""

    @abstractmethod
    def call(self, function: str, dtype: str) -> str:
        """The name of an elementary function."""

    @abstractmethod
    def own(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str | None:
        """An operation that is written in this language in its own way."""

    @abstractmethod
    def constant_of(self, dtype: str) -> str:
        """What stands before the name of a value that does not change."""

    @abstractmethod
    def declaration(self, statement: Declare) -> str:
        """A variable, or an array of them."""

    @abstractmethod
    def table(self, statement: Table) -> str:
        """An array of given entries."""

    def _unused(self, printed: PrintedFunction) -> list[str]:
        return []


class C(AbstractLanguage):
    """C99 with the functions of <math.h>; the same text is C++."""

    name = "C"
    equal = ("==", "!=")
    types: dict[str, str]

    def __init__(self) -> None:
        whole = [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
        self.types = {"float64": "double", "float32": "float", "bool": "bool"} | {name: f"{name}_t" for name in whole}

    def number(self, atom: Constant) -> str:
        """Of the type of the atom; negative ones in parentheses."""
        text = atom.text
        if atom.dtype == "bool":
            return text.lower()
        if atom.dtype.startswith("float"):
            sign, size = ("-", text[1:]) if text.startswith("-") else ("", text)
            size = {"inf": "INFINITY", "nan": "NAN"}.get(size) or (size if set(".en") & set(size) else f"{size}.0")
            suffix = "f" if atom.dtype == "float32" and size[0].isdigit() else ""
            text = f"{sign}{size}{suffix}"
        return f"({text})" if text.startswith("-") else text

    def call(self, function: str, dtype: str) -> str:
        """Functions of `float` end in f."""
        return f"{function}f" if dtype == "float32" else function

    def own(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str | None:
        """Functions that JavaScript has not or names otherwise."""
        real = dtypes[0].startswith("float")
        if operation == "convert":
            return f"{texts[0]} != 0" if dtype == "bool" else f"({self.types[dtype]}){texts[0]}"
        if operation == "is_finite":
            return f"isfinite({texts[0]}) != 0"
        if operation == "abs" and not real:
            return f"{texts[0]} < 0 ? -{texts[0]} : {texts[0]}"
        if operation == "rem" and not real:
            return f"{texts[0]} % {texts[1]}"
        renamed = {"abs": "fabs", "rem": "fmod", "round_half_even": "rint", "round_half_away": "round"}
        if operation in renamed or operation in ("erf", "erfc", "exp2", "nextafter"):
            return f"{self.call(renamed.get(operation, operation), dtype)}({', '.join(texts)})"
        return None

    def constant_of(self, dtype: str) -> str:
        """`const` and the type."""
        return f"const {self.types[dtype]} "

    def declaration(self, statement: Declare) -> str:
        """A variable, or an array of them."""
        size = "" if statement.size is None else f"[{statement.size}]"
        start = "" if statement.start is None else f" = {self.atom(statement.start)}"
        return f"{self.types[statement.target.dtype]} {statement.target.name}{size}{start};"

    def table(self, statement: Table) -> str:
        """An array, which stands in read-only memory if all entries are numbers."""
        still = "static " if all(isinstance(entry, Constant) for entry in statement.entries) else ""
        entries = ", ".join(map(self.atom, statement.entries))
        size = f"[{len(statement.entries)}]"
        return f"{still}{self.constant_of(statement.target.dtype)}{statement.target.name}{size} = {{{entries}}};"

    def _unused(self, printed: PrintedFunction) -> list[str]:
        """Arguments that nothing reads or assigns are named, since compilers warn of them."""
        used = names([value for _, value in printed.outputs]) | names([printed.returned])
        used |= {text for text, _ in printed.outputs} | names_in(printed.statements)
        roots = {name.split("[")[0].split("->")[0] for name in used}
        return [f"    (void){name};" for name in printed.inputs if name not in roots]


class JavaScript(AbstractLanguage):
    """JavaScript, whose numbers are all of 64 bits."""

    name = "JavaScript"
    equal = ("===", "!==")

    def number(self, atom: Constant) -> str:
        """Negative ones in parentheses."""
        text = {"True": "true", "False": "false"}.get(atom.text, atom.text)
        text = text.replace("inf", "Infinity").replace("nan", "NaN")
        return f"({text})" if text.startswith("-") else text

    def call(self, function: str, dtype: str) -> str:
        """All are functions of `Math`."""
        return f"Math.{function}"

    def own(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str | None:
        """Conversions, remainders, and quotients of whole numbers."""
        if operation == "convert":
            if dtype == "bool":
                return f"{texts[0]} !== 0"
            return f"{'Number' if dtypes[0] == 'bool' or dtype.startswith('float') else 'Math.trunc'}({texts[0]})"
        if operation == "div" and not dtype.startswith("float"):
            return f"Math.trunc({texts[0]} / {texts[1]})"
        own = {
            "abs": "Math.abs({0})",
            "rem": "{0} % {1}",
            "is_finite": "Number.isFinite({0})",
            "exp2": "2 ** {0}",
            # the sum with 1.5 2**52 has no digits after the point
            "round_half_even": "Math.abs({0}) < 2 ** 51 ? {0} + 6755399441055744 - 6755399441055744 : {0}",
            "round_half_away": "Math.sign({0}) * Math.round(Math.abs({0}))",
        }
        return own[operation].format(*texts) if operation in own else None

    def constant_of(self, dtype: str) -> str:
        """Only types that numbers of 64 bits hold exactly."""
        self._known(dtype)
        return "const "

    def declaration(self, statement: Declare) -> str:
        """A variable, or an array of them."""
        self._known(statement.target.dtype)
        if statement.size is not None:
            return f"const {statement.target.name} = new Array({statement.size});"
        start = "" if statement.start is None else f" = {self.atom(statement.start)}"
        return f"let {statement.target.name}{start};"

    def table(self, statement: Table) -> str:
        """An array."""
        return f"const {statement.target.name} = [{', '.join(map(self.atom, statement.entries))}];"

    def _known(self, dtype: str) -> None:
        if dtype == "float32":
            self.refuse(dtype)

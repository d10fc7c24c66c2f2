"""What a step computes of each point: for one in a thread, and for many side by side in vectors.

Vectors follow no loop of a single point. A step is therefore divided into straight runs around its loops; each loop
goes on until all points of some vectors are done, while those that are done keep their values.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple, TypeAlias, final

from jaxdamp.codegen._languages import C
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
    constant,
    names_in,
    operands_of,
    pruned,
)


VECTORS = "abcd"  # of a block that a step takes in turn, operation by operation: each waits for its own last result
LONG = 700  # lines of a run that keep a processor busy with one vector, and a compiler with four for minutes
# {1} is not NaN; a NaN of {0} is the result, as that of the second operand of a vector minimum is
LIMITS = {"min": "{1} < {0} ? {1} : {0}", "max": "{1} > {0} ? {1} : {0}"}
# NaN of either operand is the result; "or" would be a choice between conditions, for which gcc has no vectors
_BEYOND = {name: f"{{1}} != {{1}} ? {{1}} : {test}" for name, test in LIMITS.items()}


class OfPoint(C):
    """C with limits that are the same in all steps, and conditions as numbers by a choice: a cast is no vector."""

    def own(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str | None:
        """As in C."""
        if operation == "convert" and dtypes == ["bool"] and dtype == "float64":
            return f"{texts[0]} ? 1.0 : 0.0"
        first, _, limit = operation.partition("limiting ")
        return super().own(operation, texts, dtypes, dtype) if first else LIMITS[limit].format(*texts)


@final
class _InVectors(OfPoint):
    """The same with whole numbers as double ones, so that all of a vector have one width."""

    def __init__(self) -> None:
        super().__init__()
        self.types = {name: "bool" if name == "bool" else "double" for name in self.types}

    def number(self, atom: Constant) -> str:
        """Whole numbers with a point."""
        whole = atom.dtype != "bool" and not atom.dtype.startswith("float")
        return super().number(Constant(f"{atom.text}.0", "float64") if whole else atom)

    def own(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str | None:
        """What whole numbers need of their own; quotients and bits of them are refused."""
        if operation in _BEYOND and dtype == "float64":
            return _BEYOND[operation].format(*texts)
        if operation == "look_up":
            return f"{texts[0]}[(int){texts[1]}]"
        if operation == "convert" and dtype != "bool":
            kept = "trunc({0})" if dtypes[0].startswith("float") and not dtype.startswith("float") else "{0}"
            return f"{texts[0]} ? 1.0 : 0.0" if dtypes[0] == "bool" else kept.format(texts[0])
        if "int" in dtype and operation in ("div", "rem", "and", "or", "xor", "not", "pow"):
            message = f"The operation {operation!r} of whole numbers cannot be printed for many points side by side."
            raise NotImplementedError(message)
        return super().own(operation, texts, dtypes, dtype)


class Step(NamedTuple):
    """What depends on point and step."""

    places: dict[Variable, str]  # where values are that were computed before
    statements: list[Statement]
    ends: list[tuple[str, Atom]]  # targets, and what they become at the end, all at once

    def lines(self) -> list[str]:
        """C for one point."""
        printer = OfPoint()
        load = [f"const {printer.types[v.dtype]} {v.name} = {place};" for v, place in self.places.items()]
        ends = assigned((target, printer.atom(value)) for target, value in self.ends)
        return [*load, *printer.lines(self.statements, 0), *ends]


def assigned(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """Assignments all at once: values are read before any of the targets changes."""
    pairs = list(pairs)
    copies = [f"const double after{i} = {value};" for i, (_, value) in enumerate(pairs)]
    return copies + [f"{target} = after{i};" for i, (target, _) in enumerate(pairs)]


class _Next(NamedTuple):
    """A new value where a loop goes on."""

    target: Variable
    value: Atom
    going: Variable

    @property
    def after(self) -> Variable:
        """The new value, or the old one."""
        return Variable(f"{self.target.name}_next", self.target.dtype)


_Straight: TypeAlias = Define | Declare | Table | _Next


class _Run(NamedTuple):
    """Statements without loops."""

    statements: list[_Straight]
    going: Variable | None = None  # which points begin a loop that follows, or go on with the one that ends here
    ends: Sequence[tuple[str, Atom]] = ()

    def reads(self) -> dict[str, Variable]:
        """What comes from elsewhere."""
        atoms = [a for s in self.statements for a in (s if isinstance(s, _Next) else operands_of(s))]
        atoms += [value for _, value in self.ends]
        defined = {s.target.name for s in self.statements if isinstance(s, Define | Table)}
        defined |= {s.after.name for s in self.statements if isinstance(s, _Next)}
        return {a.name: a for a in atoms if isinstance(a, Variable) and a.name not in defined}


class _Repeated(NamedTuple):
    """A loop, entered where one of the points of some vectors goes on."""

    going: Variable
    body: "list[_Run | _Repeated]"


_Body: TypeAlias = list[_Run | _Repeated]


def in_vectors(steps: Mapping[str, Step]) -> dict[str, str | list[str]]:
    """The lines of each step for points side by side, and how many numbers pass between runs.

    Raises:
        NotImplementedError: branches, arrays of a point, and operations of whole numbers that vectors have not.
    """
    divided = {name: _Divided(step) for name, step in steps.items()}
    lines: dict[str, str | list[str]] = {name: [*step.lines()] for name, step in divided.items()}
    return lines | {"passed": str(max(len(step.passed) for step in divided.values()))}


@final
class _Divided:
    """A step in runs, which pass numbers to each other in memory."""

    def __init__(self, step: Step) -> None:
        self._count, self._step = count(), step
        self._body = self._divided(step.statements, None, step.ends)
        runs = [*_runs(self._body)]
        written = {s.target.name: s.target for run in runs for s in run.statements}
        read = {name: written[name] for run in runs for name in run.reads() if name in written}
        self.passed = {variable: f"passed[{i}][lane]" for i, variable in enumerate(read.values())}
        self._printed = {id(run): [*self._lines_of(run)] for run in runs}

    def lines(self) -> Iterator[str]:
        """The step for all vectors of a block."""
        return self._lines(self._body)

    def _divided(
        self, statements: list[Statement], going: Variable | None, ends: Sequence[tuple[str, Atom]] = ()
    ) -> _Body:
        """Runs and loops; where a loop goes on is known at the end of the run before it, and of its own last run."""
        body: _Body = []
        run: list[_Straight] = []
        for s in statements:
            if isinstance(s, Loop):
                body += self._entered(s, run, going)
                run = []
            elif isinstance(s, Assign) and going and s.index is None:
                run.append(_Next(s.target, s.value, going))
            elif isinstance(s, Define | Table) or (isinstance(s, Declare) and s.size is None):
                run.append(s)
            else:
                raise _refused(branch=isinstance(s, Branch))
        return [*body, _Run(run, None, ends)]

    def _entered(self, loop: Loop, run: list[_Straight], outside: Variable | None) -> _Body:
        """A loop, and the run before it, which knows where it is entered."""
        going = Variable(f"going{next(self._count)}", "bool")
        place = next(i for i, s in enumerate(loop.body) if isinstance(s, Leave))
        condition, leave, after = loop.body[:place], loop.body[place], loop.body[place + 1 :]
        starts = {s.target: s.start for s in run if isinstance(s, Declare)}
        test, goes = _tested(condition, leave, starts, "_first")
        run = [*run, *test, Define(going, "and", (goes, outside or constant(True, "bool")))]
        # the rest may read what the condition has computed
        *parts, last = self._divided([*pruned(condition, names_in(after)), *after], going)
        assert isinstance(last, _Run)
        test, goes = _tested(
            condition, leave, {s.target: s.after for s in last.statements if isinstance(s, _Next)}, "_again"
        )
        last = _Run([*last.statements, *test, _Next(going, goes, going)], going)
        return [_Run(run, going), _Repeated(going, [*parts, last])]

    def _lines_of(self, run: _Run) -> Iterator[str]:
        """C for one vector."""
        printer = _InVectors()
        yield from self._loads(run)
        for s in run.statements:
            if isinstance(s, Define | Table):
                yield from printer.lines([s], 0)
            elif isinstance(s, _Next):
                yield from _moved(s, printer)
            if s.target in self.passed:
                if isinstance(s, Table):
                    raise _refused(branch=False)
                value = s.target if isinstance(s, Define) else s.after if isinstance(s, _Next) else s.start
                number = " ? 1.0 : 0.0" * (s.target.dtype == "bool")
                yield from [f"{self.passed[s.target]} = {printer.atom(value)}{number};"] if value else []
        if run.going:
            ends_loop = any(isinstance(s, _Next) and s.target == run.going for s in run.statements)
            yield f"{_points(run.going)} += {run.going.name}{'_next' * ends_loop} ? 1.0 : 0.0;"
        yield from assigned((target, printer.atom(value)) for target, value in run.ends)

    def _loads(self, run: _Run) -> Iterator[str]:
        """What a run reads from memory."""
        places = self.passed | self._step.places
        for variable in filter(places.__contains__, run.reads().values()):
            number = "_number" * (variable.dtype == "bool")
            yield f"const double {variable.name}{number} = {places[variable]};"
            if number:
                yield f"const bool {variable.name} = {variable.name}{number} != 0.0;"

    def _lines(self, body: _Body, inside: Variable | None = None) -> Iterator[str]:
        for part in body:
            if isinstance(part, _Repeated):
                yield f"while ({_points(part.going)} > 0.0) {{"
                yield from ("    " + line for line in self._lines(part.body, part.going))
                yield "}"
            elif lines := self._printed[id(part)]:
                sums = ""
                if part.going:
                    yield f"{'double ' * (part.going != inside)}{_points(part.going)} = 0.0;"
                    sums = f"reduction(+ : {_points(part.going)})"
                vectors = VECTORS if len(lines) <= LONG else VECTORS[:1]
                yield f"{'IN_TURN' if len(vectors) > 1 else 'ONE_BY_ONE'}({sums}) {{"
                yield from ("    " + line for line in ("OTHERS;", *_in_turn(lines, vectors)))
                yield "}"


def _moved(s: _Next, printer: C) -> Iterator[str]:
    """The next value of a variable of a loop; conditions as numbers, since gcc has no vectors for choices of them."""
    name, after, value = s.target.name, s.after.name, printer.atom(s.value)
    if s.target.dtype == "bool":
        yield f"const double {after}_number = {s.going.name} ? ({value} ? 1.0 : 0.0) : {name}_number;"
        yield f"const bool {after} = {after}_number != 0.0;"
    else:
        yield f"const double {after} = {s.going.name} ? {value} : {name};"


def _tested(
    condition: list[Statement], leave: Statement, given: Mapping[Variable, Atom | None], suffix: str
) -> tuple[list[_Straight], Atom]:
    """The condition of a loop for given values of its variables, and its result."""
    constants: dict[Atom, Atom] = {variable: value for variable, value in given.items() if value is not None}
    test: list[_Straight] = []
    for s in condition:
        if not isinstance(s, Define):
            message = "A loop in the condition of a loop cannot be printed for many points side by side."
            raise NotImplementedError(message)
        target = Variable(s.target.name + suffix, s.target.dtype)
        test.append(Define(target, s.operation, tuple(constants.get(a, a) for a in s.operands)))
        constants[s.target] = target
    assert isinstance(leave, Leave)
    return test, constants.get(leave.unless, leave.unless)


def _points(going: Variable) -> str:
    """The number of points that go on."""
    return f"points_{going.name}"


def _refused(*, branch: bool) -> NotImplementedError:
    what = "A branch" if branch else "An array that loops read or write"
    return NotImplementedError(f"{what} inside a step cannot be printed for many points side by side.")


def _runs(body: _Body) -> Iterator[_Run]:
    for part in body:
        yield from _runs(part.body) if isinstance(part, _Repeated) else (part,)


def _in_turn(lines: Sequence[str], vectors: str) -> Iterator[str]:
    """Each line for one vector after the other, with names of its own for what it defines."""
    local = {"lane", *(name for line in lines for name in re.findall(r"^ *const \w+ (\w+)", line))}
    for line in lines:
        for vector in vectors:
            yield re.sub(r"[A-Za-z]\w*", lambda word, v=vector: word[0] + v * (word[0] in local), line)

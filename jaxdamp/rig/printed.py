"""The C functions of a law on a machine: its force, the step of its states, and what they are differentiated by."""

import ctypes
import dataclasses
import functools
import logging
import threading
from collections.abc import Callable, Hashable, Sequence
from typing import Generic, NamedTuple, TypeVar

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from jaxdamp.codegen import Constant, Signature, Symbols, library, symbols, with_slopes
from jaxdamp.dampers import AbstractDamper, laws_inside, margins
from jaxdamp.rig.law_numbers import LawNumbers, numbers_of
from jaxdamp.rig.machine import Rig, gas_and_friction
from jaxdamp.rig.printed_records import MachineNumbers, MachinePlaces, PrintedRecord, Record


T = TypeVar("T")
_LOG = logging.getLogger("jaxdamp.printed")
LANES = 4  # derivatives side by side, of which there is a whole number
_HEAD = """#include <math.h>
#include <stdint.h>
#include <stdbool.h>
#include <string.h>
enum {{ SLOPES = {slopes}, LANES = {lanes}, STATES = {states} }};
static const double dp[SLOPES + 1][LANES] = {{{rows}}};
{moves}
"""
# Derivatives of the motion by the delay of the machine, which are those of its lane.
_MOVES = "\n".join(f"#define D{end} (d{end} * dp[{{0}}][k])" for end in ("x", "v", "x0", "v0", "x1", "v1"))
_RECORD = """
void record(const double *p, int64_t count, int64_t parts, const double *x, const double *v, const double *fine_x,
            const double *fine_v, const double *dx, const double *dv, const double *fine_dx, const double *fine_dv,
            double h, const double *weight, const double *measured, const int64_t *column, int64_t width, double *out)
{
    double s[STATES + 1], F, dF[LANES] __attribute__((aligned(64)));
    double ds[STATES + 1][LANES] __attribute__((aligned(64)));
    const int slopes = weight != 0;
    begin_prepare(p); force_prepare(p); advance_prepare(p);
    begin(p, x[0], dx ? dx[0] : 0.0, s, ds, slopes);
    for (int64_t t = 0; t < count; t++) {
        if (!slopes) {
            force(p, x[t], v[t], 0.0, 0.0, s, (const double (*)[LANES])ds, &F, dF, 0);
            out[t] = F;
        } else if (weight[t] > 0.0) {
            double *row = out + t * width;
            force(p, x[t], v[t], dx ? dx[t] : 0.0, dv ? dv[t] : 0.0, s, (const double (*)[LANES])ds, &F, dF, 1);
            for (int k = 0; k < SLOPES; k++) row[column[k]] += dF[k] * weight[t];
            row[width - 1] = (F - measured[t]) * weight[t];
        }
        if (STATES && t + 1 < count)
            for (int64_t j = t * parts; j < (t + 1) * parts; j++)
                advance(p, fine_x[j], fine_v[j], fine_x[j + 1], fine_v[j + 1], h, dx ? fine_dx[j] : 0.0,
                        dx ? fine_dv[j] : 0.0, dx ? fine_dx[j + 1] : 0.0, dx ? fine_dv[j + 1] : 0.0, s, ds, slopes);
    }
}
"""
_HOLD = """
void hold(const double *p, double x, int64_t points, const double *v, int64_t count, double *states, double *forces)
{
    double ds[STATES + 1][LANES], dF[LANES], before[STATES + 1];
    force_prepare(p); advance_prepare(p);
    for (int64_t i = 0; i < points; i++) {
        double *s = states + i * STATES;
        for (int64_t step = 0, moves = 1; moves && step < count; step++) {
            moves = 0;
            memcpy(before, s, STATES * sizeof *s);
            advance(p, x, v[i], x, v[i], 1e-3, 0.0, 0.0, 0.0, 0.0, s, ds, 0);
            for (int m = 0; m < STATES; m++) moves |= !(fabs(s[m] - before[m]) <= 4e-16 * fabs(s[m]));
        }
        force(p, x, v[i], 0.0, 0.0, s, (const double (*)[LANES])ds, forces + i, dF, 0);
    }
}
"""
_CONDITIONS = """
void conditions(const double *p, double *m, double (*dm)[LANES]) { margins_prepare(p); margins(p, m, dm, 1); }
"""
_ARGUMENTS = {
    "begin": "double x, double dx, double *restrict s, double (*restrict ds)[LANES], int slopes",
    "force": "double x, double v, double dx, double dv, const double *restrict s, "
    "const double (*restrict ds)[LANES], double *restrict F, double *restrict dF, int slopes",
    "advance": "double x0, double v0, double x1, double v1, double h, double dx0, double dv0, double dx1, double dv1, "
    "double *restrict s, double (*restrict ds)[LANES], int slopes",
    "margins": "double *restrict m, double (*restrict dm)[LANES], int slopes",
}


@functools.cache
def plain_rig() -> Rig:
    """A machine that adds nothing, so that a law has the same functions on a machine and without."""
    return Rig()


class _OnRig(NamedTuple):
    law: AbstractDamper
    rig: Rig


def numbers_on_rig(law: AbstractDamper, rig: Rig | None = None) -> LawNumbers:
    """The numbers of a law on a machine `rig`, or on one that adds nothing."""
    return numbers_of(_OnRig(law, rig or plain_rig()))


class _Printed(NamedTuple):
    """A function of a law before it is printed: of its arrays, its states, and the other arguments."""

    function: Callable[..., Array]
    results: tuple[list[str], list[str]]  # texts of values and of their derivatives in lane k
    states: int = 0
    rest: tuple[str, ...] = ()

    def text(self, name: str, shapes: Sequence[tuple[int, ...]], free: Sequence[int], moves: bool) -> str:
        """In C; with `moves`, the motion has derivatives."""
        signature = Signature(name, _ARGUMENTS[name], *self.results)
        still = Symbols(np.array(Constant("0.0", "float64"), object))  # the step h of time
        of_rest = [still if each == "h" else symbols(f"D{each}") for each in self.rest if moves]
        return with_slopes(
            signature, self.function, shapes, free, self.states, rest=list(map(symbols, self.rest)), moves=of_rest
        )


def _functions(numbers: LawNumbers, states: int, conditions: int) -> dict[str, _Printed]:
    """What is printed of a law on its machine."""

    def force(arrays: list[Array], s: Array, x: Array, v: Array) -> Array:
        law, rig = numbers.built(arrays)
        gas, friction = gas_and_friction(rig, x, v)
        return law.force(x - rig.stroke_offset, v, s) + gas + friction + rig.force_offset

    def advance(arrays: list[Array], s: Array, x0: Array, v0: Array, x1: Array, v1: Array, h: Array) -> Array:
        law, rig = numbers.built(arrays)
        return law.advance(x0 - rig.stroke_offset, v0, x1 - rig.stroke_offset, v1, s, h)

    def each(name: str, count: int) -> tuple[list[str], list[str]]:
        return [f"{name}[{i}]" for i in range(count)], [f"d{name}[{i}][k]" for i in range(count)]

    def begin(arrays: list[Array], s: Array, x: Array) -> Array:
        law, rig = numbers.built(arrays)
        return law.state_at_rest(x - rig.stroke_offset)

    of_conditions = _Printed(lambda arrays, s: margins(numbers.built(arrays).law), each("m", conditions))
    return {
        "begin": _Printed(begin, each("s", states), 0, ("x",)),
        "force": _Printed(force, (["*F"], ["dF[k]"]), states, ("x", "v")),
        "advance": _Printed(advance, each("s", states), states, ("x0", "v0", "x1", "v1", "h")),
    } | ({"margins": of_conditions} if conditions else {})


class PrintedLaw:
    """The C functions of a structure of a law, differentiated by some of its arrays of numbers.

    Arguments:
        numbers: of the law on its machine.
        free: places of these arrays among all.
    """

    def __init__(self, numbers: LawNumbers, free: tuple[int, ...]) -> None:
        self._on_rig = numbers.built(numbers.arrays)
        law = self._on_rig.law
        self.free, shapes = free, [array.shape for array in numbers.arrays]
        self.slopes = sum(numbers.arrays[i].size for i in free)
        self.lanes = LANES * max(-(-self.slopes // LANES), 1)
        self.states = int(jax.eval_shape(lambda: law.initial_state()).size)
        conditional = any(part.has_conditions() for _, part in laws_inside(law))
        self.conditions = int(jax.eval_shape(lambda: margins(law)).size) if conditional else 0
        ends = np.cumsum([0, *(array.size for array in numbers.arrays)])
        rig = numbers.built([int(end) for end in ends[:-1]]).rig  # the place of each number
        self._machine = MachinePlaces(*map(int, (rig.force_delay, rig.moving_mass, rig.force_lag)))
        places = np.concatenate([ends[:0], *(np.arange(ends[i], ends[i + 1]) for i in free)])
        delay = np.flatnonzero(places == self._machine.delay)
        rows = np.eye(max(self.slopes, 1), self.lanes, dtype=int)
        head = {"slopes": self.slopes, "lanes": self.lanes, "states": self.states}
        text = _HEAD.format(
            **head,
            rows=", ".join(f"{{{', '.join(map(str, row))}}}" for row in rows),
            moves=_MOVES.format(*delay) if delay.size else "",
        )
        functions = _functions(numbers, self.states, self.conditions)
        text += "".join(each.text(name, shapes, free, delay.size > 0) for name, each in functions.items())
        self._text = text + _RECORD + _HOLD + _CONDITIONS * bool(self.conditions)
        self._load()

    def _load(self) -> None:
        compiled, pointer, whole = library(self._text), ctypes.c_void_p, ctypes.c_int64
        self._record, self._hold = compiled.record, compiled.hold
        self._conditions = getattr(compiled, "conditions", None)
        self._record.argtypes = [pointer, whole, whole, *[pointer] * 8, ctypes.c_double, *[pointer] * 3, whole, pointer]
        self._hold.argtypes = [pointer, ctypes.c_double, whole, pointer, whole, pointer, pointer]
        self._record.restype = self._hold.restype = None

    def __getstate__(self) -> dict[str, object]:
        """For another process, which loads the functions anew."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_record", "_hold", "_conditions")}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self._load()

    def forces(self, p: Float[np.ndarray, " numbers"], row: Record) -> Float[np.ndarray, " time"]:
        """The force [N] at every instant of a record."""
        out = np.empty(len(row.force))
        self._record(p.ctypes.data, len(out), *_motion(row), None, None, None, 0, out.ctypes.data)
        return out

    def hold(
        self,
        p: Float[np.ndarray, " numbers"],
        x: float,
        v: Float[np.ndarray, " points"],
        count: int,
        states: np.ndarray,
    ) -> Float[np.ndarray, " points"]:
        """The force [N] after so many milliseconds at constant velocities, or where the states stand still.

        Arguments:
            p: all numbers.
            x: the stroke [m].
            v: the velocities [m/s].
            count: steps of a millisecond.
            states: of each point, shape (points, states), which are changed.
        """
        forces = np.empty(v.size)
        self._hold(p.ctypes.data, x, v.size, v.ctypes.data, count, states.ctypes.data, forces.ctypes.data)
        return forces

    def linearise(
        self, p: np.ndarray, row: Record, column: Int[np.ndarray, " slopes"], out: Float[np.ndarray, "time width"]
    ) -> None:
        """Add weighted derivatives to the columns of `out`, and put the weighted difference into the last one."""
        data = row.weight.ctypes.data, row.force.ctypes.data, column.ctypes.data
        self._record(p.ctypes.data, row.used, *_motion(row), *data, out.shape[1], out.ctypes.data)

    def machine(self, p: Float[np.ndarray, " numbers"]) -> MachineNumbers:
        """The numbers of the machine among all."""
        return MachineNumbers(*(float(p[place]) for place in self._machine))

    def columns_of_machine(self, taken: Int[np.ndarray, " numbers"]) -> MachinePlaces:
        """Which free numbers those of the machine take."""
        return MachinePlaces(*(int(taken[place]) for place in self._machine))

    def margins(
        self, p: Float[np.ndarray, " numbers"]
    ) -> tuple[Float[np.ndarray, " conditions"], Float[np.ndarray, "conditions slopes"]]:
        """The margins of the conditions between parameters, and their derivatives."""
        values, slopes = np.zeros(self.conditions), np.zeros((self.conditions, self.lanes))
        if self._conditions is not None:
            self._conditions(*(ctypes.c_void_p(a.ctypes.data) for a in (p, values, slopes)))
        return values, slopes[:, : self.slopes]


def _motion(row: Record) -> list[object]:
    """The arguments of a record's function that describe its motion."""
    return [row.parts, *row.motion.places(), *(row.by_delay.places() if row.by_delay else [None] * 4), row.step]


_laws: dict[Hashable, list[PrintedLaw]] = {}
_locks: dict[Hashable, threading.Lock] = {}
_refused: dict[Hashable, str] = {}
_LOCK = threading.Lock()


def printed_law(numbers: LawNumbers, free: set[int] | None) -> PrintedLaw | None:
    """The C functions of a structure, printed when they are first asked for; None where they cannot be.

    Arguments:
        numbers: of a law of this structure on its machine.
        free: arrays by which they are differentiated at least; any will do if None.
    """
    with _LOCK:
        lock = _locks.setdefault(numbers.key, threading.Lock())
    with lock:
        for law in _laws.get(numbers.key, []):
            if (free or set()) <= set(law.free):
                return law
        if numbers.key in _refused:
            return None
        try:
            law = PrintedLaw(numbers, tuple(sorted(free or set())))
        except NotImplementedError as error:
            _refused[numbers.key] = str(error)
            say(f"{type(numbers.built(numbers.arrays).law).__name__} is computed by XLA. {error}")
            return None
        with _LOCK:
            _laws.setdefault(numbers.key, []).append(law)
        return law


def printed_forces(
    numbers: Sequence[LawNumbers], rows: Sequence[PrintedRecord]
) -> list[Float[np.ndarray, " time"]] | None:
    """What the force channel shows [N] in each record; None where the law cannot be printed.

    Arguments:
        numbers: of the law on its machine in each record, all of one structure.
        rows: the records.
    """
    law = printed_law(numbers[0], None)
    if law is None:
        return None
    forces, none = [], MachinePlaces(-1, -1, -1)
    for p, row in zip((each.flat for each in numbers), rows, strict=True):
        record = row.on_machine(law.machine(p).delay)
        forces.append(row.shown(law.forces(p, record)[:, None], record, law.machine(p), none)[:, 0])
    return forces


@dataclasses.dataclass(frozen=True)
class WithPrinted(Generic[T]):
    """A function whose result comes with the laws that were printed for it, for `remember` in another process."""

    function: Callable[..., T]

    def __call__(self, *arguments: object) -> tuple[T, list[PrintedLaw]]:
        """The result, and the laws."""
        before = set(map(id, _printed()))
        result = self.function(*arguments)
        return result, [law for law in _printed() if id(law) not in before]


def _printed() -> list[PrintedLaw]:
    with _LOCK:
        return [law for laws in _laws.values() for law in laws]


def remember(laws: Sequence[PrintedLaw]) -> None:
    """Laws that another process has printed need not be printed here.

    Arguments:
        laws: of `WithPrinted`.
    """
    for law in laws:
        key = numbers_of(law._on_rig).key
        with _LOCK:
            printed = _laws.setdefault(key, [])
            if all(law.free != other.free for other in printed):
                printed.append(law)


@functools.cache
def say(text: str) -> None:
    """Into the log, once for each text."""
    _LOG.info(text)

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
from jaxdamp.dampers import laws_inside, margins
from jaxdamp.identify.model import Model, OnRig, law_of, rig_of
from jaxdamp.identify.printed_records import MachineNumbers, MachinePlaces, Record
from jaxdamp.rig import LawNumbers, Rig, gas_and_friction, numbers_of


T = TypeVar("T")
_LOG = logging.getLogger("jaxdamp.identify.printed")
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
    begin(p, s, ds, slopes);
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
_CONDITIONS = """
void conditions(const double *p, double *m, double (*dm)[LANES]) { margins_prepare(p); margins(p, m, dm, 1); }
"""
_ARGUMENTS = {
    "begin": "double *restrict s, double (*restrict ds)[LANES], int slopes",
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


def numbers_on_rig(model: Model, rig: Rig | None = None) -> LawNumbers:
    """The numbers of a law on its machine, or on another one if it has none."""
    return numbers_of(OnRig(law_of(model), rig_of(model) or rig or plain_rig()))


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
        law, rig = numbers.built(arrays).law, numbers.built(arrays).rig
        assert rig is not None
        gas, friction = gas_and_friction(rig, x, v)
        return law.force(x - rig.stroke_offset, v, s) + gas + friction + rig.force_offset

    def advance(arrays: list[Array], s: Array, x0: Array, v0: Array, x1: Array, v1: Array, h: Array) -> Array:
        law, rig = numbers.built(arrays).law, numbers.built(arrays).rig
        assert rig is not None
        return law.advance(x0 - rig.stroke_offset, v0, x1 - rig.stroke_offset, v1, s, h)

    def each(name: str, count: int) -> tuple[list[str], list[str]]:
        return [f"{name}[{i}]" for i in range(count)], [f"d{name}[{i}][k]" for i in range(count)]

    of_conditions = _Printed(lambda arrays, s: margins(numbers.built(arrays)), each("m", conditions))
    return {
        "begin": _Printed(lambda arrays, s: numbers.built(arrays).law.initial_state(), each("s", states)),
        "force": _Printed(force, (["*F"], ["dF[k]"]), states, ("x", "v")),
        "advance": _Printed(advance, each("s", states), states, ("x0", "v0", "x1", "v1", "h")),
    } | ({"margins": of_conditions} if conditions else {})


class PrintedLaw:
    """The C functions of a structure of a law, and which arrays of its numbers they are differentiated by."""

    def __init__(self, numbers: LawNumbers, free: tuple[int, ...]) -> None:
        self.model = model = numbers.built(numbers.arrays)
        self.free, shapes = free, [array.shape for array in numbers.arrays]
        self.slopes = sum(numbers.arrays[i].size for i in free)
        self.lanes = LANES * max(-(-self.slopes // LANES), 1)
        self.states = int(jax.eval_shape(lambda: law_of(model).initial_state()).size)
        conditional = any(law.has_conditions() for _, law in laws_inside(model))
        self.conditions = int(jax.eval_shape(lambda: margins(model)).size) if conditional else 0
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
        self._text = text + _RECORD + _CONDITIONS * bool(self.conditions)
        self._load()

    def _load(self) -> None:
        compiled, pointer, whole = library(self._text), ctypes.c_void_p, ctypes.c_int64
        self._record, self._conditions = compiled.record, getattr(compiled, "conditions", None)
        self._record.argtypes = [pointer, whole, whole, *[pointer] * 8, ctypes.c_double, *[pointer] * 3, whole, pointer]
        self._record.restype = None

    def __getstate__(self) -> dict[str, object]:
        """For another process, which loads the functions anew."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_record", "_conditions")}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self._load()

    def forces(self, p: Float[np.ndarray, " numbers"], row: Record) -> Float[np.ndarray, " time"]:
        """The force [N] at every instant of a record."""
        out = np.empty(len(row.force))
        self._record(p.ctypes.data, len(out), *_motion(row), None, None, None, 0, out.ctypes.data)
        return out

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
    """A law of this structure, differentiated by these arrays at least; any, if None; None where it does not print."""
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
    """Laws that another process has printed need not be printed here."""
    for law in laws:
        key = numbers_of(law.model).key
        with _LOCK:
            known = _laws.setdefault(key, [])
            if all(law.free != other.free for other in known):
                known.append(law)


@functools.cache
def say(text: str) -> None:
    """Into the log, once for each text."""
    _LOG.info(text)

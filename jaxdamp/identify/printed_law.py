"""The C functions of a law on a machine: its force, the step of its states, and what they are differentiated by."""

import ctypes
import functools
import logging
import threading
from collections.abc import Hashable
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from jaxdamp.codegen import Signature, library, symbols, with_slopes
from jaxdamp.dampers import laws_inside, margins
from jaxdamp.identify.model import Model, OnRig, law_of, rig_of
from jaxdamp.rig import LawNumbers, Rig, gas_and_friction, numbers_of


_LOG = logging.getLogger("jaxdamp.identify.printed")
LANES = 4  # derivatives side by side, of which there is a whole number
_HEAD = """#include <math.h>
#include <stdint.h>
#include <stdbool.h>
#include <string.h>
enum {{ SLOPES = {slopes}, LANES = {lanes}, STATES = {states} }};
static const double dp[SLOPES + 1][LANES] = {{{rows}}};
"""
_RECORD = """
void record(const double *p, int64_t count, int64_t parts, const double *x, const double *v, const double *fine_x,
            const double *fine_v, double h, const double *weight, const double *measured, const int64_t *column,
            int64_t width, double *out)
{
    double s[STATES + 1], F, dF[LANES] __attribute__((aligned(64)));
    double ds[STATES + 1][LANES] __attribute__((aligned(64)));
    const int slopes = weight != 0;
    begin_prepare(p); force_prepare(p); advance_prepare(p);
    begin(p, s, ds, slopes);
    for (int64_t t = 0; t < count; t++) {
        if (!slopes) {
            force(p, x[t], v[t], s, (const double (*)[LANES])ds, &F, dF, 0);
            out[t] = F;
        } else if (weight[t] > 0.0) {
            double *row = out + t * width;
            force(p, x[t], v[t], s, (const double (*)[LANES])ds, &F, dF, 1);
            for (int k = 0; k < SLOPES; k++) row[column[k]] += dF[k] * weight[t];
            row[width - 1] = (F - measured[t]) * weight[t];
        }
        if (STATES && t + 1 < count)
            for (int64_t j = t * parts; j < (t + 1) * parts; j++)
                advance(p, fine_x[j], fine_v[j], fine_x[j + 1], fine_v[j + 1], h, s, ds, slopes);
    }
}
"""
_CONDITIONS = """
void conditions(const double *p, double *m, double (*dm)[LANES]) { margins_prepare(p); margins(p, m, dm, 1); }
"""
_ARGUMENTS = {
    "begin": "double *restrict s, double (*restrict ds)[LANES], int slopes",
    "force": "double x, double v, const double *restrict s, const double (*restrict ds)[LANES], double *restrict F, "
    "double *restrict dF, int slopes",
    "advance": "double x0, double v0, double x1, double v1, double h, double *restrict s, "
    "double (*restrict ds)[LANES], int slopes",
    "margins": "double *restrict m, double (*restrict dm)[LANES], int slopes",
}


@functools.cache
def plain_rig() -> Rig:
    """A machine that adds nothing, so that a law has the same functions on a machine and without."""
    return Rig()


def numbers_on_rig(model: Model, rig: Rig | None = None) -> LawNumbers:
    """The numbers of a law on its machine, or on another one if it has none."""
    return numbers_of(OnRig(law_of(model), rig_of(model) or rig or plain_rig()))


class Record(NamedTuple):
    """A record as its function takes it."""

    stroke: np.ndarray
    velocity: np.ndarray
    fine_stroke: np.ndarray
    fine_velocity: np.ndarray
    parts: int
    step: float  # s, of a part
    weight: np.ndarray
    force: np.ndarray
    used: int  # samples up to the last one with a weight

    def motion(self) -> tuple[int, int, int, int, int, float]:
        """The arguments that describe the motion."""
        places = (a.ctypes.data for a in (self.stroke, self.velocity, self.fine_stroke, self.fine_velocity))
        return (self.parts, *places, self.step)  # type: ignore[return-value]


class PrintedLaw:
    """The C functions of a structure of a law, and which arrays of its numbers they are differentiated by."""

    def __init__(self, numbers: LawNumbers, free: tuple[int, ...]) -> None:
        model = numbers.built(numbers.arrays)
        self.free, shapes = free, [array.shape for array in numbers.arrays]
        self.slopes = sum(numbers.arrays[i].size for i in free)
        self.lanes = LANES * max(-(-self.slopes // LANES), 1)
        self.states = int(jax.eval_shape(lambda: law_of(model).initial_state()).size)
        self.conditions = (
            int(jax.eval_shape(lambda: margins(model)).size)
            if any(law.has_conditions() for _, law in laws_inside(model))
            else 0
        )
        m, printed = self.states, functools.partial(with_slopes, shapes=shapes, free=free)

        def force(arrays: list[Array], s: Array, x: Array, v: Array) -> Array:
            law, rig = numbers.built(arrays).law, numbers.built(arrays).rig
            assert rig is not None
            gas, friction = gas_and_friction(rig, x, v)
            return law.force(x - rig.stroke_offset, v, s) + gas + friction + rig.force_offset

        def advance(arrays: list[Array], s: Array, x0: Array, v0: Array, x1: Array, v1: Array, h: Array) -> Array:
            law, rig = numbers.built(arrays).law, numbers.built(arrays).rig
            assert rig is not None
            return law.advance(x0 - rig.stroke_offset, v0, x1 - rig.stroke_offset, v1, s, h)

        states, of_states = [f"s[{i}]" for i in range(m)], [f"ds[{i}][k]" for i in range(m)]
        signatures = {
            "begin": Signature("begin", _ARGUMENTS["begin"], states, of_states),
            "force": Signature("force", _ARGUMENTS["force"], ["*F"], ["dF[k]"]),
            "advance": Signature("advance", _ARGUMENTS["advance"], states, of_states),
        }
        rest = {"force": list(map(symbols, "xv")), "advance": list(map(symbols, ("x0", "v0", "x1", "v1", "h")))}
        each = {"begin": (lambda arrays, s: numbers.built(arrays).law.initial_state(), 0)}
        each |= {"force": (force, m), "advance": (advance, m)}
        if self.conditions:
            names = [f"m[{i}]" for i in range(self.conditions)], [f"dm[{i}][k]" for i in range(self.conditions)]
            signatures["margins"] = Signature("margins", _ARGUMENTS["margins"], *names)
            each["margins"] = (lambda arrays, s: margins(numbers.built(arrays)), 0)
        rows = np.eye(max(self.slopes, 1), self.lanes, dtype=int)
        head = {"slopes": self.slopes, "lanes": self.lanes, "states": m}
        parts = [_HEAD.format(**head, rows=", ".join(f"{{{', '.join(map(str, row))}}}" for row in rows))]
        parts += [
            printed(signatures[name], function, states=count, rest=rest.get(name, ()))
            for name, (function, count) in each.items()
        ]
        text = "".join([*parts, _RECORD, _CONDITIONS * bool(self.conditions)])
        self._record, self._conditions = library(text).record, getattr(library(text), "conditions", None)
        pointer, whole = ctypes.c_void_p, ctypes.c_int64
        self._record.argtypes = [pointer, whole, whole, *[pointer] * 4, ctypes.c_double, *[pointer] * 3, whole, pointer]
        self._record.restype = None

    def forces(self, p: Float[np.ndarray, " numbers"], row: Record) -> Float[np.ndarray, " time"]:
        """The force [N] at every instant of a record."""
        out = np.empty(len(row.stroke))
        self._record(p.ctypes.data, len(out), *row.motion(), None, None, None, 0, out.ctypes.data)
        return out

    def linearise(
        self, p: np.ndarray, row: Record, column: Int[np.ndarray, " slopes"], out: Float[np.ndarray, "time width"]
    ) -> None:
        """Add weighted derivatives to the columns of `out`, and put the weighted difference into the last one."""
        data = row.weight.ctypes.data, row.force.ctypes.data, column.ctypes.data
        self._record(p.ctypes.data, row.used, *row.motion(), *data, out.shape[1], out.ctypes.data)

    def margins(
        self, p: Float[np.ndarray, " numbers"]
    ) -> tuple[Float[np.ndarray, " conditions"], Float[np.ndarray, "conditions slopes"]]:
        """The margins of the conditions between parameters, and their derivatives."""
        values, slopes = np.zeros(self.conditions), np.zeros((self.conditions, self.lanes))
        if self._conditions is not None:
            self._conditions(*(ctypes.c_void_p(a.ctypes.data) for a in (p, values, slopes)))
        return values, slopes[:, : self.slopes]


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
        _laws.setdefault(numbers.key, []).append(law)
        return law


@functools.cache
def say(text: str) -> None:
    """Into the log, once for each text."""
    _LOG.info(text)

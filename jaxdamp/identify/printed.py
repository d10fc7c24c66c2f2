"""Forces of a law in bench records, and their derivatives, by printed C: compiled in a tenth of XLA's time.

One function for each structure of a law serves records of any number and length, every start, and predictions. What it
cannot compute is computed by XLA, with the same numbers: a machine with delay, lag, mass or heat, a measured
temperature, periodic or estimated initial states, single precision, or where no C compiler is at hand; the log says so
once for each reason.
"""

import ctypes
import dataclasses
import functools
import logging
import threading
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jaxdamp._traced import is_traced
from jaxdamp.codegen import Signature, library, symbols, with_slopes
from jaxdamp.dampers import laws_inside, margins, without_fitted_ranges
from jaxdamp.identify.model import Model, OnRig, law_of, rig_of, starts_in
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters, get, with_values
from jaxdamp.rig import Rig


_LOG = logging.getLogger(__name__)
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


class _Numbers(NamedTuple):
    """A law on a machine as plain numbers.

    Attributes:
        key: its structure, and what of it is no number of a program.
        tree: how it is put together.
        others: its leaves, with None in place of arrays of numbers.
        arrays: the arrays of numbers, in the order of the leaves.
    """

    key: Hashable
    tree: Any
    others: tuple[Any, ...]
    arrays: list[np.ndarray]

    def built(self, arrays: Sequence[Any]) -> OnRig:
        """The law on its machine with other numbers."""
        rest = iter(arrays)
        return jax.tree.unflatten(self.tree, [next(rest) if leaf is None else leaf for leaf in self.others])


def _is_number(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray) and np.issubdtype(leaf.dtype, np.floating)


@functools.cache
def _plain_rig() -> Rig:
    """A machine that adds nothing, so that a law has the same functions on a machine and without."""
    return Rig()


def _blank(tree: Any) -> Any:
    """With −1 in place of every number."""
    return jax.tree.map(lambda leaf: np.full(leaf.shape, -1.0) if _is_number(leaf) else leaf, tree)


def _numbers(model: Model, rig: Rig | None = None) -> _Numbers:
    """The numbers of a law on its machine, or on another one if it has none."""
    on_rig = OnRig(without_fitted_ranges(law_of(model)), rig_of(model) or rig or _plain_rig())
    leaves, tree = jax.tree.flatten(on_rig)
    others = tuple(None if _is_number(leaf) else leaf for leaf in leaves)
    arrays = [np.asarray(leaf, np.float64) for leaf in leaves if _is_number(leaf)]
    fixed = tuple(np.asarray(leaf).tobytes() if isinstance(leaf, jax.Array) else repr(leaf) for leaf in others)
    return _Numbers((tree, fixed, tuple(array.shape for array in arrays)), tree, others, arrays)


class PrintedLaw:
    """The C functions of a structure of a law, and which arrays of its numbers they are differentiated by."""

    def __init__(self, numbers: _Numbers, free: tuple[int, ...]) -> None:
        model = numbers.built(numbers.arrays)
        self.free, shapes = free, [array.shape for array in numbers.arrays]
        self.slopes = sum(numbers.arrays[i].size for i in free)
        self.lanes = LANES * max(-(-self.slopes // LANES), 1)
        self.states = int(law_of(model).initial_state().size)
        self.conditions = int(margins(model).size) if any(law.has_conditions() for _, law in laws_inside(model)) else 0
        m, printed = self.states, functools.partial(with_slopes, shapes=shapes, free=free)

        def force(arrays: list[Any], s: Any, x: Any, v: Any) -> Any:
            law, rig = numbers.built(arrays).law, numbers.built(arrays).rig
            assert rig is not None
            inside = x - rig.stroke_offset
            gas = rig.gas_force + rig.gas_stiffness * inside
            friction = rig.friction * jnp.tanh(v / rig.friction_velocity)
            return law.force(inside, v, s) + gas + friction + rig.force_offset

        def advance(arrays: list[Any], s: Any, x0: Any, v0: Any, x1: Any, v1: Any, h: Any) -> Any:
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

    def forces(self, p: Float[np.ndarray, " numbers"], row: "_Record") -> Float[np.ndarray, " time"]:
        """The force [N] at every instant of a record."""
        out = np.empty(len(row.stroke))
        self._record(p.ctypes.data, len(out), *row.motion(), None, None, None, 0, out.ctypes.data)
        return out

    def linearise(
        self, p: np.ndarray, row: "_Record", column: Int[np.ndarray, " slopes"], out: Float[np.ndarray, "time width"]
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


def _printed_law(numbers: _Numbers, free: set[int] | None) -> PrintedLaw | None:
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
            _say(f"{type(numbers.built(numbers.arrays).law).__name__} is computed by XLA. {error}")
            return None
        _laws.setdefault(numbers.key, []).append(law)
        return law


@functools.cache
def _say(text: str) -> None:
    _LOG.info(text)


def _refusal(parts: Sequence[Any], model: Model) -> str:
    """Why these records with this model are left to XLA; empty if they are not."""
    for part in parts:
        if not isinstance(part, Batch):
            return f"{type(part).__name__} beside the records"
        if part.effects:
            return f"a machine with {', '.join(part.effects)}"
        if part.temperature is not None:
            return "a measured temperature"
        if part.cycle is not None:
            return "periodic initial states"
        if any(leaf.dtype != np.float64 for leaf in (part.stroke, part.force)):
            return "single precision"
    if starts_in(model):
        return "estimated initial states"
    return "a law that is traced" if is_traced((parts, model)) else ""


class _Record(NamedTuple):
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


def _records(batch: Batch) -> list[_Record]:
    rows, parts = [], batch.substeps
    columns = (batch.dt, batch.stroke, batch.velocity, batch.weight, batch.force)
    for step, stroke, velocity, weight, force in zip(*map(np.asarray, columns), strict=True):
        fine = (stroke, velocity)
        if parts > 1:
            fine = _refined(stroke, step * velocity, parts), _refined(velocity, step * _slopes(velocity, step), parts)
        used = np.flatnonzero(weight > 0)
        count = int(used[-1]) + 1 if used.size else 0
        motion = map(np.ascontiguousarray, (stroke, velocity, *fine))
        weights = map(np.ascontiguousarray, (weight, force))
        rows.append(_Record(*motion, parts, float(step) / parts, *weights, count))
    return rows


def _slopes(values: np.ndarray, step: float) -> np.ndarray:
    """`rig.marching.slopes` by NumPy."""
    if values.size < 5:
        return np.gradient(values, step)
    slopes = np.empty_like(values)
    slopes[2:-2] = (values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) / 12.0
    edge = np.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]]) / 12.0
    slopes[:2], slopes[-2:] = edge @ values[:5], -(edge @ values[:-6:-1])[::-1]
    return slopes / step


def _refined(values: np.ndarray, rises: np.ndarray, parts: int) -> np.ndarray:
    """Cubic Hermite interpolation to so many parts of each interval."""
    s = (np.arange(parts) / parts)[None, :]
    start, start_rise, stop, stop_rise = values[:-1, None], rises[:-1, None], values[1:, None], rises[1:, None]
    between = start_rise * (s * (1 - s) ** 2) + stop_rise * (s * s * (s - 1))
    fine = start * ((1 + 2 * s) * (1 - s) ** 2) + stop * (s * s * (3 - 2 * s)) + between
    return np.append(np.ravel(fine), values[-1])


def predicted(batch: Batch, model: Model) -> Float[np.ndarray, "runs time"] | None:
    """Forces [N] of a model in records; None where XLA computes them."""
    if _refusal([batch], model):
        return None
    numbers = [_numbers(_of_row(batch, model, row)) for row in range(len(batch.dt))]
    law = _printed_law(numbers[0], None)
    if law is None:
        return None
    pairs = zip(map(_flat, numbers), _records(batch), strict=True)
    return np.stack([law.forces(p, row) for p, row in pairs])


def _of_row(batch: Batch, model: Model, row: int) -> Model:
    """The model of one record, with the values that it has for each."""
    number = int(batch.number[row])
    own = {path: np.asarray(values)[row] for path, values in batch.fixed.items()}
    own |= {path: np.asarray(get(model, path))[number] for path in batch.per_record}
    return with_values(model, {path: np.asarray(value) for path, value in own.items()})


def _flat(numbers: _Numbers) -> np.ndarray:
    return np.concatenate([np.zeros(0), *map(np.ravel, numbers.arrays)])


@dataclasses.dataclass(frozen=True)
class Evaluator:
    """Residuals and Jacobian of a problem, and the margins of its conditions, at physical values of the free numbers.

    Attributes:
        law: the printed functions.
        rows: of each record its place among the residuals, its motion, the numbers of its law, and which of them take
            which free number (−1: none).
        size: number of the residuals.
        free: number of the free numbers.
    """

    law: PrintedLaw
    rows: list[tuple[int, _Record, np.ndarray, np.ndarray]]
    size: int
    free: int

    def __call__(
        self, values: Float[np.ndarray, " free"]
    ) -> tuple[Float[np.ndarray, " samples"], Float[np.ndarray, "samples free"]]:
        """Weighted residual and its Jacobian."""
        out = np.zeros((self.size, self.free + 1))
        for place, record, p, taken in self.rows:
            self.law.linearise(self._at(p, taken, values), record, self._columns(taken), out[place:])
        return out[:, -1], out[:, :-1]

    def margins(
        self, values: Float[np.ndarray, " free"]
    ) -> tuple[Float[np.ndarray, " conditions"], Float[np.ndarray, "conditions free"]]:
        """The margins of the conditions between parameters and their derivatives."""
        _, _, p, taken = self.rows[0]
        margins, slopes = self.law.margins(self._at(p, taken, values))
        by_values, columns = np.zeros((margins.size, self.free + 1)), self._columns(taken)
        for k, column in enumerate(columns):
            by_values[:, column] += slopes[:, k]
        return margins, by_values[:, :-1]

    def _at(self, p: np.ndarray, taken: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.where(taken >= 0, np.asarray(values, np.float64)[taken], p)

    def _columns(self, taken: np.ndarray) -> np.ndarray:
        """Of each derivative the free number; of those by a number that is not free the column of the residual."""
        return np.where(taken >= 0, taken, self.free)[self.derivatives]

    @functools.cached_property
    def derivatives(self) -> Int[np.ndarray, " slopes"]:
        """The numbers of the law by which its functions are differentiated."""
        numbers = np.arange(self.rows[0][2].size)
        return np.concatenate([numbers[:0], *(numbers[part] for part in self.parts)])

    parts: tuple[slice, ...] = ()


def evaluator(free: FreeParameters, residuals: Sequence[Any]) -> Evaluator | None:
    """The residuals of records as printed C; None where XLA computes them."""
    reason = _refusal(residuals, free.tree)
    if reason or (any(part.per_record for part in residuals) and free_has_conditions(free)):
        _say(f"Computed by XLA: {reason or 'a value for each record beside conditions'}.")
        return None
    numbered = dict(zip((p.path for p in free.chosen), free.split(np.arange(float(free.values.size))), strict=True))
    taken_tree = with_values(_blank(free.tree), numbered | {path: numbered[leader] for path, leader in free.ties})
    places, rows, offset, first = [], [], 0, None
    for batch in residuals:
        for row, record in enumerate(_records(batch)):
            numbers = _numbers(_of_row(batch, free.tree, row))
            marked = _of_row(dataclasses.replace(batch, fixed={}), _marked(taken_tree, batch), row)
            taken = _numbers(marked, _blank(_plain_rig())).arrays
            first = first or numbers
            places.append({i for i, array in enumerate(taken) if np.any(array >= 0)})
            marks = np.concatenate([np.zeros(0), *map(np.ravel, taken)]).astype(np.int64)
            rows.append((offset, record, _flat(numbers), marks))
            offset += batch.stroke.shape[1]
    law = None if first is None else _printed_law(first, set().union(*places))
    if law is None or first is None:
        return None
    ends = np.cumsum([array.size for array in first.arrays])
    parts = tuple(slice(int(ends[i]) - first.arrays[i].size, int(ends[i])) for i in law.free)
    return Evaluator(law, rows, offset, free.values.size, parts)


def _marked(taken: Any, batch: Batch) -> Any:
    """Values that the records state take no free number."""
    return with_values(taken, {path: np.asarray(-1.0) for path in batch.fixed})


def free_has_conditions(free: FreeParameters) -> bool:
    """Whether a law has conditions between its parameters."""
    return any(law.has_conditions() for _, law in laws_inside(free.tree))

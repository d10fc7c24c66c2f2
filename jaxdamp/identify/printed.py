"""Forces of a law in bench records, and their derivatives, by printed C: compiled in a tenth of XLA's time.

One function for each structure of a law serves records of any number and length, every start, and predictions. What it
cannot compute is computed by XLA, with the same numbers: a machine with delay, lag, mass or heat, a measured
temperature, a command that varies, periodic or estimated initial states, single precision, or where no C compiler is
at hand; the log says so once for each reason.
"""

import dataclasses
import functools
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float, Int, PyTree

from jaxdamp._traced import is_traced
from jaxdamp._triangles import triangle
from jaxdamp.dampers import laws_inside
from jaxdamp.identify.model import Model, starts_in
from jaxdamp.identify.printed_law import PrintedLaw, Record, numbers_on_rig, plain_rig, printed_law, say
from jaxdamp.identify.problem import AbstractResiduals
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters, get, with_values
from jaxdamp.rig import LawNumbers, Rig, is_number


def _blank(tree: PyTree) -> PyTree:
    """With −1 in place of every number."""
    return jax.tree.map(lambda leaf: np.full(leaf.shape, -1.0) if is_number(leaf) else leaf, tree)


def _refusal(parts: Sequence[object], model: PyTree) -> str:
    """Why these records with this model are left to XLA; empty if they are not."""
    for part in parts:
        if not isinstance(part, Batch):
            return f"{type(part).__name__} beside the records"
        if part.effects:
            return f"a machine with {', '.join(part.effects)}"
        if part.temperature is not None:
            return "a measured temperature"
        if part.command is not None:
            return "a command that varies"
        if part.cycle is not None:
            return "periodic initial states"
        if any(leaf.dtype != np.float64 for leaf in (part.stroke, part.force)):
            return "single precision"
    if starts_in(model):
        return "estimated initial states"
    return "a law that is traced" if is_traced((parts, model)) else ""


def _records(batch: Batch) -> list[Record]:
    rows, parts = [], batch.substeps
    columns = (batch.dt, batch.stroke, batch.velocity, batch.weight, batch.force)
    for step, stroke, velocity, weight, force in zip(*map(np.asarray, columns), strict=True):
        fine = (stroke, velocity)
        if parts > 1:
            fine = _refined(stroke, step * velocity, parts), _refined(velocity, step * _slopes(velocity, step), parts)
        used = np.flatnonzero(weight > 0)
        count = int(used[-1]) + 1 if used.size else 0
        x, v, fine_x, fine_v, w, f = map(np.ascontiguousarray, (stroke, velocity, *fine, weight, force))
        rows.append(Record(x, v, fine_x, fine_v, parts, float(step) / parts, w, f, count))
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
    numbers = _numbers_of(batch, model)
    law = printed_law(numbers[0], None)
    if law is None:
        return None
    return np.stack([law.forces(own.flat, row) for own, row in zip(numbers, _records(batch), strict=True)])


def _numbers_of(batch: Batch, model: Model, rig: Rig | None = None) -> list[LawNumbers]:
    """The numbers of the law in each record: the same object where no record has values of its own."""
    if not batch.fixed and not batch.per_record:
        return [numbers_on_rig(model, rig)] * len(batch.dt)
    return [numbers_on_rig(_of_row(batch, model, row), rig) for row in range(len(batch.dt))]


def _of_row(batch: Batch, model: Model, row: int) -> Model:
    """The model of one record, with the values that it has for each."""
    number = int(np.asarray(batch.number)[row])
    own = {path: np.asarray(values)[row] for path, values in batch.fixed.items()}
    own |= {path: np.asarray(get(model, path))[number] for path in batch.per_record}
    return with_values(model, {path: np.asarray(value) for path, value in own.items()})


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
    rows: list[tuple[int, Record, np.ndarray, np.ndarray]]
    size: int
    free: int

    def __call__(self, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, "samples columns"]:
        """The Jacobian of the weighted residual, which is the last column."""
        out = np.zeros((self.size, self.free + 1))
        for place, record, p, taken in self.rows:
            self.law.linearise(self._at(p, taken, values), record, self._columns(taken), out[place:])
        return out

    def triangle(self, out: Float[np.ndarray, "samples columns"]) -> Float[np.ndarray, "rows columns"]:
        """Rows with the same products of columns: the triangles of the records, without samples after the last used."""
        return np.concatenate([triangle(out[place : place + record.used]) for place, record, _, _ in self.rows])

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


def evaluator(free: FreeParameters, residuals: Sequence[AbstractResiduals]) -> Evaluator | None:
    """The residuals of records as printed C; None where XLA computes them."""
    batches = [part for part in residuals if isinstance(part, Batch)]
    reason = _refusal(residuals, free.tree)
    conditions = any(law.has_conditions() for _, law in laws_inside(free.tree))
    if not reason and conditions and any(batch.per_record for batch in batches):
        reason = "a value for each record beside conditions"
    if reason:
        say(f"Computed by XLA: {reason}.")
        return None
    taken_tree = _taken(free)
    model = free.build(free.values)  # with the values that are tied to others
    places, rows, offset, first = [], [], 0, None
    for batch in batches:
        # values that the records state take no free number
        mine = with_values(taken_tree, {path: np.asarray(-1.0) for path in batch.fixed})
        marked = _numbers_of(dataclasses.replace(batch, fixed={}), mine, _blank(plain_rig()))
        for record, numbers, taken in zip(_records(batch), _numbers_of(batch, model), marked, strict=True):
            first = first or numbers
            places.append({i for i, array in enumerate(taken.arrays) if np.any(array >= 0)})
            rows.append((offset, record, numbers.flat, taken.flat.astype(np.int64)))
            offset += batch.stroke.shape[1]
    law = None if first is None else printed_law(first, set().union(*places))
    if law is None or first is None:
        return None
    ends = np.cumsum([array.size for array in first.arrays])
    parts = tuple(slice(int(ends[i]) - first.arrays[i].size, int(ends[i])) for i in law.free)
    return Evaluator(law, rows, offset, free.values.size, parts)


def _taken(free: FreeParameters) -> PyTree:
    """The tree with the number of each free value in its place, and −1 elsewhere."""
    numbers = free.split(np.arange(float(free.values.size)))
    numbered = dict(zip((p.path for p in free.chosen), numbers, strict=True))
    return with_values(_blank(free.tree), numbered | {path: numbered[leader] for path, leader in free.ties})

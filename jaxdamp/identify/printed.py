"""Forces of a law in bench records, and their derivatives, by printed C: compiled in a tenth of XLA's time.

One function for each structure of a law serves records of any number and length, every start, and predictions. What it
cannot compute is computed by XLA, with the same numbers: a machine with heat, a measured temperature, a command that
varies, periodic or estimated initial states, or where no C compiler is at hand; the log says so once for each reason.
C computes in double precision, whatever that of JAX is.
"""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float, Int, PyTree

from jaxdamp._traced import is_traced
from jaxdamp._triangles import triangle
from jaxdamp.dampers import laws_inside
from jaxdamp.identify.model import Model, law_of, rig_of, starts_in
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters, get, with_values
from jaxdamp.rig import (
    PRINTED,
    LawNumbers,
    PrintedLaw,
    PrintedRecord,
    Rig,
    is_number,
    numbers_on_rig,
    plain_rig,
    printed_forces,
    printed_law,
    say,
)


def _blank(tree: PyTree) -> PyTree:
    """With −1 in place of every number."""
    return jax.tree.map(lambda leaf: np.full(leaf.shape, -1.0) if is_number(leaf) else leaf, tree)


def _refusal(parts: Sequence[Batch], model: PyTree) -> str:
    """Why these records with this model are left to XLA; empty if they are not."""
    for part in parts:
        if others := [effect for effect in part.effects if effect not in PRINTED]:
            return f"a machine with {', '.join(others)}"
        if part.temperature is not None:
            return "a measured temperature"
        if part.command is not None:
            return "a command that varies"
        if part.cycle is not None:
            return "periodic initial states"
    if starts_in(model):
        return "estimated initial states"
    return "a law that is traced" if is_traced((parts, model)) else ""


def predicted(batch: Batch, model: Model) -> Float[np.ndarray, "runs time"] | None:
    """Forces [N] of a model in records; None where XLA computes them."""
    if _refusal([batch], model):
        return None
    forces = printed_forces(_numbers_of(batch, model), rows_of(batch))
    return None if forces is None else np.stack(forces)


def rows_of(batch: Batch) -> list[PrintedRecord]:
    """The records of a batch."""
    columns = (batch.dt, batch.stroke, batch.velocity, batch.weight, batch.force)
    arrays = zip(*(np.ascontiguousarray(np.asarray(column), np.float64) for column in columns), strict=True)
    return [PrintedRecord(float(dt), x, v, w, f, batch.substeps, batch.effects) for dt, x, v, w, f in arrays]


def _numbers_of(batch: Batch, model: Model, rig: Rig | None = None) -> list[LawNumbers]:
    """The numbers of the law in each record: the same object where no record has values of its own."""
    if not batch.fixed and not batch.per_record:
        return [_numbers(model, rig)] * len(batch.dt)
    return [_numbers(_of_row(batch, model, row), rig) for row in range(len(batch.dt))]


def _numbers(model: Model, rig: Rig | None = None) -> LawNumbers:
    """The numbers of a law on its machine, or on another one if it has none."""
    return numbers_on_rig(law_of(model), rig_of(model) or rig)


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
        size: number of the residuals of records.
        free: number of the free numbers.
        derivatives: the numbers of the law by which its functions are differentiated.
        beside: further rows, after those of the records, that are linear in the free numbers (`linear_rows`).
    """

    law: PrintedLaw
    rows: list[tuple[int, PrintedRecord, np.ndarray, np.ndarray]]
    size: int
    free: int
    derivatives: Int[np.ndarray, " slopes"]
    beside: Float[np.ndarray, "rows columns"]

    def __call__(self, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, "samples columns"]:
        """The Jacobian of the weighted residual, which is the last column."""
        out = np.zeros((self.size + len(self.beside), self.free + 1))
        out[self.size :] = self.beside
        out[self.size :, -1] += self.beside[:, :-1] @ values
        for place, row, p, taken in self.rows:
            at, columns = self._at(p, taken, values), self._columns(taken)
            if not row.effects:
                self.law.linearise(at, row.still, columns, out[place:])
            if not (row.effects and row.used):  # no sample of a record that is left out counts
                continue
            numbers = self.law.machine(at)
            record = row.on_machine(numbers.delay)
            forces = np.zeros((record.used, self.free + 1))
            self.law.linearise(at, record, columns, forces)
            shown = row.shown(forces, record, numbers, self.law.columns_of_machine(taken))
            out[place : place + len(shown)] = row.missed(shown)
        return out

    def counted(self, out: Float[np.ndarray, "samples columns"]) -> list[Float[np.ndarray, "rows columns"]]:
        """The rows of each record without samples after the last used, and those beside the records."""
        return [*(out[place : place + row.used] for place, row, _, _ in self.rows), out[self.size :]]

    def triangle(self, out: Float[np.ndarray, "samples columns"]) -> Float[np.ndarray, "rows columns"]:
        """Rows with the same products of columns: the triangles of the records."""
        return np.concatenate([triangle(rows) for rows in self.counted(out)])

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


def evaluator(free: FreeParameters, residuals: Sequence[AbstractResiduals]) -> Evaluator | None:
    """The residuals of records as printed C; None where XLA computes them."""
    return next(iter(evaluators(free, [residuals])), None)


def evaluators(free: FreeParameters, problems: Sequence[Sequence[AbstractResiduals]]) -> list[Evaluator]:
    """`evaluator` of the residuals of many problems with the same free numbers; none where XLA computes them."""
    parts = [part for residuals in problems for part in residuals]
    batches = [part for part in parts if isinstance(part, Batch)]
    others = [type(part).__name__ for part in parts if not isinstance(part, Batch) and part.linear_rows(free) is None]
    reason = _refusal(batches, free.tree) or "".join(f"{name} beside the records" for name in others[:1])
    conditions = any(law.has_conditions() for _, law in laws_inside(free.tree))
    if not reason and conditions and any(batch.per_record for batch in batches):
        reason = "a value for each record beside conditions"
    if reason:
        say(f"Computed by XLA: {reason}.")
        return []
    model, taken = free.build(free.values), _taken(free)  # with the values that are tied to others
    common = _numbers(model), _numbers(taken, _blank(plain_rig()))
    each = [_with_numbers(residuals, model, taken, common) for residuals in problems]
    unique = {id(numbers): numbers for records in each for _, *both in records for numbers in both}
    marked = [unique[key] for key in {id(taken) for records in each for *_, taken in records}]
    first = next((numbers for records in each for _, numbers, _ in records), None)
    if first is None:
        return []
    law = printed_law(first, {i for numbers in marked for i, array in enumerate(numbers.arrays) if np.any(array >= 0)})
    if law is None:
        return []
    ends, numbers = np.cumsum([array.size for array in first.arrays]), np.arange(first.flat.size)
    derivatives = np.concatenate([numbers[:0], *(numbers[ends[i] - first.arrays[i].size : ends[i]] for i in law.free)])
    flat = {key: one.flat for key, one in unique.items()}
    made = []
    for residuals, records in zip(problems, each, strict=True):
        rows, place = [], 0
        for row, numbers, taken in records:
            rows.append((place, row, flat[id(numbers)], flat[id(taken)].astype(np.int64)))
            place += row.weight.size
        made.append(Evaluator(law, rows, place, free.values.size, derivatives, rows_beside(free, residuals)))
    return made


def rows_beside(free: FreeParameters, residuals: Sequence[AbstractResiduals]) -> Float[np.ndarray, "rows columns"]:
    """The `linear_rows` of all residuals that have some."""
    rows = (part.linear_rows(free) for part in residuals if not isinstance(part, Batch))
    return np.concatenate([np.zeros((0, free.values.size + 1)), *(some for some in rows if some is not None)])


def _with_numbers(
    residuals: Sequence[AbstractResiduals], model: Model, taken: PyTree, common: tuple[LawNumbers, LawNumbers]
) -> list[tuple[PrintedRecord, LawNumbers, LawNumbers]]:
    """The records with the numbers of their laws, and with the number of the free value that each takes."""
    records = []
    for batch in residuals:
        if not isinstance(batch, Batch):
            continue
        rows, each = rows_of(batch), ([common[0]] * len(batch.dt), [common[1]] * len(batch.dt))
        if batch.fixed or batch.per_record:
            # values that the records state take no free number
            mine = with_values(taken, {path: np.asarray(-1.0) for path in batch.fixed})
            marked = _numbers_of(dataclasses.replace(batch, fixed={}), mine, _blank(plain_rig()))
            each = _numbers_of(batch, model), marked
        records += zip(rows, *each, strict=True)
    return records


def _taken(free: FreeParameters) -> PyTree:
    """The tree with the number of each free value in its place, and −1 elsewhere."""
    numbers = free.split(np.arange(float(free.values.size)))
    numbered = dict(zip((p.path for p in free.chosen), numbers, strict=True))
    return with_values(_blank(free.tree), numbered | {path: numbered[leader] for path, leader in free.ties})

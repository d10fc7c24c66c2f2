"""`fit_many` in blocks of dampers into a Zarr store, which many processes can fill and later calls go on with."""

import dataclasses
import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias, final, overload

import jax
import numpy as np
from filelock import FileLock
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._status import Status
from jaxdamp.bench import BenchRun, DamperRecords
from jaxdamp.blocks import AbstractWork, Blocks, BlockStore, Cluster, Variable, fill, stored_blocks
from jaxdamp.identify.contradicting import refuse_several_laws
from jaxdamp.identify.many_records import (
    AllRecords,
    Options,
    begun_on,
    code_of,
    fitted_records,
    left_out_in_words,
    warn_of_left_out,
)
from jaxdamp.identify.many_result import ManyFits
from jaxdamp.identify.preparing import Beginning
from jaxdamp.identify.starting import Start
from jaxdamp.identify.stated import followed_channels, stated_parameters, stated_values
from jaxdamp.parameters import with_values
from jaxdamp.rig import Rig


BLOCK = 64  # dampers: some seconds of work, and few enough records for any memory
ABSENT = "Its records were not among those of the call that came to its block."
AGAIN = "The next call tries it again."  # at the end of a reason that may pass
FLOAT = np.dtype(np.float64)
OF_EACH = ("values", "standard_errors", "bias")  # of each parameter of each damper
Row: TypeAlias = dict[str, Any]  # what is stored of a damper
NUMBERS = ("fit_percent", "rmse", "drift", "share_left_out")  # of each damper, beside those of its parameters


@final
class DamperFits(AbstractWork):
    """Fits of the dampers in the rows of a store, from a beginning with a first record; rows without a name stay empty.

    The name of a damper of another call is empty.
    """

    def __init__(
        self, beginning: Beginning, options: Options, first: BenchRun, records: AllRecords, names: Mapping[int, str]
    ) -> None:
        self._beginning, self._options, self._first = beginning, options, first
        self._records, self._names = records, names

    def part(self, indices: np.ndarray) -> "DamperFits":
        """The work of some rows, with the records of their dampers, or what reads them."""
        names = {row: self._names[row] for row in map(int, indices) if row in self._names}
        records = _part(self._records, filter(None, names.values()))
        return DamperFits(self._beginning, self._options, self._first, records, names)

    def compute(self, indices: np.ndarray) -> Mapping[str, np.ndarray]:
        """The fits of some rows as they are stored; a damper that cannot be read or fitted is left out, with why."""
        results = self.without_results(indices, ABSENT)
        places = {name: place for place, row in enumerate(map(int, indices)) if (name := self._names.get(row))}
        good: dict[str, tuple[BenchRun, ...]] = {}
        lacking: dict[str, list[str]] = {}
        for name, place in places.items():
            results["reason"][place] = ""
            try:
                good[name], lacking[name] = self._checked(name)
            except MemoryError:
                raise
            except Exception as error:
                results["reason"][place] = _reason(error)
        for name, row in self._fitted(good).items():
            for variable, value in row.items():
                results[variable][places[name]] = value
            if not row.get("reason"):
                results["record_rmse"][places[name]] = json.dumps([*row["record_rmse"], *lacking[name]])
        results["failed"][:] = results["reason"] != ""
        return results

    def without_results(self, indices: np.ndarray, reason: str) -> dict[str, np.ndarray]:
        """Rows that hold why there is no fit; those without a damper hold nothing."""
        size, count = indices.size, len(self._beginning.free.names)
        named = np.array([int(row) in self._names for row in indices])
        empty = {name: np.full((size, count), np.nan) for name in OF_EACH}
        empty |= {name: np.full(size, np.nan) for name in NUMBERS}
        texts = {name: np.full(size, "", dtype=object) for name in ("status", "record_rmse")}
        reasons = np.where(named, reason, "").astype(object)
        return {**empty, "steps": np.zeros(size, np.int32), **texts, "failed": reasons != "", "reason": reasons}

    def _checked(self, name: str) -> tuple[tuple[BenchRun, ...], list[str]]:
        """The records of a damper that its fit takes, and the names of those that are left out."""
        records = self._records[name]
        runs, model = fitted_records(name, records, self._options), self._beginning.model
        refuse_several_laws(model, runs, self._options, f"dampers[{name!r}]")
        for stated in (stated_values, followed_channels):  # what only some dampers state is refused as in memory
            stated(model, (self._first, *runs))
        return runs, [run.name for run in records if run not in runs]

    def _fitted(self, records: AllRecords) -> dict[str, Row]:
        """What is stored of each damper; if the fit of all together raises, those of its halves, to leave one out."""
        from jaxdamp.identify.many import fitted_together  # of `fit_many`, which hands its blocks to this file

        if not records:
            return {}
        names = list(records)
        try:
            many = fitted_together(self._beginning, records, self._options)
        except MemoryError:
            raise
        except Exception as error:
            if len(names) == 1:
                return {names[0]: {"reason": _reason(error)}}
            halves = (names[: len(names) // 2], names[len(names) // 2 :])
            return {k: row for half in halves for k, row in self._fitted({n: records[n] for n in half}).items()}
        return {name: _row(many, place) for place, name in enumerate(names)}


def _row(many: ManyFits, place: int) -> Row:
    """What is stored of a damper, errors of its records as a list; why, of one that is left out."""
    if many.status[place] is Status.LEFT_OUT:
        return {"reason": many.reasons[place]}
    row: Row = {
        name: getattr(many, name)[place] for name in ("values", "standard_errors", "fit_percent", "rmse", "steps")
    }
    row |= {name: array[place] for name in ("drift", "share_left_out") if (array := getattr(many, name)).size}
    row |= {} if many.bias is None else {"bias": many.bias[place]}
    errors = many.record_rmse[place].tolist() if many.record_rmse else []
    return row | {"status": many.status[place].name.lower(), "record_rmse": errors}


def fit_into_store(
    law: Start,
    records: AllRecords,
    settings: tuple[float, ...] | None,
    path: str | os.PathLike[str] | None,
    cluster: Cluster,
    progress: Callable[[int, int], None] | None,
    *,
    shared: bool,
    options: Options,
) -> ManyFits:
    """Fit the dampers that a store lacks, and give the fits of all dampers of the call."""
    place = _checked_path(path, len(records), settings, shared)
    name, runs = _first_readable(records, options)
    beginning = begun_on(law, runs, options)
    store, rows = _rows(place, _identity(beginning, runs, options), records, len(beginning.free.names))
    names = {row: "" for row, name in enumerate(store.read("name")["name"]) if name}
    names |= dict(zip(map(int, rows), records, strict=True))
    shortest = min(runs, key=len)
    first = dataclasses.replace(shortest, name=f"{shortest.name} of {name!r}, with which the fits begin")
    fill(store, DamperFits(beginning, options, first, records, names), cluster, progress, "Fitting", "rows for dampers")
    return ManyFits(
        names=tuple(records),
        records=RecordsInOrder(records, options),
        settings=settings,
        free=beginning.free,
        options={**options, "bad_records": "keep"},
        **_found(store, rows, tuple(records)),
    )


def _checked_path(
    path: str | os.PathLike[str] | None, count: int, settings: tuple[float, ...] | None, shared: bool
) -> Path:
    """The path of a store; what does not go with one is refused."""
    if path is None or Path(path).suffix != ".zarr":
        remedy = "Write `file='name.zarr'`, in a folder that all workers reach."
        _checks.refuse("file", "end in '.zarr'", None if path is None else repr(str(path)), remedy)
    if shared:
        remedy = "Fit some dampers without `file` with it, then all with their law as the start and `freeze`."
        _checks.refuse("shared", "be left out with `file`: blocks do not know each other", "given", remedy)
    if settings is not None and len(settings) != count:
        _checks.refuse("settings", f"be one number for each of {count} dampers", f"{len(settings)} numbers")
    return Path(path).expanduser().absolute()


def _found(store: BlockStore, rows: np.ndarray, names: tuple[str, ...]) -> dict[str, Any]:
    """What a store holds of some dampers: fields of the result; those that were left out are named."""
    columns: dict[str, Any] = store.read(*OF_EACH, *NUMBERS, "steps", "status", "record_rmse", "reason")
    columns = {name: values[rows] for name, values in columns.items()}
    if not np.any(np.isfinite(columns["bias"])):  # nobody asked for it
        del columns["bias"]
    status = tuple(Status[text.upper()] if text else Status.LEFT_OUT for text in columns["status"])
    reasons = [str(reason) for reason in columns.pop("reason")]
    warn_of_left_out([name for name, reason in zip(names, reasons, strict=True) if reason], len(names))
    errors, without = zip(*map(_of_records, columns["record_rmse"]), strict=True)
    pending = ["its block is not done yet" * (s is Status.LEFT_OUT) for s in status]
    said = tuple(next(filter(None, words), "") for words in zip(reasons, without, pending, strict=True))
    return columns | {"status": status, "reasons": said, "record_rmse": errors}


def _of_records(text: str) -> tuple[Float[np.ndarray, " records"], str]:
    """The errors of the records of a damper as they are stored, and what is said of those that were left out."""
    stored = json.loads(text or "[]")  # numbers, then the names of those that were left out
    errors = np.array([error for error in stored if not isinstance(error, str)], float)
    return errors, left_out_in_words([name for name in stored if isinstance(name, str)])


@final
class RecordsInOrder(Sequence[tuple[BenchRun, ...]]):
    """The records of dampers in their order, read when they are asked for; without bad ones that a fit leaves out."""

    def __init__(self, records: AllRecords, options: Options) -> None:
        self._records, self._options, self._names = records, options, tuple(records)

    def __len__(self) -> int:
        return len(self._names)

    @overload
    def __getitem__(self, place: int) -> tuple[BenchRun, ...]: ...
    @overload
    def __getitem__(self, place: slice) -> "RecordsInOrder": ...
    def __getitem__(self, place: int | slice) -> "tuple[BenchRun, ...] | RecordsInOrder":
        """The records of a damper, or of those of a slice."""
        if isinstance(place, slice):
            return RecordsInOrder(_part(self._records, self._names[place]), self._options)
        name = self._names[place]
        runs = self._records[name]
        return fitted_records(name, runs, self._options) if self._options["bad_records"] == "leave_out" else runs


def _rows(path: Path, identity: Mapping[str, str], records: AllRecords, count: int) -> tuple[BlockStore, np.ndarray]:
    """The store, with a row for every damper of the call; new and changed ones are in further blocks at its end."""
    variables = {
        **{name: Variable({"parameter": count}, FLOAT, {}) for name in OF_EACH},
        **{name: Variable({}, FLOAT, {}) for name in NUMBERS},
        **{name: Variable({}, str, {}) for name in ("name", "stamp", "status", "record_rmse", "reason")},
        "steps": Variable({}, np.dtype(np.int32), {}),
        "failed": Variable({}, np.dtype(bool), {}),
    }
    stamps = {name: _stamp(records, name) for name in records}
    if not path.parent.is_dir():
        _checks.refuse("file", "lie in a folder that exists", path, "Make the folder first.")
    with FileLock(path.with_name(f".{path.name}.lock")):
        blocks = stored_blocks(path)
        stamped = _known(stamps) if not blocks else None
        store = BlockStore(path, Blocks((blocks * BLOCK or len(stamped["name"]),), (BLOCK,)), identity)  # type: ignore
        store.create(("damper",), variables, {}, stamped)
        rows = _places(store)
        new = {name: stamp for name, stamp in stamps.items() if (name, stamp) not in rows}
        if new:
            useless = _without_fits(store) if len(new) <= BLOCK else None
            if useless is None:
                store = store.append(_known(new))
            else:
                store.begun_again(useless, _known(new))
            rows = _places(store)
    return store, np.array([rows[pair] for pair in stamps.items()])


def _places(store: BlockStore) -> dict[tuple[str, str], int]:
    """The row of each damper with its stamp; those without a fit for a reason that may pass have none."""
    columns = zip(*store.read("name", "stamp", "reason").values(), strict=True)
    again = (ABSENT, AGAIN)
    return {(str(n), str(s)): row for row, (n, s, why) in enumerate(columns) if n and not str(why).endswith(again)}


def _without_fits(store: BlockStore) -> int | None:
    """A block that is done and holds nothing but dampers that are tried again; none if there is none."""
    names, reasons = store.read("name", "reason").values()
    left = set(store.left().tolist())
    for number in range(store.blocks.count):
        region = store.blocks.region(number)
        why = [str(reason) for name, reason in zip(names[region], reasons[region], strict=True) if name]
        if number not in left and all(reason.endswith((ABSENT, AGAIN)) for reason in why):
            return number
    return None


def _known(stamps: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Names and stamps of dampers in whole blocks."""
    further = [""] * (-len(stamps) % BLOCK)
    columns = {"name": [*stamps, *further], "stamp": [*stamps.values(), *further]}
    return {name: np.array(column, dtype=object) for name, column in columns.items()}


def _stamp(records: AllRecords, name: str) -> str:
    """A text that changes whenever the records of a damper change; of records in memory by their numbers."""
    if isinstance(records, DamperRecords):
        return records.stamp(name)
    digest = hashlib.sha256()
    for run in records[name]:
        for channel in (run.time, run.stroke, run.velocity, run.force, run.temperature, run.commands):
            digest.update(b"-" if channel is None else np.ascontiguousarray(channel).tobytes())
        digest.update(repr((sorted(run.settings.items()), run.stroke_is_integrated, run.command_unit)).encode())
    return digest.hexdigest()[:16]


def _part(records: AllRecords, names: Iterable[str]) -> AllRecords:
    return records.part(names) if isinstance(records, DamperRecords) else {name: records[name] for name in names}


def _identity(beginning: Beginning, runs: Sequence[BenchRun], options: Options) -> dict[str, str]:
    """What fits belong to: start and options, as texts.

    Numbers that come from the records of the first damper are left out, except of a law class: another damper may be
    the first later. They are those that records state, and where the search of a machine begins that effects name.
    """
    free, named = beginning.free, not isinstance(options["rig"], Rig)
    from_records = np.array([named and p.path.startswith("rig.") for p in free.owners], bool)
    tree = free.started_at(np.where(from_records, 0.0, free.values)).tree
    tree = with_values(tree, dict.fromkeys(stated_parameters(beginning.model, runs), 0.0))
    leaves, structure = jax.tree.flatten(tree)
    digest = hashlib.sha256(re.sub(r" at 0x\w+", "", str(structure)).encode())
    for leaf in leaves:
        digest.update(np.asarray(leaf).tobytes() if isinstance(leaf, jax.Array | np.ndarray) else repr(leaf).encode())
    start = f"{type(beginning.law).__name__} ({digest.hexdigest()[:12]})"
    said = {
        name: re.sub(r" at 0x\w+", "", str(value))
        for name, value in options.items()
        if name not in ("rig", "over", "freeze")
    }
    return {"start": start, "code": code_of(beginning.law), "parameters": ", ".join(beginning.free.names), **said}


def _sentence(error: Exception) -> str:
    """Why a damper is left out, in a line."""
    text = " ".join(str(error).split())
    return text if isinstance(error, ValueError | OSError) and text else f"{type(error).__name__}: {text}"


def _reason(error: Exception) -> str:
    """Why a damper is left out, as it is stored; what a system of files or a network says may pass."""
    return f"{_sentence(error)} {AGAIN}" if isinstance(error, OSError) else _sentence(error)


def _first_readable(records: AllRecords, options: Options) -> tuple[str, tuple[BenchRun, ...]]:
    """The first damper that can be read and its records, from which a law class starts."""
    why = ""
    for name in records:
        try:
            return name, fitted_records(name, records[name], options)
        except Exception as error:
            why = why or f"{name}: {_sentence(error)}"
    _checks.refuse("dampers", "hold one whose records can be read", f"{len(records)} dampers without ({why})")

"""A Zarr store of labelled results that is at any time what is done, block by block."""

import errno
import json
import os
import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Dataset
from jaxdamp.blocks.cutting import Blocks


if TYPE_CHECKING:
    import zarr


IDENTITY, COMMAND = "jaxdamp", "jaxdamp_command"  # attributes: what the store belongs to, and what filled it, in words
DONE = "done"  # variable along `BLOCK`: how many points of a block failed, negative before it is computed
BLOCK = "jaxdamp_block"
FAILURES = ("failed", "reason")  # variables that say where and why there is no result
INSTALL = "pip install 'jaxdamp[cluster]'"


class Variable(NamedTuple):
    """What is stored for each point.

    Attributes:
        dims: dimensions besides those of the points, by name, with their lengths.
        dtype: of the numbers; `str` for texts.
        attributes: such as units.
    """

    dims: dict[str, int]
    dtype: np.dtype | type[str]
    attributes: dict[str, str]


class AbstractStore(ABC):
    """Takes the results of blocks of points, and knows which are done.

    Attributes:
        path: where what is done lies.
        blocks: of the points.
    """

    path: Path
    blocks: Blocks

    @abstractmethod
    def left(self) -> np.ndarray:
        """The blocks that are not done."""

    @abstractmethod
    def repair(self, numbers: Iterable[int]) -> int:
        """Those of some blocks that are not as they were written are not done; gives how many."""

    @abstractmethod
    def write(self, number: int, values: Mapping[str, np.ndarray]) -> None:
        """Take the results of a block, which is done then."""


@final
class BlockStore(AbstractStore):
    """Arrays along the points of a grid, one chunk a block, each with a checksum, and a mark for each finished block.

    No two blocks share a chunk, chunks are renamed into place when they are whole, and the mark of a block is written
    after its results: any number of processes may write, and whatever is marked is complete.

    Arguments:
        path: a folder that ends in `.zarr`.
        blocks: of the points.
        identity: what the results belong to, as texts by name; a store of another identity is refused.
    """

    def __init__(self, path: str | os.PathLike[str], blocks: Blocks, identity: Mapping[str, str]) -> None:
        self.path, self.blocks = Path(path).expanduser().absolute(), blocks
        self._identity = {**identity, "block": " x ".join(map(str, blocks.box))}
        if not self.path.parent.is_dir():
            _checks.refuse("file", "lie in a folder that exists", self.path, "Make the folder first.")
        import_zarr()

    def create(
        self,
        dims: tuple[str, ...],
        variables: Mapping[str, Variable],
        coordinates: Mapping[str, tuple[str, np.ndarray, dict[str, str]]],
        arrays: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        """Make the store, whole or not at all, unless it is there; one of something else is refused.

        Arguments:
            dims: names of the axes of the grid.
            variables: what is stored for each point.
            coordinates: along an axis each, with attributes.
            arrays: what is known of the points already, by the name of its variable.
        """
        self._names = tuple(variables)
        if not self.path.exists():
            draft = Path(tempfile.mkdtemp(prefix=f".{self.path.name}.", dir=self.path.parent))
            try:
                self._make(draft, dims, variables, coordinates)
                _enter(draft, arrays or {}, 0)
                draft.chmod(0o777 & ~_umask())
                draft.rename(self.path)
            except OSError as error:
                if error.errno not in (errno.EEXIST, errno.ENOTEMPTY):  # another process was faster
                    raise
            finally:
                shutil.rmtree(draft, ignore_errors=True)
        self._check()

    def _make(
        self,
        folder: Path,
        dims: tuple[str, ...],
        variables: Mapping[str, Variable],
        coordinates: Mapping[str, tuple[str, np.ndarray, dict[str, str]]],
    ) -> None:
        zarr = import_zarr()
        group = zarr.open_group(folder, mode="w")
        group.attrs[IDENTITY] = json.dumps(self._identity)
        exact = [zarr.codecs.Crc32cCodec()]
        for name, variable in variables.items():
            more = tuple(variable.dims.values())
            text = variable.dtype is str
            group.create_array(
                name,
                shape=(*self.blocks.shape, *more),
                chunks=(*self.blocks.box, *more),
                dtype=variable.dtype,
                fill_value="" if text else np.nan if np.dtype(variable.dtype).kind == "f" else 0,
                compressors=[zarr.codecs.ZstdCodec(), *exact] if text else exact,
                dimension_names=(*dims, *variable.dims),
                attributes=variable.attributes,
            )
        for name, (along, values, attributes) in coordinates.items():
            array = group.create_array(
                name, shape=values.shape, dtype=values.dtype, dimension_names=(along,), attributes=attributes
            )
            array[:] = values
        group.create_array(
            DONE,
            shape=(self.blocks.count,),
            chunks=(1,),
            dtype=np.int32,
            fill_value=-1,
            compressors=exact,
            dimension_names=(BLOCK,),
        )

    def append(self, arrays: Mapping[str, np.ndarray]) -> "BlockStore":
        """The store with further blocks at the end of its only axis, which are not done.

        Arguments:
            arrays: what is known of their points, by the name of its variable; whole blocks.
        """
        (size,), (box,) = self.blocks.shape, self.blocks.box
        longer = size + len(next(iter(arrays.values())))
        group = import_zarr().open_group(self.path, mode="r+")
        for name in self._names:
            array: zarr.Array = group[name]  # pyright: ignore[reportAssignmentType]
            array.resize((longer, *array.shape[1:]))
        _enter(self.path, arrays, size)
        marks: zarr.Array = group[DONE]  # pyright: ignore[reportAssignmentType]
        marks.resize((longer // box,))  # last: before it the further points are not there
        more = BlockStore(self.path, Blocks((longer,), (box,)), self._identity)
        more._names = self._names
        return more

    def begun_again(self, number: int, arrays: Mapping[str, np.ndarray]) -> None:
        """A block along the only axis that is not done any more, with what is known of its points."""
        group, start = import_zarr().open_group(self.path, mode="r+"), number * self.blocks.box[0]
        group[DONE][number] = -1
        for name, blank in zip(FAILURES, (False, ""), strict=True):
            group[name][self.blocks.region(number)] = blank
        _enter(self.path, arrays, start)

    def read(self, *names: str, start: int = 0, stop: int | None = None) -> dict[str, np.ndarray]:
        """Variables of all points along the first axis, or of some."""
        group, stop = import_zarr().open_group(self.path, mode="r"), self.blocks.shape[0] if stop is None else stop
        return {name: np.asarray(group[name][start:stop]) for name in names}

    def _check(self) -> None:
        """Refuse a store of something else, with what differs."""
        try:
            stored = json.loads(import_zarr().open_group(self.path, mode="r").attrs[IDENTITY])
        except Exception as error:
            remedy = "Choose another name, or delete the folder."
            message = f"Argument `file`: {self.path} is no store of jaxdamp's ({error!r}). {remedy}"
            raise _checks.ArgumentError(message, argument="file") from error
        differences = [
            f"{name} is {stored.get(name)} there, {self._identity.get(name)} now"
            for name in {**self._identity, **stored}
            if stored.get(name) != self._identity.get(name)
        ]
        if differences:
            raise _checks.ArgumentError(
                f"Argument `file`: {self.path} holds other work: {'; '.join(differences)}. Choose another name, or "
                "delete the folder to begin anew.",
                argument="file",
            )

    def left(self) -> np.ndarray:
        """The blocks that are not done."""
        return np.flatnonzero(self._marks() < 0)

    def _marks(self) -> np.ndarray:
        return np.asarray(import_zarr().open_group(self.path, mode="r")[DONE][:])

    def repair(self, numbers: Iterable[int]) -> int:
        """Read those of some blocks that are marked; what is not as it was written is not done. Returns how many."""
        group, damaged = import_zarr().open_group(self.path, mode="r+"), 0
        for number in numbers:
            try:
                whole = int(group[DONE][number]) < 0 or self._is_whole(group, number)
            except Exception:  # what a damaged chunk raises depends on where it is damaged
                whole = False
            if not whole:
                damaged += 1
                region = self.blocks.region(number)
                for name, blank in zip(FAILURES, (False, ""), strict=True):  # written again only where points fail
                    group[name][region] = blank
                group[DONE][number] = -1
        return damaged

    def _is_whole(self, group: "zarr.Group", number: int) -> bool:
        """Whether the chunks of a block are there and can be read; raises if their checksums are wrong."""
        region, chunk = self.blocks.region(number), np.unravel_index(number, self.blocks.numbers)
        for name in self._names:
            array: zarr.Array = group[name]  # pyright: ignore[reportAssignmentType]
            key = array.metadata.encode_chunk_key((*map(int, chunk), *[0] * (array.ndim - len(region))))
            if name not in FAILURES and not (self.path / name / key).exists():
                return False
            array[region]
        return True

    def write(self, number: int, values: Mapping[str, np.ndarray]) -> None:
        """Write the results of a block, then its mark."""
        region = self.blocks.region(number)
        shape = tuple(part.stop - part.start for part in region)
        failed = int(np.count_nonzero(values["failed"]))
        try:
            with import_zarr().config.set({"array.write_empty_chunks": True}):  # a chunk that is not there was lost
                group = import_zarr().open_group(self.path, mode="r+")
                arrays = {name: group[name] for name in values}
            for name, column in values.items():
                if failed or name not in FAILURES:  # what is not written is false and empty
                    arrays[name][region] = column.reshape(*shape, *column.shape[1:])
            group[DONE][number] = failed
        except OSError as error:
            words = f"Block {number} cannot be written to {self.path}: {error.strerror or error}. What is done is there"
            raise OSError(error.errno, f"{words}, and the same call goes on once this is mended.") from error

    def dataset(self, coordinates: tuple[str, ...] = ()) -> Dataset:
        """The results, read when they are asked for; `attrs` say how many points failed and how many are done."""
        import xarray

        chunks = {} if _has_dask() else None
        data = xarray.open_zarr(self.path, consolidated=False, chunks=chunks)
        marks = self._marks()
        done = sum(self.blocks.size(int(i)) for i in np.flatnonzero(marks >= 0))
        about = {"failed_points": int(marks[marks >= 0].sum()), "points_done": done}
        return data.drop_vars(DONE).set_coords(coordinates).drop_attrs(deep=False).assign_attrs(about)


def stored_blocks(path: Path) -> int:
    """How many blocks a store has; none if there is none, or what is there cannot be read as one.

    Arguments:
        path: of the store.
    """
    try:
        return int(import_zarr().open_group(path, mode="r")[DONE].shape[0])
    except (OSError, KeyError, ValueError):
        return 0


def command_of(path: Path) -> str:
    """What a command noted in a store; empty if none did.

    Arguments:
        path: of the store.
    """
    try:
        return str(import_zarr().open_group(path, mode="r").attrs.get(COMMAND, ""))
    except (OSError, ValueError):
        return ""


def note_command(path: Path, text: str) -> None:
    """Note in a store what fills it.

    Arguments:
        path: of the store.
        text: the note.
    """
    if command_of(path) != text:
        import_zarr().open_group(path, mode="r+").attrs[COMMAND] = text


def _enter(path: Path, arrays: Mapping[str, np.ndarray], start: int) -> None:
    """Write what is known of points from `start` on, empty texts too: a chunk that is not there was lost."""
    with import_zarr().config.set({"array.write_empty_chunks": True}):
        group = import_zarr().open_group(path, mode="r+")
        for name, values in arrays.items():
            group[name][start : start + len(values)] = values


def import_zarr() -> ModuleType:
    """The library of stores; without it, what to install."""
    try:
        import zarr
        import zarr.codecs
    except ImportError as error:
        raise ImportError(f"A file that ends in '.zarr' needs zarr: {INSTALL}.") from error
    return zarr


def _has_dask() -> bool:
    try:
        import dask.array  # noqa: F401
    except ImportError:
        return False
    return True


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask

"""The file of a sweep: partial results, from which the same sweep goes on."""

import json
import os
import time
import warnings
import zlib
from collections.abc import Hashable
from pathlib import Path
from typing import final

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import DataArray, Dataset
from jaxdamp._writing import whole
from jaxdamp.sweeps.table import Table


INTERVAL = 10.0  # s between two writings
LARGEST = 2**31 - 1  # bytes of one variable in a classic netCDF file
MARK, AXES = "jaxdamp_sweep", "axes"  # attributes that hold the fingerprint of the function, and the axes in order
CHECKSUMS = "checksums"  # attribute: of each block of points
BLOCK = 4096  # points


@final
class SweepFile:
    """A netCDF file (classic format, 64-bit offsets) that is at any time the labelled results of what is done."""

    def __init__(self, path: str | os.PathLike[str], table: Table) -> None:
        self.path, self._table = Path(path).expanduser(), table
        if self.path.suffix != ".nc":
            _checks.refuse("file", "end in '.nc', for netCDF, or '.zarr', for Zarr", repr(str(path)))
        if not self.path.parent.is_dir():
            _checks.refuse("file", "lie in a folder that exists", self.path, "Make the folder first.")
        large = [name for name, values in table.values.items() if values.nbytes > LARGEST]
        if large:
            remedy = "Sweep in several parts, each into its own file."
            _checks.refuse("file", "hold at most 2 GiB of each result", f"too small for {', '.join(large)}", remedy)
        self._fingerprint = table.traced.fingerprint()
        self._next, self._pause = time.monotonic() + INTERVAL, INTERVAL

    def resume(self) -> None:
        """Fill the table with what the file holds."""
        import xarray  # noqa: F401 so that no interrupt can hit it while it loads

        if self.path.exists():
            self._load()

    def _load(self) -> None:
        import xarray

        try:
            stored = xarray.load_dataset(self.path, engine="scipy")
        except Exception as error:
            remedy = "Choose another name, or delete the file."
            raise ValueError(f"Argument `file`: {self.path} cannot be read as a sweep ({error}). {remedy}") from error
        differences = self._differences(stored)
        if differences:
            raise ValueError(
                f"Argument `file`: {self.path} holds another sweep: {'; '.join(differences)}. Choose another name, or "
                "delete the file to begin anew."
            )
        table = self._table
        for name, values in table.values.items():
            table.values[name] = np.array(stored[name].values, values.dtype).reshape(values.shape)
        table.done = np.array(stored["done"].values, bool).ravel()
        reasons = np.array(stored["reason"].values, str).ravel()
        for reason in dict.fromkeys(reasons[reasons != ""]):
            table.give_reasons(np.flatnonzero(reasons == reason), str(reason))
        self._drop_damaged(json.loads(stored.attrs[CHECKSUMS]))

    def _drop_damaged(self, checksums: list[int]) -> None:
        """Points in blocks of the file that are not as they were written count as not done, and are computed anew."""
        table = self._table
        pairs = enumerate(zip(checksums, _checksums(table), strict=True))
        damaged = np.isin(np.arange(len(table.done)) // BLOCK, [i for i, (before, now) in pairs if before != now])
        if not damaged.any():
            return
        for values in table.values.values():
            values[damaged] = np.nan
        table.done[damaged], table.reason[damaged] = False, 0
        warnings.warn(
            f"{np.count_nonzero(damaged)} of {len(damaged)} points in {self.path} were damaged on the disk, and are "
            "computed anew.",
            stacklevel=5,
        )

    def _differences(self, stored: Dataset) -> list[str]:
        """What keeps the file from being a part of this sweep, in words."""
        if MARK not in stored.attrs or "done" not in stored:
            return ["it was not written by `jaxdamp.sweep`"]
        if "reason" not in stored.coords:
            return ["an older jaxdamp wrote it, which did not note why points fail"]
        if CHECKSUMS not in stored.attrs:
            return ["an older jaxdamp wrote it, without the sums by which damage is seen"]
        new, axes = self._table.label(), json.loads(stored.attrs[AXES])
        if stored["failed"].dims != new["failed"].dims or axes != self._table.points.names:
            names, before = ", ".join(map(repr, self._table.points.names)), ", ".join(map(repr, axes))
            over = f"along {', '.join(map(repr, stored['failed'].dims))}"
            return [f"its axes are {before} {over}, not {names}"]
        differences = [text for name in axes if (text := _other_axis(name, stored[name].values, new[name].values))]
        results = set(stored.data_vars) - {"done"}
        if results != set(new.data_vars):
            names = [", ".join(map(repr, sorted(map(str, each)))) for each in (results, new.data_vars)]
            return [*differences, f"its results are {names[0]}, not {names[1]}"]
        differences += [text for name in new.data_vars if (text := _other_result(name, stored[name], new[name]))]
        if not differences and stored.attrs[MARK] != self._fingerprint:
            differences.append(_other_function(stored.attrs.get("jax_version")))
        return differences

    def save(self, *, now: bool = False) -> None:
        """Write what is done if it is time, whole or not at all; what cannot be written stops no sweep."""
        start = time.monotonic()
        if start < self._next and not now:
            return
        try:
            self._write()
        except OSError as error:
            warnings.warn(f"The sweep could not be written to {self.path}: {error}", stacklevel=4)
        taken = time.monotonic() - start
        self._pause = max(INTERVAL, 20 * taken)
        self._next = time.monotonic() + self._pause

    def _write(self) -> None:
        data, done = self._table.label(), self._table.done
        data["done"] = (data["failed"].dims, done.reshape(data["failed"].shape).astype(np.int8))
        data.attrs |= {
            MARK: self._fingerprint,
            AXES: json.dumps(self._table.points.names),
            "jax_version": jax.__version__,
            CHECKSUMS: json.dumps(_checksums(self._table)),
        }
        with whole(self.path) as draft:
            data.to_netcdf(draft, engine="scipy", format="NETCDF3_64BIT")


def _other_function(version: str | None) -> str:
    """In what the function differs, which that version of JAX has traced."""
    other = f", which JAX {version} traced, and now JAX {jax.__version__}" if version != jax.__version__ else ""
    return f"the function computes something else, or from other numbers{other}"


def _other_axis(name: str, stored: np.ndarray, new: np.ndarray) -> str:
    """In what the values of an axis differ; empty if they do not."""
    if np.array_equal(stored, new):
        return ""
    old, now = (f"{len(v)} values from {v.min():.6g} to {v.max():.6g}" for v in (stored, new))
    return f"the axis {name!r} has other values ({old}; now {now})"


def _other_result(name: Hashable, stored: DataArray, new: DataArray) -> str:
    """In what the type or shape of a result differ; empty if they do not."""
    if stored.dtype.newbyteorder("=") == new.dtype and stored.shape == new.shape:
        return ""
    old, now = (f"{v.dtype.newbyteorder('=')} {v.shape}" for v in (stored, new))
    return f"{name!r} is {old} there, now {now}"


def _checksums(table: Table) -> list[int]:
    """A sum over the results, states and reasons of each block of points."""
    count = len(table.done)
    texts = np.array(table.reasons, dtype=object)[table.reason]
    sums = []
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        total = zlib.crc32("\n".join(texts[part]).encode())
        results = [table.values[name] for name in sorted(table.values)]  # other processes send them in another order
        for values in (*results, table.done.astype(bool)):
            total = zlib.crc32(np.ascontiguousarray(values[part]).tobytes(), total)
        sums.append(total)
    return sums

"""Reader of MATLAB files: vectors, channels with units and scales, matrices with names, arrays of structures."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from jaxdamp.bench.raw import RawColumn, RawTable, Untyped, alone, library, tables_by_clock


_MOST_COLUMNS = 64  # of a matrix that is taken for channels side by side
_UNITS, _LABELS = ("unit", "units"), ("name", "label", "title")  # keys in lower case, as all that follow
_DATA, _FACTORS, _OFFSETS = ("data", "values", "value", "samples"), ("scale", "factor", "gain", "slope"), ("offset",)
_NAMES = ("names", "labels", "channels", "channelnames", "channel_names", "columns", "headers", "header")
_CLASSES = ("timeseries", "timetable", "table", "Simulink.SimulationData.Dataset", "Simulink.SimulationOutput")
_SIGNALS = "signals"  # of the structures that Simulink writes, in which a channel may be a matrix
Structure: TypeAlias = dict[str, Untyped]  # arrays, numbers, texts, lists and structures


def read_mat(file: Path) -> list[RawTable]:
    """Read a MATLAB file, v5 to v7.3: vectors side by side, in the file or in a structure, are a record."""
    with file.open("rb") as opened:
        in_hdf5 = b"MATLAB 7.3" in opened.read(128)
    if in_hdf5:
        _refuse_objects(file)
    content = library("pymatreader", file).read_mat(file)
    fields = {k: v for k, v in content.items() if not k.startswith("__")}
    return alone(list(_structures(file, "", _in_order(fields) if in_hdf5 else fields, {})))


def _refuse_objects(file: Path) -> None:
    """Refuse records that are objects, of which a file names the class only."""
    with library("h5py", file).File(file) as content:
        kinds = {name: item.attrs.get("MATLAB_class", b"") for name, item in content.items()}
    objects = [f"{name} ({kind.decode()})" for name, kind in kinds.items() if kind.decode() in _CLASSES]
    if objects:
        raise ValueError(
            f"{file} holds {', '.join(objects)}: the numbers of such objects can be read by MATLAB only. Save vectors, "
            "such as `t = ts.Time; force = ts.Data; save('run.mat', 't', 'force')`, or write a table by `writetable`."
        )


def _in_order(content: Untyped) -> Untyped:
    """Fields by name, as HDF5 lists them: the library gives them in another order each time."""
    if isinstance(content, list):
        return [_in_order(item) for item in content]
    return {key: _in_order(content[key]) for key in sorted(content)} if isinstance(content, dict) else content


def _structures(file: Path, name: str, fields: Structure, units: Mapping[str, Untyped]) -> Iterator[RawTable]:
    """The record of a structure, and those of the structures inside it; units of its channels may stand around it."""
    stated = _of_kind(fields, _UNITS, dict)
    units = {**units, **(stated or {})}
    columns, inside, notes = [], {}, []
    for key, value in fields.items():
        elements = [] if value is stated else _elements(key, value)
        channels, scaled = _channels(file, elements, key.lower() == _SIGNALS)
        columns += channels
        notes += scaled
        if not elements and not (key.lower() in (*_NAMES, *_UNITS) and _texts(value)):
            columns += _named(fields, value) or _vectors(key, value, _text(units.get(key)))
        inside |= {} if channels else dict(elements)
    yield from tables_by_clock(file, name, columns, notes=notes)
    for place, element in inside.items():
        yield from _structures(file, f"{name}.{place}".lstrip("."), element, units)


def _of_kind(fields: Structure, keys: Sequence[str], kind: type) -> Untyped:
    """The value of the first of these fields, in any case, that is of a kind; None without one."""
    return next((value for key, value in fields.items() if key.lower() in keys and isinstance(value, kind)), None)


def _text(value: object) -> str:
    """A text of a file, in which an empty one is an empty array."""
    return value.strip() if isinstance(value, str) else ""


def _texts(value: Untyped) -> list[str]:
    """The texts of a cell array, or of a matrix of characters; none for something else."""
    cells = list(value) if isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.ndim == 1 else value
    has_text = isinstance(cells, list) and any(isinstance(cell, str) for cell in cells)
    return [_text(cell) for cell in cells] if has_text else []


def _elements(key: str, value: Untyped) -> list[tuple[str, Structure]]:
    """The structures in a field, with their names: itself, a cell array of them, or an array, read as one of lists."""
    elements = value if isinstance(value, list) and all(isinstance(item, dict) for item in value) else []
    if isinstance(value, dict):
        lists = [item for item in value.values() if isinstance(item, list)]
        if not lists or len(lists) < len(value) or len(set(map(len, lists))) > 1:
            return [(key, value)]
        elements = [{name: item[index] for name, item in value.items()} for index in range(len(lists[0]))]
    return [(f"{key}[{index}]" if len(elements) > 1 else key, element) for index, element in enumerate(elements)]


def _channels(
    file: Path, elements: Sequence[tuple[str, Structure]], may_be_matrix: bool
) -> tuple[list[RawColumn], list[str]]:
    """The channels of structures that are one each, and notes; none if any of them is something else."""
    channels = [_channel(file, place, element, may_be_matrix) for place, element in elements]
    if not all(columns for columns, _ in channels):
        return [], []
    return [column for columns, _ in channels for column in columns], [note for _, notes in channels for note in notes]


def _channel(file: Path, place: str, fields: Structure, may_be_matrix: bool) -> tuple[list[RawColumn], list[str]]:
    """The samples of a structure that has its unit, name or scale beside them, and notes; none of another."""
    arrays = {key: value for key, value in fields.items() if _is_samples(value)}
    held = [key for key in arrays if len(arrays) == 1 or key.lower() in _DATA]
    plain = {key.lower() for key, value in fields.items() if not isinstance(value, dict | list)}
    if len(held) != 1 or not (may_be_matrix or plain.intersection((*_UNITS, *_LABELS, *_FACTORS))):
        return [], []
    name, values = _text(_of_kind(fields, _LABELS, str)) or place, arrays[held[0]]
    values, notes = _scaled(f"{file}, channel {name!r}", values, fields)
    columns = _vectors(name, values, _text(_of_kind(fields, _UNITS, str)))
    return (columns, notes) if len(columns) == 1 or may_be_matrix else ([], [])


def _is_samples(value: object) -> bool:
    """Whether a field holds numbers of which there are several."""
    return isinstance(value, np.ndarray) and value.size > 1 and value.dtype.kind in "biuf"


def _scaled(where: str, values: np.ndarray, fields: Structure) -> tuple[np.ndarray, list[str]]:
    """The samples of a channel by the scale and offset beside them, if they are counts, and a note."""
    factors, offsets = _scalars(fields, _FACTORS), _scalars(fields, _OFFSETS)
    several = [f"{key} ({value.size} numbers)" for key, value in fields.items() if _scales(key) and _is_samples(value)]
    names = ", ".join((*factors, *offsets, *several))
    if len(factors) > 1 or len(offsets) > 1 or several:
        raise ValueError(f"{where}: which of {names} scales it is not clear. Export it in its unit, or with one scale.")
    scale, offset = next(iter(factors.values()), 1.0), next(iter(offsets.values()), 0.0)
    if (scale, offset) == (1.0, 0.0):
        return values, []
    finite, channel = values[np.isfinite(values)], where.rpartition(", ")[2]
    if np.any(np.mod(finite, 1)):
        return values, [
            f"{channel} as it stands: {names} not applied, because its numbers have decimals, as no counts do"
        ]
    return values * scale + offset, [f"{channel} is its counts · {scale:g} {offset:+g}, by {names} beside them"]


def _scalars(fields: Structure, keys: Sequence[str]) -> dict[str, float]:
    """The fields of these names, in any case, that are one number."""
    scalars = {key: value for key, value in fields.items() if key.lower() in keys}
    return {key: float(value) for key, value in scalars.items() if isinstance(value, int | float)}


def _scales(key: str) -> bool:
    """Whether a field of this name scales the samples beside it."""
    return key.lower() in (*_FACTORS, *_OFFSETS)


def _named(fields: Structure, value: Untyped) -> list[RawColumn]:
    """The columns of a matrix that has a list of names beside it, and perhaps one of units; none without names."""
    names = next((texts for key, item in fields.items() if key.lower() in _NAMES and (texts := _texts(item))), [])
    columns = _vectors("", value, "") if names and isinstance(value, np.ndarray) and value.ndim == 2 else []
    if len(columns) != len(names):
        return []
    units = next((texts for key, item in fields.items() if key.lower() in _UNITS and (texts := _texts(item))), [])
    units = units if len(units) == len(names) else [""] * len(names)
    return [RawColumn(n, c.values, unit) for n, c, unit in zip(names, columns, units, strict=True)]


def _vectors(name: str, value: object, unit: str) -> list[RawColumn]:
    """The columns of a variable: itself, or those of a matrix of channels side by side."""
    if isinstance(value, list) and len(value) > 1 and all(isinstance(item, str) for item in value):
        return [RawColumn(name, value, unit)]
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biufmM" or value.size < 2:
        return []
    value = np.squeeze(value)
    if value.ndim == 1:
        return [RawColumn(name, value, unit)]
    if value.ndim != 2 or min(value.shape) > _MOST_COLUMNS:
        return []
    value = value if value.shape[0] >= value.shape[1] else value.T
    return [RawColumn(f"{name}[{index}]", column, unit) for index, column in enumerate(value.T)]

"""Measured roads: arrays, text files, and OpenCRG."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._documents import read_text
from jaxdamp._types import ScalarLike, VectorLike
from jaxdamp._unit_registry import unit_registry
from jaxdamp.roads._sampled import SampledRoad


if TYPE_CHECKING:
    import pyopencrg


# Largest departure from a uniform grid that is taken for rounding in the file, as part of one step.
_UNEVENNESS = 0.01


def from_profile(
    position: Float[ArrayLike, " samples"],
    height: Float[ArrayLike, " samples"] | Float[ArrayLike, "samples wheels"],
    speed: ScalarLike | int | None = None,
    *,
    periodic: bool = False,
    ramp: float | int = 0.0,
) -> SampledRoad:
    """A road from measured or computed heights at equal spacing, with straight lines between the samples.

    The vehicle is at the first sample at time 0, whatever its position is called. Differentiable in `height` and
    `speed` (the slope jumps at each sample, so the gradient in speed is that of the piecewise linear road).

    A road that is not periodic ends with its last sample: asking for later times raises a `ValueError`, and gives NaN
    inside compiled code, where times cannot be inspected.

    Arguments:
        position: the place of each sample: distance along the road [m] if `speed` is given, otherwise time [s]. It
            must increase in equal steps.
        height: the height of each sample [m], up positive: shape [samples], or [samples, wheels] with one column per
            track.
        speed: the speed of the vehicle [m/s], for a profile over distance.
        periodic: repeat the profile for ever. The sample after the last one is then the first one again, so a closed
            lap must not hold its starting point twice.
        ramp: the time [s] over which the road fades in as a raised cosine, for profiles that do not start at height
            zero; 0 turns it off.

    Raises:
        ValueError: if lengths differ, if there are fewer than two samples, if anything is NaN or infinite, if
            `position` does not increase or its steps are not equal, if `speed` is not positive, or if `ramp` is
            negative.

    >>> import jax.numpy as jnp
    >>> ramp_up = from_profile(jnp.arange(4.0), jnp.array([0.0, 0.0, 0.1, 0.1]), speed=10.0)
    >>> ramp_up.height(jnp.array([0.1, 0.15, 0.2]))[:, 0].round(6)
    Array([0.  , 0.05, 0.1 ], dtype=float64)
    >>> round(ramp_up.grid, 6), round(ramp_up.duration, 6)
    (0.1, 0.3)
    """
    _checks.untraced("position", position, "The samples may be traced, not their places.")
    spacing = _uniform_spacing(np.asarray(position, float))
    heights = jnp.asarray(height, float)
    if heights.shape[0] != np.size(position):
        _checks.refuse(
            "height",
            f"hold one value per position ({np.size(position)})",
            f"of shape {heights.shape}",
            "Give an array of shape [samples] or [samples, wheels].",
        )
    _refuse_gaps("height", _checks.concrete(heights))
    if speed is not None:
        _checks.positive("speed", speed, "Roads are driven forwards: reverse the arrays instead.")
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    return SampledRoad(
        samples=heights[:, None] if heights.ndim == 1 else heights,
        driven_at=None if speed is None else jnp.asarray(speed, float),
        spacing=spacing,
        periodic=periodic,
        ramp=float(ramp),
    )


def _uniform_spacing(position: np.ndarray) -> float:
    if position.size < 2:
        _checks.refuse("position", "hold at least two samples", f"of length {position.size}")
    _refuse_gaps("position", position)
    steps = np.diff(position)
    if np.any(steps <= 0.0):
        first = int(np.argmax(steps <= 0.0))
        _checks.refuse(
            "position",
            "increase from sample to sample",
            f"{position[first]:.6g} followed by {position[first + 1]:.6g} at sample {first + 1}",
            "Sort the record, remove repeated samples, or cut it where it turns back.",
        )
    spacing = float((position[-1] - position[0]) / steps.size)
    if np.max(np.abs(position - np.linspace(position[0], position[-1], position.size))) > _UNEVENNESS * spacing:
        _checks.refuse(
            "position",
            "increase in equal steps",
            f"stepped by {steps.min():.6g} to {steps.max():.6g}",
            "Resample the profile first, for example with numpy.interp on numpy.linspace.",
        )
    return spacing


def _refuse_gaps(argument: str, values: np.ndarray | None) -> None:
    if values is not None and not np.all(np.isfinite(values)):
        bad = ~np.isfinite(values).reshape(values.shape[0], -1).all(axis=1)
        _checks.refuse(
            argument,
            "be finite",
            f"NaN or infinite at {int(bad.sum())} samples, first at sample {int(np.argmax(bad))}",
            "Cut or fill the gaps first, for example with numpy.interp over the good samples.",
        )


_LENGTHS = {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
_TIMES = {"s": 1.0, "ms": 0.001}
Column = str | int


def read_profile(
    path: str | Path,
    speed: ScalarLike | int | None = None,
    *,
    position: Column = 0,
    height: Column | Sequence[Column] = 1,
    position_unit: str | None = None,
    height_unit: str | None = None,
    periodic: bool = False,
    ramp: float | int = 0.0,
) -> SampledRoad:
    r"""A road from a text file with one column of positions (or times) and one or several of heights.

    Columns are separated by commas, semicolons, tabs or blanks. Lines that begin with # or %, and empty ones, are left
    out. Names of columns may stand in the first remaining line, with their units: `position [ft],height [in]`, or
    `height_mm`. Everything else is as for `from_profile`.

    Arguments:
        path: the file.
        speed: the speed of the vehicle [m/s] if the positions are distances along the road; left out if they are times.
        position: the column of positions, by name or by number from 0.
        height: the column of heights, or one column for each track, by name or by number from 0.
        position_unit: "m", "km", "cm", "mm", "ft" or "in"; without a speed "s" or "ms". By default the unit in the name
            of the column; where it has none, "m", or "s" without a speed.
        height_unit: "m", "km", "cm", "mm", "ft" or "in". By default the unit in the name of each column; where it has
            none, "m".
        periodic: repeat the profile for ever, as for `from_profile`.
        ramp: the time [s] over which the road fades in, as for `from_profile`.

    Raises:
        ValueError: if the file holds no numbers, if lines differ in length or a field is not a number, if a column or
            unit is unknown, if the unit of a column is none of its quantity or another one than is given, or if
            `from_profile` refuses the values.
        FileNotFoundError: if there is no such file.

    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "lane.csv"
    >>> _ = file.write_text("distance,left,right\n0.0,0,1\n0.1,5,2\n0.2,0,3\n")
    >>> road = read_profile(file, speed=10.0, height=["left", "right"], height_unit="mm")
    >>> road.height(np.array([0.01, 0.02]))
    Array([[0.005, 0.002],
           [0.   , 0.003]], dtype=float64)
    """
    of_positions = _TIMES if speed is None else _LENGTHS
    for argument, unit, units in (
        ("position_unit", position_unit, of_positions),
        ("height_unit", height_unit, _LENGTHS),
    ):
        if unit is not None:
            _checks.one_of(argument, unit, units)
    names, table = _table(Path(path))
    chosen = [height] if isinstance(height, str | int) else list(height)
    columns = [_column("height", column, names, path) for column in chosen]
    heights = [table[:, i] * _size_of_unit("height_unit", height_unit, names[i], _LENGTHS, path) for i in columns]
    i = _column("position", position, names, path)
    size = _size_of_unit("position_unit", position_unit, names[i], of_positions, path)
    return from_profile(table[:, i] * size, np.stack(heights, axis=1), speed, periodic=periodic, ramp=ramp)


def _size_of_unit(argument: str, given: str | None, name: str, units: Mapping[str, float], path: object) -> float:
    """The unit of a column in SI: that in its name or, where this has none, the one given, or the first of `units`."""
    written = _unit_in(name, units)
    if not written:
        return units[given or next(iter(units))]
    size = _size(written, units)
    if size is None:
        kind = "time" if units is _TIMES else "length"
        remedy = f"Usual units are {', '.join(units)}."
        if argument == "position_unit":
            remedy += " Positions along the road need `speed`, positions in time are without it."
        must = f"name a file with a unit of {kind} in the header of its {argument.removesuffix('_unit')}s"
        _checks.refuse("path", must, f"{path} with the column {name!r}", remedy)
    if given is not None and not np.isclose(units[given], size, rtol=1e-9):
        remedy = "Leave it out, or correct the header."
        _checks.refuse(argument, f"be the unit of the column {name!r} of {path}", repr(given), remedy)
    return size


def _unit_in(name: str, units: Mapping[str, float]) -> str:
    """The unit in the name of a column, in brackets or, if it is one of `units`, behind an underscore."""
    brackets = re.findall(r"[\[({]\s*([^\[\](){}]*?)\s*[\])}]", name)
    if brackets:
        return brackets[-1]
    tail = name.rpartition("_")
    return tail[2] if tail[0] and tail[2] in units else ""


def _size(written: str, units: Mapping[str, float]) -> float | None:
    """A unit in SI, or None if it is none of the same quantity as `units`."""
    known = next((unit for unit in (written, written.lower()) if unit in units), None)
    if known is not None:
        return units[known]
    registry = unit_registry()  # not within `try`: that it does not start says nothing of the text
    try:
        return float(registry.Quantity(1.0, written).to(next(iter(units))).magnitude)
    except Exception:  # pint answers unknown text with errors of many classes
        return None


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    """The names of the columns (their numbers where there are none) and the numbers of a file."""
    lines = _lines(path)
    separator = next((mark for mark in ";\t," if mark in lines[0]), None)
    # a unit in brackets belongs to the name before it
    split = (
        [re.split(r"\s+(?![\[({])", line) for line in lines]
        if separator is None
        else list(csv.reader(lines, delimiter=separator))
    )
    rows = [[field.strip() for field in row] for row in split]
    has_names = not all(map(_is_number, rows[0]))
    names = rows.pop(0) if has_names else [str(number) for number in range(len(rows[0]))]
    if not rows:
        _checks.refuse("path", "name a file with numbers", f"{path}, which has only {lines[0]!r}")
    wrong = [i for i, row in enumerate(rows, has_names) if len(row) != len(names) or not all(map(_is_number, row))]
    if wrong:
        remedy = "Remarks begin with # or %; decimals have a point."
        must = f"name a file with {len(names)} numbers in each line"
        _checks.refuse("path", must, f"{path} with {lines[wrong[0]]!r}", remedy)
    return names, np.array(rows, float).reshape(len(rows), len(names))


def _lines(path: Path) -> list[str]:
    """The lines of a file but remarks."""
    stripped = map(str.strip, read_text(path, "text").splitlines())
    lines = [line for line in stripped if line and line[0] not in "#%"]
    if not lines:
        _checks.refuse("path", "name a file with numbers", f"{path}, which is empty")
    return lines


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _column(argument: str, column: Column, names: list[str], path: object) -> int:
    if isinstance(column, str):
        _checks.one_of(argument, column, names)
        return names.index(column)
    if not 0 <= column < len(names):
        _checks.refuse(argument, f"be a column from 0 to {len(names) - 1}", column, f"{path} has {names}.")
    return column


# Modifiers of a file that change heights along a line, by the names pyopencrg has for them.
_SCALES = {
    "z": "scale_z_grid",
    "slope": "scale_slope",
    "banking": "scale_banking",
    "length": "scale_length",
    "width": "scale_width",
    "curvature": "scale_curvature",
}


def read_crg(
    path: str | Path,
    speed: ScalarLike | int,
    *,
    lateral: float | int | VectorLike | Sequence[float | int] = 0.0,
    start: float | int | None = None,
    stop: float | int | None = None,
    periodic: bool = False,
    ramp: float | int = 0.0,
) -> SampledRoad:
    """A road from an OpenCRG file: the surface along one or several lines parallel to its reference line.

    The vehicle follows the reference line, straight or curved, at a constant speed along that line; a wheel at the
    lateral position v keeps its distance v from it. Where the line curves, the wheel itself is faster or slower by
    the factor 1 - v times curvature: spectra of outer lines are then over the distance along the reference line.
    Heights are linear between the points of the grid, across and along, and hold the elevation of the reference line
    and its banking. The samples are those of the file along the road, so that a simulation may not take steps longer
    than their spacing/speed.

    All formats of OpenCRG are read (KRBI, KDBI, LRFI, LDFI), by the package pyopencrg: `pip install 'jaxdamp[io]'`.
    The scales among the modifiers of a file are applied. Those that move the whole road have no effect here. Gaps of
    the scan are not filled: a line through a gap is refused.

        left_right = read_crg("belgian_block.crg", speed=10.0, lateral=[0.75, -0.75], start=730.0, stop=740.0)

    Arguments:
        path: the file.
        speed: V, the speed of the vehicle [m/s].
        lateral: the position v of each track [m], to the left of the reference line positive; for two tracks left, then
            right. One column of `height` each.
        start: where the vehicle is at time 0, the u of the file [m]; by default where the grid begins. Taken to the
            next point of the grid.
        stop: where the road ends, the u of the file [m]; by default where the grid ends.
        periodic: repeat the profile for ever, as for `from_profile`.
        ramp: the time [s] over which the road fades in, as for `from_profile`.

    Raises:
        ModuleNotFoundError: if pyopencrg is not installed.
        FileNotFoundError: if there is no such file.
        ValueError: if the file is damaged, if `lateral`, `start` or `stop` lies outside the grid, or if a line meets a
            gap of the scan.

    Source: ASAM OpenCRG 1.2.
    """
    surface = _surface(Path(path))
    u, v = np.asarray(surface.u), np.asarray(surface.v)
    first, last = _range(u, start, stop)
    tracks = np.atleast_1d(np.asarray(lateral, float))
    if tracks.ndim != 1 or tracks.size == 0 or not np.all(np.isfinite(tracks)):
        _checks.refuse("lateral", "hold one number for each track", lateral, "For example [0.75, -0.75].")
    if tracks.min() < v[0] - 1e-9 or tracks.max() > v[-1] + 1e-9:
        must = f"lie on the surface, from {v[0]:.6g} to {v[-1]:.6g} m"
        _checks.refuse("lateral", must, tracks.tolist(), "Positive is left of the reference line.")
    heights = lines(surface, tracks)[first : last + 1]
    gaps = np.isnan(heights)
    if gaps.any():
        row, column = (int(index) for index in np.argwhere(gaps)[0])
        remedy = f"Choose other lines, or another part of the road: {_measured(surface, first, last)}."
        where = f"at v = {tracks[column]:g} m in a gap of the scan from u = {u[first + row]:.6g} m on"
        _checks.refuse("lateral", "run where the surface was measured", where, remedy)
    return from_profile(u[first : last + 1], heights, speed, periodic=periodic, ramp=ramp)


def lines(surface: "pyopencrg.CrgRoad", lateral: np.ndarray) -> np.ndarray:
    """The heights [m] along the lines at the positions `lateral` [m] of a surface of pyopencrg, NaN in gaps."""
    v, z = np.asarray(surface.v), np.asarray(surface.z, float)
    left = np.clip(np.searchsorted(v, lateral, side="right") - 1, 0, v.size - 2)
    share = (lateral - v[left]) / (v[left + 1] - v[left])
    # a point of the grid needs no neighbour: 0 times NaN is NaN
    low = np.where(share < 1.0 - 1e-9, (1.0 - share) * z[:, left], 0.0)
    high = np.where(share > 1e-9, share * z[:, left + 1], 0.0)
    return low + high + np.asarray(surface.zr)[:, None] + np.asarray(surface.banking)[:, None] * lateral


def _surface(path: Path) -> "pyopencrg.CrgRoad":
    if not path.is_file():
        raise FileNotFoundError(f"There is no file {path}.")
    try:
        import pyopencrg
    except ModuleNotFoundError as missing:
        raise ModuleNotFoundError(
            f"{path}: .crg files need the library 'pyopencrg'. Install it with pip install 'jaxdamp[io]', or export "
            "the road as text of position, height."
        ) from missing
    try:
        surface = pyopencrg.read(str(path))
    except ValueError as fault:
        _checks.refuse("path", "name an OpenCRG file without errors", f"{path}: {fault}", "Make the file again.")
    modifiers = surface.effective_mods()
    return surface.scale(**{name: modifiers[key] for name, key in _SCALES.items() if key in modifiers})


def _range(u: np.ndarray, start: float | int | None, stop: float | int | None) -> tuple[int, int]:
    """The numbers of the first and the last point of the grid that are used."""
    ends = []
    for name, value, default in (("start", start, u[0]), ("stop", stop, u[-1])):
        place = default if value is None else float(value)
        if not u[0] - 1e-6 <= place <= u[-1] + 1e-6:
            _checks.refuse(name, f"lie between {u[0]:.6g} and {u[-1]:.6g} m", f"{value} m", "It is the u of the file.")
        ends.append(int(np.argmin(np.abs(u - place))))
    if ends[1] <= ends[0]:
        _checks.refuse("stop", "lie behind `start`", f"{stop} m, and start {start} m", "Exchange them.")
    return ends[0], ends[1]


def _measured(surface: "pyopencrg.CrgRoad", first: int, last: int) -> str:
    """The lateral range of the grid lines without a gap between two points along the road, in words."""
    whole = ~np.isnan(np.asarray(surface.z)[first : last + 1]).any(axis=0)
    v = np.asarray(surface.v)[whole]
    return f"whole lines lie between v = {v[0]:.6g} and {v[-1]:.6g} m" if v.size else "no line is whole in this one"

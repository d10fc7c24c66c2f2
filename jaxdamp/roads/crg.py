"""Roads from OpenCRG files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jaxdamp import _checks
from jaxdamp._types import ScalarLike, VectorLike
from jaxdamp.roads._sampled import SampledRoad
from jaxdamp.roads.profile import from_profile


if TYPE_CHECKING:
    import pyopencrg


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

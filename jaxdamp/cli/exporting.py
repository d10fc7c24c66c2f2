"""`jaxdamp export`: the file of a law or a vehicle in, C, an FMU or the table of a simulator out."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxdamp import _checks, export
from jaxdamp.cli.console import Screen
from jaxdamp.cli.vehicle_words import read_law, read_module
from jaxdamp.dampers import AbstractDamper
from jaxdamp.vehicles import AbstractVehicle


PROGRAMS: dict[str, tuple[str, Callable[..., Any]]] = {"c": (".c", export.to_c), "fmu": (".fmu", export.to_fmu)}
TABLES: dict[str, tuple[str, Callable[..., Any]]] = {
    "adams": (".dpr", export.to_adams),
    "assetto-corsa": (".ini", export.to_assetto_corsa),
    "carsim": (".par", export.to_carsim),
    "csv": (".csv", export.to_csv),
    "matlab": (".mat", export.to_matlab),
}
_USUAL, _POINTS = (-1.0, 1.0), 41  # m/s


def run_export(
    screen: Screen, law: Path, to: str, *, out: Path | None, velocities: str | None, replace: bool = False
) -> None:
    """Write a law, or a vehicle as a program, in another format.

    Raises:
        ValueError: what the library refuses; a file that exists, unless it is to be replaced.
    """
    _checks.one_of("to", to, sorted(PROGRAMS | TABLES))
    ending, write = (PROGRAMS | TABLES)[to]
    file = new_file(Path(law.stem.replace("-", "_") + ending) if out is None else out, replace)
    if to in PROGRAMS:
        if velocities is not None:
            _checks.refuse("velocities", f"be left out for {to}", velocities, "It has the law itself, not a table.")
        kinds, remedy = (AbstractDamper, AbstractVehicle), "Give the JSON of a law or of a vehicle."
        written = write(read_module("law", law, kinds, "a law or a vehicle", remedy), file)
    else:
        damper = read_law("law", law)
        grid = _grid(damper, velocities)
        screen.say(f"Velocities: {grid.size} from {grid[0]:g} to {grid[-1]:g} m/s, positive in rebound.")
        written = write(damper, file, grid)
    files: Sequence[Path] = written if isinstance(written, list) else [written]
    screen.points([f"written: {each}" for each in files])


def new_file(file: Path, replace: bool) -> Path:
    """A file to write, refused if it exists and is not to be replaced."""
    if file.exists() and not replace and not file.is_dir():
        _checks.refuse("out", "be a new file", file, "Give another name, or --replace.")
    return file


def _grid(law: AbstractDamper, text: str | None) -> np.ndarray:
    """The velocities given as FROM:TO:POINTS; otherwise those that the law was fitted to, with zero."""
    if text is None:
        fitted = None if law.fitted_to is None else law.fitted_to.velocity
        low, high = fitted or _USUAL
        grid = np.linspace(low, high, _POINTS)
        if low < 0 < high:
            grid[np.argmin(np.abs(grid))] = 0.0  # where many laws have a kink
        return grid
    try:
        low, high, points = text.split(":")
        return np.linspace(float(low), float(high), int(points))
    except ValueError:
        _checks.refuse("velocities", "be FROM:TO:POINTS in m/s", repr(text), "Write for example -0.6:0.8:41.")

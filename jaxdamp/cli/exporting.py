"""`jaxdamp export`: a law or a vehicle as C, FMU or the table of a simulator; `jaxdamp explore`: as a page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from jaxdamp import _checks, export
from jaxdamp._display import COMPRESSION, display
from jaxdamp._words import first_upper
from jaxdamp.cli.console import Screen
from jaxdamp.cli.options import Call
from jaxdamp.cli.records import Reading
from jaxdamp.cli.riding import USUAL, parse_road, unusual
from jaxdamp.cli.vehicle_words import commanded, parse_vehicle, read_law, read_module
from jaxdamp.dampers import AbstractDamper, command_words
from jaxdamp.vehicles import AbstractVehicle


Write = Callable[..., Path | list[Path]]  # a file, or several
PROGRAMS: dict[str, tuple[str, Write]] = {"c": (".c", export.to_c), "fmu": (".fmu", export.to_fmu)}
TABLES: dict[str, tuple[str, Write]] = {
    "adams": (".dpr", export.to_adams),
    "assetto-corsa": (".ini", export.to_assetto_corsa),
    "carsim": (".par", export.to_carsim),
    "csv": (".csv", export.to_csv),
    "matlab": (".mat", export.to_matlab),
}
_USUAL, _POINTS = (-1.0, 1.0), 41  # m/s


@dataclass(frozen=True)
class OneFile:
    """The file that a command writes.

    Arguments:
        file: file to write; the name of the law with another ending if left out.
        replace: write --file although it is there.
    """

    file: Path | None = None
    replace: bool = False

    def checked(self, name: str, others: Sequence[str] = ()) -> Path:
        """The file to write, by this name if none or a folder is given; or a refusal.

        It has the ending of the name. Neither it nor a file `beside` it with these endings may exist, unless it is to
        be replaced.
        """
        file = Path(name) if self.file is None else self.file
        whole, suffix = file / name if file.is_dir() else file, Path(name).suffix
        if whole.suffix.lower() != suffix:
            _checks.refuse("file", f"be a folder or a file NAME{suffix}", whole, f"Try {whole.stem}{suffix}.")
        for each in (whole, *(whole.with_name(f"{whole.stem}{ending}") for ending in others)):
            if each.exists() and not self.replace:
                _checks.refuse("file", "be a new file", each, "Give another name, or --replace.")
        return whole


def export_command(
    screen: Screen,
    law: Path,
    *,
    to: str,
    part: str = "whole",
    velocities: str | None = None,
    command: float | None = None,
    show_units: str | None = None,
    show_sign: str | None = None,
    output: OneFile,
) -> None:
    """Write a law as C, as FMU or as the table of a simulator; or a whole vehicle, or its controller, as C or FMU.

    Arguments:
        law: a law as JSON, such as best_law.json of jaxdamp fit; or a vehicle, for c and fmu.
        to: the format: adams, assetto-corsa, c, carsim, csv, fmu or matlab.
        part: of a vehicle, as c or fmu: whole, or controller for its controller alone.
        velocities: of a table, FROM:TO:POINTS [m/s], positive in rebound; those the law was fitted to, or -1:1:41.
        command: of a table, what is set on the damper, such as clicks or a coil current; that of the law if left out.
        show_units: units of a table as csv: SI, metric (N, mm/s), imperial (lbf, in/s), or a force and a velocity such
            as kgf,mm/s; --units means this too.
        show_sign: direction in which it counts positive: rebound-positive or compression-positive.
    """
    _checks.one_of("to", to, sorted(PROGRAMS | TABLES))
    if to != "csv":
        for name, given in (("show_units", show_units), ("show_sign", show_sign)):
            if given is not None:
                _checks.refuse(name, f"be left out for {to}", given, "Its reader wants units and sign as they are.")
    ending, write = (PROGRAMS | TABLES)[to]
    name = export.identifier(law.stem)
    file = output.checked(name + ending, (".h", "_test.c") if to == "c" else ())
    if to in PROGRAMS:
        if velocities is not None:
            _checks.refuse("velocities", f"be left out for {to}", velocities, "It has the law itself, not a table.")
        if command is not None:
            _checks.refuse("command", f"be left out for {to}", command, "It has the command itself, to be set there.")
        kinds, remedy = (AbstractDamper, AbstractVehicle), "Give the JSON of a law or of a vehicle."
        written = write(read_module("law", law, kinds, "a law or a vehicle", remedy), file, part=part)
    else:
        if part != "whole":
            _checks.refuse("part", f"be left out for {to}", part, "A table has a law alone.")
        damper = commanded(read_law("law", law), command)
        grid = _grid(damper, velocities)
        low, high = sorted(grid[[0, -1]] * (-1.0 if display().sign == COMPRESSION else 1.0) + 0.0)  # no -0
        screen.say(f"Velocities: {grid.size} from {low:g} to {high:g} m/s, positive in rebound.")  # or as it is shown
        if at := command_words(damper):
            screen.say(f"{first_upper(at)}; --command sets another.")
        written = write(damper, file, grid)
    files: Sequence[Path] = written if isinstance(written, list) else [written]
    screen.points([f"written: {each}" for each in files])


def explore(
    screen: Screen,
    law: Path,
    files: Sequence[Path] = (),
    *,
    reading: Reading,
    vehicle: str = "quarter_car_000",
    road: str = "iso:C",
    speed: float = 20.0,
    baseline: Path | None = None,
    duration: float | None = None,
    seed: int = 0,
    how: Annotated[Call, "export.to_explorer"],
    show_units: str | None = None,
    show_sign: str | None = None,
    output: OneFile,
) -> None:
    """Write a law as one page for the browser: sliders, loops, records and a ride, live and without a network.

    Arguments:
        law: a law as JSON, such as best_law.json of jaxdamp fit.
        files: files with records to overlay, patterns, or folders.
        vehicle: a quarter car, see "jaxdamp vehicles"; or a file of one, *.json or *.toml.
        speed: of the vehicle [m/s].
        duration: of the ride [s]; the road's own, or 10.
        seed: of random roads.
        show_units: units of the page: SI, metric (N, mm/s), imperial (lbf, in/s), or a force and a velocity such as
            kgf,mm/s; --units without quantities means this too.
        show_sign: direction in which it counts positive: rebound-positive or compression-positive.
    """
    del show_units, show_sign  # what shows numbers asks for them
    file, damper = output.checked(f"{law.stem}.html"), read_law("law", law)
    kind, _, word = road.partition(":")
    if duration is not None:
        _checks.positive("duration", duration)
    screen.points(unusual(road, speed), style="yellow")
    how_long = USUAL if duration is None else duration
    written = export.to_explorer(
        damper,
        file,
        **how.arguments(
            records=reading.processed(reading.raw(files)) if files else (),
            vehicle=parse_vehicle(vehicle)(damper),
            road=word if kind == "iso" else parse_road(road, speed=speed, duration=how_long, seed=seed),
            speed=speed,
            baseline=None if baseline is None else read_law("baseline", baseline),
            duration=duration,
            seed=seed,
        ),
    )
    screen.points([f"written: {written}; open it in a browser"])


def _grid(law: AbstractDamper, text: str | None) -> np.ndarray:
    """The velocities given as FROM:TO:POINTS; otherwise those that the law was fitted to, with zero."""
    if text is None:
        fitted = None if law.fitted_to is None else law.fitted_to.velocity
        low, high = fitted or _USUAL
        grid = np.linspace(low, high, _POINTS)
        if low < 0 < high:  # where many laws have a kink
            grid[1 + np.argmin(np.abs(grid[1:-1]))] = 0.0
        return grid
    try:
        low, high, points = text.split(":")
        grid = np.linspace(float(low), float(high), int(points))
        if grid.size == 0 or np.any(np.diff(grid) <= 0):
            raise ValueError
    except ValueError:
        must = "be FROM:TO:POINTS in m/s, rising from FROM to TO"
        _checks.refuse("velocities", must, repr(text), "Write for example -0.6:0.8:41.")
    grid[np.abs(grid) < 1e-9 * np.ptp(grid)] = 0.0  # a rounding error
    return grid

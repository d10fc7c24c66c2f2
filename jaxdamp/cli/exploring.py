"""`jaxdamp explore`: a law and records in, one page for the browser out."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jaxdamp import export
from jaxdamp.cli.console import Screen
from jaxdamp.cli.exporting import new_file
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions
from jaxdamp.cli.riding import USUAL, parse_road
from jaxdamp.cli.vehicle_words import parse_vehicle, read_law


class RideOptions(NamedTuple):
    """The ride of the page, as the command line says it."""

    vehicle: str
    road: str
    speed: float
    duration: float | None
    seed: int
    baseline: Path | None


def run_explore(
    screen: Screen,
    law: Path,
    files: Sequence[Path],
    reading: ReadOptions,
    processing: ProcessOptions,
    on: RideOptions,
    *,
    out: Path | None,
    replace: bool = False,
) -> None:
    """Write the page of a law.

    Raises:
        ValueError: what the library refuses; a file that exists, unless it is to be replaced.
    """
    file = new_file(Path(f"{law.stem}.html") if out is None else out, replace)
    damper = read_law("law", law)
    baseline = None if on.baseline is None else read_law("baseline", on.baseline)
    kind, _, word = on.road.partition(":")
    length = on.duration or USUAL
    road = word if kind == "iso" else parse_road(on.road, speed=on.speed, duration=length, seed=on.seed)
    written = export.to_explorer(
        damper,
        file,
        records=processing.apply(reading.read(files)) if files else (),
        vehicle=parse_vehicle(on.vehicle)(damper),
        road=road,
        speed=on.speed,
        baseline=baseline,
        duration=on.duration,
        seed=on.seed,
    )
    screen.points([f"written: {written}; open it in a browser"])

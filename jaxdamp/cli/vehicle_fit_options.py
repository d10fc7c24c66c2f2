"""Options of `jaxdamp fit-vehicle`: how its records are read, what is free, what sensors and guides add."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer


if TYPE_CHECKING:
    from jaxdamp.bench import RideRecord


@dataclass(frozen=True)
class RideReadOptions:
    """How records of a vehicle are to be read, as the command line says it."""

    columns: Annotated[
        list[str],
        typer.Option(
            help='Channels of the vehicle, with headers or numbers (from 0) of their columns: "stroke=LVDT FL,time=0".'
        ),
    ] = field(default_factory=list)
    road: Annotated[
        list[str],
        typer.Option(
            help="Header or number of the column with the height under each wheel, or the force on it; repeat it for "
            'further wheels, front left first. "road", or "road 1", "road 2" and so on, if left out.'
        ),
    ] = field(default_factory=list)
    units: Annotated[
        list[str], typer.Option(help="Units that the headers do not give: road=mm,sprung_acceleration=g.")
    ] = field(default_factory=list)
    reversed_channels: Annotated[
        list[str],
        typer.Option("--reversed", help='Channels (or "road") that are positive downwards or in compression: stroke.'),
    ] = field(default_factory=list)
    sampling_rate: Annotated[
        float | None, typer.Option(help="Samples per second [Hz], for files without a time column.")
    ] = None
    delimiter: Annotated[str | None, typer.Option(help="Character between columns, if it is not found.")] = None
    manifest: Annotated[
        Path | None, typer.Option(help="TOML file with columns, road, units and so on, as bench.read_rides takes them.")
    ] = None

    def read(self, files: Sequence[Path]) -> "tuple[RideRecord, ...]":
        """Read the records."""
        from jaxdamp import bench
        from jaxdamp.cli.options import assignments

        columns = assignments("columns", self.columns, None)
        return bench.read_rides(
            list(files),
            columns={channel: _column(word) for channel, word in columns.items()} or None,
            road=[_column(word) for word in self.road] or None,
            units=assignments("units", self.units, None) or None,
            reversed_channels=listed(self.reversed_channels) or None,
            sampling_rate=self.sampling_rate,
            delimiter=self.delimiter,
            manifest=self.manifest,
        )


@dataclass(frozen=True)
class VehicleFitOptions:
    """What is fitted to the records of a vehicle, as the command line says it."""

    over: Annotated[
        list[str], typer.Option(help='Parameters of the vehicle to fit, by path or pattern; all if left out: "*_mass".')
    ] = field(default_factory=list)
    freeze: Annotated[list[str], typer.Option(help="Parameters among these to hold, such as the known mass.")] = field(
        default_factory=list
    )
    bound: Annotated[list[str], typer.Option(help="Bounds: rate=1000:4000.")] = field(default_factory=list)
    tie: Annotated[
        list[str], typer.Option(help="Parameters with the value of others: front.damper.*=rear.damper.*")
    ] = field(default_factory=list)
    per_record: Annotated[
        list[str], typer.Option(help="Parameters with a value for each record, such as sprung_mass (payload).")
    ] = field(default_factory=list)
    sensor: Annotated[
        list[str],
        typer.Option(
            help="What a sensor adds, fitted: stroke:offset,delay=0.001. Numbers: gain, offset, lag [s], delay [s], "
            'high_pass [Hz], each with a start if one is given; "*:offset" is every channel.'
        ),
    ] = field(default_factory=list)
    guide: Annotated[
        list[str],
        typer.Option(
            help="What holds a body to the ground, fitted from these starts: sprung:friction=40. Numbers: friction "
            "[N], stiffness [N/m], damping [N s/m]; held: friction_velocity [m/s], ahead [m]."
        ),
    ] = field(default_factory=list)
    initial_motion: Annotated[
        str, typer.Option(help='"rest": records begin at rest on their first heights; "free": their motion is fitted.')
    ] = "rest"
    settling: Annotated[float, typer.Option(help="Beginning of each record that is not compared [s].")] = 0.0
    noise: Annotated[
        list[str], typer.Option(help="Standard deviation of channels where it is known [SI]: stroke=0.0002.")
    ] = field(default_factory=list)
    bench: Annotated[
        list[str],
        typer.Option(
            help="Bench records of a damper of the vehicle, fitted together with the rides: a file, pattern or folder; "
            "front.damper=FILE where there are several dampers. A jaxdamp.toml in the folder says how to read it."
        ),
    ] = field(default_factory=list)
    rig: Annotated[
        list[str], typer.Option(help="What the machine of the bench records adds, as in jaxdamp fit: gas,friction.")
    ] = field(default_factory=list)
    dt: Annotated[float, typer.Option(help="Longest step of the simulation [s].")] = 1e-3
    max_steps: Annotated[int, typer.Option(help="Of each search.")] = 100


def listed(texts: Sequence[str]) -> list[str]:
    """Words between commas, also from several texts.

    >>> listed(["stroke, road", "pitch"])
    ['stroke', 'road', 'pitch']
    """
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]


def numbers_of(option: str, text: str, known: Mapping[str, float | None]) -> tuple[str, dict[str, float]]:
    """What "stroke:offset,delay=0.001" says: of what, and its numbers; those without a value take that of `known`.

    Raises:
        ValueError: no colon, an unknown number, or one without a value that needs one.

    >>> numbers_of("sensor", "stroke:offset,delay=0.001", {"offset": 0.0, "delay": 0.0})
    ('stroke', {'offset': 0.0, 'delay': 0.001})
    """
    from jaxdamp import _checks

    owner, _, rest = (part.strip() for part in text.partition(":"))
    example = "Such as stroke:offset,delay=0.001." if option == "sensor" else "Such as sprung:friction=40."
    if not owner or not rest:
        _checks.refuse(option, "read like NAME:NUMBER=START,NUMBER=START", repr(text), example)
    numbers: dict[str, float] = {}
    for part in rest.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        _checks.one_of(option, name, known)
        default = known[name]
        try:
            number = default if not equals else float(value)
        except ValueError:
            number = None
        if number is None:
            _checks.refuse(option, f"give a number for {name}", repr(text), example)
        numbers[name] = number
    return owner, numbers


def _column(word: str) -> str | int:
    return int(word) if word.isdigit() else word

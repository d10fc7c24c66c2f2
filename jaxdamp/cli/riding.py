"""`jaxdamp ride`: a law in a vehicle on a road, beside a baseline."""

from collections.abc import Mapping
from pathlib import Path

from jaxdamp import _checks, export, roads, simulate
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.early import refuse_road
from jaxdamp.cli.option_types import command_line
from jaxdamp.cli.results import results_folder
from jaxdamp.cli.run_warnings import with_step_warnings, without_range_warnings
from jaxdamp.cli.unusual import unusual
from jaxdamp.cli.vehicle_words import parse_vehicle, read_law
from jaxdamp.cli.wording import message
from jaxdamp.dampers import AbstractDamper
from jaxdamp.report import Attempts, Table, axles_sentence, notes_of, ride_report, ride_tables
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Response


USUAL = 10.0  # s, a ride on a road without an end of its own


def parse_road(text: str, *, speed: float, duration: float, seed: int, white: bool = False) -> AbstractRoad:
    """The road that a word on the command line means.

    "iso:C" is an ISO 8608 class, "bump:0.06:5" a cosine bump of height and length in metres that begins after a second,
    anything else a file: OpenCRG (*.crg), or text with positions [m] and heights [m].
    """
    kind, _, rest = text.partition(":")
    if kind == "iso":
        road: AbstractRoad = roads.iso8608(rest, speed, duration, seed=seed)
    elif kind == "bump":
        try:
            height, length = (float(number) for number in rest.split(":"))
        except ValueError:
            _checks.refuse("road", "read like bump:HEIGHT:LENGTH with numbers in metres", repr(text))
        road = roads.cosine_bump(height, start=1.0, length=length, speed=speed)
    elif Path(text).is_file():
        road = roads.read_crg(text, speed) if text.endswith(".crg") else roads.read_profile(text, speed)
    else:
        refuse_road(text)
    return road


def run_ride(
    screen: Screen,
    law: Path,
    *,
    vehicle: str,
    road: str,
    speed: float,
    baseline: Path | None = None,
    duration: float | None = None,
    dt: float = 1e-3,
    seed: int = 0,
    out: Path,
    replace: bool = False,
) -> dict[str, Response]:
    """Ride on a law and a baseline, compare their metrics, and write tables, then pictures, into a folder."""
    make = parse_vehicle(vehicle)
    _checks.positive("speed", speed)
    files = ({} if baseline is None else {"baseline": baseline}) | {"law": law}
    laws = {name: read_law(name, path) for name, path in files.items()}
    screen.points(unusual(road, speed), style="yellow")
    attempts = Attempts(interrupt.check, message)
    with results_folder(out, "ride", replace=replace) as results:
        responses: dict[str, Response] = {}
        remarks: list[str] = []
        with screen.stage("Driving", total=len(laws)) as advance:
            for done, (name, damper) in enumerate(laws.items()):
                advance(name, done)
                car = make(damper)
                under = parse_road(road, speed=speed, duration=duration or USUAL, seed=seed)
                length = duration or under.duration or USUAL
                with without_range_warnings():
                    responses[name], warned = with_step_warnings(
                        lambda car=car, u=under, t=length: simulate(car, u, duration=t, dt=dt)
                    )
                remarks += [f"{name}: {text}" for text in warned]
            tables = ride_tables(responses)
            remarks += notes_of(responses)
        for table in tables.values():
            screen.table(table)
        screen.points(remarks, style="yellow")
        interrupt.keep()
        axles = axles_sentence(responses)
        if axles:
            screen.say(axles)
        with interrupt.saving(), screen.stage("Tables and channels"):
            _write(results.draft, laws, responses, tables)
            results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            title = f"{vehicle} on {road} at {speed:g} m/s"
            options = {"title": title, "laws": laws, "remarks": remarks}
            report = ride_report(responses, **options, folder=results.draft, attempts=attempts)
            report.write(results.draft / "report.html", command_line())
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return responses


def _write(
    folder: Path, laws: Mapping[str, AbstractDamper], responses: Mapping[str, Response], tables: Mapping[str, Table]
) -> None:
    """Laws, tables and channels."""
    for name, law in laws.items():
        export.to_json(law, folder / f"{name}.json")
    for file, table in tables.items():
        (folder / f"{file}.csv").write_text(table.to_csv(), encoding="utf-8")
    for name, response in responses.items():
        response.to_xarray().to_dataframe().to_csv(folder / f"channels_{name}.csv")

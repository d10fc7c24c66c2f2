"""`jaxdamp ride`: a law in a vehicle on a road, beside a baseline."""

import inspect
import warnings
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from jaxdamp import _checks, export, metrics, plots, roads, simulate, vehicles
from jaxdamp.cli import interrupt
from jaxdamp.cli.attempts import Attempts
from jaxdamp.cli.console import Screen
from jaxdamp.cli.ranges import notes_of, range_use_table, said_in_tables
from jaxdamp.cli.results import results_folder
from jaxdamp.cli.unusual import unusual
from jaxdamp.dampers import AbstractDamper
from jaxdamp.plots.damper_use import dampers_of
from jaxdamp.report import Cell, Column, Report, Table
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import CoarseStepWarning, Response
from jaxdamp.vehicles import AbstractVehicle


USUAL = 10.0  # s, a ride on a road without an end of its own


def presets() -> dict[str, Callable[..., AbstractVehicle]]:
    """The published vehicles that take a damper, by name."""
    known = inspect.getmembers(vehicles.presets, inspect.isfunction)
    return {name: make for name, make in known if "damper" in inspect.signature(make).parameters}


def vehicles_table() -> Table:
    """The published vehicles that take a damper, with a line of meaning."""
    rows = tuple((name, (inspect.getdoc(make) or "").partition("\n")[0]) for name, make in presets().items())
    return Table("Vehicles", (Column("vehicle"), Column("what it is")), rows)


def parse_road(text: str, *, speed: float, duration: float, seed: int) -> AbstractRoad:
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
        remedy = 'Examples: "iso:C", "bump:0.06:5", "profile.csv", "course.crg".'
        _checks.refuse("road", "be iso:CLASS, bump:HEIGHT:LENGTH or a file that is there", repr(text), remedy)
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
    _checks.one_of("vehicle", vehicle, presets())
    _checks.positive("speed", speed)
    make, files = presets()[vehicle], ({} if baseline is None else {"baseline": baseline}) | {"law": law}
    laws = {name: export.from_json(path) for name, path in files.items()}
    screen.points(unusual(road, speed), style="yellow")
    attempts = Attempts()
    with results_folder(out, "ride", replace=replace) as results:
        responses: dict[str, Response] = {}
        remarks: list[str] = []
        with screen.stage("Driving", total=len(laws)) as advance:
            for done, (name, found) in enumerate(laws.items()):
                advance(name, done)
                car = make(damper=found)
                under = parse_road(road, speed=speed, duration=duration or USUAL, seed=seed)
                length = duration or under.duration or USUAL
                with said_in_tables():
                    responses[name], said = with_step_warnings(
                        lambda car=car, u=under, t=length: simulate(car, u, duration=t, dt=dt)
                    )
                remarks += [f"{name}: {text}" for text in said]
            tables = [metrics_table(responses), comfort_table(responses)]
            uses = [table for table in [range_use_table(responses)] if table is not None]
            remarks += notes_of(responses)
        for table in [*tables, *uses]:
            screen.table(table)
        screen.points(remarks, style="yellow")
        interrupt.keep()
        title = f"{vehicle} on {road} at {speed:g} m/s"
        timing = next(iter(responses.values())).axle_timing
        if timing.kind != "one axle":
            screen.say(f"Axles: {timing}.")
        with interrupt.saving(), screen.stage("Tables and channels"):
            _write(results.draft, laws, responses, tables, uses)
            results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            _draw(results.draft, title, laws, responses, [*tables, *uses], remarks, attempts)
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return responses


def with_step_warnings(drive: Callable[[], Response]) -> tuple[Response, list[str]]:
    """A run, and what it warns of its step in the words of the command line; other warnings pass."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", CoarseStepWarning)
        response = drive()
    texts = []
    for warning in caught:
        if issubclass(warning.category, CoarseStepWarning):
            texts.append(str(warning.message).replace("`dt=", "`--dt "))
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return response, texts


def _compared(
    rows: Mapping[str, tuple[str, list[float]]], without_change: Collection[str] = ()
) -> tuple[tuple[Cell, ...], ...]:
    """Rows of name, unit, a value for each law, and the change from the first to the last in percent."""

    def change(name: str, values: list[float]) -> list[float | None]:
        says = values[0] and name not in without_change
        return [100 * (values[-1] / values[0] - 1) if says else None] if len(values) > 1 else []

    return tuple((name, unit, *values, *change(name, values)) for name, (unit, values) in rows.items())


def _columns(first: str, responses: Mapping[str, Response]) -> tuple[Column, ...]:
    change = (Column("change", "%", "+.1f"),) if len(responses) > 1 else ()
    return (Column(first), Column("unit"), *[Column(name) for name in responses], *change)


def _unit(unit: str) -> str:
    return unit.replace("^2", "²") or "–"


def metrics_table(responses: Mapping[str, Response]) -> Table:
    """The ride metrics of each law, and the change."""
    first = next(iter(responses.values()))
    found = [response.metrics() for response in responses.values()]
    rows = {name: (_unit(unit), [float(of[name]) for of in found]) for name, unit in first.metric_units().items()}
    signed = [m.name for m in first.vehicle.ride_metrics if metrics.STATISTICS[m.statistic].signed]
    return Table("Ride metrics", _columns("metric", responses), _compared(rows, signed))


def comfort_table(responses: Mapping[str, Response]) -> Table:
    """What people feel of the accelerations, by ISO 2631-1."""
    first = next(iter(responses.values()))
    found = [response.comfort() for response in responses.values()]
    rows: dict[str, tuple[str, list[float]]] = {}
    for channel in found[0]:
        unit = first.units[channel]
        dose = f"{unit.removesuffix('s^2')}s^1.75"
        for name, said in (("weighted_rms", unit), ("max_transient_value", unit), ("vibration_dose_value", dose)):
            values = [float(getattr(comfort[channel], name)) for comfort in found]
            rows[f"{channel} {name.replace('_', ' ')}"] = (_unit(said), values)
    return Table("Comfort by ISO 2631-1 (Wk, angles We)", _columns("what", responses), _compared(rows))


def _write(
    folder: Path,
    laws: Mapping[str, AbstractDamper],
    responses: Mapping[str, Response],
    tables: list[Table],
    uses: list[Table],
) -> None:
    """Laws, tables and channels."""
    for name, law in laws.items():
        export.to_json(law, folder / f"{name}.json")
    for file, table in zip(("metrics", "comfort"), tables, strict=True):
        (folder / f"{file}.csv").write_text(table.to_csv(), encoding="utf-8")
    for table in uses:
        (folder / "range_use.csv").write_text(table.to_csv(), encoding="utf-8")
    for name, response in responses.items():
        response.to_xarray().to_dataframe().to_csv(folder / f"channels_{name}.csv")


def _draw(
    folder: Path,
    title: str,
    laws: Mapping[str, AbstractDamper],
    responses: Mapping[str, Response],
    tables: list[Table],
    remarks: list[str],
    attempts: Attempts,
) -> None:
    """Pictures, and the report with them."""
    report = Report(title)
    timing = next(iter(responses.values())).axle_timing
    if timing.kind != "one axle":
        report.text(f"Axles: {timing}.")
    report.points(remarks)
    for name, law in laws.items():
        covered = f" Fitted to: {law.fitted_to.words()}." if law.fitted_to is not None else ""
        report.text(f"{name}: {law!r}{'.' * bool(covered)}{covered}")
    for table in tables:
        report.table(table)
    with attempts.part("The picture ride.png"):
        report.picture(plots.ride(responses, weighting="Wk"), title, folder / "ride.png")
    for damper in dampers_of(next(iter(responses.values()))):
        with attempts.part(f"The picture {damper}.png"):
            figure = plots.damper_use(responses, damper=damper)
            report.picture(figure, f"What the ride makes the {damper.replace('_', ' ')} do", folder / f"{damper}.png")
    report.points(attempts.troubles)
    report.write(folder / "report.html")

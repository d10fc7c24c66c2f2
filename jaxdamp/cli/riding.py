"""`jaxdamp ride`: a law in a vehicle on a road, beside a baseline."""

import inspect
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

from jaxdamp import _checks, export, plots, roads, simulate, vehicles
from jaxdamp.cli.console import Screen
from jaxdamp.cli.results import results_folder, written
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
    force: bool = False,
) -> dict[str, Response]:
    """Ride on a law and a baseline, compare their metrics, and write tables and pictures into a folder."""
    _checks.one_of("vehicle", vehicle, presets())
    _checks.positive("speed", speed)
    make, files = presets()[vehicle], ({} if baseline is None else {"baseline": baseline}) | {"law": law}
    laws = {name: export.from_json(path) for name, path in files.items()}
    with results_folder(out, "ride", force=force) as folder:
        responses: dict[str, Response] = {}
        remarks: list[str] = []
        with screen.stage("Driving", total=len(laws)) as advance:
            for done, (name, found) in enumerate(laws.items()):
                advance(name, done)
                car = make(damper=found)
                under = parse_road(road, speed=speed, duration=duration or USUAL, seed=seed)
                length = duration or under.duration or USUAL
                responses[name], said = with_step_warnings(
                    lambda car=car, u=under, t=length: simulate(car, u, duration=t, dt=dt)
                )
                remarks += [f"{name}: {text}" for text in said]
            tables = [metrics_table(responses), comfort_table(responses)]
        screen.points(remarks, style="yellow")
        for table in tables:
            screen.table(table)
        title = f"{vehicle} on {road} at {speed:g} m/s"
        timing = next(iter(responses.values())).axle_timing
        if timing.kind != "one axle":
            screen.say(f"Axles: {timing}.")
        with screen.stage("Pictures and tables"):
            _write(folder, title, laws, responses, tables, remarks)
        names = written(folder)
    screen.files(out, names)
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


def _compared(rows: Mapping[str, tuple[str, list[float]]]) -> tuple[tuple[Cell, ...], ...]:
    """Rows of name, unit, a value for each law, and the change from the first to the last in percent."""
    return tuple(
        (name, unit, *values, *([100 * (values[-1] / values[0] - 1) if values[0] else None] if len(values) > 1 else []))
        for name, (unit, values) in rows.items()
    )


def _columns(first: str, responses: Mapping[str, Response]) -> tuple[Column, ...]:
    change = (Column("change", "%", "+.1f"),) if len(responses) > 1 else ()
    return (Column(first), Column("unit"), *[Column(name) for name in responses], *change)


def _unit(unit: str) -> str:
    return unit.replace("^2", "²") or "–"


def metrics_table(responses: Mapping[str, Response]) -> Table:
    """The ride metrics of each law, and the change."""
    units = next(iter(responses.values())).metric_units()
    found = [response.metrics() for response in responses.values()]
    rows = {name: (_unit(unit), [float(metrics[name]) for metrics in found]) for name, unit in units.items()}
    return Table("Ride metrics", _columns("metric", responses), _compared(rows))


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
    title: str,
    laws: Mapping[str, AbstractDamper],
    responses: Mapping[str, Response],
    tables: list[Table],
    remarks: list[str],
) -> None:
    report = Report(title)
    timing = next(iter(responses.values())).axle_timing
    if timing.kind != "one axle":
        report.text(f"Axles: {timing}.")
    report.points(remarks)
    for name, law in laws.items():
        report.text(f"{name}: {law!r}")
        export.to_json(law, folder / f"{name}.json")
    for file, table in zip(("metrics", "comfort"), tables, strict=True):
        (folder / f"{file}.csv").write_text(table.to_csv(), encoding="utf-8")
        report.table(table)
    report.picture(plots.ride(responses, weighting="Wk"), title, folder / "ride.png")
    for damper in dampers_of(next(iter(responses.values()))):
        figure = plots.damper_use(responses, damper=damper)
        report.picture(figure, f"What the ride makes the {damper.replace('_', ' ')} do", folder / f"{damper}.png")
    for name, response in responses.items():
        response.to_xarray().to_dataframe().to_csv(folder / f"channels_{name}.csv")
    report.write(folder / "report.html")

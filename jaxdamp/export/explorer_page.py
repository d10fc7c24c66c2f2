"""A law as one page for the browser: sliders, loops, records and a quarter car, computed by printed functions."""

import importlib.metadata
import json
import math
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import jax
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._display import COMPRESSION, Display, display
from jaxdamp._field_types import check_module
from jaxdamp._tables import Contents
from jaxdamp._words import class_words, first_upper, in_words, metric_words
from jaxdamp._writing import write_whole
from jaxdamp.bench import BenchRun
from jaxdamp.codegen import Atom, JavaScript, PrintedFunction, Program, lower, symbols
from jaxdamp.dampers import AbstractDamper, law_name
from jaxdamp.export._explorer_record import of_record, packed
from jaxdamp.export._law_program import LawNumber, LawProgram
from jaxdamp.export._ride_program import RideProgram
from jaxdamp.export.module_file import to_json
from jaxdamp.metrics import Metric
from jaxdamp.parameters import weight
from jaxdamp.roads import AbstractRoad, cosine_bump, iso8608
from jaxdamp.simulation import Ride, axle_timing
from jaxdamp.vehicles import UNKNOWN_SPEED, AbstractVehicle, Point, drawing_script, matrix, presets


_LANGUAGE = JavaScript()


def law_functions(law: LawProgram) -> dict[str, str]:
    """`initial(p, x, state)`, `force(p, x, v, state)`, `advance(p, ..., dt, state)`, `margins(p, y)`, by names."""
    return {
        "initial": _filled("initial(p, x, state)", law.initial_state, "state"),
        "force": _returned("force(p, x, v, state)", law.force),
        "advance": _filled("advance(p, x0, v0, x1, v1, dt, state)", law.advance, "state"),
        "margins": _filled("margins(p, y)", law.margins, "y"),
    }


def vehicle_functions(vehicle: RideProgram) -> dict[str, str]:
    """The functions of `RideProgram`, by names; results go into the arrays m, c, g and y."""
    return {
        "prepare": _filled("prepare(p, q, dt, m)", vehicle.prepare, "m"),
        "start": _filled("start(m, h, r, c)", vehicle.start, "c"),
        "begin": _filled("begin(m, c, h, r, g)", vehicle.begin, "g"),
        "step": _filled("step(m, c, h0, r0, h1, r1)", vehicle.step, "c"),
        "observe": _filled("observe(m, c, g, h, r)", vehicle.observe, "g"),
        "end": _filled("end(m, g, y)", vehicle.end, "y"),
        "moving": _filled("moving(m, c, h, r, y)", vehicle.moving, "y"),
        "others": _filled("others(p, q, y)", vehicle.margins, "y"),
    }


def bump_function() -> str:
    """`bump(t, height, length, speed)`: the height of a cosine bump that begins at 1 s."""

    def bump(t: Array, height: Array, length: Array, speed: Array) -> Array:
        return cosine_bump(height, start=1.0, length=length, speed=speed).height(t[None])[0, 0]

    names = ("t", "height", "length", "speed")
    return _returned(f"bump({', '.join(names)})", lower(bump, *map(symbols, names)))


def closed(name: str, functions: dict[str, str]) -> str:
    """One object of functions that see each other and nothing else."""
    return f"const {name} = (() => {{\n{''.join(functions.values())}return {{ {', '.join(functions)} }};\n}})();\n"


def _returned(head: str, program: Program) -> str:
    return _function(head, program, (), program.results.item())


def _filled(head: str, program: Program, target: str) -> str:
    values = [atom for leaf in jax.tree.leaves(program.results) for atom in leaf.ravel()]
    return _function(head, program, [(f"{target}[{k}]", value) for k, value in enumerate(values)], None)


def _function(head: str, program: Program, outputs: Sequence[tuple[str, Atom]], returned: Atom | None) -> str:
    return _LANGUAGE.function(PrintedFunction(f"function {head}", (), program.statements, outputs, returned))


_PARTS = Path(__file__).parent / "explorer"
_SCRIPTS = ("model.js", "chart.js", "records.js", "controls.js", "page.js")
_STEP = 1e-3  # s, as of a Ride
_SEEDS = 3  # realisations of a random road, to be chosen from in the page
_FASTEST = 60.0  # m/s, up to which a random road does not repeat within the run
_FACTOR = 3.0  # of the ranges of sliders, as in a tuning
_MAIN = re.compile(
    r"weighted_rms_|rms_.*acceleration|vibration_dose_value|working_space_rms|working_space_peak_to_peak|"
    r"rms_dynamic_tyre_load|dynamic_load_coefficient|peak_damper_velocity|.*dissipated_power"
)


def to_explorer(
    law: AbstractDamper,
    path: str | os.PathLike[str],
    *,
    records: Iterable[BenchRun] = (),
    vehicle: AbstractVehicle | None = None,
    road: AbstractRoad | str = "C",
    speed: float = 20.0,
    baseline: AbstractDamper | None = None,
    duration: float | None = None,
    seed: int = 0,
) -> Path:
    """Write a law as one HTML file that shows what its parameters do, in any browser, without server or network.

    Sliders move the parameters of the law and of the vehicle. At once the page shows force over velocity and over
    stroke, in sines or under the motion of a record with RMSE and fit; a ride on a road, with the car in motion, the
    metrics of `Ride`, spectra and channels beside the baseline. A CSV dropped onto the page is another record. "Save
    law as JSON" gives a file that `from_json` reads. Law, step of the vehicle and metrics are functions of this
    library, printed as JavaScript: the numbers are those of `respond` and `Ride` to rounding. Numbers are shown in SI,
    unless a command shows other units.

    Arguments:
        law: any law or composition.
        path: the file to write, NAME.html; an existing one is replaced, and never left incomplete.
        records: bench records to overlay, such as `bench.read(...)`. Of long ones the page takes every so many-th
            sample, and says so.
        vehicle: a vehicle that holds the law as a damper, or as several; `presets.quarter_car_000(law)` if left out.
            Axles follow each other at the speed of the road. What places the wheels, such as the wheelbase, is fixed.
        road: the class of ISO 8608 that the page begins with, "A" to "H"; or a road, which can be chosen beside them.
        speed: at which random roads are driven at first [m/s].
        baseline: what the law is compared with; the law itself, as it is here, if left out.
        duration: of the ride [s]; that of the road, or 10 s.
        seed: of the first of three realisations of random roads.

    Returns:
        The path of the file.

    Raises:
        ValueError: a folder that does not exist, a vehicle without the law, what a `Ride` refuses.
        NotImplementedError: an operation of the law that cannot be printed; the message names it.
    """
    check_module("law", law, (AbstractDamper,), "to_explorer(law, path)")
    file = Path(path).expanduser()
    if file.suffix != ".html":
        _checks.refuse("path", "be a file NAME.html", str(file))
    vehicle = presets.quarter_car_000(law) if vehicle is None else vehicle
    check_module("vehicle", vehicle, (AbstractVehicle,), "to_explorer(law, path, vehicle=QuarterCar(..., damper=law))")
    _checks.positive("speed", speed)
    profile = road if isinstance(road, AbstractRoad) else None
    duration = _lasting(profile) if duration is None else duration
    road_class = "C" if profile else str(road)
    profile = profile or iso8608(road_class, speed, duration, seed=seed)
    count = round(duration / _STEP) + 1
    program = LawProgram(law, member=".")
    car = RideProgram(program, vehicle, _STEP, count)
    ride = Ride(vehicle, profile, metrics=car.metrics[:1], duration=duration, dt=_STEP)
    functions = {"LAW": law_functions(program) | vehicle_functions(car)}
    about = _of_law(program, car, "as loaded")
    compared, substeps = about, ride.substeps
    if baseline is not None:
        check_module("baseline", baseline, (AbstractDamper,), "to_explorer(law, path, baseline=law)")
        other = LawProgram(baseline, member=".")
        other_car = RideProgram(other, car.with_law(other.law), _STEP, count)
        other_ride = Ride(other_car.vehicle, profile, metrics=car.metrics[:1], duration=duration, dt=_STEP)
        functions["BASELINE"] = law_functions(other) | vehicle_functions(other_car)
        compared, substeps = _of_law(other, other_car, "baseline"), max(substeps, other_ride.substeps)
    data = {
        "title": first_upper(law_name(law)),
        "file": file.stem,
        "law": about | {"document": json.loads(to_json(law)), "conditions": program.conditions},
        "baseline": compared,
        **_of_car(car),
        "dt": _STEP,
        "count": count,
        "substeps": substeps,
        "road": _of_roads(speed, duration, seed, road_class) | _of_profile(road, ride),
        "records": [of_record(run, (law, law if baseline is None else baseline)) for run in records],
    }
    programs = "".join(closed(name, texts) for name, texts in functions.items())
    programs += closed("ROAD", {"bump": bump_function()})
    programs += "const BASELINE = LAW;\n" if baseline is None else ""
    return write_whole(file, _assembled(data | {"shown": _shown(data)}, programs))


def _lasting(profile: AbstractRoad | None) -> float:
    """The whole steps that a road lasts [s]; 10 s where it does not end."""
    return math.floor(((profile and profile.duration) or 10.0) / _STEP * (1.0 + 1e-9)) * _STEP


def _of_profile(road: AbstractRoad | str, ride: Ride) -> Contents:
    """The heights of a road that was given."""
    if isinstance(road, str):
        return {}
    assert ride.heights is not None
    timing = axle_timing(ride.vehicle, road)
    driven = timing.kind in ("one axle", "delayed")
    speed = {"known": road.speed is not None, "speed": UNKNOWN_SPEED if road.speed is None else float(road.speed)}
    heights = [packed(column) for column in np.asarray(ride.heights).T]
    return {"profile": {"title": f"given road ({class_words(road)})", "heights": heights, "driven": driven, **speed}}


def _of_car(car: RideProgram) -> Contents:
    """The vehicle with its numbers, metrics and the channels that these need."""
    vehicle = car.vehicle
    channels = [
        {"name": name, "title": metric_words(name), "unit": vehicle.units[name], "meaning": display().text(meaning)}
        | {"signed": display().signed(meaning)}
        for name, meaning in ((name, vehicle.descriptions[name]) for name in car.needed)
    ]
    about = {
        "title": class_words(vehicle),
        "numbers": [_of_number(number) for number in car.numbers],
        "fixed": [in_words(number.path) for number in car.numbers if number.kind == "fixed"],
        "behind": [float(wheel.behind) for wheel in vehicle.frame().wheels],
        "conditions": car.conditions,
    }
    return {
        "vehicle": about,
        "drawing": car.drawing.parts | {"heights": [_row(point, vehicle) for point in car.drawing.heights]},
        "metrics": [_of_metric(metric, vehicle) for metric in car.metrics],
        "channels": channels,
    }


def _shown(data: Contents) -> Contents:
    """Units and sign in which the page shows its numbers, which are in SI: for each unit another one and the factor."""
    numbers = [*data["law"]["numbers"], *data["vehicle"]["numbers"], *data["metrics"], *data["channels"]]
    units, shown = sorted({number["unit"] for number in numbers} | {"N", "m", "m/s"}), display()
    others = {unit: [other.unit, other.factor] for unit in units if (other := shown.read(unit)).factor != 1.0}
    return {"units": others, "turned": shown.sign == COMPRESSION}


def _units_in_words(shown: Display) -> str:
    """Units and sign of the page, for its reader."""
    stroke = "Stroke and velocity are positive in rebound (extension), force is positive when it resists extension."
    if shown.sign == COMPRESSION:
        stroke = "Stroke, velocity and force are positive in compression; formulas count rebound positive."
    units = "SI units, mm and N/mm" if shown.units == "SI" else f"Units {shown.units}"
    return f"{units}; speed, bump and sines as written. {stroke}"


def _row(point: Point, vehicle: AbstractVehicle) -> list[float]:
    """The coefficients of a point, by the coordinates in their order."""
    return np.asarray(matrix([point], vehicle.layout.coordinates))[0].tolist()


def _assembled(data: Contents, programs: str) -> str:
    """The page of its parts."""
    text = {name: (_PARTS / name).read_text(encoding="utf-8") for name in ("page.html", "style.css", *_SCRIPTS)}
    parts = {
        "style": text["style.css"],
        "units": _units_in_words(display()),
        "version": importlib.metadata.version("jaxdamp"),
        "data": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "programs": programs,
        "scripts": "\n".join([drawing_script(), *(text[name] for name in _SCRIPTS)]),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], text["page.html"])


def _of_law(program: LawProgram, car: RideProgram, title: str) -> Contents:
    commands = [n.name for n in program.numbers if n.kind == "command"]
    return {
        "title": title,
        "states": program.states,
        "numbers": [_of_number(n) for n in program.numbers],
        "command": commands[0] if len(commands) == 1 else None,
        "sizes": car.sizes,
    }


def _of_number(number: LawNumber) -> Contents:
    """A parameter for the page: what it is, the allowed values, and the ranges of its sliders."""
    domain, values = number.domain, number.value.ravel()
    return {
        "path": number.path,
        "name": number.name,
        "unit": number.unit,
        "meaning": number.meaning,
        "domain": domain.name,
        "kind": number.kind,
        "scalar": number.value.ndim == 0,
        "shape": list(number.value.shape),
        "start": values.tolist(),
        "ranges": [_range(number, float(value), float(np.abs(values).max())) for value in values],
        "ordered": domain.ordered,
        "lower": _limit(domain.lower),
        "upper": _limit(domain.upper),
        "lowerOpen": not domain.ordered and not domain.contains(np.asarray(domain.lower)),
        "upperOpen": not domain.ordered and not domain.contains(np.asarray(domain.upper)),
    }


def _limit(value: float) -> float:
    """A limit that JSON can hold."""
    return float(np.clip(value, -np.finfo(float).max, np.finfo(float).max))


def _range(number: LawNumber, value: float, largest: float) -> tuple[float, float]:
    """The range of a slider: the domain if it has two ends, else from a third to three times a number of one sign."""
    domain = number.domain
    if np.isfinite(domain.upper - domain.lower):
        return domain.lower, domain.upper
    size = abs(value) or largest or 1.0
    one_sign = domain.lower >= 0.0 or domain.upper <= 0.0 or domain.ordered
    if one_sign and value and domain is not weight:
        return min(value / _FACTOR, value * _FACTOR), max(value / _FACTOR, value * _FACTOR)
    return max(value - 2.0 * size, domain.lower), min(value + 2.0 * size, domain.upper)


def _of_metric(metric: Metric, vehicle: AbstractVehicle) -> Contents:
    title = metric_words(metric.name) + (f", {metric.weighting}" if metric.weighting else "")
    unit, main = metric.unit(vehicle.units), bool(_MAIN.match(metric.name))
    turned = display().sign == COMPRESSION and display().signed(metric.name)
    entry = {"name": metric.name, "title": title, "unit": unit, "main": main}
    return entry | {"signed": metric.statistic.signed, "turned": turned}


def _of_roads(speed: float, duration: float, seed: int, road_class: str) -> Contents:
    """Amplitudes and phases of random roads of class A, of which those of all classes and speeds follow."""
    longest = max(speed, _FASTEST) * duration
    made = [iso8608("A", 1.0, seed=seed + k, length=max(1000.0, longest)) for k in range(_SEEDS)]
    lines = {
        "first": round(float(made[0].spatial_frequency[0]) * made[0].length),
        "length": made[0].length,
        "ramp": made[0].ramp,
        "seed": seed,
        "drawn": [{"amplitude": packed(road.amplitude), "phase": packed(road.phase)} for road in made],
    }
    return {"class": road_class, "speed": speed, "iso": lines, "profile": None}

"""Vehicles in motion over their road: a page for the browser."""

import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import Contents, typeset_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp._writing import write_whole
from jaxdamp.plots import _style
from jaxdamp.simulation import Response
from jaxdamp.vehicles import UNKNOWN_SPEED, Drawing, drawing_script


RATE = 100.0  # 1/s, of the samples in the page, between which it draws straight lines
LONGEST = 60.0  # s, of a run in the page
_PAGE = Path(__file__).with_name("animation.html")


@of_known_numbers
def animation(responses: Response | Mapping[str, Response], path: str | os.PathLike[str], *, title: str = "") -> Path:
    """Write a page in which a vehicle, or several side by side, moves over its road: `response.animate(path)`.

    Bodies, wheels and dampers with their forces, in slow motion if wanted, with a slider for the time; below them the
    acceleration of the body and the force of the first damper. Heights are magnified by a factor that the page states;
    of a long run it shows the first minute, and says so. One file without server or network.

    Arguments:
        responses: of `simulate`; several by name, such as `{"before": before, "after": after}`.
        path: the file to write, NAME.html; an existing one is replaced, and never left incomplete.
        title: of the page; made from the vehicle if left out.

    Returns:
        The path of the file.

    Raises:
        ValueError: no HTML file, a folder that does not exist, no response, runs at other instants.
    """
    file = Path(path).expanduser()
    if file.suffix != ".html":
        _checks.refuse("path", "be a file NAME.html", str(file))
    runs = _style.by_name("responses", responses, Response, "the response of a vehicle, or several", _style.SIMULATE)
    first = next(iter(runs.values()))
    for name, run in runs.items():
        if run.time.shape != first.time.shape or not np.allclose(run.time, first.time):
            times = f"{run.time.size} to {float(run.time[-1]):g} s"
            _checks.refuse(f"responses[{name!r}]", "have the instants of the first one", times)
    length, cut = float(first.time[-1] - first.time[0]), ""
    if length > LONGEST:
        begin, cut = float(first.time[0]), f" The first {LONGEST:g} of {length:g} s."
        runs = {name: run.between(begin, begin + LONGEST) for name, run in runs.items()}
    every = max(round(1.0 / (RATE * first.dt)), 1)
    designs: list[Contents] = [{"name": name} | _design(run, every) for name, run in runs.items()]
    data = {
        "title": title or f"{_style.first_upper(_style.class_words(first.vehicle))} on its road",
        "step": every * first.dt,
        "cut": cut,
        "designs": designs,
    }
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    page = _PAGE.read_text(encoding="utf-8").replace("{{script}}", drawing_script())
    return write_whole(file, page.replace("{{data}}", text))


def _design(run: Response, every: int) -> Contents:
    """One vehicle: where its points are, their heights over time, forces and signals."""
    frame = run.vehicle.frame()
    drawing = Drawing(frame, list(run.units))
    coordinates = dict(zip(frame.coordinates, np.asarray(run.motion).T, strict=False))
    parts = drawing.parts
    heights = [_tenths(np.asarray(point.of(coordinates)), every) for point in drawing.heights]
    forces = [np.round(np.asarray(run[force])[::every]).tolist() for force in drawing.forces]
    roads = [_tenths(column, every) for column in np.asarray(run.road).T]
    return (
        parts
        | {
            "points": [point | {"height": z} for point, z in zip(parts["points"], heights, strict=True)],
            "dampers": [
                damper | {"name": _style.in_words(damper["name"]), "force": force}
                for damper, force in zip(parts["dampers"], forces, strict=True)
            ],
            "wheels": [wheel | {"road": z} for wheel, z in zip(parts["wheels"], roads, strict=True)],
        }
        | _signals(run, every)
    )


def _tenths(heights: np.ndarray, every: int) -> list[int]:
    """Heights [m] in tenths of a millimetre."""
    return np.round(1e4 * heights[::every]).astype(int).tolist()


def _signals(run: Response, every: int) -> Contents:
    """How fast the vehicle is, and the acceleration of its body."""
    channel = next(name for name in run.units if name.endswith("_acceleration"))
    return {
        "speed": _speed(run) or UNKNOWN_SPEED,
        "speedKnown": _speed(run) is not None or run.axle_timing.kind != "one axle",
        "driven": run.axle_timing.kind in ("delayed", "one axle"),
        "signal": np.round(np.asarray(run[channel])[::every], 4).tolist(),
        "channel": f"{_style.metric_words(channel)} [{typeset_unit(run.units[channel])}]",
        "rms": _style.quantity(float(np.std(np.asarray(run[channel]))), run.units[channel]),
    }


def _speed(run: Response) -> float | None:
    """Of the vehicle [m/s], where the response knows it."""
    speed = run.axle_timing.speed
    return None if speed is None or np.ndim(speed) else float(speed)

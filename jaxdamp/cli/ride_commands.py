"""Commands that drive vehicles: ride, tune, sweep, and report on the whole chain."""

from pathlib import Path
from typing import Annotated

import typer

from jaxdamp.cli.application import command
from jaxdamp.cli.option_types import (
    Baseline,
    BaselineVehicle,
    Duration,
    Files,
    Limit,
    Replace,
    Road,
    Seed,
    Speed,
    Start,
    Step,
    Vehicle,
)
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions


@command("ride")
def ride(
    law: Annotated[Path, typer.Argument(help="A law as JSON, such as best_law.json of jaxdamp fit.")],
    vehicle: Annotated[
        str, typer.Option(help='A published vehicle, see "jaxdamp vehicles"; or a file of one, *.json or *.toml.')
    ] = "quarter_car_000",
    road: Annotated[
        str, typer.Option(help="iso:A to iso:H, bump:HEIGHT:LENGTH [m], or a file: *.crg, or text of position, height.")
    ] = "iso:C",
    speed: Annotated[float, typer.Option(help="Of the vehicle [m/s].")] = 20.0,
    baseline: Baseline = None,
    duration: Annotated[float | None, typer.Option(help="Of the ride [s]; the road's own, or 10.")] = None,
    dt: Annotated[
        float, typer.Option(help="Step [s]; 1 ms is right for cars, a coarse one is warned of or refused.")
    ] = 1e-3,
    seed: Annotated[int, typer.Option(help="Of a random road.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-ride"),
    replace: Replace = False,
) -> None:
    """Ride on a law: metrics, comfort by ISO 2631-1 and pictures, beside a baseline.

    The law is at every damper of the vehicle.
    """
    from jaxdamp.cli import console, riding

    options = {"vehicle": vehicle, "road": road, "speed": speed, "duration": duration, "dt": dt, "seed": seed}
    riding.run_ride(console.Screen(), law, baseline=baseline, out=out, replace=replace, **options)


@command("tune")
def tune_command(
    vehicle: Vehicle,
    road: Road,
    start: Start = None,
    minimise: Annotated[str, typer.Option(help="comfort, travel, grip, or the name of a ride metric.")] = "comfort",
    limit: Limit = [],  # noqa: B006
    over: Annotated[
        list[str], typer.Option(help="Parameters to tune, by path or pattern; what a workshop can change if left out.")
    ] = [],  # noqa: B006
    freeze: Annotated[list[str], typer.Option(help="Parameters among these to hold.")] = [],  # noqa: B006
    bound: Annotated[
        list[str], typer.Option(help="Bounds: rate=1000:4000; a third to three times the start if left out.")
    ] = [],  # noqa: B006
    tie: Annotated[
        list[str], typer.Option(help="Parameters with the value of others: front.damper.*=rear.damper.*")
    ] = [],  # noqa: B006
    roads: Annotated[
        int, typer.Option(help="Realisations of an iso road, driven side by side; their mean counts.")
    ] = 1,
    starts: Annotated[int, typer.Option(help="Searches side by side, from inside the bounds.")] = 1,
    max_steps: Annotated[int, typer.Option(help="Of the search.")] = 100,
    baseline: BaselineVehicle = None,
    speed: Speed = 20.0,
    duration: Duration = None,
    dt: Step = 1e-3,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-tune"),
    replace: Replace = False,
) -> None:
    """Tune the dampers of a vehicle for a ride metric within limits.

    Writes the law, the vehicle, tables, pictures and a page. Ends with exit code 1 if a limit is not met.
    """
    from jaxdamp.cli import console, tuning

    result = tuning.run_tune(
        console.Screen(),
        tuning.RoadOptions(vehicle, road, start, speed, duration, dt, seed),
        tuning.TuneOptions(
            minimise, tuple(limit), tuple(over), tuple(freeze), tuple(bound), tuple(tie), roads, starts, max_steps
        ),
        baseline=baseline,
        out=out,
        replace=replace,
    )
    if not tuning.meets_limits(result):
        raise typer.Exit(1)


@command("report")
def report(
    files: Files,
    *,
    vehicle: Annotated[
        str, typer.Option(help='A published vehicle, see "jaxdamp vehicles"; or a file of one, *.json or *.toml.')
    ] = "quarter_car_000",
    road: Annotated[
        str, typer.Option(help="iso:A to iso:H, bump:HEIGHT:LENGTH [m], or a file of position, height.")
    ] = "iso:C",
    law: Annotated[
        list[str], typer.Option(help='Names of laws to fit, see "jaxdamp laws": "linear,besinger"; or "all".')
    ] = ["all"],  # noqa: B006
    minimise: Annotated[str, typer.Option(help="comfort, travel, grip, or the name of a ride metric.")] = "comfort",
    limit: Limit = [],  # noqa: B006
    over: Annotated[
        list[str], typer.Option(help="Parameters to tune, by path or pattern; what a workshop can change if left out.")
    ] = [],  # noqa: B006
    reading: ReadOptions,
    processing: ProcessOptions,
    speed: Speed = 20.0,
    duration: Duration = None,
    dt: Step = 1e-3,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-report"),
    replace: Replace = False,
) -> None:
    """The whole chain on one page: bench records, fitted laws, rides on the best one, and its tuning.

    Writes the laws, the tuned vehicle, tables, pictures and the page. Ends with exit code 1 if a limit is not met.
    """
    from jaxdamp.cli import chaining, console, tuning

    on = tuning.RoadOptions(vehicle, road, None, speed, duration, dt, seed)
    options = tuning.TuneOptions(minimise, tuple(limit), tuple(over))
    screen, where = console.Screen(), {"out": out, "replace": replace}
    result = chaining.run_report(screen, files, reading, processing, on, options, laws=law, **where)
    if not tuning.meets_limits(result):
        raise typer.Exit(1)


@command("sweep")
def sweep_command(
    vehicle: Vehicle,
    road: Road,
    over: Annotated[list[str], typer.Option(help="Axes: damper.rate=1000:8000:15 or sprung_mass=1000;1200.")],
    start: Start = None,
    metric: Annotated[
        str, typer.Option(help="comfort, travel, grip, or names of ride metrics.")
    ] = "comfort,travel,grip",
    limit: Limit = [],  # noqa: B006
    baseline: BaselineVehicle = None,
    speed: Speed = 20.0,
    duration: Duration = None,
    dt: Step = 1e-3,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-sweep"),
    replace: Replace = False,
) -> None:
    """Compute ride metrics over a grid of parameters: curves, maps and a table."""
    from jaxdamp.cli import console, tuning

    on = tuning.RoadOptions(vehicle, road, start, speed, duration, dt, seed)
    marks = {"limit": limit, "baseline": baseline}
    tuning.run_sweep(console.Screen(), on, over=over, metrics=metric, **marks, out=out, replace=replace)

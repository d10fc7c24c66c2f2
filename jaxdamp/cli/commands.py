"""The commands and their options."""

from pathlib import Path
from typing import Annotated

import typer

from jaxdamp.cli.option_types import (
    Baseline,
    Commands,
    CrossValidate,
    Debug,
    Duration,
    Files,
    GroupBy,
    Page,
    Replace,
    Road,
    Seed,
    Speed,
    Start,
    Step,
    Vehicle,
)
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions, spread
from jaxdamp.cli.vehicle_fit_options import RideReadOptions, VehicleFitOptions


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="""From a dyno file to a damper law, a ride and a better damper.

Units: SI everywhere (m, m/s, N, s, N s/m). Files may use other units, but must name them: in their headers
("stroke [mm]", "F_N"), or with --units.

Signs: stroke and velocity are positive in rebound (extension), force is positive when it resists extension. A file
whose bench counts compression positive is read with --sign compression-positive. Nothing is guessed silently: what was
decided is printed.""",
)


def _say_version(asked: bool) -> bool:
    if asked:
        import jaxdamp

        typer.echo(f"jaxdamp {jaxdamp.__version__}")
        raise typer.Exit
    return asked


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and stop.", callback=_say_version, is_eager=True)
    ] = False,
) -> None:
    """Options before a command. The help of the application stands above."""


@app.command()
@spread
def fit(
    files: Files,
    *,
    law: Annotated[
        list[str],
        typer.Option(help='Names of laws, see "jaxdamp laws": "linear,besinger"; or "all". May be repeated.'),
    ] = ["all"],  # noqa: B006 (typer copies it)
    held_out: Annotated[
        list[str], typer.Option(help='Records to score on, not to fit: a name or a pattern, such as "30mm_*".')
    ] = [],  # noqa: B006
    reading: ReadOptions,
    processing: ProcessOptions,
    group_by: GroupBy = None,
    weighting: Annotated[
        str, typer.Option(help='"samples": every sample counts the same; "runs": every record, by its RMS force.')
    ] = "samples",
    rig: Annotated[
        list[str],
        typer.Option(
            help="What the test machine adds to the force, fitted with the law: offset, gas, gas_stiffness, friction, "
            'mass, delay, lag, stroke_offset, heat; "gas,delay" names two, "none" nothing.'
        ),
    ] = ["offset"],  # noqa: B006
    cross_validate: CrossValidate = False,
    baseline: Baseline = None,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-fit"),
    report: Page = None,
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Fit damper laws to bench records, and say how good they are.

    Writes a report, pictures, tables, and each law as JSON, which jaxdamp.export.from_json reads; with --group-by all
    of this in a folder for each value of the setting.
    """
    from jaxdamp.cli import console, fitting

    with console.plain_errors(debug):
        console.prepare()
        fitting.run_fit(
            console.Screen(),
            files,
            reading,
            laws=law,
            held_out=held_out,
            weighting=weighting,
            rig=rig,
            processing=processing,
            group_by=group_by,
            cross_validate=cross_validate,
            baseline=baseline,
            out=out,
            report=report,
            replace=replace,
        )


@app.command(name="fit-vehicle")
@spread
def fit_vehicle(
    vehicle: Vehicle,
    files: Annotated[list[Path], typer.Argument(help="Files with records of its motion, patterns, or folders.")],
    *,
    start: Start = None,
    reading: RideReadOptions,
    options: VehicleFitOptions,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-fit-vehicle"),
    report: Page = None,
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Fit masses, rates, friction and dampers of a vehicle to records of its motion on a rig or a road.

    VEHICLE is the start. Columns are named as its channels, or by --columns; heights and accelerations are positive up,
    travels in extension. Writes the vehicle and its laws as JSON, tables, pictures and a page.
    """
    from jaxdamp.cli import console, vehicle_fitting

    with console.plain_errors(debug):
        console.prepare()
        vehicle_fitting.run_fit_vehicle(
            console.Screen(), vehicle, files, reading, options, start=start, out=out, report=report, replace=replace
        )


@app.command()
@spread
def bench(
    files: Files,
    *,
    reading: ReadOptions,
    processing: ProcessOptions,
    group_by: GroupBy = None,
    velocities: Annotated[
        str | None, typer.Option(help="At which forces are stated [m/s]: 0.052,0.131; usual ones if left out.")
    ] = None,
    limits: Annotated[
        Path | None, typer.Option(help="CSV of limits: quantity, minimum, maximum, velocity, setting, record.")
    ] = None,
    baseline: Annotated[
        Path | None, typer.Option(help="To compare with: a law as JSON, or other records, read the same way.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-bench"),
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Look over bench records and evaluate them: what is odd, forces, rates, gas force, friction, limits.

    Writes a page, pictures, and tables. Records with an error are named and not evaluated. Ends with exit code 1 if a
    limit is not kept.
    """
    from jaxdamp.cli import benching, console

    with console.plain_errors(debug):
        console.prepare()
        passed = benching.run_bench(
            console.Screen(),
            files,
            reading,
            processing=processing,
            velocities=velocities,
            group_by=group_by,
            limits=limits,
            baseline=baseline,
            out=out,
            replace=replace,
        )
    if not passed:
        raise typer.Exit(1)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-demo"),
    seed: Annotated[int, typer.Option(help="Of the noise of the virtual bench and of the roads.")] = 0,
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Run the whole chain on a damper whose truth is known. Needs no input.

    A virtual bench records a known damper; laws are fitted to the files and compared on records that were held out; a
    quarter car rides on each law; the damper is tuned for comfort; all is written to a folder.
    """
    from jaxdamp.cli import console
    from jaxdamp.cli import demo as demonstration

    with console.plain_errors(debug):
        console.prepare()
        demonstration.run_demo(console.Screen(), demonstration.Scenario(seed=seed), out=out, replace=replace)


@app.command()
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
    debug: Debug = False,
) -> None:
    """Ride on a law: metrics, comfort by ISO 2631-1 and pictures, beside a baseline.

    The law is at every damper of the vehicle.
    """
    from jaxdamp.cli import console, riding

    with console.plain_errors(debug):
        console.prepare()
        options = {"vehicle": vehicle, "road": road, "speed": speed, "duration": duration, "dt": dt, "seed": seed}
        riding.run_ride(console.Screen(), law, baseline=baseline, out=out, replace=replace, **options)


@app.command(name="tune")
def tune_command(
    vehicle: Vehicle,
    road: Road,
    start: Start = None,
    minimise: Annotated[str, typer.Option(help="comfort, travel, grip, or the name of a ride metric.")] = "comfort",
    limit: Annotated[list[str], typer.Option(help="Hard limits [SI]: travel=0.1,grip=900, or NAME=LOWER:UPPER.")] = [],  # noqa: B006
    over: Annotated[
        list[str], typer.Option(help='Parameters to tune, by path or pattern, such as "damper.*_rate".')
    ] = ["*damper*"],  # noqa: B006
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
    baseline: Annotated[
        Path | None, typer.Option(help="To compare with: another law, or another tuning's vehicle.json, as JSON.")
    ] = None,
    speed: Speed = 20.0,
    duration: Duration = None,
    dt: Step = 1e-3,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-tune"),
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Tune the dampers of a vehicle for a ride metric within limits.

    Writes the law, the vehicle, tables, pictures and a page. Ends with exit code 1 if a limit is not met.
    """
    from jaxdamp.cli import console, tuning

    with console.plain_errors(debug):
        console.prepare()
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


@app.command(name="sweep")
def sweep_command(
    vehicle: Vehicle,
    road: Road,
    over: Annotated[list[str], typer.Option(help="Axes: damper.rate=1000:8000:15 or sprung_mass=1000;1200.")],
    start: Start = None,
    metric: Annotated[
        str, typer.Option(help="comfort, travel, grip, or names of ride metrics.")
    ] = "comfort,travel,grip",
    speed: Speed = 20.0,
    duration: Duration = None,
    dt: Step = 1e-3,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-sweep"),
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Compute ride metrics over a grid of parameters: curves, maps and a table."""
    from jaxdamp.cli import console, tuning

    with console.plain_errors(debug):
        console.prepare()
        on = tuning.RoadOptions(vehicle, road, start, speed, duration, dt, seed)
        tuning.run_sweep(console.Screen(), on, over=over, metrics=metric, out=out, replace=replace)


@app.command()
def export(
    law: Annotated[Path, typer.Argument(help="A law as JSON, such as best_law.json of jaxdamp fit.")],
    to: Annotated[str, typer.Option(help="adams, assetto-corsa, c, carsim, csv, fmu or matlab.")],
    out: Annotated[Path | None, typer.Option(help="File to write; the name of the law with another ending.")] = None,
    velocities: Annotated[
        str | None, typer.Option(help="Of a table, FROM:TO:POINTS [m/s]; those the law was fitted to, or -1:1:41.")
    ] = None,
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Write a law as C, as FMU or as the table of a simulator."""
    from jaxdamp.cli import console, exporting

    with console.plain_errors(debug):
        console.prepare()
        exporting.run_export(console.Screen(), law, to, out=out, velocities=velocities, replace=replace)


@app.command()
@spread
def explore(
    law: Annotated[Path, typer.Argument(help="A law as JSON, such as best_law.json of jaxdamp fit.")],
    files: Annotated[
        list[Path] | None, typer.Argument(help="Files with records to overlay, patterns, or folders.")
    ] = None,
    *,
    reading: ReadOptions,
    processing: ProcessOptions,
    vehicle: Annotated[
        str, typer.Option(help='A quarter car, see "jaxdamp vehicles"; or a file of one, *.json or *.toml.')
    ] = "quarter_car_000",
    road: Annotated[
        str, typer.Option(help="iso:A to iso:H, bump:HEIGHT:LENGTH [m], or a file: *.crg, or text of position, height.")
    ] = "iso:C",
    speed: Speed = 20.0,
    baseline: Annotated[Path | None, typer.Option(help="Another law to compare with, as JSON.")] = None,
    duration: Duration = None,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="File to write; the name of the law with .html.")] = None,
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Write a law as one page for the browser: sliders, loops, records and a ride, live and without a network."""
    from jaxdamp.cli import console, exploring

    with console.plain_errors(debug):
        console.prepare()
        exploring.run_explore(
            console.Screen(),
            law,
            files or [],
            reading,
            processing,
            exploring.RideOptions(vehicle, road, speed, duration, seed, baseline),
            out=out,
            replace=replace,
        )


@app.command(name="vehicles")
def list_vehicles() -> None:
    """List the vehicles that a law can be put into."""
    from jaxdamp.cli.console import Screen
    from jaxdamp.cli.vehicle_words import vehicles_table

    Screen().table(vehicles_table())


@app.command()
def laws() -> None:
    """List the laws that can be fitted by name."""
    from jaxdamp.cli.console import Screen
    from jaxdamp.identify import laws_table

    Screen().table(laws_table())

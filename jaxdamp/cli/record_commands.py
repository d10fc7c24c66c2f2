"""Commands on measured records, and the demonstration."""

from pathlib import Path
from typing import Annotated

import typer

from jaxdamp.cli.application import command
from jaxdamp.cli.option_types import (
    Baseline,
    CrossValidate,
    Files,
    GroupBy,
    Page,
    Replace,
    Start,
    Vehicle,
)
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions
from jaxdamp.cli.vehicle_fit_options import RideReadOptions, VehicleFitOptions


@command("fit")
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
) -> None:
    """Fit damper laws to bench records, and say how good they are.

    Writes a report, pictures, tables, and each law as JSON, which jaxdamp.export.from_json reads; with --group-by all
    of this in a folder for each value of the setting.
    """
    from jaxdamp.cli import console, fitting

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


@command("fit-vehicle")
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
) -> None:
    """Fit masses, rates, friction and dampers of a vehicle to records of its motion on a rig or a road.

    VEHICLE is the start. Columns are named as its channels, or by --columns; heights and accelerations are positive up,
    travels in extension. Writes the vehicle and its laws as JSON, tables, pictures and a page.
    """
    from jaxdamp.cli import console, vehicle_fitting

    vehicle_fitting.run_fit_vehicle(
        console.Screen(), vehicle, files, reading, options, start=start, out=out, report=report, replace=replace
    )


@command("bench")
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
) -> None:
    """Look over bench records and evaluate them: what is odd, forces, rates, gas force, friction, limits.

    Writes a page, pictures, and tables. Records with an error are named and not evaluated. Ends with exit code 1 if a
    limit is not kept.
    """
    from jaxdamp.cli import benching, console

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


@command("demo")
def demo(
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-demo"),
    seed: Annotated[int, typer.Option(help="Of the noise of the virtual bench and of the roads.")] = 0,
    replace: Replace = False,
) -> None:
    """Run the whole chain on a damper whose truth is known. Needs no input.

    A virtual bench records a known damper; laws are fitted to the files and compared on records that were held out; a
    quarter car rides on each law; the damper is tuned for comfort; all is written to a folder.
    """
    from jaxdamp.cli import console, demo as demonstration

    demonstration.run_demo(console.Screen(), demonstration.Scenario(seed=seed), out=out, replace=replace)

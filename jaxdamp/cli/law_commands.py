"""Commands on laws: export, explore, and lists."""

from pathlib import Path
from typing import Annotated

import typer

from jaxdamp.cli.application import app, command
from jaxdamp.cli.option_types import (
    Duration,
    Replace,
    Seed,
    Speed,
)
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions


@command("export")
def export(
    law: Annotated[
        Path, typer.Argument(help="A law as JSON, such as best_law.json of jaxdamp fit; or a vehicle, for c and fmu.")
    ],
    to: Annotated[str, typer.Option(help="adams, assetto-corsa, c, carsim, csv, fmu or matlab.")],
    out: Annotated[Path | None, typer.Option(help="File to write; the name of the law with another ending.")] = None,
    velocities: Annotated[
        str | None, typer.Option(help="Of a table, FROM:TO:POINTS [m/s]; those the law was fitted to, or -1:1:41.")
    ] = None,
    replace: Replace = False,
) -> None:
    """Write a law as C, as FMU or as the table of a simulator; or a whole vehicle as C or FMU."""
    from jaxdamp.cli import console, exporting

    exporting.run_export(console.Screen(), law, to, out=out, velocities=velocities, replace=replace)


@command("explore")
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
) -> None:
    """Write a law as one page for the browser: sliders, loops, records and a ride, live and without a network."""
    from jaxdamp.cli import console, exploring

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

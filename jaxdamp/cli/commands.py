"""The commands and their options."""

from pathlib import Path
from typing import Annotated

import typer


app = typer.Typer(
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

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Replace = Annotated[
    bool,
    typer.Option(
        "--replace", "--force", help="Write into --out although it is not empty: results of jaxdamp are replaced."
    ),
]


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
def fit(
    files: Annotated[
        list[Path],
        typer.Argument(help="Files with records (CSV, XLSX, MATLAB, TDMS, MDF4, Parquet), patterns, or folders."),
    ],
    law: Annotated[
        list[str],
        typer.Option(help='Names of laws, see "jaxdamp laws": "linear,besinger"; or "all". May be repeated.'),
    ] = ["all"],  # noqa: B006 (typer copies it)
    held_out: Annotated[
        list[str], typer.Option(help='Records to score on, not to fit: a name or a pattern, such as "30mm_*".')
    ] = [],  # noqa: B006
    sign: Annotated[
        str | None,
        typer.Option(help="Direction that the files count positive: rebound-positive or compression-positive."),
    ] = None,
    force_sign: Annotated[
        str | None,
        typer.Option(
            help='"same" if the files\' force is positive when it resists motion in their positive direction, '
            'otherwise "opposite".'
        ),
    ] = None,
    columns: Annotated[
        list[str],
        typer.Option(help="Headers or numbers (from 0) of columns: time=t_s,stroke=1,velocity=none."),
    ] = [],  # noqa: B006
    units: Annotated[list[str], typer.Option(help="Units that the headers do not give: stroke=mm,force=kN.")] = [],  # noqa: B006
    sampling_rate: Annotated[
        float | None, typer.Option(help="Samples per second [Hz], for files without a time column.")
    ] = None,
    delimiter: Annotated[str | None, typer.Option(help="Character between columns, if it is not found.")] = None,
    gains: Annotated[
        list[str], typer.Option(help="Gains of sensors, for columns in volts: force=500 N/V,stroke=10 mm/V - 2 mm.")
    ] = [],  # noqa: B006
    manifest: Annotated[
        Path | None,
        typer.Option(help="TOML file that says how to read the files; jaxdamp.toml in a folder is taken by itself."),
    ] = None,
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Leave out files that cannot be read.")] = False,
    weighting: Annotated[
        str, typer.Option(help='"samples": every sample counts the same; "runs": every record, by its RMS force.')
    ] = "samples",
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("jaxdamp-fit"),
    replace: Replace = False,
    debug: Debug = False,
) -> None:
    """Fit damper laws to bench records, and say how good they are.

    Writes a report, pictures, tables, and each law as JSON, which jaxdamp.export.from_json reads.
    """
    from jaxdamp.cli import console, fitting

    with console.plain_errors(debug):
        console.prepare()
        options = fitting.ReadOptions(
            sign,
            force_sign,
            tuple(columns),
            tuple(units),
            sampling_rate,
            delimiter,
            gains=tuple(gains),
            manifest=manifest,
            skip_bad=skip_bad,
        )
        fitting.run_fit(
            console.Screen(), files, options, laws=law, held_out=held_out, weighting=weighting, out=out, replace=replace
        )


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
    vehicle: Annotated[str, typer.Option(help='A published vehicle, see "jaxdamp vehicles".')] = "quarter_car_000",
    road: Annotated[
        str, typer.Option(help="iso:A to iso:H, bump:HEIGHT:LENGTH [m], or a file: *.crg, or text of position, height.")
    ] = "iso:C",
    speed: Annotated[float, typer.Option(help="Of the vehicle [m/s].")] = 20.0,
    baseline: Annotated[Path | None, typer.Option(help="Another law to compare with, as JSON.")] = None,
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


@app.command(name="vehicles")
def list_vehicles() -> None:
    """List the vehicles that a law can be put into."""
    from jaxdamp.cli.console import Screen
    from jaxdamp.cli.riding import vehicles_table

    Screen().table(vehicles_table())


@app.command()
def laws() -> None:
    """List the laws that can be fitted by name."""
    from jaxdamp.cli.console import Screen
    from jaxdamp.identify import laws_table

    Screen().table(laws_table())

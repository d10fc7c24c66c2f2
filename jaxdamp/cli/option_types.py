"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer


Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Replace = Annotated[
    bool,
    typer.Option(
        "--replace", "--force", help="Write into --out although it is not empty: results of jaxdamp are replaced."
    ),
]


Files = Annotated[
    list[Path],
    typer.Argument(help="Files with records (CSV, XLSX, MATLAB, TDMS, MDF4, Parquet), patterns, or folders."),
]
Sign = Annotated[
    str | None, typer.Option(help="Direction that the files count positive: rebound-positive or compression-positive.")
]
ForceSign = Annotated[
    str | None,
    typer.Option(
        help='"same" if the files\' force is positive when it resists motion in their positive direction, '
        'otherwise "opposite".'
    ),
]
Columns = Annotated[
    list[str], typer.Option(help="Headers or numbers (from 0) of columns: time=t_s,stroke=1,velocity=none.")
]
Units = Annotated[list[str], typer.Option(help="Units that the headers do not give: stroke=mm,force=kN.")]
SamplingRate = Annotated[float | None, typer.Option(help="Samples per second [Hz], for files without a time column.")]
Delimiter = Annotated[str | None, typer.Option(help="Character between columns, if it is not found.")]
Gains = Annotated[
    list[str], typer.Option(help="Gains of sensors, for columns in volts: force=500 N/V,stroke=10 mm/V - 2 mm.")
]
Manifest = Annotated[
    Path | None,
    typer.Option(help="TOML file that says how to read the files; jaxdamp.toml in a folder is taken by itself."),
]
SkipBad = Annotated[bool, typer.Option("--skip-bad", help="Leave out files that cannot be read.")]
Command = Annotated[
    list[str], typer.Option(help="What was set on the damper, by name or pattern: '*_0.5A=0.5,*_1A=1'.")
]
Cycles = Annotated[str | None, typer.Option(help="Full cycles to keep: 3 or last:3, or skip:2.")]
Between = Annotated[str | None, typer.Option(help="Part of the records to keep, start:end [s].")]
Filter = Annotated[
    float | None, typer.Option("--filter", help="Zero-phase low-pass of stroke, velocity and force [Hz].")
]
KeepRest = Annotated[
    bool, typer.Option("--keep-rest", help="Keep the rest before and after the motion, which is cut off otherwise.")
]


Vehicle = Annotated[
    str, typer.Argument(help='A published vehicle, see "jaxdamp vehicles"; or a file of one, *.json or *.toml.')
]
Road = Annotated[
    str,
    typer.Argument(help="iso:A to iso:H, white:A to white:H, bump:HEIGHT:LENGTH [m], or a file of position, height."),
]
Start = Annotated[Path | None, typer.Option(help="A law as JSON for all dampers, instead of the vehicle's own.")]
Speed = Annotated[float, typer.Option(help="Of the vehicle [m/s].")]
Duration = Annotated[float | None, typer.Option(help="Of each ride [s]; the road's own, or 10.")]
Step = Annotated[float, typer.Option(help="Step [s].")]
Seed = Annotated[int, typer.Option(help="Of random roads.")]

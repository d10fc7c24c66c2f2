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


CrossValidate = Annotated[
    bool, typer.Option("--cross-validate", help="Predict each record by the best law fitted to the others.")
]
Page = Annotated[Path | None, typer.Option("--report", help="Write the page to this file too: fit.html.")]


Files = Annotated[
    list[Path],
    typer.Argument(help="Files with records (CSV, XLSX, MATLAB, TDMS, MDF4, Parquet), patterns, or folders."),
]
GroupBy = Annotated[
    str | None,
    typer.Option(help='Setting of the manifest to divide the records by, or "command".'),
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

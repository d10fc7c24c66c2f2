"""Arguments and options that several commands share."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup


_typed: list[str] = []  # the command that is running, as it was typed
_words: dict[str, str] = {}  # of its arguments and options: what they are called there, by their name in Python


ORDER = (
    "demo",
    "bench",
    "fit",
    "fit-vehicle",
    "ride",
    "tune",
    "sweep",
    "report",
    "explore",
    "export",
    "laws",
    "vehicles",
)


class Commands(TyperGroup):
    """All commands, along the chain from records to a damper; keeps the words typed, for the last lines of a page."""

    def list_commands(self, ctx: Any) -> list[str]:
        """The names in the order of the help."""
        return [name for name in ORDER if name in self.commands]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words after the name of the program."""
        _typed[:] = [shlex.join(["jaxdamp", *args])]
        ctx.call_on_close(_typed.clear)
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command of the first word."""
        name, command, rest = super().resolve_command(ctx, args)
        for p in [] if command is None else command.params:
            positional = p.param_type_name == "argument"
            _words[str(p.name)] = str(p.name).upper() if positional else f"Option {p.opts[0]}"
        ctx.call_on_close(_words.clear)
        return name, command, rest


def command_line() -> str:
    """The command that is running, as it was typed; empty if a function was called from Python."""
    return "".join(_typed)


def own_words() -> dict[str, str]:
    """What the arguments and options of the running command are called there, by their name in Python."""
    return _words


Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Replace = Annotated[
    bool,
    typer.Option(
        "--replace", "--force", help="Write into --out although it is not empty; earlier results go to .previous in it."
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
Baseline = Annotated[Path | None, typer.Option(help="Another law to compare with, as JSON.")]
BaselineVehicle = Annotated[
    Path | None, typer.Option(help="To compare with: another law, or another tuning's vehicle.json, as JSON.")
]
Limit = Annotated[
    list[str],
    typer.Option(help="Hard limits [SI]: travel=0.1,comfort=+5%, NAME=LOWER:UPPER; a tuning has grip=+10% by itself."),
]
Start = Annotated[Path | None, typer.Option(help="A law as JSON for all dampers, instead of the vehicle's own.")]
Speed = Annotated[float, typer.Option(help="Of the vehicle [m/s].")]
Duration = Annotated[float | None, typer.Option(help="Of each ride [s]; the road's own, or 10.")]
Step = Annotated[float, typer.Option(help="Step [s].")]
Seed = Annotated[int, typer.Option(help="Of random roads.")]

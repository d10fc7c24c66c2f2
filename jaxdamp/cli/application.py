"""The application, its help and its version."""

from typing import Annotated

import typer

from jaxdamp.cli.option_types import (
    Commands,
)


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

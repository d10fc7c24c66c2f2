"""The application, its help and its version."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

from jaxdamp.cli.option_types import Commands, Debug
from jaxdamp.cli.record_options import spread


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


def command(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a function a command: its words are checked before JAX is loaded, and errors are said in one sentence.

    Parameters whose types are dataclasses of options become options of their own; `--debug` is added.
    """

    def register(function: Callable[..., None]) -> Callable[..., None]:
        options = spread(function)

        signature = inspect.signature(options)
        switch = inspect.Parameter("debug", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Debug)

        @functools.wraps(options)
        def run(**given: Any) -> None:
            from jaxdamp.cli import console, early

            with console.plain_errors(given.pop("debug")):
                early.check(name, given)
                console.prepare()
                options(**given)

        run.__signature__ = signature.replace(parameters=[*signature.parameters.values(), switch])  # pyright: ignore[reportAttributeAccessIssue]
        run.__annotations__ = {**options.__annotations__, "debug": Debug}
        app.command(name)(run)
        return function

    return register

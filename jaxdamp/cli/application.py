"""The application: its help and version, and its commands, whose options are made when they are asked for."""

import functools
import gc
import inspect
import itertools
import shlex
from importlib import import_module
from typing import TYPE_CHECKING, Annotated

import typer
from typer.core import TyperCommand, TyperGroup


if TYPE_CHECKING:
    from typer._click import Command as AnyCommand, Context


COMMANDS = {  # along the chain from records to a damper: name and function
    "demo": "cli.chaining.demo",
    "bench": "cli.benching.bench_command",
    "fit": "cli.fitting.fit",
    "fit-vehicle": "cli.vehicle_fitting.fit_vehicle",
    "ride": "cli.riding.ride",
    "tune": "cli.tuning.tune_command",
    "sweep": "cli.tuning.sweep_command",
    "report": "cli.chaining.report",
    "explore": "cli.exporting.explore",
    "export": "cli.exporting.export_command",
    "laws": "cli.vehicle_words.list_laws",
    "vehicles": "cli.vehicle_words.list_vehicles",
}

_typed: list[str] = []  # the command that is running, as it was typed
_words: dict[str, str] = {}  # of its arguments and options: what they are called there, by their name in Python
DEBUG = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


class Command(TyperCommand):
    """A command whose options have other names that work too."""

    aliases: dict[str, str]

    def parse_args(self, ctx: "Context", args: list[str]) -> list[str]:
        """Read the words after the name of the command."""
        names = {option for parameter in self.params for option in parameter.opts}
        replaced = []
        for word, following in itertools.zip_longest(args, args[1:], fillvalue=""):
            option, equals, value = word.partition("=")
            spelled = self.aliases.get(option, option) if option not in names else option
            if option == "--out" and "--file" in names:
                ctx.fail("--out names a folder of results. This command writes one file: name it with --file.")
            if option == "--units" and "--show-units" in names and "=" not in (value or following):
                spelled = "--show-units"
            replaced.append(f"{spelled}{equals}{value}")
        self._refuse_repeated(ctx, replaced)
        return super().parse_args(ctx, replaced)

    def _refuse_repeated(self, ctx: "Context", words: list[str]) -> None:
        """Refuse an option of one value that is given several times, of which only the last would count."""
        *_, order = self.make_parser(ctx).parse_args(args=[*words])
        for option in order:
            several = option.param_type_name == "argument" or getattr(option, "multiple", False)
            if not several and not getattr(option, "is_flag", False) and (count := order.count(option)) > 1:
                ctx.fail(f"Option {option.opts[0]} must be given once, but is given {count} times.")


class Commands(TyperGroup):
    """All commands; keeps the words typed, for the last lines of a page and for messages."""

    def list_commands(self, ctx: object) -> list[str]:
        """The names in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: object, cmd_name: str) -> Command | None:
        """The command of a name."""
        return command(cmd_name) if cmd_name in COMMANDS else None

    def parse_args(self, ctx: "Context", args: list[str]) -> list[str]:
        """Read the words after the name of the program."""
        _typed[:] = [shlex.join(["jaxdamp", *args])]
        ctx.call_on_close(_typed.clear)
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: "Context", args: list[str]) -> tuple[str | None, "AnyCommand | None", list[str]]:
        """The command of the first word."""
        name, chosen, remaining = super().resolve_command(ctx, args)
        if chosen is not None:
            from jaxdamp.cli import options

            called = {str(p.name): (str(p.name).upper(), p.opts[0], p.param_type_name) for p in chosen.params}
            for option, (word, flag, kind) in called.items():
                _words[option] = word if kind == "argument" else f"Option {flag}"
            for leaf in options.offered(COMMANDS[str(name)]):
                _words.setdefault(leaf.argument.name, _words[leaf.option])
        ctx.call_on_close(_words.clear)
        return name, chosen, remaining


def command_line() -> str:
    """The command that is running, as it was typed; empty if a function was called from Python."""
    return "".join(_typed)


def own_words() -> dict[str, str]:
    """What the arguments and options of the running command are called there, by their name in Python."""
    return _words


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="""From a dyno file to a damper law, a ride and a better damper.

Units: SI everywhere (m, m/s, N, s, N s/m). Files may use other units, but must name them: in their headers
("stroke [mm]", "F_N"), or with --units. Results are shown in lbf and in/s with --units imperial, see --show-units.

Signs: stroke and velocity are positive in rebound (extension), force is positive when it resists extension. A file
whose bench counts compression positive is read with --sign compression-positive, and results are shown so with
--show-sign compression-positive. Nothing is guessed silently: what was decided is printed.

Both can stand under [show] in jaxdamp.toml here or in ~/.config: units = "imperial", sign = "compression-positive".""",
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


@functools.cache
def command(name: str) -> Command:
    """A command: its words are checked before JAX is loaded, and errors are said in one sentence."""
    from jaxdamp.cli import options
    from jaxdamp.cli.signatures import description

    target = COMMANDS[name]

    def run(*, debug: bool = False, **given: object) -> None:
        from jaxdamp.cli import console, early, resuming

        with console.plain_errors(debug):
            early.check(name, given)
            noted = resuming.noted(name, given)
            read = options.values(target, given)
            console.prepare(quickly=name != "sweep")  # whose lanes run for long
            module, _, function = target.rpartition(".")
            screen = console.Screen()
            arguments = options.build(target, {("screen",): screen, **read})
            perform = getattr(import_module(f"jaxdamp.{module}"), function)
            if not gc.isenabled():
                gc.freeze()
                gc.enable()
            with console.showing(given, screen), noted, console.beside(name):
                perform(**arguments)

    switch = inspect.Parameter("debug", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=DEBUG)
    made = [*options.parameters(name, target), switch]
    run.__signature__ = inspect.Signature(made)  # pyright: ignore[reportFunctionMemberAccess]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in made}
    run.__doc__ = description(target)
    single = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)
    single.command(name, cls=Command)(run)
    built = typer.main.get_command(single)
    assert isinstance(built, Command)
    built.aliases = options.aliases(name, target)
    return built

"""What the commands share at the terminal: tables, stages with their progress, errors in one sentence, units shown."""

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any
from unicodedata import category

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.padding import Padding
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable
from rich.text import Text

from jaxdamp import _checks
from jaxdamp._display import Display, display, shown_in
from jaxdamp._documents import read_toml
from jaxdamp._tables import Column, Table
from jaxdamp._words import first_upper, raised
from jaxdamp.cli import interrupt
from jaxdamp.cli.wording import in_command_line, message


Advance = Callable[[str, int], None]
_WIDTH_OF_FILES = 130  # characters a line where the output is no terminal
_QUICK = 2.0  # s, stages that end sooner do not say how long they took
_MOST = 3  # remarks at the terminal; the page has all


class Screen:
    """Where a command writes what it does, and the times that its stages took.

    The terminal has the answer and the remarks that matter most; with `verbose`, all that the page has.
    """

    def __init__(self) -> None:
        self.verbose = False
        self.live = sys.stdout.isatty()  # whatever colours are forced; a notebook and a pipe keep every frame
        width = None if self.live else shutil.get_terminal_size((_WIDTH_OF_FILES, 50)).columns  # COLUMNS, if it is set
        self.console = Console(width=width, highlight=False)
        self.times: dict[str, float] = {}

    def say(self, text: str = "", style: str = "") -> None:
        """A paragraph, taken literally."""
        self.console.print(_printed(text, style), soft_wrap=False)

    def heading(self, text: str) -> None:
        """A section begins."""
        self.console.print()
        self.console.print(_printed(text, "bold"))

    def answer(self, *sentences: str) -> None:
        """What the command was asked for, in words."""
        self.console.print()
        self.say(" ".join(s if "_" in s.split(" ")[0] else first_upper(s) for s in sentences if s), "bold")

    def points(self, items: Sequence[str], style: str = "") -> None:
        """A list of remarks."""
        for item in items:
            lines = _printed(item, style).wrap(self.console, max(self.console.width - 4, 20))
            for number, line in enumerate(lines):
                self.console.print(Text("    " if number else "  - ", style).append_text(line), soft_wrap=True)

    def remarks(self, items: Sequence[str], style: str = "") -> None:
        """The first remarks of a list that is sorted by consequence, and how many more are on the page."""
        shown = items if self.verbose else items[:_MOST]
        self.points(shown, style)
        if len(shown) < len(items):
            self.points([f"{len(items) - len(shown)} more in report.html (--verbose prints all)"])

    def details(self, *tables: Table) -> None:
        """Tables that the page has, and the terminal if it is asked to print all."""
        for table in tables if self.verbose else ():
            self.table(table)

    def table(self, table: Table, mark: str | None = None) -> None:
        """A table without its meanings, which are for the files; rows whose first cell is `mark` in bold."""
        shown = RichTable(box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
        headings = table.headings()
        visible = [index for index, column in enumerate(table.columns) if column.name != "meaning"]
        for index in visible:
            side = "right" if table.is_number(index) else "left"
            shown.add_column(literal(headings[index]), justify=side, overflow="fold", no_wrap=index == 0)
        for row in table.texts():
            shown.add_row(*(literal(row[index]) for index in visible), style="bold" if row[0] == mark else "")
        self.heading(table.title)
        self.console.print(Padding(shown, (0, 0, 0, 2), expand=False))

    def files(self, folder: Path, names: Sequence[str]) -> None:
        """The files written, in one line: pages, laws and vehicles first."""
        order = [".html", ".json", ".csv", ".png"]
        first = sorted(
            names, key=lambda name: (name.count("/"), order.index(end) if (end := Path(name).suffix) in order else 9)
        )
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        self.say()
        self.say(f"Written to {folder}: {', '.join(first[:3])}{more}", "bold")

    def times_table(self) -> Table:
        """How long each stage took."""
        rows = (*self.times.items(), ("all", sum(self.times.values())))
        return Table("Times", (Column("stage"), Column("time", "s", ".1f")), rows)

    @contextmanager
    def stage(self, title: str, total: int | None = None) -> Iterator[Advance]:
        """A stage of the work: shows that it runs and how far it is, and notes how long it took.

        Gives a function to be called with a word on what is being done now and the number of parts done so far. Ctrl-C
        stops the work there, and where a stage begins.
        """
        interrupt.check()
        started = time.perf_counter()
        if self.live:
            columns = [SpinnerColumn(), TextColumn("{task.description}", markup=False)]
            columns += [BarColumn(), MofNCompleteColumn()] if total else []
            columns += [TimeElapsedColumn(), TextColumn("{task.fields[detail]}", markup=False)]
            with Progress(*columns, console=self.console, transient=True) as progress:
                task = progress.add_task(title, total=total, detail="")

                def advance(detail: str, done: int) -> None:
                    interrupt.check()
                    progress.update(task, completed=done, detail=detail)

                yield advance
        else:
            self.say(f"{title} ...")  # a log has the title once
            yield lambda detail, done: interrupt.check()
        seconds = time.perf_counter() - started
        self.times[title] = seconds
        if seconds >= _QUICK:
            self.say(f"{title}: done in {seconds:.1f} s" if self.live else f"  done in {seconds:.1f} s", "green")


def _printed(text: str, style: str = "") -> Text:
    """A sentence in the reader's words, units and signs, with raised powers and arrows."""
    return literal(raised(display().words(text)).replace(" -> ", " → "), style)


def literal(text: str, style: str = "") -> Text:
    """A text as it is, with control characters made visible: names out of files must not command the terminal."""
    unsafe = {c: c.encode("unicode_escape").decode() for c in text if category(c) == "Cc" and c not in "\n\t"}
    return Text("".join(unsafe.get(c, c) for c in text), style=style)


def prepare(*, quickly: bool) -> None:
    """Double precision, all cores, fast loops, as a command may decide for its own process.

    Called from a Python that computes already, it takes devices and loops as they are.

    Arguments:
        quickly: with compiler options that halve the time of compiling, for commands that run a program few times; the
            loops of single cars are as fast. Options in XLA_FLAGS go before them.
    """
    import jax

    from jaxdamp import configure
    from jaxdamp._forked import started

    if quickly and not started():
        options = ["--xla_backend_optimization_level=1"]
        options += ["--xla_cpu_use_fusion_emitters=false"] * (jax.__version_info__ < (0, 11))
        os.environ["XLA_FLAGS"] = " ".join([*options, os.environ.get("XLA_FLAGS", "")])
    try:
        configure()
    except RuntimeError:
        jax.config.update("jax_enable_x64", True)


_SIDE_BY_SIDE = ("fit", "report", "demo")  # commands that fit several laws


def beside(command: str) -> AbstractContextManager[None]:
    """Processes for a command whose work goes side by side."""
    from jaxdamp import _second_process

    return _second_process.opened(_ready) if command in _SIDE_BY_SIDE else nullcontext()


def _ready() -> None:
    """What a process does before it is told anything."""
    import jax
    import matplotlib.backends.backend_agg  # noqa: F401  # which it will draw with

    jax.devices()


@contextmanager
def plain_errors(debug: bool) -> Iterator[None]:
    """Show what the library refuses as one message without traceback, and end with exit code 2."""
    screen = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        with interrupt.watched():
            yield
    except interrupt.Interrupted as stop:
        screen.print(literal(str(stop), "yellow"))
        raise typer.Exit(interrupt.exit_code()) from stop
    except (ValueError, OSError, ImportError) as error:
        if debug:
            raise
        screen.print(literal("Error: ", "bold red").append(literal(message(error), "red")))
        raise typer.Exit(2) from error


FILE, TABLE = "jaxdamp.toml", "show"
KEYS = ("units", "sign")


@contextmanager
def showing(given: Mapping[str, Any], screen: Screen) -> Iterator[None]:
    """Tables, pictures and CSV as the options say, then a file in this folder, then the file of the user."""
    stated = {key: given[f"show_{key}"] for key in KEYS if given.get(f"show_{key}")}
    sources = []
    for file in _files(given.get("files") or ()) if "show_units" in given else ():
        from_file = _stated(file)
        sources += [str(file)] if from_file.keys() - stated.keys() else []
        stated = {**from_file, **stated}
    display = Display(**stated, wording=in_command_line)
    if display.described:
        where = f" (from {' and '.join(sources)})" if sources else ""
        screen.say(f"{display.described}{where}")
    with shown_in(display):
        yield


def _files(asked: Any) -> list[Path]:
    """The files that may hold settings, the nearest first: of this folder, of a folder that is read, of the user."""
    settings = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    folders = [Path(), *(path for path in map(Path, asked) if path.is_dir()), settings]
    return [file for folder in folders if (file := folder / FILE).is_file()]


def _stated(file: Path) -> dict[str, str]:
    """Units and sign in a file."""
    document = read_toml(file)
    table = document.get(TABLE, {})
    if isinstance(document.get("units"), str):  # as a table they are those of the records in its folder
        _checks.refuse("units", f"stand under [{TABLE}]", f"{document['units']!r} above all tables in {file}")
    wrong = [key for key in table if key not in KEYS or not isinstance(table[key], str)] if table else []
    if not isinstance(table, dict) or wrong:
        _checks.refuse(TABLE, f"hold {' and '.join(KEYS)} as text", f"{table!r} in {file}", 'Such as units = "SI".')
    return table

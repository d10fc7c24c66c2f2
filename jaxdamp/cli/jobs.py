"""What the commands share between their start and their end: where they write, pictures, warnings of rides."""

import contextlib
import json
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from jaxdamp._tables import Contents, Table
from jaxdamp.cli import interrupt
from jaxdamp.cli.application import command_line
from jaxdamp.cli.console import Screen
from jaxdamp.cli.results import Results, results_folder
from jaxdamp.cli.wording import message
from jaxdamp.dampers import OutsideFittedRangeWarning
from jaxdamp.report import Attempts, Report
from jaxdamp.simulation import CoarseStepWarning, Response


@dataclass(frozen=True)
class Output:
    """Where a command writes its results.

    Arguments:
        out: folder to write; jaxdamp- and the name of the command if left out.
        replace: write into --out although it is not empty; earlier results go to .previous in it.
        verbose: print all tables and remarks, as the page has them.
        show_units: units of tables, pictures and CSV: SI, metric (N, mm/s), imperial (lbf, in/s), or a force and a
            velocity such as kgf,mm/s; --units without quantities means this too.
        show_sign: direction in which they count positive: rebound-positive or compression-positive.
    """

    out: Path | None = None
    replace: bool = False
    verbose: bool = False
    show_units: str | None = None
    show_sign: str | None = None

    def store(self, command: str) -> Path:
        """Where a command keeps its blocks: a store beside the folder that it writes."""
        out = self.out or Path(f"jaxdamp-{command}")
        return out.with_name(f"{out.name}.zarr")


class Job(NamedTuple):
    """A command at work."""

    screen: Screen  # the terminal
    results: Results  # the folder that is written
    attempts: Attempts  # parts of the work that may fail by themselves

    @contextlib.contextmanager
    def saving(self, title: str, missing: str = "the pictures and the report") -> Iterator[Path]:
        """Write what is finished into the folder that this gives; it is put into place, and no `check` stops it."""
        interrupt.keep()
        with interrupt.saving(), self.screen.stage(title):
            yield self.results.draft
            self.results.publish(missing)

    def page(self, report: Callable[..., Report], *contents: object, part: str = "", **more: object) -> None:
        """Draw the pictures and write the page."""
        with self.screen.stage("Pictures and report"):
            folder = self.results.draft / part
            folder.mkdir(exist_ok=True)
            page = report(*contents, **more, folder=folder, attempts=self.attempts)
            page.write(folder / "report.html", command_line())


@contextlib.contextmanager
def job(
    screen: Screen, command: str, output: Output, page: Path | None = None, *, resume: bool = False
) -> Iterator[Job]:
    """The results of a command, its page also in another place; the terminal says at the end what was written."""
    if page is not None and (page.is_dir() or (page.exists() and not (output.replace or resume))):
        what = "is a folder: name a file" if page.is_dir() else "is there already: name another file"
        raise ValueError(f"{str(page)!r} {what} with --report{', or pass --replace' * page.is_file()}.")
    target, screen.verbose = output.out or Path(f"jaxdamp-{command}"), output.verbose
    attempts = Attempts(interrupt.check, message)
    with results_folder(target, command, replace=output.replace, resume=resume) as results:
        yield Job(screen, results, attempts)
    if page is not None:
        page.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(target.expanduser() / "report.html", page)
    screen.files(target, results.published)
    screen.points(attempts.troubles, style="yellow")


def write_tables(folder: Path, tables: Mapping[str, Table]) -> None:
    """Tables as CSV by the names of their files."""
    folder.mkdir(exist_ok=True)
    for name, table in tables.items():
        (folder / f"{name}.csv").write_text(table.to_csv(), encoding="utf-8")


def write_json(file: Path, contents: Contents) -> None:
    """Plain data as JSON."""
    file.write_text(json.dumps(contents, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def with_step_warnings(drive: Callable[[], Response]) -> tuple[Response, list[str]]:
    """A run, and what it warns of its step; that laws leave their range the tables and remarks say, the rest passes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore", OutsideFittedRangeWarning)
        warnings.simplefilter("always", CoarseStepWarning)
        response = drive()
    texts = []
    for warning in caught:
        if issubclass(warning.category, CoarseStepWarning):
            texts.append(str(warning.message))
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return response, texts

"""Options that several commands share: how records are read and processed, stated once.

A command takes them as parameters `reading: ReadOptions` and `processing: ProcessOptions`; `spread` makes options of
their fields. What is heavy is imported when it is used, so that the help of a command comes at once.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer


if TYPE_CHECKING:
    from jaxdamp.bench import BenchSet


@dataclass(frozen=True)
class ReadOptions:
    """How the files are to be read, as the command line says it."""

    sign: Annotated[
        str | None,
        typer.Option(help="Direction that the files count positive: rebound-positive or compression-positive."),
    ] = None
    force_sign: Annotated[
        str | None,
        typer.Option(
            help='"same" if the files\' force is positive when it resists motion in their positive direction, '
            'otherwise "opposite".'
        ),
    ] = None
    columns: Annotated[
        list[str], typer.Option(help="Headers or numbers (from 0) of columns: time=t_s,stroke=1,velocity=none.")
    ] = field(default_factory=list)
    units: Annotated[list[str], typer.Option(help="Units that the headers do not give: stroke=mm,force=kN.")] = field(
        default_factory=list
    )
    sampling_rate: Annotated[
        float | None, typer.Option(help="Samples per second [Hz], for files without a time column.")
    ] = None
    stroke_from_velocity: Annotated[
        bool, typer.Option("--stroke-from-velocity", help="Integrate the velocity of files without a stroke.")
    ] = False
    delimiter: Annotated[str | None, typer.Option(help="Character between columns, if it is not found.")] = None
    gains: Annotated[
        list[str], typer.Option(help="Gains of sensors, for columns in volts: force=500 N/V,stroke=10 mm/V - 2 mm.")
    ] = field(default_factory=list)
    manifest: Annotated[
        Path | None,
        typer.Option(help="TOML file that says how to read the files; jaxdamp.toml in a folder is taken by itself."),
    ] = None
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Leave out files that cannot be read, and records with an error.")
    ] = False
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all findings on the records.")] = False
    command: Annotated[
        list[str], typer.Option(help="What was set on the damper, by name or pattern: '*_0.5A=0.5,*_1A=1'.")
    ] = field(default_factory=list)

    def read(self, files: Sequence[Path]) -> "BenchSet":
        """Read the records."""
        from jaxdamp import bench
        from jaxdamp.cli.options import assignments, column_numbers, commands

        return bench.read(
            list(files),
            sign=self.sign,
            force_sign=self.force_sign,
            columns=column_numbers(assignments("columns", self.columns)),
            units=assignments("units", self.units),
            sampling_rate=self.sampling_rate,
            stroke_from_velocity=self.stroke_from_velocity or None,
            delimiter=self.delimiter,
            gains=assignments("gains", self.gains),
            manifest=True if self.manifest is None else self.manifest,
            skip_bad=self.skip_bad,
            command=commands(self.command),
        )


@dataclass(frozen=True)
class ProcessOptions:
    """What is done to the records, as the command line says it."""

    cycles: Annotated[str | None, typer.Option(help="Full cycles to keep: 3 or last:3, or skip:2.")] = None
    between: Annotated[str | None, typer.Option(help="Part of the records to keep, start:end [s].")] = None
    low_pass: Annotated[
        float | None, typer.Option("--filter", help="Zero-phase low-pass of stroke, velocity and force [Hz].")
    ] = None
    keep_rest: Annotated[
        bool, typer.Option("--keep-rest", help="Keep the rest before and after the motion, which is cut off otherwise.")
    ] = False

    def steps(self) -> dict[str, Any]:
        """The steps of `BenchRun.process`.

        >>> ProcessOptions("skip:2", "0.5:10", 50.0).steps()
        {'low_pass': 50.0, 'between': (0.5, 10.0), 'moving': True, 'skip_cycles': 2}
        """
        steps: dict[str, Any] = {} if self.low_pass is None else {"low_pass": self.low_pass}
        if self.between is not None:
            try:
                start, stop = map(float, self.between.split(":"))
            except ValueError:
                raise ValueError(f"Option --between must read like 2:10 [s], but is {self.between!r}.") from None
            steps["between"] = (start, stop)
        if not self.keep_rest:
            steps["moving"] = True
        if self.cycles is not None:
            kind, _, count = self.cycles.rpartition(":")
            if kind not in ("", "last", "skip") or not count.isdigit():
                raise ValueError(f"Option --cycles must read like 3, last:3 or skip:2, but is {self.cycles!r}.")
            steps["skip_cycles" if kind == "skip" else "last_cycles"] = int(count)
        return steps

    def apply(self, runs: "BenchSet") -> "BenchSet":
        """The records with these steps done."""
        steps = self.steps()
        return runs.process(**steps) if steps else runs


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the fields of its parameters that are dataclasses as parameters of their own."""
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters = []
    for name, parameter in inspect.signature(command).parameters.items():
        if name not in groups:
            parameters.append(parameter.replace(annotation=hints[name]))
            continue
        inside = get_type_hints(groups[name], include_extras=True)
        for each in fields(groups[name]):
            default = each.default if each.default_factory is MISSING else each.default_factory()
            parameters.append(
                inspect.Parameter(
                    each.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=inside[each.name]
                )
            )

    def spread_out(**given: Any) -> None:
        for name, kind in groups.items():
            given[name] = kind(**{each.name: given.pop(each.name) for each in fields(kind)})
        command(**given)

    spread_out.__name__, spread_out.__doc__ = command.__name__, command.__doc__
    spread_out.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    spread_out.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    return spread_out

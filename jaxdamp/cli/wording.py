"""What the library says of Python's arguments, said of the options of the command line."""

import ast
import re
import shlex

from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.cli.application import own_words


OTHER_WORDS = {
    "last_cycles": "Option --cycles",
    "low_pass": "Option --filter",
    "path": "Option --file",
    "path_or_text": "The law file",
    "paths": "FILES",
    "records": "FILES",
    "runs": "The records",
    "reversed_channels": "Option --reversed",
    "file": "The store",
    "channel": "A channel of --units or --reversed",
    "road_class": "CLASS in iso:CLASS",
    "skip_cycles": "Option --cycles",
    "start": "The beginning in --between",
    "metric": "Option --minimise",
    "metrics": "Option --metric",
}
CALLS = {
    r"Choose another name, or delete the folder": "Name another folder with --out, or delete the store",
    r" It is in `result\.rig`, not in the law,": " It is in machines/, not in the law,",
    r"; `law \+ dampers\.Spring\([^`]*` is the damper if it is gas": "",
    r'add "(\w+)" or "(\w+)" to the machine \(`rig`\)': r"add --rig \1 or --rig \2",
    r'add "(\w+)" to the machine \(`rig`\)': r"add --rig offset,\1",  # beside the default, which it replaces
    r'beside a "(\w+)" of the machine \(`rig`\)': r"with --rig offset,\1",
    r"or a `Spring` to the law": "or fit a law with a spring",
    r'`rig="heat"`': "--rig offset,heat",
    r"or put the law into `Play`": "or fit --law besinger_play",
    r" \(`identify\.design_experiment` proposes tests\)": "",
    r" \(`jaxdamp\.respond`\)": "",
    r"\bskip_bad=True\b": "--skip-bad",
    r"Look at them with `data\.where[^`]*`, and at `data\.reason`": "sweep.csv has all points with the reasons",
    r"`data\.failed` marks them, and `data\.reason` says why": "sweep.csv has the reasons",
    r"Drive over (a random road instead: )?`roads\.iso8608\([^`]*`": "Take iso:CLASS",
    r", or take an implicit solver, `engine=[^`]*`": "",
    r"`read_rides\(\.\.\., units=\{[^`]*`": "--units",
    r"`read_rides\(\.\.\., reversed_channels=\[[^`]*`": "--reversed",
    r"State it as held, `run\.held_at\(([^`]*)\)`": r"State it as held, --command NAME=\1",
    r"Record the command as a channel, `BenchRun\.command_channel`": "Record the command, --columns command=...",
    r"Freeze (\S+) of them, or add": r"Hold \1 of them with --freeze, or add",
    r"Freeze it or add records that excite it": "Hold it with --freeze, or add records that excite it",
    r"Add records beyond it, or freeze it": "Add records beyond it, or hold it with --freeze",
    r"such as knots, or take a law with fewer": "such as --freeze knots, or fit a simpler law",
    r"Try another start, bounds, or fewer free parameters": "Fit a simpler law",
    r"compare with `identify\.friction_ladder\(vehicle\)`": "compare the forms with --friction all",
    r"(try|such as) piecewise_linear or table": r"\1 --law piecewise_linear,table",
    r'`bad_records="leave_out"` fits': "--skip-bad fits",
    r'`bad_records="keep"` (fits|pools)': r"--keep-bad \1",
    r"no record but a law: dampers\.Table \(docs/reading\.md\)": "no record: jaxdamp fit makes a law of them",
    r"such as `Bilinear` or `PiecewiseLinear`": "such as --law bilinear,piecewise_linear",
    r"state what was set on the damper \(`command`\)": "state what was set on the damper (--command)",
    r"`process\(low_pass=([^)]*)\)`": r"--filter \1",
    r"`process\(between=[^`]*`": "--between start:end",
    r": `record_laws` has the law of each": "; the table of parameters has that of each",
    r", or fit a law with settings \(`dampers\.Scheduled`, `fit_scheduled`\)": "",
    r"`process\(moving=True\)` cuts it off": "it is cut off without --keep-rest",
    r"`process\(skip_cycles=[^)]*\)`": "--cycles skip:1",
    r"subtract it, `process\(without=[^`]*`": "fit it beside the law, --rig gas",
    r"`bounds=\{[^`]*`": "--bound",
    r"Pass `tyre_lifts=True` to the vehicle": "Write tyre_lifts = true into a vehicle file (docs/vehicles.md)",
    r"`process\(delay=[^)]*\)`": "fit with --rig offset,delay",
    r"together, `Scenarios\(\[[^`]*`": "together, jaxdamp tune --roads 4",
    r"with `jaxdamp\.parameters\.replace\([^']*'([^']*)'[^`]*`": r"with \1 = NUMBER below [parameters] of VEHICLE.toml",
}
"""Calls of Python in the sentences of the library, as patterns, and what the command line says instead."""


def option_text(setting: Setting, name: str = "") -> str:
    """An argument with its value as it is given on the command line.

    >>> option_text(Setting("columns", {"time": None, "stroke": "x mm"}))
    "--columns 'time=none,stroke=x mm'"
    >>> option_text(Setting("sampling_rate")), option_text(Setting("stroke_from_velocity", True))
    ('--sampling-rate ...', '--stroke-from-velocity')
    """
    name = name or f"--{setting.argument.replace('_', '-')}"
    if setting.value is True:
        return name
    if isinstance(setting.value, dict):
        value = ",".join(f"{role}={_word(item)}" for role, item in setting.value.items())
    elif isinstance(setting.value, list | tuple):
        value = ",".join(map(_word, setting.value))
    else:
        value = _word(setting.value)
    return f"{name} {value if '...' in value else shlex.quote(value)}"


def _word(value: object) -> str:
    if value is None:
        return "none"
    return "..." if value is ... else f"{value:g}" if isinstance(value, float) else str(value)


def in_options(text: str, settings: tuple[Setting, ...] = ()) -> str:
    """A sentence of the library with its settings as options."""
    for setting in settings:
        words = own_words().get(setting.argument, "")
        if words.startswith("Option "):
            text = text.replace(str(setting), option_text(setting))
    return text


def in_command_line(text: str) -> str:
    """A sentence of the library that names calls and arguments of Python, with options instead."""
    for python, words in CALLS.items():
        text = re.sub(python, words, text)
    text = re.sub(r"Argument `([^`]+)`", lambda match: _argument(match[1]), text)
    text = re.sub(r"`(\w+)=([^`]*)`", lambda match: _setting(match) or match[0], text)
    return re.sub(r"`(\w+)`", lambda match: own_words().get(match[1], match[0]).removeprefix("Option "), text)


def _argument(argument: str) -> str:
    """An argument at fault as the running command calls it; a parameter by its path."""
    name, bracket, item = argument.partition("[")
    words = own_words().get(name) or OTHER_WORDS.get(name) or (name if "." in name else f"Argument `{name}`")
    return f"{words}{' of ' * bool(bracket)}{item.rstrip(']')}"


def _setting(match: re.Match[str]) -> str:
    """An argument with its value as the running command is given it; empty if it has no such option."""
    words = own_words().get(match[1], "")
    try:
        value = ast.literal_eval(match[2])
    except (SyntaxError, ValueError):
        value = ...
    return option_text(Setting(match[1], value), words.removeprefix("Option ")) if words.startswith("Option ") else ""


def message(error: Exception) -> str:
    """What an error says, in the language of the command line."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{str(error.filename)!r} cannot be opened ({error.strerror}): look at its rights, or name another one."
    return in_command_line(in_options(str(error), error.settings if isinstance(error, ArgumentError) else ()))

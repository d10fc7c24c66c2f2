"""What the commands offer: their functions, and where the arguments of these are not taken as they are.

Every argument of a command's function, and of the library functions that it names, is an option of its name unless it
stands here. Help and defaults come from docstrings and signatures (`options`).
"""

from typing import NamedTuple

from jaxdamp.cli import words


NOT_OFFERED = {  # arguments of library functions, and why
    "bench.read": {"readers": "functions of Python"},
    "bench.Steps": {
        "moving": "--keep-rest leaves it out",
        "skip_cycles": "--cycles skip:2",
        "last_cycles": "--cycles last:3",
        "without": "friction and gas force are fitted: --rig friction,gas",
    },
    "bench.read_rides": {"readers": "functions of Python"},
    "bench.evaluate": {"by": "--group-by"},
    "identify.fit": {
        "solver": "an object of Python",
        "bad_records": "the preflight refuses them, --skip-bad leaves them out, --keep-bad keeps them",
    },
    "identify.fit_vehicle": {"solver": "an object of Python"},
    "simulation.simulate": {
        "engine": "an object of Python",
        "start": "a ride begins at rest",
        "state": "for runs in pieces, of programs",
        "return_state": "for runs in pieces, of programs",
        "every": "the pictures and metrics need every instant",
    },
    "tune.minimise": {
        "engine": "an object of Python",
        "shape": "constraints of Python",
        "metrics": "for functions of Python; every metric of a limit is computed",
        "progress": "shown at the terminal",
    },
    "sweeps.sweep": {
        "cluster": "--block",
        "file": "what is finished is kept for --resume",
        "gradients": "for programs",
        "progress": "shown at the terminal",
    },
    "sweeps.summary.Summary": dict.fromkeys(
        ("histograms", "smallest", "largest", "pareto"), "of sweeps by block, for programs; a command stores its points"
    ),
    "export.to_explorer": {"records": "FILES"},
}

NAMES = {  # of options that differ from the argument, by function or for all; the name of the argument works too
    "bounds": "bound",
    "tune.minimise limits": "limit",
    "sensors": "sensor",
    "low_pass": "filter",
    "reversed_channels": "reversed",
    "identify.fit_vehicle start": "initial_motion",
}
ALIASES = {"--force": "--replace", "--metrics": "--metric"}  # names of before, which still work
ALIASES_OF = {
    "ride": {"--sign": "--show-sign", "--start": "--law"},
    "tune": {"--sign": "--show-sign", "--start": "--law"},
    "sweep": {"--sign": "--show-sign", "--start": "--law"},
    "export": {"--sign": "--show-sign"},
    "fit-vehicle": {"--start": "--law"},
}
SHORT = {"verbose": "-v"}


class Written(NamedTuple):
    """How an option is written."""

    read: words.Reader  # gives its value, from its name and a text, or a list of texts if it may be repeated
    metavar: str  # that stands for the value in the help
    example: str = ""  # for the help
    repeated: bool = True  # whether it may be given several times


ENDS = "be a number, or two as LOWER:UPPER, each with its unit or both in SI"
SPANS = words.named(words.span, "be a number, or two as LOWER:UPPER")
SENSOR = {"gain": 1.0, "offset": 0.0, "lag": 0.0, "delay": 0.0, "high_pass": None}
GUIDE: dict[str, float | None] = dict.fromkeys(("friction", "stiffness", "damping", "friction_velocity", "ahead"))

WRITTEN = {  # by the name of the option, or by function and name, where its type does not say it
    "bound": Written(words.named(words.bound, ENDS), "NAME=LOWER:UPPER", "rate=1000:4000, rate=5lbf s/in:25lbf s/in"),
    "limit": Written(
        words.named(words.limit, ENDS),
        "NAME=LIMIT",
        "travel=0.1,grip=+10%,comfort=none, travel=4in, or NAME=LOWER:UPPER",
    ),
    "priors": Written(SPANS, "NAME=MEAN:DEVIATION"),
    "columns": Written(words.named(words.column, like="stroke=..."), "NAME=COLUMN", "time=t_s,stroke=1,velocity=none"),
    "bench.read command": Written(words.commands, "NUMBER, PATTERN=NUMBER or NAME"),
    "sensor": Written(
        words.named_numbers(SENSOR, "stroke:offset,delay=0.001"),
        "NAME:NUMBER,...",
        "stroke:offset,delay=0.001 (gain, offset, lag, delay, high_pass, each with a start if one is given), or "
        "*:offset for every channel",
    ),
    "guide": Written(words.named_numbers(GUIDE, "sprung:friction=40"), "NAME:NUMBER=START", "sprung:friction=40"),
    "block": Written(words.part, "PART/PARTS", "17/200", repeated=False),
    "bench": Written(lambda option, texts: texts, "FILE", "front.damper=FILE where there are several dampers"),
}

TYPES = (  # pattern of one alternative of an annotation, and how it is written; the first that fits an alternative
    (r"Mapping\[str, tuple\[", Written(SPANS, "NAME=LOWER:UPPER")),
    (r"Mapping\[str, Axis\]", Written(words.axes, "NAME=VALUES")),
    (r"Mapping\[str, (float|int)[ |floatin]*\]", Written(words.named(float), "NAME=NUMBER")),
    (r"Mapping\[str, str( \| int)?( \| None)?\]", Written(words.named(str), "NAME=TEXT")),
    (r"Sequence\[(str|int)( \| int)\]", Written(words.columns, "COLUMN")),
    (r"Sequence\[str\]", Written(words.words, "NAME,...")),
    (r"Sequence\[(float|int)[ |floatin]*\]", Written(words.numbers_in_order, "NUMBER,...")),
    (r"tuple\[(float|int)[ |floatin]*, (float|int)[ |floatin]*\]", Written(words.two, "FIRST:SECOND", repeated=False)),
)
NAMES_OR_NUMBERS = Written(words.names_or_numbers, "NAME or NUMBER,...")  # of `str | Sequence[float]`

SHARED = {  # help of the words that several commands take, unless the docstring of one says something else
    "files": "files with records (CSV, XLSX, MATLAB, TDMS, MDF4, Parquet), patterns, or folders.",
    "law": "a law as JSON for the dampers, instead of the vehicle's own; seats and cabs keep theirs.",
    "vehicle": 'a published vehicle, see "jaxdamp vehicles"; or a file of one, *.json or *.toml.',
    "road": "iso:A to iso:H, bump:HEIGHT:LENGTH [m], or a file: *.crg, or text of position, height.",
    "baseline": "another law to compare with, as JSON.",
    "report": "write the page to this file too: fit.html.",
    "group_by": 'setting of the manifest to divide the records by, or "command".',
}

TEXTS = {  # help where the docstring speaks of Python only, by option, or by command and option
    "manifest": "TOML file that says how to read the files; jaxdamp.toml in a folder is taken by itself.",
    "settings": "What else the names of records say: *_{current}A takes the setting current from them.",
    "skip_bad": "Leave out files that cannot be read, and records with an error.",
    "bench": "Bench records of a damper of the vehicle, fitted together with the rides: a file, pattern or folder.",
    "sensor": "What a sensor adds, fitted.",
    "samples_per_cycle": "Slow bench records are averaged in blocks down to so many samples a cycle.",
    "initial_state": 'Of a law with states at the first sample of a record: "warm_up" (the default, after a copy of '
    'the first cycle), "rest", "periodic" or "estimated".',
    "starts": "Number of searches, from several starts; the best end is the result.",
    "tie": "Parameters that take the values of others, such as front.damper.*=rear.damper.*.",
    "limit": "Hard limits by metric, in its SI unit, in one that is named, or relative to the start; comfort, travel "
    "and grip are metrics.",
    "resume": "Go on where the same command was stopped, killed or switched off: what it had finished is taken up.",
    "seed": "Of random roads, noise and further starts.",
    "priors": "What is known of parameters beforehand: mean and standard deviation.",
    "substeps": "Steps of the simulation between two instants; as many as the laws need if left out.",
    "over": "Parameters to change, by path, last part or pattern; what a workshop can change if left out.",
    "fit over": "Parameters to fit, by path, last part or pattern; all if left out.",
    "fit-vehicle over": "Parameters of the vehicle to fit, by path, last part or pattern; all if left out.",
    "sweep over": "Axes: damper.rate=1000:8000:15 are 15 values, sprung_mass=1000;1200 two; in SI, or with units, "
    "sprung_mass=800lb:1200lb:5.",
    "bound": "Limits of parameters, in their SI unit or in one that is named.",
    "tune bound": "Bounds of parameters, in their SI unit or in one that is named; a third to three times the start if "
    "left out.",
    "rig": "What the test machine adds to the force, fitted with the law: offset, gas, gas_stiffness, friction, mass, "
    "delay, lag, command_lag, stroke_offset, heat; none for nothing.",
    "initial_motion": '"rest": records begin at rest on their first heights; "free": their motion is fitted.',
}

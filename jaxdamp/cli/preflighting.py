"""The preflight of a command: findings on the records are printed, and records with an error are left out."""

from jaxdamp import bench
from jaxdamp.bench import BenchSet, Preflight
from jaxdamp.cli.console import Screen
from jaxdamp.cli.wording import in_command_line


_COLOURS = {"error": "red", "warning": "yellow", "note": ""}


def checked(screen: Screen, runs: BenchSet, *, notes: bool = True) -> tuple[BenchSet, Preflight]:
    """The records without an error, and the findings on all of them.

    Arguments:
        screen: where the findings are printed.
        runs: the records as they were read.
        notes: print notes too, not only errors and warnings.

    Raises:
        ValueError: every record has an error.
    """
    with screen.stage("Checking the records"):
        found = bench.preflight(runs)
    screen.heading(found.summary())
    for sentence in found.sentences():
        severity = sentence.split(",")[0]
        if notes or severity != "note":
            screen.points([in_command_line(sentence)], style=_COLOURS[severity])
    wrong = {name for finding in found.of("error") for name in finding.records}
    sound = BenchSet((run for run in runs if run.name not in wrong), runs.left_out)
    if not len(sound):
        raise ValueError(" ".join(f"{finding}" for finding in found.of("error")))
    if wrong:
        screen.points([f"left out, with an error: {', '.join(sorted(wrong))}"], style="red")
    return sound, found

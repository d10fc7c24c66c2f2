"""The preflight of a command: its findings are printed, records with an error refused or left out."""

from jaxdamp import bench
from jaxdamp.bench import BenchSet, Preflight
from jaxdamp.cli.console import Screen
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions
from jaxdamp.cli.wording import in_command_line


_COLOURS = {"error": "red", "warning": "yellow", "note": ""}
_LINES = 5  # of findings at the terminal
_CUT_OFF = ("rest before", "rest after")  # findings on what `process(moving=True)` cuts off


def checked(
    screen: Screen, runs: BenchSet, reading: ReadOptions, processing: ProcessOptions, *, refuse: bool = False
) -> tuple[BenchSet, Preflight]:
    """The records without an error, and the findings on all of them but those on rest that is cut off.

    Arguments:
        screen: where the worst findings are printed; with `--verbose` all.
        runs: the records as they were read.
        reading: the options that say whether bad records are left out, and whether all findings are printed.
        processing: what is done to the records.
        refuse: refuse a record with an error unless bad ones are to be left out.

    Raises:
        ValueError: every record has an error, or one has and errors are refused.
    """
    with screen.stage("Checking the records"):
        found = bench.preflight(runs).without(() if processing.keep_rest else _CUT_OFF)
    screen.heading(found.summary)
    sentences = found.sentences()
    shown = sentences if reading.verbose else [text for text in sentences if not text.startswith("note")][:_LINES]
    for sentence in shown:
        screen.points([in_command_line(sentence)], style=_COLOURS[sentence.split(",")[0]])
    if len(sentences) > len(shown):
        kinds = dict.fromkeys(f.name for f in found.findings)
        more = [kind for kind in kinds if not any(kind in text.split(":")[0] for text in shown)]
        screen.points([f"also {', '.join(more)}: --verbose prints all, the page has them"])
    wrong = {name for finding in found.of("error") for name in finding.records}
    sound = BenchSet((run for run in runs if run.name not in wrong), runs.left_out)
    if not len(sound):
        raise ValueError(" ".join(f"{finding}" for finding in found.of("error")))
    if wrong and refuse and not reading.skip_bad:
        names = ", ".join(sorted(wrong))
        raise ValueError(f"{found.of('error')[0]} With --skip-bad, records with an error are left out: {names}.")
    if wrong:
        screen.points([f"left out, with an error: {', '.join(sorted(wrong))}"], style="red")
    return sound, found

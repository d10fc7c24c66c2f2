"""The preflight: all checks of all records."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Cell, Column, Contents, Table, plain
from jaxdamp.bench.analysis import as_records, peak_velocity_points
from jaxdamp.bench.contradictions import contradictions
from jaxdamp.bench.preflight import changes, consistency, motion_checks, sample_checks
from jaxdamp.bench.preflight.finding import SEVERITIES, Examined, Finding
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sign import OPPOSITE


# In this order; where one family finds an error in a record, the later ones are left out for it.
FAMILIES = (
    (motion_checks.magnitudes, motion_checks.few_samples, motion_checks.few_cycles, motion_checks.integrated),
    (sample_checks.repeated, sample_checks.edges, sample_checks.clipping, motion_checks.rest, motion_checks.run_up),
    (
        sample_checks.held_command,
        sample_checks.quantisation,
        sample_checks.ripple,
        consistency.velocity,
        consistency.sign,
    ),
    (
        motion_checks.jitter,
        changes.changes,
        consistency.gas_force,
        consistency.delay,
        consistency.breakaway,
        consistency.drift,
    ),
)
# The checks that find errors, which are quick.
ERRORS = (
    motion_checks.magnitudes,
    sample_checks.repeated,
    sample_checks.edges,
    sample_checks.clipping,
    consistency.velocity,
    consistency.sign,
)
# What is in the names of warnings, by what it does to results; all others come behind.
CONSEQUENCE = (
    *("unit of", "unusual", "changes", "jump", "dropout", "held", "spikes", "velocity", "contradiction", "sign"),
    "delay",
)
BAD_RECORDS = ("refuse", "leave_out", "keep")
_SAME_DELAY = 0.3  # relative difference of delays that may come from one channel
_ALIKE = 1.25  # factor between peak velocities whose forces can be compared


@final
@dataclass(frozen=True, eq=False, repr=False)
class Preflight(AbstractResult):
    """The findings on records, errors first.

    Attributes:
        findings: all of them.
        records: the names of the records that were checked.
    """

    findings: tuple[Finding, ...]
    records: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether there is no error; warnings and notes may be there."""
        return not self.of("error")

    def of(self, severity: str) -> tuple[Finding, ...]:
        """The findings of one severity: "error", "warning" or "note"."""
        _checks.one_of("severity", severity, SEVERITIES)
        return tuple(finding for finding in self.findings if finding.severity == severity)

    def named(self, name: str) -> tuple[Finding, ...]:
        """The findings of one name, such as "rest before"."""
        return tuple(finding for finding in self.findings if finding.name == name)

    def table(self) -> Table:
        """A row for each finding."""
        columns = (Column("severity"), Column("record"), Column("from", "s"), Column("to", "s"), Column("finding"))
        columns += (Column("message"), Column("size"), Column("unit"), Column("remedy"))
        rows: list[tuple[Cell, ...]] = []
        for f in self.findings:
            start, stop = (None, None) if f.between is None else f.between
            rows.append((f.severity, f.record, start, stop, f.name, f.message, f.size, f.unit, f.remedy))
        return Table(str(self.summary), columns, tuple(rows))

    @property
    def warnings(self) -> tuple[str, ...]:
        """The errors and warnings in words, worst first."""
        return tuple(sentence for sentence in self.sentences() if not sentence.startswith("note"))

    @property
    def summary(self) -> str:
        """How many records were checked, and how much was found, in words."""
        counts = [(len(self.of(severity)), severity) for severity in SEVERITIES]
        words = ", ".join(f"{count} {severity}{'s' * (count > 1)}" for count, severity in counts if count)
        records = f"{len(self.records)} record{'s' * (len(self.records) > 1)}"
        return f"Preflight of {records}: {words or 'nothing odd'}"

    def sentences(self) -> list[str]:
        """Each kind of finding once, worst first: in how many records, and that with the largest size in words."""
        kinds: dict[tuple[str, str], list[Finding]] = {}
        for finding in self.findings:
            kinds.setdefault((finding.severity, finding.name), []).append(finding)
        said = []
        for (severity, name), members in kinds.items():
            worst = max(members, key=lambda finding: abs(finding.size or 0.0))
            count = len({record for finding in members for record in finding.records})
            where = f"{name} in {count} records, most in" if count > 1 else f"{name}:"
            said.append(f"{severity}, {where} {worst.record}: {worst.message}. {worst.remedy}".rstrip())
        return said

    def without(self, names: Iterable[str]) -> "Preflight":
        """The same without the findings of these names."""
        left_out = tuple(names)
        return Preflight(tuple(f for f in self.findings if f.name not in left_out), self.records)

    def content(self) -> Contents:
        """All findings as plain data."""
        return {"ok": self.ok, "records": list(self.records), "findings": plain(self.table().records())}

    plot = drawn_by("preflight", "Which finding is in which record.")

    def __repr__(self) -> str:
        return "\n".join([self.summary, *(f"- {sentence}" for sentence in self.sentences())])


@one_thread()
def preflight(runs: BenchRun | Iterable[BenchRun]) -> Preflight:
    """Look over records before anything is computed from them.

    Each check compares with the noise of the record itself. Of a record with an error only that is said which does not
    follow from the error.

    Arguments:
        runs: one record or several of a bench; only several can contradict one another.

    Raises:
        ValueError: no record.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Linear
    >>> test = bench.SineTest(0.02, 2.0, cycles=6, rest_before=1.0, run_up=1.0)
    >>> found = bench.preflight(bench.VirtualDyno(Linear(1500.0), force_noise=3.0, stroke_noise=1e-5).run(test))
    >>> found.ok, [finding.name for finding in found.findings]
    (True, ['rest before', 'run-up'])
    """
    chosen = [run for run in as_records(runs, "preflight(runs)") if not run.of_points]  # these are no motion
    findings = [finding for run in chosen for finding in _of_record(run)]
    for family in ((copies,), (turned_by_the_reader, turned_motion), (mixed_settings,)):
        wrong = {name for finding in findings if finding.severity == "error" for name in finding.records}
        sound = [run for run in chosen if run.name not in wrong]
        findings += [finding for check in family for finding in check(sound)]
    findings = gas_of_the_slowest(hysteresis_or_delay(findings), chosen)
    findings.sort(key=_consequence)
    return Preflight(tuple(findings), tuple(run.name for run in chosen))


def _of_record(run: BenchRun) -> list[Finding]:
    """The findings of all families up to the first with an error."""
    examined, findings = Examined(run), []
    for family in FAMILIES:
        findings += [finding for check in family for finding in check(examined)]
        if any(finding.severity == "error" for finding in findings):
            break
    return findings


def _consequence(finding: Finding) -> tuple[int, int]:
    """The rank of a finding: by severity, then by what it does to results."""
    kinds = (number for number, kind in enumerate(CONSEQUENCE) if kind in finding.name)
    return SEVERITIES.index(finding.severity), next(kinds, len(CONSEQUENCE))


def usable(
    runs: Iterable[BenchRun], bad_records: str = "refuse", *, robust: bool = False, argument: str = "runs"
) -> tuple[BenchRun, ...]:
    """The records that something may be computed from: checks for errors only, in milliseconds a record.

    Arguments:
        runs: the records.
        bad_records: what is done with records that have an error: "refuse" all, "leave_out" these, or "keep" them.
        robust: whether what follows gives spikes little weight, so that they are no error.
        argument: what the caller calls the records.

    Raises:
        ValueError: a record with an error, or, where these are left out, none without one.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Linear
    >>> test = bench.SineTest(0.02, 2.0, cycles=6)
    >>> good, bad = (bench.VirtualDyno(Linear(1500.0), force_limit=limit).run(test)[0] for limit in (None, 300.0))
    >>> len(bench.usable([good, bad], "leave_out"))
    1
    """
    _checks.one_of("bad_records", bad_records, BAD_RECORDS)
    runs = tuple(runs)
    if bad_records == "keep" or not any(np.ptp(run.force) > 0.0 for run in runs):
        return runs  # a fit says itself that no force varies
    errors = [_first_error(run, robust) for run in runs]
    sound = tuple(run for run, error in zip(runs, errors, strict=True) if error is None)
    wrong = [error for error in errors if error is not None]
    if wrong and (bad_records == "refuse" or not sound):
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        error = wrong[0]
        ways = '`bad_records="leave_out"` fits the others, ' if len(sound) else "No record would be left; "
        ways += '`bad_records="keep"` fits them as they are.'
        is_ = f"{error.record}{more}: {error.message}"
        _checks.refuse(argument, "be records without errors", is_, f"{error.remedy} {ways}")
    return sound


def _first_error(run: BenchRun, robust: bool) -> Finding | None:
    """The first finding of a record that is an error; the points of a table are no motion to be looked at."""
    if run.of_points:
        return None
    examined = Examined(run)
    findings = (finding for check in ERRORS for finding in check(examined) if finding.severity == "error")
    return next((finding for finding in findings if not (robust and finding.name.endswith("spikes"))), None)


def copies(runs: Sequence[BenchRun]) -> list[Finding]:
    """Records that are another one once more, sample by sample: no measurement repeats its noise."""
    firsts: dict[bytes, str] = {}
    findings = []
    for run in runs:
        first = firsts.setdefault(run.stroke.tobytes() + run.force.tobytes(), run.name)
        if first != run.name:
            message = f"a copy of {first}: all samples are the same"
            remedy = "Leave it out: it would count twice, and be predicted by itself where records are held out."
            findings.append(Finding("error", "copy", (run.name,), message, None, "", None, remedy))
    return findings


def mixed_settings(runs: Sequence[BenchRun]) -> list[Finding]:
    """Records of one command and one setting, or of none, with the same motion but another force."""
    findings = []
    groups: dict[str, list[BenchRun]] = {}
    for run in runs:
        groups.setdefault(str(sorted(run.settings.items())), []).append(run)
    for pair in (pair for group in groups.values() for pair in contradictions(group, same_command=True)):
        message = (
            f"the same motion, but forces differ by {pair.difference:.3g} N, {100 * pair.share:.0f} % of their RMS"
        )
        remedy = "Were settings mixed (clicks, current, temperature)? State them as `command`, or fit apart."
        names = tuple(dict.fromkeys((pair.first, pair.second)))
        findings.append(Finding("warning", "contradiction", names, message, pair.difference, "N", None, remedy))
    return findings


def turned_by_the_reader(runs: Sequence[BenchRun]) -> list[Finding]:
    """Files whose force counts the other way than in the other files of the bench."""
    turned = [run for run in runs if any(note.startswith(OPPOSITE) for note in run.notes)]
    if not turned or len(turned) == len(runs):
        return []
    fewer = turned if 2 * len(turned) <= len(runs) else [run for run in runs if run not in turned]
    message = f"the sign of the force in the file differs from that of the other {len(runs) - len(fewer)}"
    remedy = "It was made alike by the work per cycle; which direction is rebound it cannot tell: look at both."
    return [Finding("warning", "sign unlike its bench", (run.name,), message, None, "", None, remedy) for run in fewer]


def turned_motion(runs: Sequence[BenchRun]) -> list[Finding]:
    """A record whose rebound looks like the compression of the others of its command, and the other way round."""
    whole = [run for run in runs if run.cycles and run.command_channel is None]
    if len(whole) < 3:
        return []
    points = peak_velocity_points(whole)
    findings = []
    for i, run in enumerate(whole):
        votes = []
        for j, other in enumerate(whole):
            speeds = np.abs(points.velocity[[i, j]])
            near = bool(np.all(np.isfinite(speeds)) and np.all(np.abs(np.log(speeds[0] / speeds[1])) < np.log(_ALIKE)))
            if i != j and near and other.command == run.command:
                scale = np.abs(points.velocity[i] / points.velocity[j])
                straight = np.abs(points.force[i] - points.force[j] * scale)
                turned = np.abs(points.force[i] + points.force[j][::-1] * scale[::-1])
                votes.append(float(turned.sum()) < 0.3 * float(straight.sum()))
        if len(votes) > 1 and np.mean(votes) > 0.5:
            message = "its rebound is like the compression of the other records, and the other way round"
            remedy = 'Was it recorded with the other sign? Read it with sign="compression-positive".'
            findings.append(Finding("error", "sign unlike its bench", (run.name,), message, None, "", None, remedy))
    return findings


def hysteresis_or_delay(findings: Sequence[Finding]) -> list[Finding]:
    """All findings, those of delays judged together: a channel is late by the same time in every record."""
    late = [finding for finding in findings if finding.name == "delay"]
    sizes = np.array([finding.size for finding in late])
    if len(late) < 2 or np.all(np.abs(sizes - np.median(sizes)) < _SAME_DELAY * np.abs(np.median(sizes))):
        return list(findings)
    remedy = "Fit a law with memory: a lag, a series spring, Bouc-Wen, LuGre."
    spread = f"it is {1e3 * sizes.min():.3g} to {1e3 * sizes.max():.3g} ms over the records, so no delay of a channel"
    note = {"severity": "note", "name": "hysteresis", "remedy": remedy}
    said = (f"{finding.message.split(':')[0]}; {spread}" for finding in findings)
    return [
        replace(f, message=words, **note) if f.name == "delay" else f for f, words in zip(findings, said, strict=True)
    ]


def gas_of_the_slowest(findings: Sequence[Finding], runs: Sequence[BenchRun]) -> list[Finding]:
    """The findings without static forces of fast records that the slowest one of their command does not have.

    Gas and the offset of a load cell are there at every velocity; the hysteresis of fast records is not.
    """
    names = ("gas force", "static force against gas")
    having = {finding.record for finding in findings if finding.name in names}
    slowest: dict[float | None, BenchRun] = {}
    for run in sorted(runs, key=lambda run: run.peak_velocity):
        slowest.setdefault(run.command, run)
    without = {run.name for run in runs if slowest[run.command].name not in having}
    return [finding for finding in findings if finding.name not in names or finding.record not in without]

"""Checks of records beside one another: other forces in the same motion, a record turned against its bench."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jaxdamp.bench.analysis import peak_velocity_points
from jaxdamp.bench.contradictions import contradictions
from jaxdamp.bench.preflight.finding import Finding
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sign import OPPOSITE


_SAME_DELAY = 0.3  # relative difference of delays that may come from one channel
_ALIKE = 1.25  # factor between peak velocities whose forces can be compared


def mixed_settings(runs: Sequence[BenchRun]) -> list[Finding]:
    """Records of one command, or of none, with the same motion but another force."""
    findings = []
    for pair in contradictions(runs, same_command=True):
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
    judged = {
        id(f): replace(
            f, severity="note", name="hysteresis", message=f"{f.message.split(':')[0]}; {spread}", remedy=remedy
        )
        for f in late
    }
    return [judged.get(id(finding), finding) for finding in findings]


def gas_of_the_slowest(findings: Sequence[Finding], runs: Sequence[BenchRun]) -> list[Finding]:
    """The findings without static forces of fast records that the slowest one of their command does not have.

    Gas and the offset of a load cell are there at every velocity; the hysteresis of fast records is not.
    """
    names = ("gas force", "static force against gas")
    having = {finding.record for finding in findings if finding.name in names}
    slowest: dict[float | None, BenchRun] = {}
    for run in runs:
        other = slowest.get(run.command)
        slowest[run.command] = run if other is None or run.peak_velocity < other.peak_velocity else other
    without = {run.name for run in runs if slowest[run.command].name not in having}
    return [finding for finding in findings if finding.name not in names or finding.record not in without]

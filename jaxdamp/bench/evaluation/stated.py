"""Forces at stated velocities, from the records of a setting."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp.bench.analysis import FoldedCycles
from jaxdamp.bench.contradictions import repeats
from jaxdamp.bench.evaluation import curve
from jaxdamp.bench.evaluation.curve import Measurement, measured
from jaxdamp.bench.runs import BenchRun


WINDOW = 0.05  # share of a stated velocity within which samples, or records, count as taken at it


def forces_at(
    velocities: Sequence[float] | None,
    peaks: Mapping[str, Sequence[curve.PeakForce]],
    fastest: FoldedCycles,
    setting: str,
    method: str,
    window: float,
) -> list[Measurement]:
    """Forces and their ratio at the stated velocities; without any stated, at those that the records reach."""
    measurements = []
    for velocity in curve.OEM_VELOCITIES if velocities is None else velocities:
        forces = {}
        for direction, sign in curve.DIRECTIONS.items():
            if method == "loop":
                forces[direction] = curve.on_loop(fastest, sign, velocity, window)
            elif method == "window":
                forces[direction] = curve.in_window(peaks[direction], velocity, window)
            else:
                forces[direction] = curve.interpolated(peaks[direction], velocity)
        values = [force[0] for force in forces.values()]
        if velocities is None and not np.isfinite(values).any():
            continue
        more = {"setting": setting, "velocity": float(velocity)}
        measurements += [Measurement(f"{name} force", "N", *force, **more) for name, force in forces.items()]
        measurements.append(Measurement("rebound/compression ratio", "", *_ratio(*forces.values()), **more))
    return measurements


def peaks_of(
    setting: str, runs: Sequence[BenchRun], measurements: Sequence[Measurement]
) -> dict[str, list[curve.PeakForce]]:
    """Forces at the peak velocities of the records of a setting, by direction."""
    of_records = [m for m in measurements if m.record and m.setting == setting]
    return {direction: _peak_forces(runs, of_records, direction) for direction in curve.DIRECTIONS}


def _peak_forces(runs: Sequence[BenchRun], of_records: Sequence[Measurement], direction: str) -> list[curve.PeakForce]:
    """Force at the peak velocity of a direction, one for each motion: repeated records are averaged."""
    by = {(m.record, m.quantity): m for m in of_records}
    peaks = []
    for group in repeats(runs):
        velocity = np.array([abs(by[run.name, f"{direction} velocity"].value) for run in group])
        forces = [by[run.name, f"{direction} force"] for run in group]
        value, between, count = measured(np.array([m.value for m in forces]))
        within = [m.scatter for m in forces if m.scatter is not None]
        parts = ([] if between is None else [between]) + (
            [float(np.sqrt(np.mean(np.square(within))))] if within else []
        )
        if count and np.isfinite(velocity).all():
            scatter = float(np.linalg.norm(parts)) if parts else None
            peaks.append(curve.PeakForce(float(velocity.mean()), value, scatter))
    return peaks


def span(peaks: Mapping[str, Mapping[str, Sequence[curve.PeakForce]]], method: str) -> tuple[float, float, str]:
    """The lowest and highest velocity at which the records of all settings give a force, equal if at none; in words."""
    spans = [[point.velocity for point in points] for both in peaks.values() for points in both.values() if points]
    low, high = max(map(min, spans), default=0.0), min(map(max, spans), default=0.0)
    low = 0.0 if method == "loop" else low
    words = f"the records give forces from {low:.3g} to {high:.3g} m/s" if low < high else "the records enclose none"
    return low, max(low, high), words


def _ratio(
    one: tuple[float, float | None, int], other: tuple[float, float | None, int]
) -> tuple[float, float | None, int]:
    """Ratio of the magnitudes of two forces; their scatters taken as independent."""
    if not other[0]:
        return float("nan"), None, 0
    value = abs(one[0] / other[0])
    has_scatter = one[1] is not None and other[1] is not None and one[0] != 0.0
    scatter = float(value * np.hypot((one[1] or 0.0) / one[0], (other[1] or 0.0) / other[0])) if has_scatter else None
    return value, scatter, min(one[2], other[2])

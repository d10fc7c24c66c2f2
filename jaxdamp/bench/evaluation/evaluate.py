"""`evaluate`: every measurement of records, by setting."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError
from jaxdamp._one_thread import one_thread
from jaxdamp.bench.analysis import as_records, fold_cycles
from jaxdamp.bench.contradictions import repeats
from jaxdamp.bench.evaluation import curve
from jaxdamp.bench.evaluation.curve import WINDOW, Forces, Measurement, fastest, measured
from jaxdamp.bench.evaluation.result import Evaluation
from jaxdamp.bench.evaluation.separation import GasAndFriction, separate_gas_and_friction
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.settings import by_number, settings_apart


HELD = "Cut the part in which it is held, `process(between=(start, stop))`."


@one_thread()
def evaluate(
    runs: BenchRun | Iterable[BenchRun],
    *,
    velocities: Sequence[float] | None = None,
    method: str | None = None,
    window: float = WINDOW,
    by: Callable[[BenchRun], object] | None = None,
) -> Evaluation:
    """Evaluate records as dampers are bought and sold, every figure with its scatter over cycles or repeats.

    Arguments:
        runs: one record or several.
        velocities: at which forces are stated [m/s]; those of `OEM_VELOCITIES` that the records reach, if left out, or
            the largest that the records of all settings reach, if they reach none of these.
        method: "interpolation" between the peak forces of records; "window": of the records whose peak velocity is
            within `window` of the stated one; "loop": on the continuous loop of the fastest record. Interpolation
            where every setting has two records or more of different peak velocity, each at most six times the last, the
            loop elsewhere, if left out.
        window: share of the stated velocity.
        by: gives the setting of a record; its command, if left out. Where records without a command contradict one
            another again and again, they are told apart by what they state or by their names, or not pooled at all,
            and the notes say so.

    Raises:
        ValueError: no record, none with a full cycle, a velocity that is not positive.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear
    >>> dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=2.0)
    >>> evaluation = bench.evaluate(dyno.run([bench.SineTest(0.02, f) for f in (0.5, 1.0, 3.0)]))
    >>> ratio = evaluation.get("rebound/compression ratio", velocity=0.131)
    >>> print(f"{ratio.value:.2f}")
    2.17
    """
    _check_options(velocities, method, window)
    chosen = as_records(runs, "evaluate(runs)")
    cyclic = [run for run in chosen if run.cycles]
    if not cyclic:
        _checks.refuse("runs", "hold a record with a full cycle", f"only {', '.join(repr(r.name) for r in chosen)}")
    settings, notes = _by_settings(cyclic, by)
    notes += _notes(chosen)
    cycles = {run.name: fold_cycles(run) for run in cyclic}
    forces = Forces(settings, cycles, method or _usual_method(settings), window)
    measurements: list[Measurement] = []
    gas: dict[str, GasAndFriction] = {}
    for name, group in settings.items():
        slowest = min(group, key=lambda run: run.peak_velocity)
        measurements += _of_setting(name, forces, velocities)
        try:
            gas[name] = separate_gas_and_friction(slowest)
        except ArgumentError as error:
            notes.append(f"Gas force and friction were not separated. {error}")
        else:
            measurements += [replace(m, setting=name) for m in gas[name].measurements if np.isfinite(m.value)]
            notes += [f"{slowest.name}: {gas[name].note}"] if gas[name].note else []
    missed, added = _not_reached(velocities, forces, measurements)
    measurements, notes = measurements + added, missed + notes
    stated = tuple(sorted({m.velocity for m in measurements if m.velocity is not None}))
    return Evaluation(tuple(measurements), settings, cycles, gas, stated, forces.method, tuple(notes), window)


def _check_options(velocities: Sequence[float] | None, method: str | None, window: float) -> None:
    if method is not None:
        _checks.one_of("method", method, curve.METHODS)
    _checks.positive("window", window)
    for velocity in velocities or ():
        _checks.positive("velocities", velocity, "The direction is in the quantity.")


_NEXT = 6.0  # largest ratio of neighbouring peak velocities, between which forces are interpolated


def _usual_method(settings: Mapping[str, Sequence[BenchRun]]) -> str:
    """Interpolation where every setting has several peak velocities, none far from the next; elsewhere the loop."""
    peaks = [sorted(run.peak_velocity for run in runs) for runs in settings.values()]
    near = all(after <= _NEXT * before for each in peaks for before, after in itertools.pairwise(each))
    return "interpolation" if near and all(len(repeats(runs)) > 1 for runs in settings.values()) else "loop"


def _of_setting(name: str, forces: Forces, velocities: Sequence[float] | None) -> list[Measurement]:
    """The figures of the records at one setting, its forces at the stated velocities, its rates and knees."""
    runs, cycles = forces.settings[name], forces.cycles
    of_records = [
        Measurement(quantity, unit, *measured(values), setting=name, record=run.name)
        for run in runs
        for (quantity, unit), values in curve.cycle_figures(cycles[run.name]).items()
    ]
    record = fastest(runs).name
    return [*of_records, *forces.at(velocities, name, of_records), *curve.rates_and_knees(cycles[record], name, record)]


def _notes(runs: Sequence[BenchRun]) -> list[str]:
    """What is not evaluated, and what belongs to no place in the damper."""
    varying = [run.name for run in runs if run.command_channel is not None]
    said = [f"The command of {name} varies, so that its figures are of no one setting. {HELD}" for name in varying]
    said += [f"{run.name} has no full cycle: it is not evaluated." for run in runs if not run.cycles]
    return said + [
        f"{run.name}: the stroke was integrated from the velocity, so that forces at mid-stroke and gas force belong "
        "to the middle of the motion, wherever in the damper that is."
        for run in runs
        if run.cycles and run.stroke_is_integrated
    ]


def _by_settings(
    runs: Sequence[BenchRun], by: Callable[[BenchRun], object] | None
) -> tuple[dict[str, tuple[BenchRun, ...]], list[str]]:
    """The records of each setting, and a sentence where they are told apart by what they state or by their names."""
    notes: list[str] = []
    if by is None and all(run.commands is None for run in runs):
        apart, sentence = settings_apart(runs)
        notes += [sentence] if sentence else []
        if apart:
            runs, by = sorted(runs, key=lambda run: by_number(apart[run.name])), lambda run: apart[run.name]
    if by is None:
        runs = sorted(runs, key=lambda run: -np.inf if run.command is None else run.command)
    settings: dict[str, tuple[BenchRun, ...]] = {}
    for run in runs:
        name = _setting(run, by)
        settings[name] = (*settings.get(name, ()), run)
    return settings, notes


def _setting(run: BenchRun, by: Callable[[BenchRun], object] | None) -> str:
    if by is not None:
        return str(by(run))
    if run.command_channel is not None:
        return f"{run.command_channel.min():g} to {run.command_channel.max():g}"
    return "" if run.command is None else f"{run.command:g}"


def _not_reached(
    velocities: Sequence[float] | None, forces: Forces, measurements: Sequence[Measurement]
) -> tuple[list[str], list[Measurement]]:
    """Sentences on velocities at which no record gives a force; and forces at another one, where none was stated."""
    reached = {m.velocity for m in measurements if m.velocity is not None and np.isfinite(m.value)}
    missed = [v for v in velocities or () if v not in reached]
    if not missed and (velocities is not None or reached):
        return [], []
    low, high, where = forces.span(measurements)
    if velocities is not None:
        return [f"No force at {v:.4g} m/s: {where}." for v in missed], []
    at_velocities, instead = list[Measurement](), "Add records of other velocities."
    if low < high or forces.method == "loop":
        digits = 1 - int(np.floor(np.log10(high)))
        velocity = max(float(np.floor(high * 10.0**digits) / 10.0**digits), low)
        instead = f"Forces are stated at {velocity:.4g} m/s."
        for name in forces.settings:
            at_velocities += forces.at([velocity], name, measurements)
    usual = f"None of the usual velocities, from {curve.OEM_VELOCITIES[0]:g} m/s on, is reached"
    return [f"{usual}: {where}. {instead}"], at_velocities

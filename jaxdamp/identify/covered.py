"""What the records of a fit cover: the range in which its law is known."""

from collections.abc import Sequence

import jax
import numpy as np

from jaxdamp.bench import BenchRun, initial_temperature
from jaxdamp.dampers import FittedRange
from jaxdamp.identify.model import Model, law_of, rig_of
from jaxdamp.rig import gas_and_friction


def joined_range(ranges: Sequence[FittedRange]) -> FittedRange:
    """The lowest and highest of several ranges."""
    names = {q.name for each in ranges for q in each.known()}
    limits = {name: [q.limits for each in ranges for q in each.known() if q.name == name] for name in names}
    return FittedRange(
        **{name: (min(low for low, _ in both), max(high for _, high in both)) for name, both in limits.items()}
    )


def covered_range(runs: Sequence[BenchRun], models: Model | Sequence[Model] | None = None) -> FittedRange:
    """Lowest and highest value of each channel over all records, and of temperature and command if stated.

    Stroke and force are those of the law, without what the fitted machine adds: offsets, gas, friction, inertia. If the
    law depends on the temperature, the one at the start of the records counts too.

    Arguments:
        runs: the records.
        models: the fitted law on its machine, of all or of each record.

    >>> from jaxdamp import bench, dampers
    >>> runs = bench.VirtualDyno(dampers.Linear(1500.0)).run([bench.SineTest(0.01, f) for f in (1.0, 3.0)])
    >>> covered_range(tuple(runs)).words()
    'velocity −0.188 to 0.188 m/s, stroke −10 to 10 mm, frequency 1 to 3 Hz, force −283 to 283 N'
    """
    each = models if isinstance(models, Sequence) else [models] * len(runs)
    inside = [_without_machine(run, model) for run, model in zip(runs, each, strict=True)]
    channels = {"velocity": [run.velocity for run in runs]}
    channels["stroke"], channels["force"] = ([*values] for values in zip(*inside, strict=True))
    channels["frequency"] = [np.array([run.frequency]) for run in runs]
    channels["temperature"] = _temperatures(runs, each[0])
    channels["command"] = [run.commands for run in runs if run.commands is not None]
    joined = {name: np.concatenate(values) for name, values in channels.items() if values}
    limits = {name: (float(values.min()), float(values.max())) for name, values in joined.items()}
    return FittedRange(**limits)


def _temperatures(runs: Sequence[BenchRun], model: Model | None) -> list[np.ndarray]:
    """The measured temperatures [K]; if there are none and the law depends on them, those at the start."""
    warms = model is not None and law_of(model).traits().temperature_dependent
    measured = [run.temperature for run in runs if run.temperature is not None]
    if measured or not warms:
        return measured
    return [np.array([t]) for run in runs if (t := initial_temperature(run)) is not None]


def _without_machine(run: BenchRun, model: Model | None) -> tuple[np.ndarray, np.ndarray]:
    """Stroke and force of a record as the law has them; delay, lag and heat of the machine are not undone."""
    rig = None if model is None else rig_of(model)
    if rig is None:
        return run.stroke, run.force
    rig = jax.tree.map(np.asarray, rig)
    gas, friction = gas_and_friction(rig, run.stroke, run.velocity)
    inertia = rig.moving_mass * np.gradient(run.velocity, run.time)
    return run.stroke - rig.stroke_offset, run.force - rig.force_offset - gas - friction - inertia

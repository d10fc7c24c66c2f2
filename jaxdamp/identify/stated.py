"""What records state for a law beside their motion: what was set on the damper, and how warm it is."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, initial_temperature, number_and_unit, ratio, refuse_misspelt
from jaxdamp.dampers import (
    AbstractDamper,
    Scheduled,
    check_commands,
    command_paths,
    laws_inside,
    takes_command,
    values_at_start,
    with_command,
)
from jaxdamp.identify.model import Model, effects_of, law_of, rig_of
from jaxdamp.identify.rows import channel, refuse_units
from jaxdamp.parameters import Parameter, matching, parameters, with_values


COMMAND_REMEDY = 'Pass it when reading, `bench.read(..., command={"*_0.5A": 0.5})`.'
TEMPERATURE = "temperature"  # a setting that is how warm the damper begins, whatever parameters are named so
APART = "Fit those with and those without it apart."


def stated_values(model: Model, runs: Sequence[BenchRun]) -> dict[str, list[float]]:
    """Values that the records state for the model, by path.

    The command, if the law has one and it is held in all; the temperature at the start, if it says something of the
    force and no record has a channel of it; and parameters that settings state (`stated_parameters`).
    """
    commands, law = [run.command for run in runs if run.command is not None], law_of(model)
    warm = _temperatures(model, runs) | stated_parameters(model, runs)
    if not takes_command(law) or not commands or _vary(runs):
        return warm
    refuse_lacking("command", [run for run in runs if run.command is None], COMMAND_REMEDY)
    for command in set(commands):
        with_command(law, command)  # refuses what is out of range
    return warm | dict.fromkeys(command_paths(model), commands)


def stated_parameters(model: Model, runs: Sequence[BenchRun]) -> dict[str, list[float]]:
    """Parameters of the model that settings of the records name, by path, in the unit of the parameter.

    Such as `settings={"gas.pressure": "20 bar"}`: a number with a unit, by the name or its last part.

    Refused are a number without a unit of the parameter or outside its domain, records of which only some state it, and
    a misspelt name.
    """
    names = {name for run in runs for name in run.settings if name != TEMPERATURE}
    if not names:
        return {}
    by_path = {p.path: p for p in parameters(law_of(model))}
    for name in names:
        if not matching([*by_path], name):
            refuse_misspelt(name, [TEMPERATURE, *by_path, *(path.rpartition(".")[2] for path in by_path)])
    inside = "" if law_of(model) is model else "law."
    return {
        inside + path: _of_records(name, by_path[path], runs) for name in names for path in matching([*by_path], name)
    }


def _of_records(name: str, parameter: Parameter, runs: Sequence[BenchRun]) -> list[float]:
    """The values of a parameter that all records state, in its unit."""
    refuse_lacking(name, [run for run in runs if name not in run.settings], APART)
    values = []
    for run in runs:
        number, unit = number_and_unit(run.settings[name])
        factor = (ratio(unit, parameter.unit) if unit else None) if parameter.unit else float(not unit)
        if number is None or not factor:
            given, must = repr(run.settings[name]), f"state {name} of {run.name!r} in a unit of it"
            remedy = f'Write it like `settings={{"{name}": "2 {parameter.unit}"}}`, or name the setting otherwise:'
            remedy += " it is a parameter of the law."
            _checks.refuse("settings", must, given, remedy)
        values.append(number * factor)
    if not parameter.domain.contains(np.array(values)):
        _checks.refuse("settings", f"have {name} {parameter.domain.name}", ", ".join(f"{v:g}" for v in values))
    return values


def _temperatures(model: Model, runs: Sequence[BenchRun]) -> dict[str, list[float]]:
    """The numbers that the temperature of each record sets, by path; none where channels of it are followed."""
    warms = law_of(model).traits().temperature_dependent or "heat" in effects_of(model)
    if not warms or any(run.temperature is not None for run in runs):
        return {}
    kelvins = {run: initial_temperature(run) for run in runs}
    if all(kelvin is None for kelvin in kelvins.values()):
        return {}
    remedy = f'State it, `settings={{"temperature": "20 degC"}}`. {APART}'
    refuse_lacking("temperature", [run for run, kelvin in kelvins.items() if kelvin is None], remedy)
    each = [at_start(model, kelvin) for run in runs if (kelvin := kelvins[run]) is not None]
    return {path: [values[path] for values in each] for path in each[0]}


def at_start(model: Model, kelvin: float) -> dict[str, float]:
    """The numbers of a model that a temperature [K] at the start of a record sets, by path; none without an effect."""
    values, rig = values_at_start(model, kelvin), rig_of(model)
    if rig is not None and "heat" in rig.effects():
        values |= {"rig.initial_rise": kelvin - rig.reference_temperature}
    return {path: float(np.asarray(value)) for path, value in values.items()}


def with_stated(model: Model, stated: Mapping[str, Sequence[float]]) -> Model:
    """The model with the mean of what records state, apart from laws at levels of a command, which have their own."""
    levels = tuple(prefix for prefix, law in laws_inside(model) if isinstance(law, Scheduled))
    return with_values(model, {p: np.mean(v) for p, v in stated.items() if not (levels and p.startswith(levels))})


def start_paths(model: Model) -> list[str]:
    """Paths of the parameters that say only how warm a record begins, of laws and machines that warm up themselves."""
    paths = {p.path for p in parameters(model)}
    return [path for path in at_start(model, 293.15) if path in paths]


def gas_charges(law: AbstractDamper) -> list[tuple[str, AbstractDamper]]:
    """The laws inside whose static force has a meaning of its own, such as a gas charge, by the prefixes of paths."""
    parts = [(prefix, part) for prefix, part in laws_inside(law) if not part.inner_laws()]
    return [(prefix, part) for prefix, part in parts if part.traits().contains_offset and not part.constant_forces()]


def charged_apart(law: AbstractDamper, runs: Sequence[BenchRun]) -> bool:
    """Whether the records state several values of a gas charge, so that a constant force is told from it."""
    prefixes = tuple(prefix for prefix, _ in gas_charges(law))
    stated = stated_parameters(law, runs).items() if prefixes else ()
    return any(np.ptp(values) > 0.0 for path, values in stated if path.startswith(prefixes))


def _vary(runs: Sequence[BenchRun]) -> bool:
    """Whether the command varies in one of the records."""
    return any(run.command_channel is not None for run in runs)


def refuse_lacking(what: str, runs: Sequence[BenchRun], remedy: str) -> None:
    """Refuse those of the records that do not state what others do, if there are any."""
    if runs:
        lacking = ", ".join(run.name for run in runs)
        _checks.refuse("runs", f"all state their {what}", f"without one: {lacking}", remedy)


def followed_channels(model: Model, runs: Sequence[BenchRun]) -> list[str]:
    """The channels that a model is compared with, the temperature among them if it says something of the force."""
    channels, rig = ["stroke", "velocity", "force"], rig_of(model)
    law = law_of(model)
    varying = ["command"] if takes_command(law) and _vary(runs) else []
    if varying:
        refuse_lacking("commands", [run for run in runs if run.commands is None], COMMAND_REMEDY)
        refuse_units(runs)
        for run in runs:
            check_commands(f"command of {run.name!r}", law, channel(run, "command"))
    slopes = () if rig is None else (rig.temperature_slope, rig.gas_temperature_slope)
    warms = law.traits().temperature_dependent or any(np.any(np.asarray(slope)) for slope in slopes)
    if not warms or all(run.temperature is None for run in runs):
        return channels + varying
    _check_temperatures(runs)
    return [*channels, "temperature", *varying]


def _check_temperatures(runs: Sequence[BenchRun]) -> None:
    """Refuse records without a measured temperature, and those that have it in degrees Celsius."""
    refuse_lacking("temperature", [run for run in runs if run.temperature is None], APART)
    for run in runs:
        _checks.kelvin(f"temperature of {run.name!r}", channel(run, "temperature"))

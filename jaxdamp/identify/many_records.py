"""The records of many dampers: what a call gives as such, what a fit takes of them, and where all fits start."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, DamperRecords, as_runs, usable
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.contradicting import contradicting, refuse_contradicting
from jaxdamp.identify.machine import absent_paths, started_on
from jaxdamp.identify.model import Model, on_rig, own_names
from jaxdamp.identify.starting import Start
from jaxdamp.identify.stated import start_paths, stated_parameters, stated_values
from jaxdamp.parameters import FreeParameters, free_parameters


CALL = 'fit_many(law, {"A": runs_of_a, "B": runs_of_b})'
Options = Mapping[str, Any]  # of a call
AllRecords = Mapping[str, tuple[BenchRun, ...]]


def by_name(dampers: object) -> AllRecords:
    """The records of each damper by name, those of `bench.DamperRecords` unread."""
    if isinstance(dampers, DamperRecords) and len(dampers):
        return dampers
    if isinstance(dampers, Mapping):
        pairs = [(str(name), runs) for name, runs in dampers.items()]
    elif isinstance(dampers, Iterable) and not isinstance(dampers, str | BenchRun):
        pairs = [(str(i), runs) for i, runs in enumerate(dampers)]
    else:
        _checks.refuse("dampers", "be the records of each damper", _checks.described(dampers), f"The call is `{CALL}`.")
    if not pairs:
        _checks.refuse("dampers", "hold at least one damper", "empty")
    return {name: as_runs(runs, f"dampers[{name!r}]") for name, runs in pairs}


def fitted_records(name: str, runs: tuple[BenchRun, ...], options: Options) -> tuple[BenchRun, ...]:
    """The records of a damper that its fit takes.

    Arguments:
        name: of the damper.
        runs: its records.
        options: of `fit_many`.

    Raises:
        ValueError: a record with an error, or a force that does not vary.
    """
    argument = f"dampers[{name!r}]"
    if not any(np.ptp(run.force) > 0 for run in runs):
        _checks.refuse(argument, "hold records with a force that varies", f"{len(runs)} without")
    return usable(runs, options["bad_records"], robust=options["loss"] != "squares", argument=argument)


def refuse_several_laws(name: str, runs: tuple[BenchRun, ...], model: Model, options: Options) -> None:
    """Refuse records of one damper that no one law can follow, unless they are to be kept, or begin by themselves.

    Records that state parameters of the law are refused, too.
    """
    if paths := list(stated_parameters(model, runs)):
        remedy = "Fit such dampers one by one, with `fit`, or leave this setting out."
        must = "have records that state no parameter of the law"
        _checks.refuse(f"dampers[{name!r}]", must, ", ".join(paths), remedy)
    if options["bad_records"] != "keep" and options["initial_state"] != "estimated":
        refuse_contradicting(contradicting(model, runs), f"dampers[{name!r}]")


class Beginning(NamedTuple):
    """Where the fits of all dampers start."""

    law: AbstractDamper
    model: Model  # with the machine
    free: FreeParameters


def begun_on(law: Start, runs: Sequence[BenchRun], options: Options, shared: Iterable[str] = ()) -> Beginning:
    """The start that some records give.

    Arguments:
        law: the start as it was given.
        runs: the records.
        options: of `fit_many`.
        shared: names of parameters that are shared.
    """
    bounds, priors, tie = (options[name] for name in ("bounds", "priors", "tie"))
    named = [*(bounds or ()), *(priors or ()), *(tie or ()), *shared]
    begun, machine, held = started_on(law, runs, options["rig"], named)
    model = on_rig(begun, machine)
    stated = stated_values(model, runs)  # temperatures that the records begin with
    held = (*held, *(path for path in start_paths(model) if path in stated))
    names = own_names(model)
    freeze = (*names.find("freeze", options["freeze"]), *absent_paths(machine), *held)
    limits, tied = names.find_keys("bounds", bounds), names.find_keys("tie", tie)
    free = free_parameters(model, freeze=freeze, bounds=limits, tie=tied)
    _checks.finite("law", free.values)
    return Beginning(begun, model, free)

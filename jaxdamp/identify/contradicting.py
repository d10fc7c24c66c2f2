"""Records that no one law can follow: the same motion, but another force."""

from collections.abc import Sequence

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, Contradiction, contradictions, initial_temperature, pairs_in_words
from jaxdamp.dampers import takes_command
from jaxdamp.identify.model import Model, effects_of, law_of
from jaxdamp.identify.settings import FitSettings
from jaxdamp.identify.stated import stated_parameters


def contradicting(model: Model, runs: Sequence[BenchRun]) -> list[Contradiction]:
    """Records with the same motion but different forces, where the records state nothing else that the model follows.

    A law may take a command; a law or a machine may depend on the temperature; records may state a parameter of the
    law, such as a gas pressure. All count if all records state them.
    """
    law = law_of(model)
    warms = law.traits().temperature_dependent or "heat" in effects_of(model)
    if warms and all(initial_temperature(run) is not None for run in runs):
        return []
    same_command = takes_command(law) and all(run.commands is not None for run in runs)
    stated = stated_parameters(model, runs).values()
    groups: dict[tuple[float, ...], list[BenchRun]] = {}
    for i, run in enumerate(runs):
        groups.setdefault(tuple(values[i] for values in stated), []).append(run)
    return [pair for group in groups.values() for pair in contradictions(group, same_command=same_command)]


def refuse_several_laws(model: Model, runs: Sequence[BenchRun], settings: FitSettings, argument: str = "runs") -> None:
    """Refuse records that no one law can follow, unless they are to be kept or have own numbers."""
    if settings["bad_records"] != "keep" and not settings["per_record"] and settings["initial_state"] != "estimated":
        refuse_contradicting(contradicting(model, runs), argument)


def refuse_contradicting(contradictions: Sequence[Contradiction], argument: str = "runs") -> None:
    """Refuse to fit one law to records that contradict each other, if there are any."""
    if not contradictions:
        return
    remedy = (
        "If settings were mixed, state them as the `command` of the records and use `fit_scheduled`, or give each to "
        '`fit_many` as a damper of its own; `bad_records="keep"` pools them.'
    )
    is_ = f"of the same motion with different forces: {pairs_in_words(contradictions)}"
    _checks.refuse(argument, "be records that one law can follow", is_, remedy)

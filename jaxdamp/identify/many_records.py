"""The records of many dampers: what a call gives as such, what a fit takes of them, and where all fits start."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._settings import part
from jaxdamp._types import Scalar, State
from jaxdamp._warned import warn
from jaxdamp.bench import BenchRun, DamperRecords, as_runs, usable
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.machine import Machine
from jaxdamp.identify.preparing import Beginning, begun
from jaxdamp.identify.settings import FREE, PROBLEM, FitSettings, ProblemSettings
from jaxdamp.identify.starting import Start


CALL = 'fit_many(law, {"A": runs_of_a, "B": runs_of_b})'
AllRecords = Mapping[str, tuple[BenchRun, ...]]


class Options(FitSettings, total=False):
    """What a call asks of each fit."""

    rig: Machine


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
    name, times = Counter(name for name, _ in pairs).most_common(1)[0]
    if times > 1 or any(name == "" for name, _ in pairs):
        is_ = f"{times} times {name!r}" if times > 1 else "''"
        _checks.refuse("dampers", "have names that are different as texts and not empty", is_, "Rename one of them.")
    return {name: as_runs(runs, f"dampers[{name!r}]") for name, runs in pairs}


def fitted_records(name: str, runs: tuple[BenchRun, ...], options: Options) -> tuple[BenchRun, ...]:
    """The records of a damper that its fit takes; one with an error, or forces that do not vary, are refused."""
    argument = f"dampers[{name!r}]"
    if not any(np.ptp(run.force) > 0 for run in runs):
        _checks.refuse(argument, "hold records with a force that varies", f"{len(runs)} without")
    return usable(runs, options["bad_records"], robust=options["loss"] != "squares", argument=argument)


def left_out_in_words(names: Sequence[str]) -> str:
    """What is said of a damper some of whose records were left out because of an error; empty if none were."""
    return f"it was fitted without {', '.join(map(repr, names))}: records with an error" if names else ""


def warn_of_left_out(names: Sequence[str], count: int) -> None:
    """Warn of dampers that have no fit, some of so many."""
    if names:
        some = ", ".join(names[:5]) + ", …" * (len(names) > 5)
        warn(f"{len(names)} of {count} dampers were left out: {some}. `many.remarks` says why.")


def begun_on(law: Start, runs: Sequence[BenchRun], options: Options, shared: Iterable[str] = ()) -> Beginning:
    """The start that some records give."""
    how: ProblemSettings = {**PROBLEM, **part(options, FREE)}
    return begun(law, runs, [1.0] * len(runs), options["rig"], how, mentioned=shared)


def code_of(law: AbstractDamper) -> str:
    """A text that changes with the code of a law, also of one of your own, but not with its numbers."""
    arrays, others = eqx.partition(law, eqx.is_array)

    def force_and_step(arrays: PyTree, x: Scalar, v: Scalar, dt: Scalar, state: State) -> tuple[Scalar, State]:
        whole = eqx.combine(arrays, others)
        return whole.force(x, v, state), whole.advance(x, v, x, v, state, dt)

    one = np.ones((), jnp.result_type(float))
    program = jax.make_jaxpr(force_and_step)(arrays, one, one, one, law.initial_state())
    return hashlib.sha256(re.sub(r"0x[0-9a-f]+", "", str(program)).encode()).hexdigest()[:12]

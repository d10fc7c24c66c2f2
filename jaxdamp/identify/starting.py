"""What a fit can start from: a law, a class of laws, or a function that makes a law from records."""

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import numpy as np

from jaxdamp import _checks, dampers
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges


Start = AbstractDamper | type[AbstractDamper] | Callable[..., AbstractDamper]
CHANNELS = ("velocity", "force", "stroke", "time")


def started(law: Start, runs: Sequence[BenchRun]) -> AbstractDamper:
    """An instance to start from, without the ranges of earlier fits.

    A class starts by its `from_runs(runs)` if it has one, otherwise by its `guess`. They and any function are given
    what their arguments name: `runs`, or the samples of all records one after the other as `velocity`, `force`,
    `stroke`, `time`. The first two need not have these names.
    """
    check_start("law", law)
    if isinstance(law, AbstractDamper):
        return without_fitted_ranges(law)
    make: Any = law
    if isinstance(law, type):
        make = getattr(law, "from_runs", None) or getattr(law, "guess", None)
        if make is None:
            remedy = f"Pass an instance, `{law.__name__}(...)`, as the start."
            _checks.refuse("law", "know how to start from data", f"the class {law.__name__} without `guess`", remedy)
    names = inspect.signature(make).parameters
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", np.exceptions.RankWarning)
        if "runs" in names:
            return without_fitted_ranges(make(tuple(runs)))
        channels = {name: np.concatenate([getattr(run, name) for run in runs]) for name in CHANNELS}
        asked = {name: channels[name] for name in ("stroke", "time") if name in names}
        return without_fitted_ranges(make(channels["velocity"], channels["force"], **asked))


def check_start(argument: str, law: Any) -> None:
    """Refuse anything that no fit can start from."""
    if isinstance(law, AbstractDamper) or (isinstance(law, type) and issubclass(law, AbstractDamper)):
        return
    if isinstance(law, str):
        laws = [name for name in dampers.__all__ if isinstance(getattr(dampers, name), type(AbstractDamper))]
        known = next((name for name in laws if name.lower() == law.lower().replace("_", "")), None)
        remedy = f"Write `dampers.{known}`." if known else f"Write `default_ladder(runs, [{law!r}])[{law!r}]`."
    elif callable(law) and not isinstance(law, type | BenchRun | eqx.Module):
        return
    else:
        remedy = (
            "The calls are `fit(law, runs)` and `compare(laws, runs)`, with `dampers.Besinger` for instance as law."
        )
    must = "be a law, a class of laws, or a function that makes a law of velocities and forces"
    _checks.refuse(argument, must, _checks.described(law), remedy)


def check_starts(laws: Any, call: str) -> None:
    """Refuse anything that is not laws by name."""
    example = "{'linear': dampers.Linear, 'besinger': dampers.Besinger}"
    if not isinstance(laws, Mapping):
        names = isinstance(laws, list | tuple) and all(isinstance(name, str) for name in laws)
        ladder = f"`default_ladder(runs, {list(laws)})`" if names and laws else "`default_ladder(runs)`"
        remedy = f"The call is `{call}`; write {ladder} or {example}."
        _checks.refuse("laws", "be laws by name", _checks.described(laws), remedy)
    if not laws:
        _checks.refuse("laws", "hold at least one law", "empty", f"Take `default_ladder(runs)` or {example}.")
    for name, law in laws.items():
        check_start(f"laws[{name!r}]", law)

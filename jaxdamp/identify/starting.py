"""Starts of a fit: a law, a class of laws, or a function that makes a law from records."""

import inspect
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import numpy as np

from jaxdamp import _checks, dampers
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, from_samples, without_fitted_ranges


class AbstractTrainedStart(ABC):
    """A function of records that trains a law, of which a fit then changes only a part."""

    @property
    @abstractmethod
    def freeze(self) -> tuple[str, ...]:
        """The parameters that a fit holds at the values of the training."""

    @abstractmethod
    def untrained(self, runs: Sequence[BenchRun]) -> AbstractDamper:
        """The law before its training."""

    @abstractmethod
    def __call__(self, runs: Sequence[BenchRun]) -> AbstractDamper:
        """The trained law."""


Start = AbstractDamper | type[AbstractDamper] | Callable[..., AbstractDamper]


def started(law: Start, runs: Sequence[BenchRun]) -> AbstractDamper:
    """An instance to start from, without the ranges of earlier fits.

    A class starts by its `from_runs`. A function with an argument `runs` gets the records; any other function gets the
    samples of all records one after the other: velocity, force, and `stroke` and `time` if it has such arguments.
    """
    check_start("law", law)
    if isinstance(law, AbstractDamper):
        return without_fitted_ranges(law)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", np.exceptions.RankWarning)
        if isinstance(law, type):
            return without_fitted_ranges(law.from_runs(tuple(runs)))
        takes_runs = "runs" in inspect.signature(law).parameters
        return without_fitted_ranges(law(tuple(runs)) if takes_runs else from_samples(law, runs))


def frozen_by(law: Start) -> tuple[str, ...]:
    """The parameters that a start asks a fit to hold."""
    return law.freeze if isinstance(law, AbstractTrainedStart) else ()


def check_start(argument: str, law: object) -> None:
    """Refuse anything that is not a start of a fit."""
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

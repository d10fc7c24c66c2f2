"""What comparisons of laws and of vehicles share: the recommended one, and fits side by side."""

import dataclasses
import functools
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ClassVar, Generic, TypeVar, cast

import jax
import jax.numpy as jnp

from jaxdamp import _second_process
from jaxdamp._one_thread import usable_cores
from jaxdamp._results import AbstractResult
from jaxdamp._status import Status
from jaxdamp._tables import Cell, Column, Contents, Table, with_unit
from jaxdamp.bench import BenchRun, RideRecord
from jaxdamp.identify.rungs import Failure, R, Recommendation, recommendation
from jaxdamp.parameters import matching


NAMED = ("over", "freeze", "per_record", "bounds", "priors", "tie")  # options that name parameters
MOST_THREADS = 4  # fits side by side: more of them wait for Python's lock

D = TypeVar("D", BenchRun, RideRecord)
C = TypeVar("C", bound="AbstractComparison")  # not `Self`, which run-time type checks refuse
Names = str | Sequence[str] | Mapping[str, object] | None
Start = TypeVar("Start")
Outcome = TypeVar("Outcome")
V = TypeVar("V")  # of options


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class AbstractComparison(AbstractResult, Generic[R, D]):
    """Laws or vehicles fitted to the same records, in the order given.

    Attributes:
        rungs: those that were fitted, with their errors.
        held_out: the records or drives scored on, not fitted; empty if parts of the fitted ones were held out.
        failed: those without a fit, and why.
        kind: what is compared, in a word.
    """

    rungs: tuple[R, ...]
    held_out: tuple[D, ...] = ()
    failed: tuple[Failure, ...] = ()
    kind: ClassVar[str]
    _title: ClassVar[str]  # of the table
    _error: ClassVar[Column]  # by which they are ranked

    @classmethod
    def of(cls: type[C], outcomes: Iterable[R | Failure], held_out: Iterable[D] = ()) -> C:
        """The comparison of the outcomes of fits.

        Raises:
            ValueError: nothing could be fitted.
        """
        outcomes = tuple(outcomes)
        failed = tuple(one for one in outcomes if isinstance(one, Failure))
        rungs = tuple(one for one in outcomes if not isinstance(one, Failure))
        if not rungs:
            reasons = list(dict.fromkeys(failure.reason for failure in failed))
            texts = reasons if len(reasons) == 1 else [f"{failure.name}: {failure.reason}" for failure in failed]
            one = f"The {cls.kind} {failed[0].name} could not" if len(failed) == 1 else ""
            raise ValueError(f"{one or f'None of {len(failed)} {cls.kind}s could'} be fitted. {' '.join(texts)}")
        return cls(rungs, tuple(held_out), failed)

    @property
    @abstractmethod
    def verdict(self) -> tuple[str, ...]:
        """Sentences on the recommended one and why it is this one."""

    def _shares(self, rung: R) -> dict[str, float]:
        """Shares of its squared error [%], by name."""
        return {}

    def table(self) -> Table:
        """Each with its number of free parameters, its errors, their shares if there are any, and remarks."""
        held, (error, unit, spec) = any(rung.held_out_rmse is not None for rung in self.rungs), self._error
        columns = [Column(self.kind), Column("free", spec="d"), Column("fit", "%", ".1f"), self._error]
        columns += [Column("held-out fit", "%", ".1f"), Column(f"held-out {error}", unit, spec)] * held
        columns += [*(Column(share, "%", ".0f") for share in self._shares(self.rungs[0])), Column("note")]
        rows: list[tuple[Cell, ...]] = []
        for rung in self.rungs:
            errors = (rung.fit_percent, rung.rmse, *(rung.held_out_fit_percent, rung.held_out_rmse) * held)
            note = ", ".join(filter(None, ["recommended" * (rung is self.best), rung.doubt]))
            rows.append((rung.name, rung.parameters, *errors, *self._shares(rung).values(), note))
        rows += [(failure.name, *[None] * (len(columns) - 2), "failed") for failure in self.failed]
        return Table(self._title, tuple(columns), tuple(rows))

    def held_out_errors(self, rung: R) -> Contents:
        """The errors of one on motion held out, as plain data."""
        error, unit, _ = self._error
        fit = with_unit(rung.held_out_fit_percent, "%")
        return {"held_out_fit": fit, f"held_out_{error.lower()}": with_unit(rung.held_out_rmse, unit)}

    @property
    def summary(self) -> str:
        """The recommended one and its errors: the first sentence of the verdict."""
        return self.verdict[0]

    def content(self) -> Contents:
        """All fits as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        return {
            "best": self.best.name,
            "best_fit": self.best_fit.name,
            "verdict": list(self.verdict),
            "held_out": [record.name for record in self.held_out],
            f"{self.kind}s": {
                rung.name: {**rung.result.to_dict(), **self.held_out_errors(rung)} for rung in self.rungs
            },
            "failed": {failure.name: failure.reason for failure in self.failed},
        }

    @functools.cached_property
    def recommendation(self) -> Recommendation[R]:
        """The recommended one, those that predict as well, and those left aside."""
        return recommendation(self.rungs)

    @property
    def best(self) -> R:
        """The recommended one: the simplest that predicts motion held out as well as any, within the noise.

        It has no numbers at bounds or not identifiable, and its search converged, where another is as good
        (`recommendation`).
        """
        return self.recommendation.rung

    @property
    def best_fit(self) -> R:
        """The one with the smallest error on the fitted records, however many numbers it needs."""
        return min(self.rungs, key=lambda rung: rung.rmse)

    @property
    def status(self) -> Status:
        """How the search of the recommended one ended."""
        return self.best.result.status

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of all fits, which concern the records, such as contradicting records."""
        first, *others = (rung.result.warnings for rung in self.rungs)
        return tuple(warning for warning in first if all(warning in warnings for warnings in others))

    def rung(self, name: str) -> R:
        """The one of that name.

        Raises:
            KeyError: an unknown name, or one that has no fit.
        """
        for rung in self.rungs:
            if rung.name == name:
                return rung
        why = "".join(f" {failure.name} failed: {failure.reason}" for failure in self.failed if failure.name == name)
        names = ", ".join(rung.name for rung in self.rungs)
        raise KeyError(f"No {self.kind} is named {name!r}; there are {names}.{why}")


def side_by_side(
    fitted: Callable[[str, Start], Outcome], starts: Mapping[str, Start], progress: Callable[[str], None]
) -> Iterator[Outcome]:
    """The outcome of each start in their order, as soon as it is available, several in threads at the same time."""
    # A thread begins with the precision of the process, not with that of its caller.
    double = jnp.result_type(float) == jnp.float64
    processes = _second_process.count()
    count = 1 + processes if processes else min(usable_cores(), MOST_THREADS)
    outcomes = {name: Future[Outcome]() for name in starts}
    left = deque(starts)

    def work(number: int) -> None:
        """The first thread begins with the simplest, whose results come first, others with what takes longest."""
        while left:
            try:
                name = left.pop() if number and processes else left.popleft()
            except IndexError:
                return
            try:
                with jax.enable_x64(double):
                    outcomes[name].set_result(fitted(name, starts[name]))
            except BaseException as error:
                outcomes[name].set_exception(error)

    pool = ThreadPoolExecutor(max_workers=count)
    try:
        for number in range(count):
            pool.submit(work, number)
        for name, outcome in outcomes.items():
            progress(name)
            yield outcome.result()
    finally:
        left.clear()
        pool.shutdown()


def naming_only(options: Mapping[str, V], paths_of_law: Sequence[str], every: Iterable[Sequence[str]]) -> dict[str, V]:
    """Options of a fit that name only parameters that the law or the vehicle has, or that none has: that is refused.

    `own` are the paths of the parameters of this one, `every` those of each of the comparison.
    """
    paths = [*every]
    named = {
        name: cast(V, _of(paths_of_law, paths, cast(Names, value))) for name, value in options.items() if name in NAMED
    }
    return {**options, **named}


def _of(own: Sequence[str], every: Sequence[Sequence[str]], names: Names) -> Names:
    """The names of parameters that this one has, or none of the others, which its fit then refuses."""
    if names is None:
        return None

    def counts(name: str) -> bool:
        return bool(matching(own, name)) or not any(matching(paths, name) for paths in every)

    if isinstance(names, Mapping):
        return {name: value for name, value in names.items() if counts(name)}
    return [name for name in ([names] if isinstance(names, str) else names) if counts(name)]

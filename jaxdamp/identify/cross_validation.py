"""`cross_validate`: every record is predicted by laws fitted to the others."""

import dataclasses
import itertools
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._results import AbstractResult, drawn_by, worst_status
from jaxdamp._status import Status
from jaxdamp._tables import Column, Contents, Table, plain, with_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, as_runs, usable
from jaxdamp.identify.fitting import fit
from jaxdamp.identify.law_result import AbstractFitted
from jaxdamp.identify.machine import OFFSET, Machine
from jaxdamp.identify.preparing import weights
from jaxdamp.identify.rungs import cannot_choose
from jaxdamp.identify.starting import Start, check_starts
from jaxdamp.parameters import parameters


CHOICE = ("held_out", "group", "law", "fit_percent", "rmse")  # of a fold, for a law that was chosen


class Fold(NamedTuple):
    """One law fitted without one record, or without two for a nested choice."""

    law: str
    group: Hashable
    held_out: str
    fit_percent: float  # of the record held out
    rmse: float  # of the record held out, N
    result: Any
    also_out: str | None = None  # a second record without part in the fit, for which a law is chosen by this score


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class CrossValidation(AbstractResult):
    """How well laws predict records that they were not fitted to. Results of the same records are joined with `+`.

    Attributes:
        folds: for each law and each record held out the fit and its errors.
        inner: of a nested choice, the same for the records that remain when one is held out.
    """

    folds: tuple[Fold, ...]
    inner: tuple[Fold, ...] = ()  # of a nested choice

    @property
    def laws(self) -> tuple[str, ...]:
        """Names in the order given."""
        return tuple(dict.fromkeys(fold.law for fold in self.folds))

    @property
    def groups(self) -> tuple[Hashable, ...]:
        """Groups in the order of their records."""
        return tuple(dict.fromkeys(fold.group for fold in self.folds))

    def fit_percent(self, law: str, group: Hashable = None) -> float:
        """Mean over the records held out, of one group or of all."""
        return float(np.mean([fold.fit_percent for fold in self._of(law, group)]))

    def rmse(self, law: str, group: Hashable = None) -> float:
        """Root of the mean squared error over the records held out [N], every record counted the same."""
        return float(np.sqrt(np.mean([fold.rmse**2 for fold in self._of(law, group)])))

    @property
    def best(self) -> str:
        """The law with the highest mean fit percent."""
        return max(self.laws, key=self.fit_percent)

    @property
    def status(self) -> Status:
        """How the searches ended: the first that did not converge, if any."""
        return worst_status(fold.result.status for fold in self.folds)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The fits whose search did not converge."""
        failed = (fold for fold in self.folds if fold.result.status is not Status.CONVERGED)
        return tuple(f"{fold.law} without {fold.held_out}: {fold.result.status.sentence}" for fold in failed)

    @property
    def summary(self) -> str:
        """The best law: the first sentence of the verdict."""
        return self.verdict[0]

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences on the best law, and on those that the records cannot tell from it."""
        errors = {law: [fold.rmse for fold in self._of(law, None)] for law in self.laws}
        numbers = {law: sum(p.value.size for p in parameters(self._of(law, None)[0].result.law)) for law in self.laws}
        best = self.best
        lead = f"Best on records that were held out: {best}, fit {self.fit_percent(best):.1f} % in the mean."
        sentences = [lead, *cannot_choose(errors, best, numbers)]
        if self.inner:
            laws = ", ".join(dict.fromkeys(choice.law for choice in self.choices))
            sentences.append(
                f"Chosen without the record that is scored ({laws}): fit {self.chosen_fit_percent:.1f} % in the mean."
            )
        return tuple(sentences)

    @property
    def choices(self) -> tuple[Fold, ...]:
        """For each record the law with the highest mean fit on all other records, and the score of this law on it.

        In the group of the record, the fits to choose by leave out the record itself besides the one they are scored
        on; fits of other groups never contain it. Needs `cross_validate(..., nested=True)`.
        """
        if not self.inner:
            raise ValueError("There are no fits to choose by: call `cross_validate(..., nested=True)`.")
        return tuple(self._chosen_without(fold) for fold in self._of(self.laws[0], None))

    def _chosen_without(self, scored: Fold) -> Fold:
        """Of the law with the highest mean fit on the other records, the fold of this record."""
        out, group = scored.held_out, scored.group

        def score(law: str) -> float:
            means = [self.fit_percent(law, other) for other in self.groups if other != group]
            same_group = [f.fit_percent for f in self.inner if (f.law, f.group, f.also_out) == (law, group, out)]
            return float(np.mean([*means, float(np.mean(same_group))]))

        (chosen,) = (f for f in self._of(max(self.laws, key=score), group) if f.held_out == out)
        return chosen

    @property
    def chosen_fit_percent(self) -> float:
        """Mean fit of records predicted by laws that were chosen, as well as fitted, without them."""
        return float(np.mean([choice.fit_percent for choice in self.choices]))

    def _of(self, law: str, group: Hashable) -> list[Fold]:
        folds = [f for f in self.folds if f.law == law and (group is None or f.group == group)]
        if not folds:
            raise KeyError(f"No folds of {law!r} in {group!r}; laws: {self.laws}, groups: {self.groups}.")
        return folds

    def __add__(self, other: "CrossValidation") -> "CrossValidation":
        return CrossValidation(self.folds + other.folds, self.inner + other.inner)

    plot = drawn_by("cross_validation", "The fit of every held-out record, law by law.")

    def table(self) -> Table:
        """One row for each law: mean fit of the held-out records by group and over all records, and RMSE."""
        groups = self.groups if len(self.groups) > 1 else ()
        columns = [Column(f"{group}", "%", ".1f") for group in groups] + [Column("all", "%", ".1f")]
        rows = tuple(
            (law, *(self.fit_percent(law, group) for group in groups), self.fit_percent(law), self.rmse(law))
            for law in self.laws
        )
        return Table("Fit of the held-out records", (Column("law"), *columns, Column("RMSE", "N", ".1f")), rows)

    def record_table(self) -> Table:
        """One row for each law and record held out: its error."""
        columns = (Column("law"), Column("held-out record"), Column("fit", "%", ".1f"), Column("RMSE", "N", ".1f"))
        rows = tuple((fold.law, fold.held_out, fold.fit_percent, fold.rmse) for fold in self.folds)
        return Table("Errors of the held-out records", columns, rows)

    def tables(self) -> dict[str, Table]:
        """Errors by law, and by record."""
        return {"laws": self.table(), "records": self.record_table()}

    def content(self) -> Contents:
        """The errors of each law on each held-out record with units, ready for JSON."""
        folds = [
            {
                "law": fold.law,
                "group": None if fold.group is None else str(fold.group),
                "held_out": fold.held_out,
                "fit": with_unit(fold.fit_percent, "%"),
                "rmse": with_unit(fold.rmse, "N"),
                "parameters": plain({p.path: p.value for p in parameters(fold.result.law)}),
            }
            for fold in self.folds
        ]
        return {"best": self.best, "verdict": list(self.verdict), "folds": folds} | (
            {"choices": [plain({name: getattr(c, name) for name in CHOICE}) for c in self.choices]}
            if self.inner
            else {}
        )

    def __repr__(self) -> str:
        return f"{self.table().to_text()}\nbest: {self.best}"


@of_known_numbers
def cross_validate(
    laws: Mapping[str, Start],
    runs: Iterable[BenchRun],
    *,
    by: Callable[[BenchRun], Hashable] | None = None,
    method: Callable[..., AbstractFitted] = fit,
    rig: Machine = OFFSET,
    weighting: str = "samples",
    nested: bool = False,
    **options: Any,
) -> CrossValidation:
    """Hold out each record in turn, fit every law to the others, and score it on the record held out.

    Arguments:
        laws: starts by name, as for `fit`; classes and functions are called again for each fit with its records only,
            so that the held-out record has no influence on the start.
        runs: two records or more.
        by: the group of a record, such as `lambda run: run.command`: the laws are fitted to each group separately;
            records for which it gives None are the group "None".
        method: called as `method(start, runs, weighting=..., **options)`, with an infinite weighting for the record
            held out, or without it if `per_record` is asked for; the result has a `law`. `fit`, or for networks a
            function that calls `train`.
        rig: the test machine as in `compare`. Another method than `fit` gets it only if it is not the default.
        weighting: of the records that are fitted: `"samples"`, or `"runs"`, with which every record counts the same, as
            it does in the mean fit.
        nested: whether to fit without every pair of records too, so that `choices` can choose the law for each record
            without this record; each group then needs three records.
        options: passed on to the method.

    Raises:
        ValueError: no laws; a group with a single record; or what the method raises.

    >>> from jaxdamp import bench, dampers
    >>> dyno = bench.VirtualDyno(dampers.Bilinear(2600.0, 1200.0), force_noise=5.0)
    >>> runs = dyno.run([bench.SineTest(amplitude=a, frequency=2.0) for a in (0.01, 0.02, 0.03)])
    >>> cross_validate({"linear": dampers.Linear, "bilinear": dampers.Bilinear}, runs).best
    'bilinear'
    """
    call = "cross_validate(laws, runs)"
    check_starts(laws, call)
    records = as_runs(runs, call=call)
    if options.get("bad_records") == "leave_out":
        records = usable(records, "leave_out", robust=options.get("loss", "squares") != "squares")
    groups = _grouped(records, by, nested)
    if method is fit or rig != OFFSET:
        options["rig"] = rig
    jobs = [(name, group, out) for name in laws for group, few in groups.items() for out in _left_out(few, nested)]
    folds, inner = list[Fold](), list[Fold]()
    with Progress("Cross-validating") as shown:
        for number, (name, group, out) in enumerate(jobs, 1):
            members, names = groups[group], [groups[group][i].name for i in out]
            shown(f"{name} without {' and '.join(names)}, {number} of {len(jobs)}")
            fitted, sigma = _without(out, members, weights(weighting, members), bool(options.get("per_record")))
            result = method(laws[name], fitted, weighting=sigma, **options)
            scores = result.score(members)[2]
            for i, other in zip(out, names[::-1] if len(out) > 1 else [None], strict=True):
                fold = Fold(name, group, scores[i].name, scores[i].fit_percent, scores[i].rmse, result, other)
                (folds if other is None else inner).append(fold)
    return CrossValidation(tuple(folds), tuple(inner))


def _without(
    out: Sequence[int], members: Sequence[BenchRun], sigma: Sequence[float], own_values: bool
) -> tuple[Sequence[BenchRun], list[float]]:
    """What is fitted without some records, and the weighting: a record held out has no value of its own."""
    if own_values:
        left = [i for i in range(len(members)) if i not in out]
        return [members[i] for i in left], [sigma[i] for i in left]
    return members, [np.inf if i in out else s for i, s in enumerate(sigma)]


def _grouped(
    runs: Iterable[BenchRun], by: Callable[[BenchRun], Hashable] | None, nested: bool
) -> dict[Hashable, list[BenchRun]]:
    """The records of each group."""
    groups: dict[Hashable, list[BenchRun]] = {}
    for run in runs:
        group = None if by is None else by(run)
        groups.setdefault("None" if by is not None and group is None else group, []).append(run)
    fewest, few = (3, "three") if nested else (2, "two")
    for group, members in groups.items():
        if len(members) < fewest:
            name, must = ("runs", "hold") if by is None else ("by", f"put into group {group}")
            _checks.refuse(name, f"{must} {few} records or more", [run.name for run in members])
    return groups


def _left_out(members: Sequence[BenchRun], nested: bool) -> list[tuple[int, ...]]:
    """The numbers of the records without part in each fit: every record, for a nested choice every pair too."""
    numbers = range(len(members))
    return [*itertools.combinations(numbers, 1), *(itertools.combinations(numbers, 2) if nested else ())]

"""`cross_validate`: every record is predicted by laws fitted to the others."""

import dataclasses
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._tables import Column, Table, plain, with_unit
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.identify.fitting import fit
from jaxdamp.identify.machine import OFFSET, Machine
from jaxdamp.identify.result import AbstractFitted
from jaxdamp.identify.starting import Start, check_starts
from jaxdamp.parameters import parameters


if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Fold(NamedTuple):
    """One law fitted without one record."""

    law: str
    group: Hashable
    held_out: str
    fit_percent: float  # of the record held out
    rmse: float  # of the record held out, N
    result: Any


@dataclasses.dataclass(frozen=True, repr=False)
class CrossValidation:
    """How well laws predict records that they were not fitted to. Results of the same records are joined with `+`.

    Attributes:
        folds: for each law and each record held out the fit and its errors.
    """

    folds: tuple[Fold, ...]

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

    def _of(self, law: str, group: Hashable) -> list[Fold]:
        folds = [f for f in self.folds if f.law == law and (group is None or f.group == group)]
        if not folds:
            raise KeyError(f"No folds of {law!r} in {group!r}; laws: {self.laws}, groups: {self.groups}.")
        return folds

    def __add__(self, other: "CrossValidation") -> "CrossValidation":
        return CrossValidation(self.folds + other.folds)

    def plot(self, **options: Any) -> "Figure":
        """The fit of every held-out record, law by law."""
        from jaxdamp.plots import cross_validation

        return cross_validation(self, **options)

    def table(self) -> Table:
        """One row for each law: mean fit of the held-out records by group and over all records, and RMSE."""
        groups = self.groups if len(self.groups) > 1 else ()
        columns = [Column(f"{group}", "%", ".1f") for group in groups] + [Column("all", "%", ".1f")]
        rows = tuple(
            (law, *(self.fit_percent(law, group) for group in groups), self.fit_percent(law), self.rmse(law))
            for law in self.laws
        )
        return Table("Fit of the held-out records", (Column("law"), *columns, Column("RMSE", "N", ".1f")), rows)

    def to_dict(self) -> dict[str, Any]:
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
        return {"best": self.best, "folds": folds}

    def __repr__(self) -> str:
        return f"{self.table().to_text()}\nbest: {self.best}"


def cross_validate(
    laws: Mapping[str, Start],
    runs: Iterable[BenchRun],
    *,
    by: Callable[[BenchRun], Hashable] | None = None,
    method: Callable[..., AbstractFitted] = fit,
    rig: Machine = OFFSET,
    **options: Any,
) -> CrossValidation:
    """Hold out each record in turn, fit every law to the others, and score it on the record held out.

    Arguments:
        laws: starts by name, as for `fit`; classes and functions are called again for each fit with its records only,
            so that the held-out record has no influence on the start.
        runs: two records or more.
        by: the group of a record, such as `lambda run: run.command`: the laws are fitted to each group separately.
        method: called as `method(start, runs, weighting=..., **options)`, with an infinite weighting for the record
            held out; the result has a `law`. `fit`, or for networks a function that calls `train`.
        rig: the test machine as in `compare`. Another method than `fit` gets it only if it is not the default.
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
    groups: dict[Hashable, list[BenchRun]] = {}
    for run in as_runs(runs, call=call):
        groups.setdefault(None if by is None else by(run), []).append(run)
    for group, members in groups.items():
        if len(members) < 2:
            name, must = ("runs", "hold") if by is None else ("by", f"put into group {group}")
            _checks.refuse(name, f"{must} two records or more", [run.name for run in members])
    if method is fit or rig != OFFSET:
        options["rig"] = rig
    total, folds = len(laws) * sum(map(len, groups.values())), []
    with Progress("Cross-validating") as shown:
        for name, start in laws.items():
            for group, members in groups.items():
                for out, run in enumerate(members):
                    shown(f"{name} without {run.name}, {len(folds) + 1} of {total}")
                    weighting = [np.inf if i == out else 1.0 for i in range(len(members))]
                    result = method(start, members, weighting=weighting, **options)
                    held_out = result.score(members)[2][out]
                    folds.append(Fold(name, group, run.name, held_out.fit_percent, held_out.rmse, result))
    return CrossValidation(tuple(folds))

"""Sweeps of which statistics, histograms, the best points and Pareto sets are kept instead of all results."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table, plain, typeset_unit
from jaxdamp._types import DataArray, Dataset
from jaxdamp.blocks import AbstractStore, Blocks, BlockStore, Cluster, Variable, fill
from jaxdamp.sweeps.axes import POINT, AbstractPoints
from jaxdamp.sweeps.block_program import BlockProgram
from jaxdamp.sweeps.gathered import Chosen, Gathered, Kept


STATISTICS = ("count", "mean", "standard_deviation", "minimum", "maximum")
TEXT = "summary"  # variable of the store: what was gathered in a block
MANY = 4096  # blocks whose texts are read together


@final
@dataclasses.dataclass(frozen=True)
class Summary:
    """What a sweep keeps of its points, besides count, mean, standard deviation and ends of every scalar result.

    Arguments:
        histograms: edges of the bins of a result, in increasing order; what lies outside is counted too.
        smallest: how many points with the smallest values of a result stay, with all their scalar results.
        largest: how many points with its largest values stay.
        pareto: results that are all to be small: the points stay of which none is better in one without being worse in
            another.

    >>> import jaxdamp
    >>> from jaxdamp import sweeps
    >>> points = sweeps.points(lambda i: {"a": 0.001 * i}, count=10_000)
    >>> keep = sweeps.Summary(histograms={"y": [0.0, 1.0, 10.0]}, smallest={"y": 2})
    >>> found = jaxdamp.sweep(lambda p: {"y": (p["a"] - 5.0) ** 2}, points, summary=keep)
    >>> found.smallest["y"]["a"].values, found.histograms["y"].values
    (array([5.   , 4.999]), array([   0, 1999, 4326, 3675]))
    """

    histograms: Mapping[str, Sequence[float] | np.ndarray] = dataclasses.field(default_factory=dict)
    smallest: Mapping[str, int] = dataclasses.field(default_factory=dict)
    largest: Mapping[str, int] = dataclasses.field(default_factory=dict)
    pareto: Sequence[str] = ()

    def checked(self, names: Sequence[str]) -> Kept:
        """The same, checked against the results of a sweep.

        Arguments:
            names: of the results that are one number.

        Raises:
            ValueError: an unknown result, edges that do not increase, a count below one.
        """
        edges = {}
        for name, values in self.histograms.items():
            _checks.one_of("summary.histograms", name, names)
            edges[name] = np.asarray(values, np.float64)
            if edges[name].ndim != 1 or edges[name].size < 2 or not np.all(np.diff(edges[name]) > 0):
                must = "be two or more numbers in increasing order"
                _checks.refuse(f"summary.histograms[{name!r}]", must, _checks.summary(edges[name]))
        for which, sizes in (("smallest", self.smallest), ("largest", self.largest)):
            for name, count in sizes.items():
                _checks.one_of(f"summary.{which}", name, names)
                _checks.counts(**{f"summary.{which}[{name!r}]": count})
        pareto = (self.pareto,) if isinstance(self.pareto, str) else tuple(self.pareto)
        for name in pareto:
            _checks.one_of("summary.pareto", name, names)
        if len(pareto) == 1 or len(set(pareto)) < len(pareto):
            _checks.refuse("summary.pareto", "be two or more different results", ", ".join(pareto))
        return Kept(edges, dict(self.smallest), dict(self.largest), pareto)


@final
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SweepSummary(AbstractResult):
    """What was kept of a sweep.

    The figures are those of all points together to the last bit, whatever the blocks were and whoever computed them:
    means and standard deviations are rounded once, from exact sums.

    Attributes:
        points: how many were computed.
        failed_points: how many of them have no result.
        reasons: why, with the number of points.
        statistics: of each scalar result along `statistic`: count of finite values, mean, standard deviation (divided
            by the count), minimum, maximum.
        histograms: counts by the name of the result, along `bin` with the coordinates `lower` and `upper`; the first
            and the last are below and above all edges.
        smallest: by the name of a result the points where it is smallest, along `point` with the axes as coordinates.
        largest: the points where it is largest.
        pareto: the Pareto set, with its results as `attrs["objectives"]`; None if none was asked for.
    """

    points: int
    failed_points: int
    reasons: Mapping[str, int]
    statistics: Dataset
    histograms: "Mapping[str, DataArray]"
    smallest: Mapping[str, Dataset]
    largest: Mapping[str, Dataset]
    pareto: "Dataset | None"

    @property
    def summary(self) -> str:
        """How many points there were and failed."""
        failed = f", {self.failed_points} of them without a result" if self.failed_points else ""
        return f"{self.points} points{failed}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why points failed."""
        return tuple(f"{count} points: {reason}" for reason, count in self.reasons.items())

    def table(self) -> Table:
        """A row for each result with its statistics."""
        words = [name.replace("_", " ") for name in STATISTICS]
        columns = (Column("result"), Column("unit"), Column(words[0], spec="d"), *map(Column, words[1:]))
        rows = [
            (str(name), typeset_unit(row.attrs.get("units", "")), int(row[0]), *(float(v) for v in row[1:]))
            for name, row in self.statistics.items()
        ]
        return Table(f"Statistics of {self.summary}", columns, tuple(rows))

    def tables(self) -> dict[str, Table]:
        """Statistics, and the points that were kept."""
        kinds = {f"smallest {name}": data for name, data in self.smallest.items()}
        kinds |= {f"largest {name}": data for name, data in self.largest.items()}
        kinds |= {} if self.pareto is None else {"pareto": self.pareto}
        return {"statistics": self.table(), **{name: _listed(name, data) for name, data in kinds.items()}}

    plot = drawn_by("sweep_summary", "Histograms, or mean and range, of each result, and the Pareto set.")

    def content(self) -> Contents:
        """All tables and histograms as plain data."""
        bins = {name: plain(counts.to_dict()) for name, counts in self.histograms.items()}
        return {name: table.to_dict() for name, table in self.tables().items()} | {"histograms": bins}


def _listed(name: str, data: Dataset) -> Table:
    columns = [*data.coords, *data.data_vars]
    headings = tuple(Column(str(c), typeset_unit(data[c].attrs.get("units", ""))) for c in columns)
    rows = tuple(zip(*(data[c].values.tolist() for c in columns), strict=True))
    return Table({"pareto": "Pareto set"}.get(name, f"Points with the {name}"), headings, rows)


@final
class SummaryStore(AbstractStore):
    """What was gathered of each block of a sweep, as a text in a Zarr store."""

    def __init__(self, program: BlockProgram, summary: Kept, path: str) -> None:
        self.blocks, self._kept, self._names = program.blocks, summary, program.scalars
        identity = {**program.identity(), "points of a block": str(self.blocks.box), "summary": _said(summary)}
        self._texts = BlockStore(path, Blocks((self.blocks.count,), (1,)), identity)
        some = {"failed": Variable({}, np.dtype(bool), {}), "reason": Variable({}, str, {})}
        self._texts.create(("block",), {TEXT: Variable({}, str, {}), **some}, {})
        self.path = self._texts.path

    def left(self) -> np.ndarray:
        """The blocks that are not done."""
        return self._texts.left()

    def repair(self, numbers: Iterable[int]) -> int:
        """Mark those of some blocks whose text is damaged as not done; gives how many."""
        return self._texts.repair(numbers)

    def write(self, number: int, values: Mapping[str, np.ndarray]) -> None:
        """Gather the results of a block, and write that."""
        gathered = Gathered.of(self._kept, self._names, self.blocks.indices(number), values)
        text = np.array([gathered.to_text()], dtype=object)
        self._texts.write(number, {TEXT: text, "failed": np.zeros(1, bool), "reason": np.array([""], dtype=object)})

    def gathered(self) -> Gathered | None:
        """Of all blocks that are done."""
        total = None
        for start in range(0, self.blocks.count, MANY):
            for text in self._texts.read(TEXT, start=start, stop=start + MANY)[TEXT]:
                if text:
                    one = Gathered.from_text(str(text))
                    total = one if total is None else total.merged(one, self._kept)
        return total


@final
class HeldSummary(AbstractStore):
    """What was gathered of the blocks so far, in memory."""

    def __init__(self, program: BlockProgram, summary: Kept) -> None:
        self.blocks, self.path, self._kept, self._names = program.blocks, Path(), summary, program.scalars
        self._total: Gathered | None = None

    def left(self) -> np.ndarray:
        """All blocks."""
        return np.arange(self.blocks.count)

    def repair(self, numbers: Iterable[int]) -> int:
        """Nothing can be damaged."""
        del numbers
        return 0

    def write(self, number: int, values: Mapping[str, np.ndarray]) -> None:
        """Gather the results of a block."""
        one = Gathered.of(self._kept, self._names, self.blocks.indices(number), values)
        self._total = one if self._total is None else self._total.merged(one, self._kept)

    def gathered(self) -> Gathered | None:
        """Of all blocks."""
        return self._total


def summarise(
    program: BlockProgram,
    summary: Summary,
    path: str | None,
    cluster: Cluster,
    progress: Callable[[int, int], None] | None,
) -> SweepSummary:
    """Compute all blocks that are not done, and give what was gathered."""
    _checks.instance("summary", summary, Summary, "say what is kept", "Write `summary=sweeps.Summary(...)`.")
    checked = summary.checked(program.scalars)
    store = HeldSummary(program, checked) if path is None else SummaryStore(program, checked, path)
    fill(store, program, cluster, progress, "Sweeping")
    gathered = store.gathered()
    if gathered is None:  # all blocks belong to other parts of an array job
        none = dict.fromkeys([*program.scalars, "failed", "reason"], np.zeros(0))
        gathered = Gathered.of(checked, program.scalars, np.zeros(0, np.int64), none)
    return _labelled(gathered, checked, program)


def _labelled(gathered: Gathered, summary: Kept, program: BlockProgram) -> SweepSummary:
    """With names, axes and units."""
    import xarray

    about = program.about
    figures = {name: ("statistic", list(f.numbers()), about(name)) for name, f in gathered.figures.items()}
    histograms = {}
    for name, counts in gathered.histograms.items():
        ends = [-np.inf, *summary.histograms[name], np.inf]
        coordinates = {"lower": ("bin", ends[:-1], about(name)), "upper": ("bin", ends[1:], about(name))}
        histograms[name] = xarray.DataArray(counts, coordinates, ["bin"], name)
    lists = {key: _points(some, program.points, about) for key, some in gathered.chosen.items()}
    return SweepSummary(
        gathered.points,
        gathered.failed,
        dict(sorted(gathered.reasons.items(), key=lambda pair: (-pair[1], pair[0]))),
        xarray.Dataset(figures, {"statistic": list(STATISTICS)}),
        histograms,
        {name: lists[f"smallest {name}"] for name in summary.smallest},
        {name: lists[f"largest {name}"] for name in summary.largest},
        lists["pareto"].assign_attrs(objectives=list(summary.pareto)) if summary.pareto else None,
    )


def _points(some: Chosen, points: AbstractPoints, about: Callable[[str], dict[str, str]]) -> Dataset:
    """Chosen points with their axes and numbers in the sweep."""
    import xarray

    axes = points.columns(some.index) if some.index.size else dict.fromkeys(points.names, np.zeros(0))
    coordinates = {name: (POINT, values, about(name)) for name, values in axes.items()}
    data = xarray.Dataset({name: (POINT, v, about(name)) for name, v in some.values.items()}, coordinates)
    return data.assign_coords(index=(POINT, some.index))


def _said(summary: Kept) -> str:
    """What is kept, in a text."""
    edges = {name: values.tolist() for name, values in summary.histograms.items()}
    return f"histograms {edges}, smallest {summary.smallest}, largest {summary.largest}, pareto {list(summary.pareto)}"

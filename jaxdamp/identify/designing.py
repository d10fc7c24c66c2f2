"""`design_experiment`: the runs of a test machine that determine a law best."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypedDict, Unpack

import numpy as np
from jaxtyping import Float, PyTree

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column, Table
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import Excitation
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.design_goal import WAVEFORMS, Goal, Information, MachineLimits, Point, grid, information, near
from jaxdamp.parameters import FreeParameters
from jaxdamp.rig import Rig


CRITERIA = ("D", "A", "c")
FINER = (1.25, 1.08)  # ratios of stroke and frequency of the tests around the chosen ones
WEAK = 0.5  # standard error, relative to the value, above which a parameter is not identifiable


class DesignSettings(TypedDict, total=False):
    """Which tests a design of experiments chooses from, and what is known of the parameters before.

    Arguments:
        tests: the candidates, instead of a grid of tests within the limits.
        waveforms: of the grid: "sine", "triangle", "random", "multisine".
        strokes: number of strokes of the grid.
        frequencies: number of frequencies of the grid.
        duration: length of each run of the grid [s], at least three cycles.
        sampling_rate: of the records [Hz].
        freeze: parameters that are known, as in `Free`.
        tie: parameters that take the values of others, as in `Free`.
        prior: standard deviations of parameters that are known before, as Gaussians around their values; by path, last
            part of a path or pattern.
    """

    tests: Iterable[Excitation] | None
    waveforms: Sequence[str]
    strokes: int
    frequencies: int
    duration: float
    sampling_rate: float
    freeze: Sequence[str]
    tie: Mapping[str, str] | None
    prior: Mapping[str, float] | None


DEFAULTS: DesignSettings = {
    "tests": None, "waveforms": WAVEFORMS, "strokes": 5, "frequencies": 7, "duration": 3.0, "sampling_rate": 1000.0,
    "freeze": (), "tie": None, "prior": None,
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class ExperimentDesign(AbstractResult):
    """Runs chosen for a law, and the standard errors that they are expected to give.

    Attributes:
        law: the law that the design is for, with the expected values.
        tests: the chosen runs, in the order in which they help, for `VirtualDyno.run` or a real machine.
        free: the free parameters.
        covariance: expected covariance of the free numbers, in their units; the prior counts.
        criterion: "D", "A" or "c".
        programme: the tests of the programme for comparison.
        programme_covariance: what that programme would give; `None` without one.
        runs_to_match: number of runs of the design that are as good, by the criterion, as the whole programme; `None`
            without a programme, or if more runs than it has would be needed.
        function_errors: expected standard error of the function of the criterion "c", with the design and with the
            programme; `None` where there is none.
    """

    law: AbstractDamper
    tests: tuple[Excitation, ...]
    free: FreeParameters
    covariance: Float[np.ndarray, "free free"]
    criterion: str
    programme: tuple[Excitation, ...] = ()
    programme_covariance: Float[np.ndarray, "free free"] | None = None
    runs_to_match: int | None = None
    function_errors: tuple[float | None, float | None] = (None, None)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Expected standard error of each free number, by name."""
        return dict(zip(self.free.names, map(float, np.sqrt(np.diag(self.covariance))), strict=True))

    @property
    def runs_saved(self) -> int | None:
        """Runs of the programme less those of the design that are as good; `None` if the design does not reach it."""
        return None if self.runs_to_match is None else len(self.programme) - self.runs_to_match

    def table(self) -> Table:
        """Expected standard errors of the parameters, beside those of the programme."""
        several = self.programme_covariance is not None
        columns = [Column("parameter"), Column("unit"), Column("value", spec=".5g")]
        columns += [Column(f"standard error, {len(self.tests)} runs", spec=".2g")]
        columns += [Column(f"standard error, {len(self.programme)} runs of the programme", spec=".2g")] * several
        columns += [Column("note")]
        others = np.sqrt(np.diag(self.programme_covariance)) if self.programme_covariance is not None else None
        rows = []
        for i, (p, value) in enumerate(zip(self.free.owners, np.asarray(self.free.values), strict=True)):
            error = self.standard_errors[self.free.names[i]]
            note = "not identifiable" if error > WEAK * abs(value) else ""
            of_programme = () if others is None else (float(others[i]),)
            rows.append((self.free.names[i], p.unit or "–", float(value), error, *of_programme, note))
        return Table("Expected standard errors", tuple(columns), tuple(rows))

    def tables(self) -> dict[str, Table]:
        """Expected standard errors, and the chosen runs."""
        return {"parameters": self.table(), "runs": self.runs_table()}

    def runs_table(self) -> Table:
        """The chosen runs."""
        columns = (
            Column("run"),
            Column("0-peak", "mm", ".3g"),
            Column("peak velocity", "m/s", ".3g"),
            Column("highest frequency", "Hz", ".3g"),
            Column("duration", "s", ".3g"),
        )
        rows = [(t.name, *extent(t), t.highest_frequency, t.duration) for t in self.tests]
        return Table("Runs, the most useful first", columns, tuple(rows))

    plot = drawn_by("experiment", "The runs over stroke and velocity, and the standard errors they give.")

    @property
    def summary(self) -> str:
        """Number of runs, and how many are as good as the programme."""
        if self.programme_covariance is None:
            return f"{len(self.tests)} runs chosen by the criterion {self.criterion}."
        count, match = len(self.programme), self.runs_to_match
        return f"{match or f'More than {count}'} such runs are as good as the {count} of the programme."

    @property
    def warnings(self) -> tuple[str, ...]:
        """Numbers that the runs will not determine."""
        weak = [str(row["parameter"]) for row in self.table().records() if row["note"]]
        return (f"The runs will not determine {', '.join(weak)}.",) * bool(weak)

    def __repr__(self) -> str:
        lines = [str(self.runs_table()), "", str(self.table())]
        return "\n".join([*lines, *[self.summary] * (self.programme_covariance is not None)])


def extent(test: Excitation) -> tuple[float, float]:
    """Largest stroke [mm] and velocity [m/s] of a record.

    Arguments:
        test: the excitation.
    """
    time = np.arange(0.0, test.duration, 0.01 / test.highest_frequency)
    return 1e3 * float(np.max(np.abs(test.stroke(time)))), float(np.max(np.abs(test.velocity(time))))


@of_known_numbers
@with_defaults(DEFAULTS)
def design_experiment(
    law: AbstractDamper,
    limits: MachineLimits | None = None,
    *,
    runs: int = 6,
    force_noise: float,
    rig: Rig | None = None,
    criterion: str = "D",
    function: Callable[[PyTree], PyTree] | None = None,
    programme: Iterable[Excitation] | None = None,
    **settings: Unpack[DesignSettings],
) -> ExperimentDesign:
    """Choose the runs that determine the parameters of a law best, before any of them is run.

    The Fisher information of every candidate is JᵀJ/σ² with the derivatives J of the force by the free parameters, by
    the same model as in a fit. Runs are added one by one, each the best beside those before, then exchanged one for
    another until no exchange helps; where the candidates come from limits, tests around the chosen ones, with strokes
    and frequencies between those of the grid, then take part too. A run may be chosen more than once.

    The information is that of the law with the values given: a design is as good as the guess. Fit, and design again.

    Arguments:
        law: the law with the values that are expected, such as that of a first fit.
        limits: of the machine; the candidates are made from them (without `tests`), and those with too much force or
            heat are left out.
        runs: number of runs.
        force_noise: standard deviation of a sample of the measured force [N], as white noise.
        rig: the test machine, as in `fit`: its free numbers are determined too.
        criterion: "D", the volume of the confidence ellipsoid; "A", the sum of the squared relative standard errors;
            "c", the standard error of `function`.
        function: of the law, a number computed by JAX, such as a ride metric with it; for the criterion "c".
        programme: tests to compare with, such as `bench.programmes.paper_000_table_1()`.
        settings: keywords, all optional: `tests`, `waveforms`, `strokes`, `frequencies`, `duration` and `sampling_rate`
            say which tests are candidates, `freeze`, `tie` and `prior` what is known (see `DesignSettings`).

    Raises:
        ValueError: neither limits nor tests; no candidate within the limits; a criterion without its function, or a
            function that the criterion does not use; unknown names.

    >>> from jaxdamp.dampers import Bilinear
    >>> limits = MachineLimits(stroke=0.02, velocity=0.5)
    >>> design = design_experiment(
    ...     Bilinear(2600.0, 1200.0), limits, runs=2, force_noise=10.0, waveforms=["sine"], strokes=2, frequencies=2
    ... )
    >>> max(design.standard_errors.values()) < 10.0
    True
    """
    tests, duration = settings["tests"], settings["duration"]
    _check(limits, tests, runs, force_noise, criterion, function)
    freeze, tie, rate = settings["freeze"], settings["tie"], settings["sampling_rate"]
    informed = functools.partial(
        information, law, rig=rig, freeze=freeze, tie=tie, sampling_rate=rate, force_noise=force_noise
    )
    if tests is not None:
        candidates: dict[Any, Excitation] = dict(enumerate(tests))
    else:
        assert limits is not None
        candidates = dict(grid(limits, settings["waveforms"], duration, settings["strokes"], settings["frequencies"]))
    if not candidates:
        _checks.refuse("limits", "leave tests to choose from", "no candidate", "Allow more, or give `tests`.")
    pool = _Pool.of(candidates, informed(list(candidates.values())), limits)
    free = pool.free
    goal = Goal.of(free, criterion, function, settings["prior"])
    chosen = goal.exchanged(goal.added([], runs, pool.matrices), pool.matrices)
    for ratio in FINER if tests is None else ():
        assert limits is not None
        keys = [pool.keys[k] for k in chosen]
        more = near([key for key in keys if isinstance(key, Point)], ratio, limits, duration)
        new = {point: test for point, test in more.items() if point not in pool.keys}
        if new:
            pool = pool.joined(_Pool.of(new, informed(list(new.values())), limits))
        chosen = goal.exchanged(chosen, pool.matrices)
    chosen = goal.ordered(chosen, pool.matrices)
    covariance = goal.covariance(pool.matrices[chosen].sum(axis=0))
    design = ExperimentDesign(law, _named([pool.tests[k] for k in chosen]), free, covariance, criterion)
    design = dataclasses.replace(design, function_errors=(goal.function_error(covariance), None))
    return design if programme is None else _compared(design, goal, pool, chosen, tuple(programme), informed)


def _check(
    limits: MachineLimits | None,
    tests: Iterable[Excitation] | None,
    runs: int,
    force_noise: float,
    criterion: str,
    function: Callable[[PyTree], PyTree] | None,
) -> None:
    if limits is None and tests is None:
        remedy = "Write `limits=MachineLimits(stroke=0.05, velocity=1.0)` or `tests=[...]`."
        _checks.refuse("limits", "be given, or `tests`", "neither", remedy)
    _checks.counts(runs=runs)
    _checks.positive("force_noise", force_noise)
    _checks.one_of("criterion", criterion, CRITERIA)
    if (criterion == "c") != (function is not None):
        remedy = "Write `criterion='c', function=lambda law: law.force_velocity(0.5)`."
        _checks.refuse("function", "be given with the criterion 'c', and only with it", repr(function), remedy)


def _named(tests: Sequence[Any]) -> tuple[Excitation, ...]:
    """Tests with different names: a run that is chosen again gets a number."""
    seen: dict[str, int] = {}
    named = []
    for test in tests:
        seen[test.name] = seen.get(test.name, 0) + 1
        number = seen[test.name]
        named.append(test if number == 1 else dataclasses.replace(test, name=f"{test.name}_{number}"))
    return tuple(named)


@dataclasses.dataclass(frozen=True)
class _Pool:
    """Candidates with their information."""

    keys: list[Point | int]  # points of a grid, or numbers
    tests: list[Excitation]
    matrices: Float[np.ndarray, "tests free free"]
    free: FreeParameters

    @classmethod
    def of(
        cls, candidates: Mapping[Any, Excitation], information: Information, limits: MachineLimits | None
    ) -> "_Pool":
        """Those within the limits of force and heat."""
        bears = [
            limits is None or (force <= limits.force and power <= limits.power)
            for force, power in zip(information.force, information.power, strict=True)
        ]
        if not any(bears):
            assert limits is not None
            value = f"no candidate below {limits.force:g} N and {limits.power:g} W"
            _checks.refuse(
                "limits", "leave tests to choose from", value, "Allow more, or add slower and shorter tests."
            )
        items = [item for item, within in zip(candidates.items(), bears, strict=True) if within]
        return cls(
            [k for k, _ in items], [t for _, t in items], information.matrices[np.array(bears)], information.free
        )

    def joined(self, other: "_Pool") -> "_Pool":
        """Both together."""
        matrices = np.concatenate([self.matrices, other.matrices])
        return _Pool(self.keys + other.keys, self.tests + other.tests, matrices, self.free)


def _compared(
    design: ExperimentDesign,
    goal: Goal,
    pool: _Pool,
    chosen: list[int],
    programme: tuple[Excitation, ...],
    informed: Callable[[Sequence[Excitation]], Information],
) -> ExperimentDesign:
    """The design beside a programme of tests."""
    of_programme = informed(programme).matrices.sum(axis=0)
    aim = float(goal.value(of_programme))
    longest = goal.added(chosen, max(len(programme) - len(chosen), 0), pool.matrices)
    reached = goal.value(np.cumsum(pool.matrices[longest[: len(programme)]], axis=0)) <= aim
    covariance = goal.covariance(of_programme)
    return dataclasses.replace(
        design,
        programme=programme,
        programme_covariance=covariance,
        runs_to_match=int(np.argmax(reached)) + 1 if np.any(reached) else None,
        function_errors=(design.function_errors[0], goal.function_error(covariance)),
    )

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
from jaxdamp.bench import CommandedExcitation, Excitation
from jaxdamp.dampers import AbstractDamper, command_words
from jaxdamp.identify.design_candidates import WAVEFORMS, MachineLimits, Point, beyond, extent, grid, near, refuse_all
from jaxdamp.identify.design_goal import Goal, Information, Pool, information
from jaxdamp.identify.machine import free_fields
from jaxdamp.parameters import FreeParameters, listed
from jaxdamp.rig import Rig


CRITERIA = ("D", "A", "c")
FINER = (1.25, 1.08)  # ratios of stroke and frequency of the tests around the chosen ones
WEAK = 0.5  # standard error, relative to the size of its parameter, above which this is not identifiable


class DesignSettings(TypedDict, total=False):
    """Which tests a design of experiments chooses from, and what is known of the parameters before.

    Arguments:
        tests: the candidates, instead of a grid of tests within the limits; those beyond limits are left out.
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


@dataclasses.dataclass(frozen=True, eq=False)
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
        undetermined: the free numbers whose expected standard error is more than half of their size.
        warnings: those numbers, tests that the machine cannot run, and a command that is held, each in a sentence.
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
    undetermined: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

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
            note = "not identifiable" if self.free.names[i] in self.undetermined else ""
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

    def __repr__(self) -> str:
        lines = [str(self.runs_table()), "", str(self.table())]
        lines += [self.summary] * (self.programme_covariance is not None)
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])


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
        law: the law with the values that are expected, such as that of a first fit. A command is held at its value
            in all tests but those that set it (`bench.CommandStep`).
        limits: of the machine; the candidates are made from them (without `tests`), and those beyond them or with too
            much force or heat are left out. A warning names those of `tests`, and what of the programme is beyond.
        runs: number of runs.
        force_noise: standard deviation of a sample of the measured force [N], as white noise.
        rig: the test machine with the values that are expected: those that are not at their defaults are determined
            too.
        criterion: "D", the volume of the confidence ellipsoid; "A", the sum of the squared relative standard errors;
            "c", the standard error of `function`. The error of a zero is relative to the largest value of its vector,
            else to its `prior`, else to the change that moves the force by its RMS.
        function: of the law, a number computed by JAX, such as a ride metric with it; for the criterion "c".
        programme: tests to compare with, such as `bench.programmes.paper_000_table_1()`.
        settings: keywords, all optional: `tests`, `waveforms`, `strokes`, `frequencies`, `duration` and `sampling_rate`
            say which tests are candidates, `freeze`, `tie` and `prior` what is known (see `DesignSettings`).

    Raises:
        ValueError: a law or machine without values; neither limits nor tests; no candidate within the limits; a
            criterion without its function, or a function that the criterion does not use; unknown names.

    >>> from jaxdamp.dampers import Bilinear
    >>> limits = MachineLimits(stroke=0.02, velocity=0.5)
    >>> design = design_experiment(
    ...     Bilinear(2600.0, 1200.0), limits, runs=2, force_noise=10.0, waveforms=["sine"], strokes=2, frequencies=2
    ... )
    >>> max(design.standard_errors.values()) < 10.0
    True
    """
    tests, duration = settings["tests"], settings["duration"]
    _check(law, rig, limits, runs, force_noise, criterion, function, settings)
    freeze, tie, rate = settings["freeze"], settings["tie"], settings["sampling_rate"]
    informed = functools.partial(
        information, law, rig=rig, freeze=freeze, tie=tie, sampling_rate=rate, force_noise=force_noise
    )
    candidates, left_out = _candidates(limits, settings)
    first = informed(list(candidates.values()))
    pool = Pool.of(candidates, first, limits)
    goal = Goal.of(first, criterion, function, settings["prior"])
    chosen = goal.exchanged(goal.added([], runs, pool.matrices), pool.matrices)
    for ratio in FINER if tests is None else ():
        assert limits is not None
        keys = [pool.keys[k] for k in chosen]
        more = near([key for key in keys if isinstance(key, Point)], ratio, limits, duration)
        new = {point: test for point, test in more.items() if point not in pool.keys}
        if new:
            pool = pool.joined(Pool.of(new, informed(list(new.values())), limits))
        chosen = goal.exchanged(chosen, pool.matrices)
    chosen = goal.ordered(chosen, pool.matrices)
    covariance = goal.covariance(pool.matrices[chosen].sum(axis=0))
    left_out += pool.left_out if tests is not None else ()
    best, firm = [pool.tests[k] for k in chosen], np.sqrt(np.diag(covariance)) <= WEAK * goal.scale
    weak = tuple(name for name, sure in zip(pool.free.names, firm, strict=True) if not sure)
    design = ExperimentDesign(
        law,
        _named(best),
        pool.free,
        covariance,
        criterion,
        function_errors=(goal.function_error(covariance), None),
        undetermined=weak,
        warnings=_warnings(law, best, weak, left_out),
    )
    return design if programme is None else _compared(design, goal, pool, chosen, tuple(programme), informed, limits)


def _check(
    law: AbstractDamper,
    rig: Rig | None,
    limits: MachineLimits | None,
    runs: int,
    force_noise: float,
    criterion: str,
    function: Callable[[PyTree], PyTree] | None,
    settings: DesignSettings,
) -> None:
    """Refuse what no design can be made for."""
    expected = "There are no records yet that a start could be taken from: write"
    remedy = f"{expected} the law with the numbers you expect, such as `dampers.Bilinear(2600.0, 1200.0)`."
    _checks.instance("law", law, AbstractDamper, "be a law with its numbers", remedy)
    remedy = f"{expected} the machine with the numbers you expect, such as `rig=Rig(gas_force=-100.0)`."
    _checks.instance("rig", rig, (Rig, type(None)), "be a `Rig` with its numbers", remedy)
    if rig is not None and not free_fields(rig):
        remedy = "Write those that the runs shall determine, `rig=Rig(gas_force=-100.0)`, or leave `rig` out."
        _checks.refuse("rig", "have a number that is not at its default", "one that adds nothing", remedy)
    if limits is None and settings["tests"] is None:
        remedy = "Write `limits=MachineLimits(stroke=0.05, velocity=1.0)` or `tests=[...]`."
        _checks.refuse("limits", "be given, or `tests`", "neither", remedy)
    _checks.counts(runs=runs, strokes=settings["strokes"], frequencies=settings["frequencies"])
    for name in ("duration", "sampling_rate"):
        _checks.positive(name, settings[name])
    _checks.positive("force_noise", force_noise)
    _checks.one_of("criterion", criterion, CRITERIA)
    if (criterion == "c") != (function is not None):
        remedy = "Write `criterion='c', function=lambda law: law.force_velocity(0.5)`."
        _checks.refuse("function", "be given with the criterion 'c', and only with it", repr(function), remedy)


def _candidates(
    limits: MachineLimits | None, settings: DesignSettings
) -> tuple[dict[Any, Excitation], tuple[str, ...]]:
    """The tests to choose from, by point of a grid or by number, and in words those that the machine cannot run."""
    beside: tuple[str, ...] = ()
    if settings["tests"] is None:
        assert limits is not None
        how = settings["waveforms"], settings["duration"], settings["strokes"], settings["frequencies"]
        candidates: dict[Any, Excitation] = dict(grid(limits, *how))
    else:
        tests = [(test, beyond(test, limits)) for test in settings["tests"]]
        if not tests:
            _checks.refuse("tests", "hold at least one test", "empty", "Leave it out for a grid within `limits`.")
        candidates = {number: test for number, (test, over) in enumerate(tests) if not over}
        beside = tuple(over for _, over in tests if over)
    if not candidates:
        refuse_all(beside)
    return candidates, beside


def _warnings(
    law: AbstractDamper, tests: Sequence[Excitation], weak: Sequence[str], left_out: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on numbers not determined, candidates that the machine cannot run, and a command that is held."""
    said = [f"The runs will not determine {', '.join(weak)}."] * bool(weak)
    said += [f"Left out of the candidates as beyond `limits`: {listed(left_out)}."] * bool(left_out)
    held = command_words(law)
    if held and not any(isinstance(test, CommandedExcitation) for test in tests):
        remedy = "Design for each command (`dampers.with_command`), or give `tests` that vary it (`bench.CommandStep`)."
        said += [f"All runs are {held}, and say little or nothing of numbers that act at others. {remedy}"]
    return tuple(said)


def _named(tests: Sequence[Any]) -> tuple[Excitation, ...]:
    """Tests with different names: a run that is chosen again gets a number."""
    seen: dict[str, int] = {}
    named = []
    for test in tests:
        seen[test.name] = seen.get(test.name, 0) + 1
        number = seen[test.name]
        named.append(test if number == 1 else dataclasses.replace(test, name=f"{test.name}_{number}"))
    return tuple(named)


def _compared(
    design: ExperimentDesign,
    goal: Goal,
    pool: Pool,
    chosen: list[int],
    programme: tuple[Excitation, ...],
    informed: Callable[[Sequence[Excitation]], Information],
    limits: MachineLimits | None,
) -> ExperimentDesign:
    """The design beside a programme of tests."""
    gained = informed(programme)
    each = zip(programme, gained.force, gained.power, strict=True)
    over = [words for test, force, power in each if (words := beyond(test, limits, force, power))]
    notes = [f"The machine cannot run {len(over)} of the {len(programme)} tests of the programme: {listed(over)}."]
    of_programme = gained.matrices.sum(axis=0)
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
        warnings=(*design.warnings, *notes * bool(over)),
    )

"""`fit_scheduled`: one law for records at several settings, such as coil currents or clicks of an adjuster."""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, Unpack, cast

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._results import AbstractResult, Derived
from jaxdamp._settings import part, with_defaults
from jaxdamp._tables import Column, Contents, Table, plain
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.bench import BenchRun, as_runs, contradictions, usable
from jaxdamp.dampers import Scheduled, takes_command
from jaxdamp.identify.at_levels import AtLevel, choices_of, of_lag, ties_at
from jaxdamp.identify.blending import AtSetting, Choice, choose_blend, with_blended_forces
from jaxdamp.identify.contradicting import refuse_contradicting
from jaxdamp.identify.estimating import undetermined
from jaxdamp.identify.fitting import fit, solve
from jaxdamp.identify.judging import fitted_models
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.machine import OFFSET, Machine, held_constant_forces, refuse_lag_of_held, without_command_lag
from jaxdamp.identify.model import Model, OnRig, law_of, own_names, rig_of
from jaxdamp.identify.predicting import score
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.settings import FIT, PROBLEM, SCHEDULED, FitSettings, ScheduledSettings, check_keywords
from jaxdamp.identify.starting import Start, frozen_by
from jaxdamp.identify.stated import COMMAND_REMEDY, refuse_lacking, stated_parameters
from jaxdamp.parameters import get, match_paths, name_patterns, parameters, with_values
from jaxdamp.rig import Rig


CALL = "fit_scheduled(law, runs)"
Alone = dict[float, AtSetting]


class LeftOutSetting(NamedTuple):
    """How well a law interpolates to a setting whose records it was not fitted to.

    Attributes:
        setting: the command that was left out.
        runs: its records.
        result: the law fitted to the records of all other settings.
        fit_percent: of the interpolated law on the records left out.
        rmse: of the same [N].
        own_fit_percent: of the law fitted to these records alone.
        own_rmse: of the same [N].
    """

    setting: float
    runs: tuple[BenchRun, ...]
    result: FitResult
    fit_percent: float
    rmse: float
    own_fit_percent: float
    own_rmse: float

    def sentence(self, name: str) -> str:
        """The comparison with a law fitted at this setting, in words."""
        return (
            f"{name} interpolated to {self.setting:g}, whose records it was not fitted to: RMSE {self.rmse:.1f} N"
            f" (fit {self.fit_percent:.1f} %), {self.rmse / self.own_rmse:.2f} times that of the law fitted there alone"
            f" ({self.own_rmse:.1f} N, {self.own_fit_percent:.1f} %)."
        )

    def plot(self) -> Figure:
        """Loops at the setting left out, measured and interpolated, with residuals."""
        return self.result.plot(runs=self.runs)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ScheduledFit(AbstractResult):
    """One law for several settings.

    Attributes:
        result: the fit of all records together; its law is a `Scheduled`.
        alone: the fit of the records of each setting alone, whose laws the common fit started from.
        choice: whether parameters are interpolated between settings or forces blended, and why.
        chain: the fits behind it.
        respond, score: of `result`: the forces of records with the machine, and how well they are predicted.
    """

    result: FitResult
    alone: Alone
    choice: Choice
    chain: "Chain"

    @functools.cached_property
    def between(self) -> tuple[LeftOutSetting, ...]:
        """How well the law interpolates, for each setting between others; fitted when first asked for."""
        with Progress("Leaving out settings") as shown:
            return tuple(self.chain.without(u, self.choice.blend, shown) for u in self.chain.settings[1:-1])

    @property
    def law(self) -> Scheduled:
        """The law of all settings; `dampers.with_command(law, setting)` is that of one."""
        assert isinstance(self.result.law, Scheduled)
        return self.result.law

    respond = Derived(lambda self: self.result.respond)
    score = Derived(lambda self: self.result.score)
    status = Derived(lambda self: self.result.status)
    warnings = Derived(lambda self: self.result.warnings)

    @property
    def summary(self) -> str:
        """The settings, and the errors of the common fit."""
        settings, result = ", ".join(f"{setting:g}" for setting in self.alone), self.result
        return f"One law for the settings {settings}: fit {result.fit_percent:.1f} %, RMSE {result.rmse:.1f} N."

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences on the common fit and on the interpolation."""
        none = "No setting lies between two others, so the interpolation cannot be scored: measure a third one."
        said = []
        if varying := self.chain.varying:
            percent, rmse, _ = self.result.score(varying)
            said = [f"Where the command varies: fit {percent:.1f} %, RMSE {rmse:.1f} N."]
        return (
            self.summary,
            self.choice.reason,
            *said,
            *([left.sentence("The law") for left in self.between] or [none]),
        )

    def table(self) -> Table:
        """For each setting, the fit of the law of this setting alone, of the common law, and of an interpolated one."""
        columns = [Column("setting", spec="g"), Column("records", spec="d"), Column("alone", "%", ".1f")]
        columns += [Column("as one law", "%", ".1f"), Column("interpolated", "%", ".1f")]
        between = {left.setting: left.fit_percent for left in self.between}
        rows = []
        for setting, at in self.alone.items():
            percent = self.result.score(at.runs)[0]
            rows.append((setting, len(at.runs), at.fit_percent, percent, between.get(setting)))
        between_settings = "parameters interpolated" if self.choice.blend == "parameters" else "forces blended"
        return Table(f"Fit by setting ({between_settings} between settings)", tuple(columns), tuple(rows))

    def content(self) -> Contents:
        """The fits as numbers with units and words, ready for JSON."""
        return {
            "verdict": list(self.verdict),
            "result": self.result.to_dict(),
            "settings": plain(self.table().records()),
        }

    def plot(self) -> Figure:
        """Loops at the first setting left out, interpolated; without one, those of the common fit."""
        return self.between[0].plot() if self.between else self.result.plot()

    def __repr__(self) -> str:
        return "\n".join([self.table().to_text(), *self.verdict])


@of_known_numbers
@with_defaults(SCHEDULED, check=check_keywords)
def fit_scheduled(
    law: Start, runs: Iterable[BenchRun], *, rig: Machine = OFFSET, **settings: Unpack[ScheduledSettings]
) -> ScheduledFit:
    """Fit one law to records at several settings: it depends on the command, a `Scheduled`.

    Every setting has its own parameters. First the law is fitted at each setting alone, from its own start and from the
    law of the neighbouring setting, of which the better fit counts, so that the parameters of neighbours belong
    together. From there all records are fitted as one problem. `between` then leaves each setting between two others
    out in turn and predicts it by the law interpolated from all others.

    Between the settings, parameters are interpolated or forces blended (`Scheduled.blend`). With three or more
    settings the records decide: each setting between two others is predicted from the laws of its neighbours in both
    ways. With two, forces are blended if some number of a law is not determined by the records or if the law halfway
    leaves the span of its neighbours' forces, since such numbers differ from setting to setting without a meaning.

    Records whose command varies (`BenchRun.command_channel`) join the common fit, with the way of the settings. There
    the lag of the actuator can be estimated too: `rig=["offset", "command_lag"]`.

    Arguments:
        law: the start, as in `fit`, of a law without a command.
        runs: records that state their `command`, of two or more commands, and such with a command that varies.
        rig: the test machine as in `compare`, common to all settings.
        settings: keywords, all optional: `common`, `blend` and `progress` (see `ScheduledSettings`), and those of `fit`
            (see `FitSettings`).

    Raises:
        ValueError: records without a command, or of one command only; records of one command that contradict
            each other; a law that takes a command itself.

    >>> from jaxdamp import bench, dampers, identify
    >>> runs = []
    >>> for current in (0.0, 1.0, 2.0):
    ...     dyno = bench.VirtualDyno(dampers.Linear(1000.0 + 500.0 * current), force_noise=5.0)
    ...     runs += [dataclasses.replace(run, command=current) for run in dyno.run(bench.SineTest(0.02, 2.0))]
    >>> identify.fit_scheduled(dampers.Linear, runs).between[0].fit_percent > 95.0
    True
    """
    blend, progress, bad_records = settings["blend"], settings["progress"], settings["bad_records"]
    runs = usable(settings_stated(as_runs(runs, call=CALL)), bad_records, robust=settings["loss"] != "squares")
    if bad_records != "keep" and not settings["per_record"]:
        refuse_contradicting(contradictions(runs, same_command=True))
    _checks.one_of("weighting", cast(str, settings["weighting"]), ("samples", "runs"))
    if blend is not None:
        _checks.one_of("blend", blend, ("parameters", "force"))
    if settings["initial_state"] == "estimated":
        remedy = 'Estimate states in fits of one setting: `fit(law, runs, initial_state="estimated")`.'
        _checks.refuse("initial_state", "be the same at every fit of a chain of settings", "'estimated'", remedy)
    frozen = [*name_patterns("freeze", settings["freeze"]), *frozen_by(law)]
    held_rig, lag = without_command_lag(rig)
    refuse_lag_of_held(lag > 0.0, runs)
    how: FitSettings = {**part(settings, FIT), "freeze": frozen, "bad_records": "keep"}
    on_lag = of_lag(how, lag=True)
    if lag:
        freeze, bounds, priors = of_lag(how, lag=False)
        how = {**how, "freeze": freeze, "bounds": bounds, "priors": priors}
    chain = Chain(law, runs, settings["common"], held_rig, lag, on_lag, how)
    with Progress("Fitting by setting") as line:
        shown = progress or line
        alone = chain.alone(chain.settings, shown)
        stated = Choice(blend, f"Chosen by the call: blend={blend!r}.") if blend else None
        choice = stated or choose_blend(alone, how["initial_state"])
        shown("all settings as one law")
        return ScheduledFit(chain.together(alone, choice.blend), alone, choice, chain)


def settings_stated(runs: Sequence[BenchRun]) -> tuple[BenchRun, ...]:
    """The records, all of which must state a command or have a channel of it, those that hold it two or more."""
    refuse_lacking("command", [run for run in runs if run.commands is None], COMMAND_REMEDY)
    if len(commands := {run.command for run in runs if run.command is not None}) < 2:
        remedy = "Use `fit` for one setting, and with a start, `Scheduled(...)`, where the command varies in all."
        _checks.refuse("runs", "have two commands or more that are held", f"records of {commands or 'none'}", remedy)
    return tuple(runs)


@dataclasses.dataclass(frozen=True, eq=False)
class Chain:
    """The fits of one law at several settings, each of which starts from those of its neighbours."""

    law: Start
    runs: tuple[BenchRun, ...]
    common: Sequence[str]
    rig: Machine  # without the lag of the actuator, which shows only where the command varies
    command_lag: float  # s, its start; 0 where none is fitted
    on_lag: AtLevel  # what the call says of it
    how: FitSettings
    own: Alone = dataclasses.field(default_factory=dict)  # the fit at a setting from the start of the law there

    @property
    def settings(self) -> list[float]:
        """The commands in increasing order."""
        return sorted({float(run.command) for run in self.runs if run.command is not None})

    @property
    def varying(self) -> list[BenchRun]:
        """The records whose command varies."""
        return [run for run in self.runs if run.command_channel is not None]

    def at(self, setting: float) -> list[BenchRun]:
        """The records of one setting."""
        return [run for run in self.runs if run.command == setting]

    def alone(self, settings: Sequence[float], shown: Callable[[str], None]) -> Alone:
        """The best fit at each of these settings: from its own start, or from the neighbour below or above."""
        for setting in settings:
            if setting not in self.own:
                shown(f"{setting:g} alone")
                self.own[setting] = self.fitted_at(setting, self.law, self.how["starts"])
        fits = {setting: self.own[setting] for setting in settings}
        pairs = list(itertools.pairwise(settings))
        for begin, to in [*pairs, *((above, below) for below, above in reversed(pairs))]:
            if fits[to].is_only_minimum:
                continue
            shown(f"{to:g} from the law at {begin:g}")
            again = self.fitted_at(to, fits[begin].law, 1)
            fits[to] = min(fits[to], again, key=lambda at: at.rmse)
        return fits

    def fitted_at(self, setting: float, start: Start, starts: int | None) -> AtSetting:
        """The law at one setting, by least squares: the start of a larger fit, so without errors and warnings."""
        problem = prepare(start, self.at(setting), rig=self.rig, **part(self.how, PROBLEM))
        if takes_command(problem.law):
            remedy = "Such a law is fitted to all commands by `fit`."
            _checks.refuse("law", "take no command itself", repr(problem.law), remedy)
        if of_law := [path for path in problem.per_record if not path.startswith("rig.")]:
            remedy = "Numbers of the law have a value for each setting: fit the records of one setting by themselves."
            _checks.refuse("per_record", "name numbers of the machine for a law at settings", ", ".join(of_law), remedy)
        self._named_common(problem.free.tree)
        solution = solve(problem, starts=starts, max_steps=self.how["max_steps"], solver=self.how["solver"])
        models, model = fitted_models(problem, solution.best.values)
        errors = score(models or model, problem.runs, initial_state=problem.initial_state)[:2]
        open_numbers = undetermined(problem, solution.best)
        return AtSetting(
            law_of(model), rig_of(model), problem.runs, *errors, solution.closed_form, problem.free, open_numbers
        )

    def together(self, alone: Alone, blend: str) -> FitResult:
        """The fit of all records of these settings as one law, from the laws of each.

        At the settings, where all records are, interpolated parameters and blended forces are one law. So laws of equal
        structure are fitted with interpolated parameters, which takes the states and the time of one law. Records whose
        command varies are between the settings; they are left out together with any setting.
        """
        laws = [at.law for at in alone.values()]
        shared = self._shared_by(alone)
        means = {path: np.mean([np.asarray(get(law, path)) for law in laws], axis=0) for path in shared}
        varying = self.varying if list(alone) == self.settings else []
        machine = _mean_machine(alone, self.command_lag * bool(varying))
        place = "laws" if machine is None else "law.laws"
        tie = {f"{place}.{k}.{path}": f"{place}.0.{path}" for path in shared for k in range(1, len(laws))}
        for k, at in enumerate(alone.values()):
            tie |= ties_at(at, f"{place}.{k}.", self.how["tie"])
        chosen = choices_of(alone.values(), place, self.how, tie, machine, self.on_lag)
        blended = tuple(with_values(law, means) for law in laws)
        at_levels = Scheduled.of_equal_structure(laws) and not (varying and blend == "force")
        scheduled = Scheduled(blended, list(alone), min(alone), "parameters" if at_levels else "force")
        held = held_constant_forces(scheduled, machine)
        how: FitSettings = {**self.how, **chosen, "starts": 1, "freeze": [*chosen["freeze"], *held]}
        result = fit(scheduled, [*itertools.chain(*map(self.at, alone)), *varying], rig=machine, **how)
        return with_blended_forces(result) if at_levels and blend == "force" else result

    def _named_common(self, model: Model) -> list[str]:
        """The paths that the call names as common, in the law of the model of one setting."""
        names = own_names(model).find("common", name_patterns("common", self.common))
        names = [name.removeprefix("law.") for name in names] if isinstance(model, OnRig) else names
        return match_paths([p.path for p in parameters(law_of(model))], names)

    def _shared_by(self, alone: Alone) -> list[str]:
        """The paths of the parameters that are common to all settings; of tied ones, that which the others follow."""
        paths = [[p.path for p in parameters(at.law)] for at in alone.values()]
        in_all = [path for path in paths[0] if all(path in of_law for of_law in paths)]
        first = next(iter(alone.values()))
        stated, tied = stated_parameters(first.law, self.runs), ties_at(first, "", self.how["tie"])
        named = [*self._named_common(first.model), *(p for p in tied if p.startswith("rig."))]
        shared = dict.fromkeys(tied.get(path, path) for path in named)
        return [path for path in shared if path in in_all and path not in stated]  # each level has them as stated

    def without(self, setting: float, blend: str, shown: Callable[[str], None]) -> LeftOutSetting:
        """The score at a setting of the law interpolated from all others; its records have no part in any start."""
        alone = self.alone([other for other in self.settings if other != setting], shown)
        shown(f"all but {setting:g} as one law")
        result, runs, there = self.together(alone, blend), tuple(self.at(setting)), self.own[setting]
        return LeftOutSetting(setting, runs, result, *result.score(runs)[:2], there.fit_percent, there.rmse)


def _mean_machine(alone: Alone, command_lag: float) -> Rig | None:
    """The mean of the machines that were fitted, with this start of the lag of the actuator [s]; 0 for none."""
    rigs = [at.rig for at in alone.values() if at.rig is not None]
    mean = jax.tree.map(lambda *leaves: sum(leaves) / len(leaves), *rigs) if rigs else None
    return dataclasses.replace(mean or Rig(), command_lag=command_lag) if command_lag else mean

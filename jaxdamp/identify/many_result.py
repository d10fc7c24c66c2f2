"""The result of `fit_many`: a row for each damper."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._status import Status
from jaxdamp._tables import Cell, Column, Contents, Shown, Table, plain, with_unit
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, Scheduled, keeps_conditions, with_fitted_range
from jaxdamp.identify.covered import covered_range, joined_range
from jaxdamp.identify.criteria import against_priors, priors_on
from jaxdamp.identify.dependence import OWN, Dependence
from jaxdamp.identify.estimates import rounded
from jaxdamp.identify.estimating import WEAK
from jaxdamp.identify.initial_states import DRIFT
from jaxdamp.identify.many_remarks import on_few, on_most, robust_scores, trend, undetermined
from jaxdamp.identify.model import Model, law_of, rig_of, with_range
from jaxdamp.identify.settings import FitSettings
from jaxdamp.identify.stated import stated_parameters, with_stated
from jaxdamp.parameters import Coordinates, FreeParameters
from jaxdamp.rig import Rig


if TYPE_CHECKING:
    from jaxdamp.identify.law_result import FitResult


OUTLYING = 6.0  # robust standard deviations from the other dampers from which one is named
NOT_COUNTED = 0.02  # share of samples with little weight, above that of the others, from which it is named
ONE_RECORD = 1.5  # times the RMSE of the other records, from which one is named as the cause
CERTAIN = 4.0  # standard errors by which it must differ as well
ROUNDING = 1e-9  # of a number, by which it may be beyond a limit


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ManyFits(AbstractResult):
    """One law fitted to many dampers.

    Attributes:
        names: of the dampers.
        records: the records of each damper; from a store they are read when they are asked for.
        settings: the setting of each damper, if stated.
        values: of the free numbers of each damper, in their units, shape (dampers, free).
        standard_errors: of the values; infinite for numbers that the records do not determine.
        fit_percent: of each damper over its records.
        rmse: of each damper over its records [N].
        status: how the search of each damper ended.
        steps: of each search.
        free: the free parameters, with names, units and meanings.
        dependence: how shared parameters depend on the setting.
        vector: the numbers that the dependence is made of.
        record_rmse: of each record of each damper [N].
        share_left_out: of the samples of each damper, to which a robust loss gives less than half weight.
        drift: largest relative change of the states of each damper over the cycle before a record that starts in the
            periodic solution.
        bias: of the values by the noise of stroke and velocity, if `input_noise` was given.
        options: of the call, for `fit` of one damper.
        reasons: why each damper, in a store, or which of its records were left out; empty for most.
    """

    names: tuple[str, ...]
    records: Sequence[tuple[BenchRun, ...]]
    settings: tuple[float, ...] | None
    values: Float[np.ndarray, "dampers free"]
    standard_errors: Float[np.ndarray, "dampers free"]
    fit_percent: Float[np.ndarray, " dampers"]
    rmse: Float[np.ndarray, " dampers"]
    status: tuple[Status, ...]
    steps: Int[np.ndarray, " dampers"]
    free: FreeParameters
    dependence: Dependence | None = None
    vector: Float[np.ndarray, " size"] | None = None
    record_rmse: tuple[Float[np.ndarray, " _"], ...] = ()
    share_left_out: Float[np.ndarray, " _"] = dataclasses.field(default_factory=lambda: np.zeros(0))
    drift: Float[np.ndarray, " _"] = dataclasses.field(default_factory=lambda: np.zeros(0))
    bias: Float[np.ndarray, "dampers free"] | None = None
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    reasons: tuple[str, ...] = ()

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the free numbers."""
        return tuple(self.free.names)

    @functools.cached_property
    def models(self) -> tuple[Model, ...]:
        """The fitted law of each damper, on its machine if one was fitted."""
        return tuple(map(self._model, range(len(self))))

    def _model(self, place: int) -> Model:
        """The fitted law of one damper, on its machine if one was fitted."""
        if self.status[place] is Status.LEFT_OUT:
            must, value = "name a damper that was fitted", f"{self.names[place]!r} ({self.reasons[place]})"
            _checks.refuse("name", must, value, "Take the laws of the others by name: `many[name]`.")
        runs, model = self.records[place], self.free.started_at(self.values[place]).tree
        return with_range(with_stated(model, stated_parameters(model, runs)), covered_range(runs, model))

    @property
    def laws(self) -> tuple[AbstractDamper, ...]:
        """The fitted law of each damper, with the range of its records."""
        return tuple(law_of(model) for model in self.models)

    @property
    def rigs(self) -> tuple[Rig | None, ...]:
        """The fitted machine of each damper."""
        return tuple(rig_of(model) for model in self.models)

    def __len__(self) -> int:
        """Number of dampers."""
        return len(self.names)

    def __getitem__(self, name: str) -> AbstractDamper:
        """The fitted law of the damper of that name."""
        _checks.one_of("name", name, self.names)
        return law_of(self._model(self.names.index(name)))

    def fit(self, name: str, **options: Unpack[FitSettings]) -> "FitResult":
        """The fit of one damper with everything that `identify.fit` gives: several minima, profiles, bias, states.

        It starts at the law of this damper, with the options of `fit_many`; parameters that are shared are not held.

        Arguments:
            name: of the damper.
            options: others of `identify.fit`, such as `input_noise`.
        """
        from jaxdamp.identify.fitting import fit  # which hands many dampers to `fit_many`

        _checks.one_of("name", name, self.names)
        given = {**self.options, "starts": None, **options}
        return fit(self[name], self.records[self.names.index(name)], **given)

    def law_at(self, setting: float, blend: str | None = None) -> AbstractDamper:
        """The law at a setting between those of the dampers.

        Shared parameters follow their polynomials. All others are interpolated by straight lines between the
        neighbouring settings, or the forces of the laws at these settings are blended (`dampers.Scheduled`).

        Arguments:
            setting: between the lowest and the highest of the dampers.
            blend: `"parameters"` or `"force"`. If it is left out, forces are blended where the records of a neighbour
                leave a number that is not shared undetermined: such numbers may differ from setting to setting without
                a meaning.

        Raises:
            ValueError: no settings were given, or the setting is outside them; a polynomial beyond the limits of
                its parameter; an unknown blend.
        """
        if blend is not None:
            _checks.one_of("blend", blend, ("parameters", "force"))
        if self.settings is None:
            _checks.refuse("settings", "be given to `fit_many` for a law between them", None)
        settings = np.array(self.settings)[self._fitted]
        if not settings.size:
            _checks.refuse("setting", "lie between dampers that were fitted, and none was", setting, self.summary)
        if not settings.min() <= setting <= settings.max():
            must = f"be from {settings.min():g} to {settings.max():g}, where there are dampers"
            _checks.refuse("setting", must, setting)
        low, high = float(settings[settings <= setting].max()), float(settings[settings >= setting].min())
        if low == high or (blend or self._blend_at(low, high)) == "parameters":
            law = self._interpolated(setting)
        else:
            law = Scheduled((self._interpolated(low), self._interpolated(high)), [low, high], setting, "force")
        ranges = [law_of(self.models[place]).fitted_to for place in self._fitted]
        return with_fitted_range(law, joined_range([each for each in ranges if each is not None]))

    def _blend_at(self, low: float, high: float) -> str:
        """What lies between two settings: forces if a number that is not shared is undetermined at one of them."""
        not_shared = np.ones(len(self.free.names), bool) if self.dependence is None else self.dependence.degree == OWN
        not_shared &= np.array([not name.startswith("rig.") for name in self.free.names])
        at = np.isin(np.array(self.settings), (low, high)) & np.isin(np.arange(len(self)), self._fitted)
        weak = ~(self.standard_errors[at] <= WEAK * np.abs(self.values[at]))
        return "force" if np.any(weak[:, not_shared]) else "parameters"

    def _interpolated(self, setting: float) -> AbstractDamper:
        """The law with parameters on their polynomials, or on straight lines between the settings."""
        settings, fitted = np.array(self.settings)[self._fitted], self.values[self._fitted]
        distinct = np.unique(settings)
        means = np.stack([fitted[settings == one].mean(axis=0) for one in distinct])
        values = np.array([np.interp(setting, distinct, column) for column in means.T])
        if self.dependence is not None and self.vector is not None:
            y = self.dependence.at_setting(self.vector, setting)
            with_own = np.where(np.isnan(y), Coordinates(self.free, smooth="ordered").start, y)
            shared = np.asarray(Coordinates(self.free, smooth="ordered").to_physical(jnp.asarray(with_own)))
            values = np.where(np.isnan(y), values, shared)
        remedy = "Share with lower degrees, over more settings, or not at all."
        for name, value, low, high in zip(self.free.names, values, *self.free.limits(), strict=True):
            if not low - ROUNDING * abs(value) <= value <= high + ROUNDING * abs(value):
                must = f"be one at which {name} is within {low:g} to {high:g}"
                _checks.refuse("setting", must, f"{setting:g}, where its polynomial gives {value:.4g}", remedy)
        tree = self.free.started_at(values).tree
        if not keeps_conditions(tree):
            _checks.refuse("setting", "be one at which the law keeps its conditions", setting, remedy)
        return law_of(tree)

    @functools.cached_property
    def remarks(self) -> tuple[str, ...]:
        """For each damper how its search failed and in what it differs from the others; empty for most."""
        good = (Status.CONVERGED, Status.LEFT_OUT)
        texts: list[list[str]] = [[] if s in good else [s.sentence] for s in self.status]
        for i, reason in enumerate(self.reasons):
            words = f"it was left out: {reason}" if self.status[i] is Status.LEFT_OUT else reason
            texts[i] += [words] if reason else []
        if self._fitted.size:
            self._compare(texts)
        return tuple("; ".join([*text, *self._biased(i)]) for i, text in enumerate(texts))

    def _compare(self, texts: list[list[str]]) -> None:
        """Add to the remark on each damper in what it differs from the others that were fitted."""
        fitted = self._fitted
        settings = None if self.settings is None else tuple(np.array(self.settings)[fitted])
        priors = priors_on(self.free, self.options.get("priors") or {})
        for i in fitted:
            texts[i] += [f"its records {words}" for words in against_priors(self.free, priors, self.values[i])]
        for i in np.flatnonzero(self.drift > DRIFT):
            texts[i].append(f"its states are not periodic: over a cycle they still change by {self.drift[i]:.2g}")
        misfit = 100.0 - self.fit_percent
        for i, score in zip(fitted, robust_scores(misfit[fitted], None), strict=True):
            if score > OUTLYING:
                times = misfit[i] / np.median(misfit[fitted])
                texts[i].append(f"its error is {times:.2g} times that of the others{self._mostly_of(int(i))}")
        for i, share in enumerate(self.share_left_out):
            if share > NOT_COUNTED + float(np.nanmedian(self.share_left_out)):
                texts[i].append(f"{100.0 * share:.2g} % of its samples have less than half weight")
        for j, name in enumerate(self.parameters):
            values = self.values[fitted, j]
            expected, scores = trend(values, settings), robust_scores(values, settings)
            apart = np.abs(values - expected)
            sure = (np.abs(scores) > OUTLYING) & (apart > CERTAIN * self.standard_errors[fitted, j])
            for k in np.flatnonzero(sure):
                unit = f" {self.free.owners[j].unit}".rstrip()
                suggested = f"{expected[k]:.4g}{unit}"
                texts[fitted[k]].append(f"{name} = {values[k]:.4g}{unit} where the others suggest {suggested}")
        for i, words in zip(fitted, on_few(self.parameters, self._undetermined), strict=True):
            texts[i] += [words] if words else []

    @functools.cached_property
    def _undetermined(self) -> np.ndarray:
        """Which numbers the records of each damper that was fitted do not determine."""
        return undetermined(self.free, self.values[self._fitted], self.standard_errors[self._fitted])

    def _biased(self, i: int) -> list[str]:
        """The numbers of a damper that the noise of stroke and velocity biases by more than their standard errors."""
        if self.bias is None:
            return []
        numbers = zip(self.parameters, self.free.owners, self.bias[i], self.standard_errors[i], strict=True)
        words = "noise of stroke and velocity biases {} by about {:+.2g} {}"
        return [words.format(name, bias, p.unit).rstrip() for name, p, bias, error in numbers if abs(bias) > error]

    @functools.cached_property
    def _fitted(self) -> np.ndarray:
        """The places of the dampers that were fitted."""
        return np.flatnonzero([status is not Status.LEFT_OUT for status in self.status])

    @property
    def unusual(self) -> tuple[str, ...]:
        """The dampers with a remark."""
        return tuple(name for name, remark in zip(self.names, self.remarks, strict=True) if remark)

    def table(self) -> Table:
        """A row for each damper: its parameters with standard errors, its error and a remark."""
        columns = [Column("damper"), *([Column("setting")] if self.settings is not None else [])]
        for name, owner in zip(self.parameters, self.free.owners, strict=True):
            columns += [Column(name, owner.unit), Column("±", owner.unit)]
            columns += [Column("bias", owner.unit)] * (self.bias is not None)
        columns += [Column("fit", "%", ".1f"), Column("RMSE", "N", ".1f"), Column("remark")]
        rows = []
        for i, name in enumerate(self.names):
            row: list[Cell] = [name, *([self.settings[i]] if self.settings is not None else [])]
            if self.status[i] is Status.LEFT_OUT:
                rows.append((*row, *[None] * (len(columns) - len(row) - 1), self.remarks[i]))
                continue
            for j, (value, error) in enumerate(zip(self.values[i], self.standard_errors[i], strict=True)):
                texts = rounded(float(value), float(error))
                row += [Shown(float(value), texts[0]), Shown(float(error), texts[1])]
                row += [] if self.bias is None else [float(self.bias[i, j])]
            rows.append((*row, float(self.fit_percent[i]), float(self.rmse[i]), self.remarks[i]))
        return Table(
            f"{type(law_of(self.free.tree)).__name__} fitted to {len(self)} dampers", tuple(columns), tuple(rows)
        )

    plot = drawn_by("many_fits", "The parameters and errors of all dampers side by side.")

    def content(self) -> Contents:
        """The fits as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        names = list(self.parameters)
        units = dict(zip(names, (owner.unit for owner in self.free.owners), strict=True))
        arrays = {"values": self.values, "standard_errors": self.standard_errors, "bias": self.bias}
        dampers = {
            name: {
                **({} if self.settings is None else {"setting": self.settings[i]}),
                **{
                    kind: plain(dict(zip(names, array[i].tolist(), strict=True)))
                    for kind, array in arrays.items()
                    if array is not None
                },
                "fit": with_unit(float(self.fit_percent[i]), "%"),
                "rmse": with_unit(float(self.rmse[i]), "N"),
                "status": self.status[i].name.lower(),
                "steps": int(self.steps[i]),
                "remark": self.remarks[i],
            }
            for i, name in enumerate(self.names)
        }
        return {"law": repr(law_of(self.free.tree)), "units": units, "dampers": dampers}

    @property
    def summary(self) -> str:
        """Law, number of dampers and errors."""
        at, law = self._fitted, type(law_of(self.free.tree)).__name__
        if not at.size:
            return f"{law}: none of {len(self)} dampers was fitted: {self.reasons[0]}"
        left = f", {len(self) - at.size} of them left out" if at.size < len(self) else ""
        errors = f": mean fit {np.mean(self.fit_percent[at]):.1f} %, RMSE up to {np.max(self.rmse[at]):.4g} N"
        return f"{law} fitted to {len(self)} dampers{left}{errors}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the records of most dampers do not determine, and the remark on each damper that has one."""
        remarks = (f"{name}: {remark}" for name, remark in zip(self.names, self.remarks, strict=True) if remark)
        return (*on_most(self.parameters, self._undetermined), *remarks)

    def __repr__(self) -> str:
        return "\n".join([self.summary, *self.warnings])

    def _mostly_of(self, i: int) -> str:
        """The record that a large error of a damper is due to, if it is one."""
        errors = self.record_rmse[i]
        worst = int(np.argmax(errors))
        alone = len(errors) > 1 and errors[worst] > ONE_RECORD * np.median(np.delete(errors, worst))
        return f", mostly of {self.records[i][worst].name!r} with an RMSE of {errors[worst]:.3g} N" if alone else ""

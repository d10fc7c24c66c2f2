"""Results of fits: the law, its parameters with uncertainty, and its errors."""

import dataclasses
import functools
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np
from jaxtyping import Float

from jaxdamp._results import AbstractResult
from jaxdamp._status import Status
from jaxdamp._tables import Table, plain, with_unit
from jaxdamp._types import VectorLike
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.bayes import Posterior, posterior
from jaxdamp.identify.estimates import Estimate, parameter_table, rounded
from jaxdamp.identify.model import Model, RecordStart, on_rig
from jaxdamp.identify.predicting import predict_runs
from jaxdamp.identify.profile_curve import ProfileCurve, profile_curve
from jaxdamp.identify.propagation import Band, Evidence, Propagated, band, propagate
from jaxdamp.identify.record_sensitivity import RecordSensitivity, sensitivity_to_records
from jaxdamp.identify.residual import ErrorShares, error_shares
from jaxdamp.identify.scoring import Score, score
from jaxdamp.rig import Rig


if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Minimum(NamedTuple):
    """A set of parameters at which the sum of squares has a minimum."""

    values: dict[str, float]  # of the free numbers, in their units
    chi_square: float  # sum of squares over the variance of the noise, above that of the best minimum
    starts: int  # number of starts that ended here


def describe(minima: Sequence[Minimum], starts: int) -> str:
    """The ends of several starts, in words."""
    best, *others = minima
    parts = [f"{best.starts} ended here"]
    parts += [f"{m.starts} in another minimum, chi-square {m.chi_square:.3g} higher" for m in others]
    left = starts - sum(m.starts for m in minima)
    return f"{starts} starts: " + "; ".join([*parts, *[f"{left} given up as worse"] * bool(left)])


@dataclasses.dataclass(frozen=True, repr=False)
class AbstractFitted(AbstractResult):
    """A law fitted to records or trained on them, and how good it is.

    Attributes:
        law: the fitted law.
        runs: the records given; those with an infinite weighting were not fitted.
        fit_percent: 100 (1 − ‖y − ŷ‖/‖y − mean y‖) over all records fitted.
        rmse: root of the mean squared error over all records fitted [N].
        scores: the same for each record given.
        warnings: doubts about the result, in words.
        status: how the search ended.
        rig: the fitted test machine, if one was fitted.
        initial_state: how records start, as in `fit`.
        record_starts: the states at the first sample of each record if they were estimated, None for one left out.
    """

    law: AbstractDamper
    runs: tuple[BenchRun, ...]
    fit_percent: float
    rmse: float
    scores: tuple[Score, ...]
    warnings: tuple[str, ...]
    status: Status
    rig: Rig | None = dataclasses.field(default=None, kw_only=True)
    initial_state: str = dataclasses.field(default="warm_up", kw_only=True)
    record_starts: tuple[RecordStart | None, ...] = dataclasses.field(default=(), kw_only=True)

    @property
    def summary(self) -> str:
        """Law, number of records and errors."""
        percent = f"{self.fit_percent:.1f} %"
        return f"{type(self.law).__name__} on {len(self.runs)} records: {percent}, RMSE {self.rmse:.4g} N"

    @property
    def model(self) -> Model:
        """What was fitted to the records: the law, on a machine if that was fitted too."""
        return on_rig(self.law, self.rig)

    def model_of(self, runs: Sequence[BenchRun]) -> Model:
        """`model`, with the estimated states at the beginning of those of these records that were fitted."""
        known = {id(run): start for run, start in zip(self.runs, self.record_starts, strict=False)}
        return on_rig(self.law, self.rig, [known.get(id(run)) for run in runs] if known else ())

    @overload
    def respond(self, runs: BenchRun) -> np.ndarray: ...
    @overload
    def respond(self, runs: Iterable[BenchRun]) -> list[np.ndarray]: ...
    def respond(self, runs: BenchRun | Iterable[BenchRun]) -> np.ndarray | list[np.ndarray]:
        """Force [N] that the fit expects at every sample of a record, old or new, of the same machine.

        It is the force of the law with what the fit found beside it: gas force and zero error of the load cell
        (`rig`), and the states at the beginning (`initial_state`). `jaxdamp.respond(result.law, ...)` is the damper
        alone, started at rest.

        Arguments:
            runs: one record, or several for a list of forces.
        """
        records = as_runs(runs)
        forces = predict_runs(self.model_of(records), records, self.initial_state)
        return forces[0] if isinstance(runs, BenchRun) else forces

    def predict(self, runs: BenchRun | Iterable[BenchRun]) -> list[np.ndarray]:
        """Deprecated: `respond` gives the same, without a list for one record."""
        text = "`predict` is deprecated: `respond(run)` gives the force of one record, `respond(runs)` a list."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return self.respond(as_runs(runs))

    def score(self, runs: BenchRun | Iterable[BenchRun]) -> tuple[float, float, tuple[Score, ...]]:
        """Fit percent, RMSE [N] and the scores by record, on records old or new, as `respond` predicts them."""
        runs = as_runs(runs)
        return score(self.model_of(runs), runs, initial_state=self.initial_state)

    def content(self) -> dict[str, Any]:
        """Law, errors and scores as plain data.

        The law itself is written by `export.to_json`.
        """
        return {
            "law": repr(self.law),
            **({} if self.rig is None else {"rig": repr(self.rig)}),
            "fit": with_unit(self.fit_percent, "%"),
            "rmse": with_unit(self.rmse, "N"),
            "scores": [score.to_dict() for score in self.scores],
        }


@dataclasses.dataclass(frozen=True, repr=False)
class FitResult(AbstractFitted):
    """A fitted law with its parameters, their uncertainty and its errors.

    Attributes:
        parameters: an estimate for each free number, with unit, standard error and 95 % interval.
        covariance: of the free numbers, in their units, in the order of `parameters`.
        steps: steps of the search that gave the law, 0 for a closed form.
        starts: number of starts, 1 for a closed form.
        minima: the minima that were reached, the best first, which is this result.
        inflation: factor on the standard errors because the residual is correlated from sample to sample; 1 if it is
            not, or if the noise was given.
        record_laws: the law of each record, if parameters have a value for each record; `law` then has their means.
        record_rigs: the test machine of each record, as `record_laws`.
        criterion: loss, priors and what is special about the records in words; empty for plain least squares.
        main_warnings: the gist of `warnings`: at most five, the one with the gravest consequence first, groups of
            numbers named once.
        patterns: what each pattern with `*` in the call stood for, in words.
        evidence: the minimum and the noise, for `band`, `propagate`, `profile` and `posterior`.
    """

    parameters: tuple[Estimate, ...]
    covariance: Float[np.ndarray, "free free"]
    steps: int
    starts: int = 1
    minima: tuple[Minimum, ...] = ()
    inflation: float = 1.0
    record_laws: tuple[AbstractDamper, ...] = ()
    record_rigs: tuple[Rig, ...] = ()
    criterion: str = ""
    main_warnings: tuple[str, ...] = ()
    patterns: str = ""
    evidence: Evidence | None = None

    @property
    def initial_states(self) -> tuple[Float[np.ndarray, " states"] | None, ...]:
        """The states at the first sample of each record, if they were estimated; None for records left out."""
        return tuple(None if start is None else np.asarray(start.initial_state) for start in self.record_starts)

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of that name, or of the only name that ends with it: `"rate"` for `"law.rate"`."""
        named = [estimate for estimate in self.parameters if estimate.name == name]
        named = named or [estimate for estimate in self.parameters if estimate.name.endswith(f".{name}")]
        if len(named) == 1:
            return named[0]
        raise KeyError(f"No parameter is named {name!r}; there are {', '.join(e.name for e in self.parameters)}.")

    @functools.cached_property
    def error_shares(self) -> ErrorShares:
        """Shares of the squared error over the records: shape, hysteresis, rest (`identify.error_shares`)."""
        rigs = self.record_rigs or (None,) * len(self.record_laws)
        starts = [(start,) for start in self.record_starts] or [()] * len(self.record_laws)
        models = [on_rig(*each) for each in zip(self.record_laws, rigs, starts, strict=False)]
        return error_shares(models or self.model_of(self.runs), self.runs, self.initial_state)

    def table(self, truth: AbstractDamper | None = None, *, true_rig: Rig | None = None, title: str = "") -> Table:
        """The parameters with units, standard errors and meanings, compared with a true law if one is given.

        Arguments:
            truth: the true law.
            true_rig: the true test machine, if one was fitted.
            title: of the table.
        """
        title = title or f"Parameters of {type(self.law).__name__}"
        title += f" ({self.criterion})" if self.criterion else ""
        true = None if truth is None else on_rig(truth, None if self.rig is None else true_rig or Rig())
        return parameter_table(title, self.parameters, true)

    def propagate(self, function: Callable[[Any], Any], *, samples: int | None = None, seed: int = 0) -> Propagated:
        """The uncertainty of any function of the law: a force, a table, a metric of a ride with it.

        Arguments:
            function: of the law, such as `lambda law: law.force_velocity(0.5)`; computed by JAX, of any shape.
            samples: number of laws drawn from the uncertainty of the parameters, for functions that are not straight
                within it; derivatives are used if it is left out.
            seed: of the samples.

        Returns:
            Value, standard error, and lower and upper end of the 95 % interval.
        """
        return propagate(self._evidence, function, samples, seed)

    def sensitivity_to_records(self, function: Callable[[Any], Any]) -> RecordSensitivity:
        """Exact derivatives of a function of the law by the measured forces, through the fit itself.

        What would a ride metric, or the difference from another damper, be if the force of a record were 1 % larger, or
        10 N higher, and the law were fitted again? Parameters at bounds stay there.

        Arguments:
            function: of the law, computed by JAX: a number, or a dictionary of numbers such as the metrics of a `Ride`,
                as in `lambda law: ride.of_vehicle(quarter_car(law))()`.

        Raises:
            ValueError: a fit with a robust loss or priors; a minimum that the records do not determine.
        """
        return sensitivity_to_records(self._evidence, function, self.runs, self.criterion)

    def band(self, velocities: VectorLike) -> Band:
        """95 % intervals of the force [N] at constant velocities [m/s]; `result.band(velocities).plot()`.

        The states of a law with states are settled, for the derivatives over two seconds at each velocity.
        """
        return band(self._evidence, self.law, np.asarray(velocities, float))

    def profile(self, name: str) -> ProfileCurve:
        """The cost of other values of a parameter, all others fitted again, and its 95 % interval; `.plot()` shows it.

        Unlike the standard error it is valid where the sum of squares is no parabola.

        Arguments:
            name: as in `parameters`.
        """
        return profile_curve(self._evidence, name, self[name].interval)

    def posterior(self, *, samples: int = 1000, warm_up: int = 500, chains: int = 2, seed: int = 0) -> Posterior:
        """The full posterior of the parameters, by the no-U-turn sampler of numpyro (`pip install 'jaxdamp[bayes]'`).

        Unlike standard errors it is valid where parameters depend on one another along curves, or end at bounds. The
        prior is flat within the domains and `bounds`, times the `priors` of the fit; the level of the noise is unknown.
        Noise with a memory counts by its `inflation`, a robust loss with the weights of its minimum.

        Arguments:
            samples: of each chain.
            warm_up: steps before them, to adapt the sampler.
            chains: side by side.
            seed: of the sampler.

        Raises:
            ImportError: numpyro is not installed.
            ValueError: a parameter that nothing determines.
        """
        return posterior(self._evidence, samples, warm_up, chains, seed)

    @property
    def _evidence(self) -> Evidence:
        if self.evidence is None:
            raise ValueError("This result was made without `evidence`: only those of `fit` and `judge` hold it.")
        return self.evidence

    def content(self) -> dict[str, Any]:
        """Law, errors, scores and parameters as plain data."""
        return super().content() | {
            **{name: words for name in ("criterion", "patterns") if (words := getattr(self, name))},
            "error_shares": plain(self.error_shares._asdict()),
            "parameters": [plain(estimate._asdict()) for estimate in self.parameters],
            "covariance": plain(self.covariance),
        }

    def plot(self, runs: Iterable[BenchRun] | None = None, **options: Any) -> "Figure":
        """Loops of force over velocity and over stroke, measured and fitted, with residuals."""
        from jaxdamp.plots import fit_loops

        return fit_loops(self, runs if runs is None else tuple(runs), **options)

    def __repr__(self) -> str:
        width = max(len(e.name) for e in self.parameters)
        texts = [rounded(e.value, e.standard_error) for e in self.parameters]
        lines = [self.summary]
        for e, (value, error) in zip(self.parameters, texts, strict=True):
            note = f"  ({e.note})" * bool(e.note) + f"  = {', '.join(e.tied)}" * bool(e.tied)
            lines.append(f"  {e.name:<{width}}  {value:>11} ± {error:<9} {e.unit}{note}")
        lines += [f"  {words}" for words in (self.criterion, self.patterns) if words]
        if len(self.minima) > 1:
            lines.append(f"  {describe(self.minima, self.starts)}")
        return "\n".join(lines + [f"  warning: {warning}" for warning in self.warnings])

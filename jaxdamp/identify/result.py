"""`Fit`: what every fit gives, of a law, a vehicle, or any model to numbers."""

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, PyTree

from jaxdamp._results import AbstractResult
from jaxdamp._status import Status
from jaxdamp._tables import Contents, Table, plain
from jaxdamp.identify.bayes import Posterior, posterior
from jaxdamp.identify.estimates import Estimate, Minimum, describe, rounded
from jaxdamp.identify.profile import ProfileCurve, profile_curve
from jaxdamp.identify.propagation import Evidence, Propagated, propagate


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Fit(AbstractResult):
    """A model fitted to records or numbers, with the uncertainty of its parameters.

    Attributes:
        parameters: an estimate for each free number, with unit, standard error and 95 % interval.
        covariance: of the free numbers, in their units, in the order of `parameters`.
        warnings: doubts about the result, in words.
        status: how the search ended.
        steps: steps of the search that gave the result, 0 for a closed form.
        starts: number of starts, 1 for a closed form.
        minima: the minima that were reached, the best first, which is this result.
        inflation: factor on the standard errors because the residual is correlated from sample to sample; 1 if it is
            not, or if the noise was given.
        criterion: loss, priors and what is special about the records in words; empty for plain least squares.
        main_warnings: the gist of `warnings`: at most five, the one with the gravest consequence first, groups of
            numbers named once.
        patterns: what each pattern with `*` in the call stood for, in words.
        evidence: the minimum and the noise, for `propagate`, `profile` and `posterior`.
    """

    parameters: tuple[Estimate, ...]
    covariance: Float[np.ndarray, "free free"]
    warnings: tuple[str, ...]
    status: Status
    steps: int
    starts: int = 1
    minima: tuple[Minimum, ...] = ()
    inflation: float = 1.0
    criterion: str = ""
    main_warnings: tuple[str, ...] = ()
    patterns: str = ""
    evidence: Evidence | None = None

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of that name, or of the only name that ends with it: `"rate"` for `"law.rate"`."""
        return self.estimate(name)

    def estimate(self, name: str) -> Estimate:
        """The estimate of that name, or of the only one whose name ends with it: "sprung_mass", "stroke.offset"."""
        named = [e for e in self.parameters if e.name == name]
        named = named or [e for e in self.parameters if e.name.endswith(f".{name}")]
        if len(named) == 1:
            return named[0]
        what = f"{len(named)} parameters are" if named else "No parameter is"
        raise KeyError(f"{what} named {name!r}; there are {', '.join(e.name for e in self.parameters)}.")

    def propagate(
        self, function: Callable[[PyTree], PyTree], *, samples: int | None = None, seed: int = 0
    ) -> Propagated:
        """The uncertainty of any function of the fitted law, vehicle or model: a force, a table, a metric of a ride.

        Arguments:
            function: of it, such as `lambda law: law.force_velocity(0.5)`; computed by JAX, it returns
                a number, an array, or a dict or other pytree of them.
            samples: number of models drawn from the uncertainty of the parameters within their domains, for functions
                that are not straight within it. If it is left out, the derivatives at the fit are used, which know no
                domain: the interval of a mass of 1 ± 2 kg then begins below zero. Truths and counts need samples.
            seed: of the samples.

        Returns:
            Value, standard error, and lower and upper end of the 95 % interval, each in the structure that the function
            returns.
        """
        return propagate(self._evidence, function, samples, seed)

    def profile(self, name: str) -> ProfileCurve:
        """The cost of other values of a parameter, all others fitted again, and its 95 % interval; its `plot` shows it.

        Unlike the standard error it is valid where the sum of squares is no parabola.

        Arguments:
            name: as in `parameters`, or its end, as in `estimate`.
        """
        parameter = self.estimate(name)
        return profile_curve(self._evidence, parameter.name, parameter.interval)

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

    def parameters_table(self) -> Table:
        """The fitted numbers with units, standard errors and meanings."""
        return self.table()

    def content(self) -> Contents:
        """Parameters and their covariance as plain data, and what was minimised in words."""
        return {
            **{name: words for name in ("criterion", "patterns") if (words := getattr(self, name))},
            "parameters": [plain(estimate._asdict()) for estimate in self.parameters],
            "covariance": plain(self.covariance),
        }

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

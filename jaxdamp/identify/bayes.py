"""The posterior of the parameters of a fitted law, sampled by numpyro."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Table
from jaxdamp.dampers import margins
from jaxdamp.identify.propagation import Evidence, Propagated, numbers_of, over_samples
from jaxdamp.parameters import Coordinates


INSIDE = 0.5  # standard errors from an edge at which a chain starts, if the fit ended there
APART = 1.0  # spread of the starts of the chains, in standard errors
AGREED = 1.05  # largest ratio r hat of chains that agree
REFUSED = 1e12  # potential where the forces are not finite


class Spread(NamedTuple):
    """The posterior of one number.

    Attributes:
        name: path of the number.
        unit: in SI.
        mean: over the samples, in the unit.
        standard_deviation: over the samples, in the unit.
        interval: ends of the 95 % interval of the samples, in the unit.
        r_hat: near 1 if the chains agree.
        effective: number of independent samples.
    """

    name: str
    unit: str
    mean: float
    standard_deviation: float
    interval: tuple[float, float]
    r_hat: float
    effective: float


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Posterior(AbstractResult):
    """Samples of the posterior of the free parameters.

    Attributes:
        evidence: the fit.
        samples: in the units of the parameters, of all chains, without those that break a condition of the law, shape
            (samples, free).
        parameters: mean, standard deviation and interval of each free number, with the agreement of the chains.
        divergences: steps of the sampler that went wrong; more than a few mean that corners of the posterior are
            missing.
    """

    evidence: Evidence
    samples: Float[np.ndarray, "samples free"]
    parameters: tuple[Spread, ...]
    divergences: int

    def __getitem__(self, name: str) -> Spread:
        """The posterior of the number of that name."""
        _checks.one_of("name", name, [row.name for row in self.parameters])
        return next(row for row in self.parameters if row.name == name)

    def propagate(self, function: Callable[[PyTree], PyTree]) -> Propagated:
        """A function of the law over the samples, as `FitResult.propagate`."""
        return over_samples(numbers_of(function, self.evidence.model), jnp.asarray(self.samples))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Steps of the sampler that went wrong, and numbers on which its chains do not agree."""
        wrong = f"{self.divergences} steps of the sampler went wrong: corners of the posterior may be missing."
        apart = [row.name for row in self.parameters if not row.r_hat < AGREED]
        unsure = f"The chains do not agree on {', '.join(apart)}: take more samples."
        return (*[wrong] * (self.divergences > 0), *[unsure] * bool(apart))

    @property
    def summary(self) -> str:
        """Numbers of samples and of parameters."""
        return f"{len(self.samples)} samples of the posterior of {len(self.parameters)} numbers."

    plot = drawn_by("posterior", "Histograms of the samples.")

    def table(self) -> Table:
        """The posterior of every number."""
        columns = [Column("parameter"), Column("unit"), Column("mean", spec=".5g"), Column("std", spec=".2g")]
        columns += [Column("95 % from", spec=".5g"), Column("to", spec=".5g"), Column("r hat", spec=".3f")]
        columns += [Column("independent samples", spec=".0f")]
        rows = [
            (r.name, r.unit or "–", r.mean, r.standard_deviation, *r.interval, r.r_hat, r.effective)
            for r in self.parameters
        ]
        return Table(f"Posterior from {len(self.samples)} samples", tuple(columns), tuple(rows))


def posterior(evidence: Evidence, samples: int, warm_up: int, chains: int, seed: int) -> Posterior:
    """`FitResult.posterior`."""
    try:
        from numpyro.diagnostics import effective_sample_size, split_gelman_rubin
        from numpyro.infer import MCMC, NUTS
    except ImportError as error:
        raise ImportError("`posterior` needs numpyro: pip install 'jaxdamp[bayes]'.") from error
    for name, count in (("samples", samples), ("warm_up", warm_up), ("chains", chains)):
        if count < 2:
            _checks.refuse(name, "be 2 or more", count)
    _checks.seed(seed)
    potential, physical = _potential(evidence)
    begin = APART * np.random.default_rng(seed).uniform(-1.0, 1.0, (chains, evidence.minimum.values.size))
    if not bool(jnp.any(jax.vmap(potential)(jnp.asarray(begin)) < REFUSED)):
        must, remedy = "have finite forces or numbers about its minimum", "Freeze parameters, or give `bounds`."
        _checks.refuse("the fit", must, "one without any at the starts of the chains", remedy)
    kernel = NUTS(potential_fn=potential, forward_mode_differentiation=True)
    side_by_side = {"num_chains": chains, "chain_method": "vectorized", "progress_bar": False}
    sampler = MCMC(kernel, num_warmup=warm_up, num_samples=samples, **side_by_side)
    with jax.numpy_dtype_promotion("standard"):  # which numpyro relies on
        sampler.run(jax.random.key(seed), init_params=jnp.asarray(begin), extra_fields=("diverging",))
    drawn = np.asarray(jax.vmap(jax.vmap(physical))(sampler.get_samples(group_by_chain=True)), float)
    free, flat = evidence.problem.free, drawn.reshape(-1, drawn.shape[-1])
    # The prior is zero where a condition of the law does not hold: the samples beyond are none of the posterior.
    holds = np.asarray(jax.vmap(lambda values: jnp.all(margins(free.build(values)) > 0.0))(jnp.asarray(flat)))
    flat = flat[holds]
    if len(flat) < 2:
        _checks.refuse("samples", "be more: of these, nearly all break a condition of the law", samples)
    low, high = np.quantile(flat, [0.025, 0.975], axis=0)
    checks = (split_gelman_rubin(drawn), np.mean(holds) * effective_sample_size(drawn))
    measures = (flat.mean(axis=0), flat.std(axis=0, ddof=1), low, high, *checks)
    rows = [
        Spread(name, p.unit, mean, std, (below, above), r_hat, count)
        for name, p, (mean, std, below, above, r_hat, count) in zip(
            free.names, free.owners, np.stack(measures, axis=1).tolist(), strict=True
        )
    ]
    return Posterior(evidence, flat, tuple(rows), int(np.sum(sampler.get_extra_fields()["diverging"])))


def _potential(evidence: Evidence) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Minus the logarithm of the posterior in coordinates without correlation, and their conversion to physical values.

    The prior is flat in the physical values, within their domains; conditions between them do not count here. With the
    level of the noise unknown and ν degrees of freedom, the likelihood is (1 + χ²/ν)^(−(ν + p)/2), χ² being the
    increase over the minimum; for a linear law that is Student's distribution with the covariance of the fit. With a
    known level, ν is infinite and the likelihood exp(−χ²/2).
    """
    problem, noise, centre = evidence.problem, evidence.noise, evidence.minimum.values
    if not np.all(np.isfinite(evidence.covariance)):
        lost = [n for n, v in zip(problem.free.names, np.diag(evidence.covariance), strict=True) if not np.isfinite(v)]
        must, remedy = "have a finite standard error for every free parameter", "Freeze those that nothing shows."
        _checks.refuse("the fit", must, f"one without for {', '.join(lost)}", remedy)
    errors = np.sqrt(np.diag(evidence.covariance))
    lower, upper = problem.free.limits()
    room = np.minimum(INSIDE * errors, np.where(np.isfinite(upper - lower), 0.5 * (upper - lower), np.inf))
    inside = np.clip(centre, lower + room, upper - room)
    coordinates = Coordinates(problem.free.started_at(inside), smooth="all")
    middle = jnp.asarray(coordinates.start)
    slopes = np.asarray(jax.jacfwd(coordinates.to_physical)(middle), float)
    backward = np.linalg.inv(slopes)
    half = jnp.asarray(np.linalg.cholesky(backward @ evidence.covariance @ backward.T))
    sigma = noise.by_sample
    weight = jnp.asarray(1.0 / np.where(sigma > 0, sigma, 1.0))
    # Σ (r/σ)² counts every sample; noise with a memory has fewer independent ones. Priors count as they are.
    counted = float(noise.variance / np.mean(sigma[problem.used] ** 2))
    weight = weight / jnp.where(jnp.asarray(problem.used), np.sqrt(counted), 1.0)
    # Of a robust loss the rows have its second derivatives, and at the minimum its first ones.
    shift = evidence.minimum.residual * (1.0 / np.square(noise.root) - 1.0)
    least = float(np.sum(((evidence.minimum.residual + shift) * np.asarray(weight)) ** 2))
    power = 0.5 * (noise.dof + centre.size)

    def physical(z: Array) -> Array:
        return coordinates.to_physical(middle + half @ z)

    def potential(z: Array) -> Array:
        values, stretch = physical(z), jax.jacfwd(physical)(z)
        residual = weight * (problem.residual(values) + shift)
        rise = jnp.sum(residual**2) - least
        student = power * jnp.log1p(jnp.maximum(rise, -0.5 * noise.dof) / noise.dof)
        energy = (student if np.isfinite(noise.dof) else 0.5 * rise) - jnp.linalg.slogdet(stretch)[1]
        return jnp.where(jnp.isfinite(energy), energy, REFUSED)

    return potential, physical

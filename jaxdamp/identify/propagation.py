"""The uncertainty of what follows from a fitted law: forces at velocities, or any function of the law."""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.special
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._jacobian import with_jacobian
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Table, plain
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, keeps_conditions, laws_inside, without_fitted_ranges
from jaxdamp.identify.model import fitted_part
from jaxdamp.identify.noise import Noise
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.parameters import Coordinates, get, with_values
from jaxdamp.rig import march, quasi_static


if TYPE_CHECKING:
    from matplotlib.figure import Figure


HELD = 2.0  # s at constant velocity, for the derivatives of a law with states
STEP = 1e-3  # s
MOST_DRAWS = 100  # batches of draws; draws outside the domains are thrown away


class Evidence(NamedTuple):
    """What a fit knows of its minimum.

    Attributes:
        problem: the problem that was minimised.
        minimum: the minimum.
        noise: of the weighted residual.
        covariance: of the free numbers.
    """

    problem: Problem
    minimum: SearchEnd
    noise: Noise
    covariance: Float[np.ndarray, "free free"]

    def model(self, values: Float[Array, " free"]) -> Any:
        """The law, vehicle or model with these values, without fitted range; where each record has one, their mean."""
        model = self.problem.free.build(values)
        means = {path: jnp.mean(get(model, path)) for path in self.problem.per_record}
        return without_fitted_ranges(fitted_part(with_values(model, means) if means else model))

    @property
    def quantile(self) -> float:
        """Half the width of a 95 % interval in standard errors, by Student's t."""
        return float(scipy.special.stdtrit(self.noise.dof, 0.975))

    def draws(self, count: int, seed: int) -> Float[np.ndarray, "draws free"]:
        """Values of the free numbers as the fit leaves them possible: Student's t within domains and conditions."""
        if not np.all(np.isfinite(self.covariance)):
            remedy = "Freeze the parameters that do not change the force."
            _checks.refuse("samples", "be drawn from finite standard errors", "infinite for some parameters", remedy)
        rng, free = np.random.default_rng(seed), self.problem.free
        errors = np.sqrt(np.diag(self.covariance))
        scale = np.where(errors > 0, errors, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        half = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))  # a root of the covariance of any rank
        lower, upper = free.limits()
        limited = any(law.has_conditions() for _, law in laws_inside(free.tree))
        drawn: list[np.ndarray] = []
        for _ in range(MOST_DRAWS):
            spread = np.sqrt(rng.chisquare(self.noise.dof, (count, 1)) / self.noise.dof)
            values = self.minimum.values + rng.standard_normal((count, len(half))) @ half.T / spread
            inside = values[np.all((values >= lower) & (values <= upper), axis=1)]
            drawn += [v for v in inside if not limited or keeps_conditions(free.started_at(v).tree)]
            if len(drawn) >= count:
                return np.stack(drawn[:count])
        value, remedy = f"nearly all outside the domains, {len(drawn)} inside", "Leave `samples` out."
        _checks.refuse("samples", "be drawn within the domains of the parameters", value, remedy)


class Propagated(NamedTuple):
    """A function of the fitted law, with its uncertainty; all arrays have the shape of the function's value.

    Attributes:
        value: at the fitted values.
        standard_error: from the derivatives by the parameters, or the standard deviation of the samples.
        lower: lower end of the 95 % interval, of Student's t or between the samples.
        upper: upper end.
        samples: the function of every sample, shape (samples, ...), if samples were drawn.
    """

    value: Float[np.ndarray, "..."]
    standard_error: Float[np.ndarray, "..."]
    lower: Float[np.ndarray, "..."]
    upper: Float[np.ndarray, "..."]
    samples: Float[np.ndarray, "samples ..."] | None = None


def propagate(
    evidence: Evidence, function: Callable[[Any], Any], samples: int | None = None, seed: int = 0
) -> Propagated:
    """`FitResult.propagate`."""

    def of(values: Array) -> Array:
        return jnp.asarray(function(evidence.model(values)), float)

    centre = jnp.asarray(evidence.minimum.values, evidence.problem.free.values.dtype)
    if samples is not None:
        if samples < 2:
            _checks.refuse("samples", "be 2 or more", samples)
        value = np.asarray(eqx.filter_jit(of)(centre), float)
        return _over_samples(of, jnp.asarray(evidence.draws(samples, seed), centre.dtype), value)

    value, slopes = (np.asarray(a, float) for a in eqx.filter_jit(with_jacobian(of))(centre))
    error = np.asarray(standard_error(slopes, evidence.covariance))
    return Propagated(value, error, value - evidence.quantile * error, value + evidence.quantile * error)


def _over_samples(of: Callable[[Array], Array], samples: Array, value: np.ndarray | None = None) -> Propagated:
    """A function over samples of the free numbers, with its value or its mean."""
    drawn = np.asarray(eqx.filter_jit(jax.vmap(of))(samples), float)
    lower, upper = np.quantile(drawn, [0.025, 0.975], axis=0)
    return Propagated(drawn.mean(axis=0) if value is None else value, drawn.std(axis=0, ddof=1), lower, upper, drawn)


def standard_error(slopes: Float[np.ndarray, "... free"], covariance: Float[np.ndarray, "free free"]) -> np.ndarray:
    """√(g C gᵀ) of derivatives g; infinite where they meet a parameter of infinite variance."""
    lost = ~np.isfinite(np.diag(covariance))
    finite = np.where(lost[:, None] | lost, 0.0, covariance)
    variance = np.einsum("...i,ij,...j->...", slopes, finite, slopes)
    return np.where(np.any((slopes != 0.0) & lost, axis=-1), np.inf, np.sqrt(np.maximum(variance, 0.0)))


@dataclasses.dataclass(frozen=True, repr=False)
class Band(AbstractResult):
    """95 % intervals of the force of a fitted law, each for its own velocity.

    Attributes:
        law: the fitted law.
        velocity: velocities [m/s].
        force: of the law [N], NaN where it has none at constant velocity.
        lower: lower ends [N].
        upper: upper ends [N].
        runs: the fitted records.
    """

    law: AbstractDamper
    velocity: Float[np.ndarray, " points"]
    force: Float[np.ndarray, " points"]
    lower: Float[np.ndarray, " points"]
    upper: Float[np.ndarray, " points"]
    runs: tuple[BenchRun, ...] = ()

    @property
    def summary(self) -> str:
        """The widest interval."""
        width = 0.5 * (self.upper - self.lower)
        if not np.any(np.isfinite(width)):
            return "The force has no finite interval at any of these velocities."
        i = int(np.nanargmax(np.where(np.isfinite(width), width, np.nan)))
        return f"The force is known to ±{width[i]:.3g} N or better (95 %), least at {self.velocity[i]:.3g} m/s."

    @property
    def warnings(self) -> tuple[str, ...]:
        """Velocities at which the force has no finite interval."""
        open_ended = int(np.count_nonzero(~np.isfinite(self.upper - self.lower)))
        return (f"At {open_ended} velocities the force or its interval is not finite.",) * bool(open_ended)

    def table(self) -> Table:
        """Force with its interval at each velocity."""
        columns = Column("velocity", "m/s"), *(Column(name, "N", ".1f") for name in ("force", "from", "to"))
        rows = zip(*map(plain, (self.velocity, self.force, self.lower, self.upper)), strict=True)
        return Table("Force at constant velocity with its 95 % interval", columns, tuple(rows))

    def plot(self) -> "Figure":
        """The curve with its band, over the records."""
        from jaxdamp.plots import force_velocity

        return force_velocity(self.law, self.velocity, self.runs or None, bands=self)


def band(evidence: Evidence, law: AbstractDamper, velocities: Float[np.ndarray, " points"]) -> Band:
    """`FitResult.band`."""
    velocity = np.asarray(velocities, float)
    force = np.asarray(quasi_static(law, velocity).force, float)
    steps = 1 if law.initial_state().size == 0 else round(HELD / STEP)

    def curve(law: AbstractDamper) -> Array:
        def held(v: Array) -> Array:
            return march(law, jnp.asarray(STEP, v.dtype), jnp.zeros(steps + 1, v.dtype), jnp.full(steps + 1, v), 1)[-1]

        return jax.vmap(held)(jnp.asarray(velocity, float))

    width = evidence.quantile * propagate(evidence, curve).standard_error
    return Band(law, velocity, force, force - width, force + width, tuple(evidence.problem.fitted_to))


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
    interval: tuple[float, float]  # 95 %, between the samples
    r_hat: float  # near 1 if the chains agree
    effective: float  # number of independent samples


@dataclasses.dataclass(frozen=True, repr=False)
class Posterior(AbstractResult):
    """Samples of the posterior of the free parameters.

    Attributes:
        evidence: the fit.
        samples: in the units of the parameters, shape (samples, free).
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

    def propagate(self, function: Callable[[Any], Any]) -> Propagated:
        """A function of the law over the samples, as `FitResult.propagate`."""
        model = self.evidence.model
        return _over_samples(lambda values: jnp.asarray(function(model(values)), float), jnp.asarray(self.samples))

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
    potential, physical = _potential(evidence)
    begin = APART * np.random.default_rng(seed).uniform(-1.0, 1.0, (chains, evidence.minimum.values.size))
    kernel = NUTS(potential_fn=potential, forward_mode_differentiation=True)
    side_by_side = {"num_chains": chains, "chain_method": "vectorized", "progress_bar": False}
    sampler = MCMC(kernel, num_warmup=warm_up, num_samples=samples, **side_by_side)
    with jax.numpy_dtype_promotion("standard"):  # which numpyro relies on
        sampler.run(jax.random.key(seed), init_params=jnp.asarray(begin), extra_fields=("diverging",))
    drawn = np.asarray(jax.vmap(jax.vmap(physical))(sampler.get_samples(group_by_chain=True)), float)
    free, flat = evidence.problem.free, drawn.reshape(-1, drawn.shape[-1])
    low, high = np.quantile(flat, [0.025, 0.975], axis=0)
    checks = (split_gelman_rubin(drawn), effective_sample_size(drawn))
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

    The prior is flat in the physical values, within their domains. With the level of the noise unknown and ν degrees of
    freedom, the likelihood is (1 + χ²/ν)^(−(ν + p)/2), χ² being the increase over the minimum; for a linear law that is
    Student's distribution with the covariance of the fit.
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
    weight = jnp.asarray(1.0 / np.where(noise.sigma > 0, noise.sigma, 1.0))
    # Σ (r/σ)² counts every sample; noise with a memory has fewer independent ones. Priors count as they are.
    counted = float(noise.variance / np.mean(noise.sigma[problem.used] ** 2))
    weight = weight / jnp.where(jnp.asarray(problem.used), np.sqrt(counted), 1.0)
    least = float(np.sum((evidence.minimum.residual * np.asarray(weight)) ** 2))
    power = 0.5 * (noise.dof + centre.size)

    def physical(z: Array) -> Array:
        return coordinates.to_physical(middle + half @ z)

    def potential(z: Array) -> Array:
        values, stretch = physical(z), jax.jacfwd(physical)(z)
        model = problem.free.build(values)
        residual = weight * jnp.concatenate([part(model) for part in problem.residuals])
        rise = jnp.sum(residual**2) - least
        energy = power * jnp.log1p(jnp.maximum(rise, -0.5 * noise.dof) / noise.dof) - jnp.linalg.slogdet(stretch)[1]
        return jnp.where(jnp.isfinite(energy), energy, REFUSED)

    return potential, physical

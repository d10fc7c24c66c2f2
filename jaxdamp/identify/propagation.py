"""The uncertainty of what follows from a fitted law: forces at velocities, or any function of the law."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.special
from jax.core import Tracer
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import with_jacobian
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._results import AbstractResult
from jaxdamp._tables import Column, Table, plain
from jaxdamp._traced import depends
from jaxdamp._types import Figure
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, keeps_conditions, laws_inside, without_fitted_ranges
from jaxdamp.identify.model import count_states, fitted_part, of_law, with_means
from jaxdamp.identify.noise import Noise
from jaxdamp.identify.printed import evaluator
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.rows import on_device
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters
from jaxdamp.rig import march, quasi_static


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

    def model(self, values: Float[Array, " free"]) -> PyTree:
        """The law, vehicle or model with these values, without fitted range; where each record has one, their mean."""
        model = with_means(self.problem.free.build(values), self.problem.per_record)
        return without_fitted_ranges(fitted_part(model))

    @property
    def quantile(self) -> float:
        """Half the width of a 95 % interval in standard errors, by Student's t."""
        return float(scipy.special.stdtrit(self.noise.dof, 0.975))

    def draws(self, count: int, seed: int) -> Float[np.ndarray, "draws free"]:
        """Values of the free numbers as the fit leaves them possible: Student's t within domains and conditions.

        Of infinite degrees of freedom, which a known noise has, it is the normal distribution.
        """
        if not np.all(np.isfinite(self.covariance)):
            remedy = "Freeze the parameters that do not change the force."
            _checks.refuse("samples", "be drawn from finite standard errors", "infinite for some parameters", remedy)
        _checks.seed(seed)
        rng, free, dof = np.random.default_rng(seed), self.problem.free, self.noise.dof
        errors = np.sqrt(np.diag(self.covariance))
        scale = np.where(errors > 0, errors, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        half = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))  # a root of the covariance of any rank
        lower, upper = free.limits()
        limited = any(law.has_conditions() for _, law in laws_inside(free.tree))
        ordered = [i for i, p in enumerate(free.chosen) if p.domain.ordered]
        drawn: list[np.ndarray] = []
        for _ in range(MOST_DRAWS):
            spread = np.sqrt(rng.chisquare(dof, (count, 1)) / dof) if np.isfinite(dof) else 1.0
            values = self.minimum.values + rng.standard_normal((count, len(half))) @ half.T / spread
            inside = values[np.all((values >= lower) & (values <= upper), axis=1)]
            if ordered:
                inside = [v for v in inside if _in_order(free, ordered, v)]
            drawn += [v for v in inside if not limited or keeps_conditions(free.started_at(v).tree)]
            if len(drawn) >= count:
                return np.stack(drawn[:count])
        value, remedy = f"nearly all outside the domains, {len(drawn)} inside", "Leave `samples` out."
        _checks.refuse("samples", "be drawn within the domains of the parameters", value, remedy)


def _in_order(free: FreeParameters, ordered: Sequence[int], values: Float[np.ndarray, " free"]) -> bool:
    """Whether each of the ordered vectors among the chosen parameters is in its order."""
    pieces = free.split(values)
    return all(free.chosen[i].domain.contains(pieces[i]) for i in ordered)


class Propagated(NamedTuple):
    """A function of the fitted law, with its uncertainty; each field has the structure of the function's value.

    Attributes:
        value: at the fitted values.
        standard_error: from the derivatives by the parameters, or the standard deviation of the samples.
        lower: lower end of the 95 % interval, of Student's t or between the samples.
        upper: upper end.
        samples: the function of every sample, arrays of shape (samples, ...), if samples were drawn.
    """

    value: PyTree
    standard_error: PyTree
    lower: PyTree
    upper: PyTree
    samples: PyTree | None = None


def propagate(
    evidence: Evidence, function: Callable[[PyTree], PyTree], samples: int | None = None, seed: int = 0
) -> Propagated:
    """`FitResult.propagate`."""
    of = numbers_of(function, evidence.model)
    centre = jnp.asarray(evidence.minimum.values, evidence.problem.free.values.dtype)
    if samples is not None:
        if samples < 2:
            _checks.refuse("samples", "be 2 or more", samples)
        value = _on_host(compiled_for_loops(of)(centre))
        return over_samples(of, jnp.asarray(evidence.draws(samples, seed), centre.dtype), value)

    slanted = numbers_of(function, evidence.model, by_derivatives=True)
    value, slopes = _on_host(compiled_for_loops(with_jacobian(slanted))(centre))
    error = jax.tree.map(lambda slope: np.asarray(standard_error(slope, evidence.covariance)), slopes)
    lower = jax.tree.map(lambda v, e: v - evidence.quantile * e, value, error)
    upper = jax.tree.map(lambda v, e: v + evidence.quantile * e, value, error)
    return Propagated(value, error, lower, upper)


def numbers_of(
    function: Callable[[PyTree], PyTree], model: Callable[[Array], PyTree], *, by_derivatives: bool = False
) -> Callable[[Array], PyTree]:
    """A user's function of a model as one of its free numbers, which returns arrays in the user's structure.

    By derivatives, truths and counts that depend on the model are refused: their derivatives are zero, their errors are
    not.
    """

    def counts(values: Array) -> list[Array]:
        return _counts(jax.tree.leaves(function(model(values))))

    def of(values: Array) -> PyTree:
        result = function(model(values))
        leaves = jax.tree.leaves(result)
        if not leaves or not all(eqx.is_array_like(leaf) and not jnp.iscomplexobj(leaf) for leaf in leaves):
            remedy = "Return a number, an array, or a dict or other pytree of them."
            _checks.refuse("function", "return real numbers", _checks.described(result), remedy)
        if by_derivatives and (counted := _counts(leaves)):
            if depends(counts, np.zeros(values.shape, values.dtype)):
                must, remedy = "return numbers that have derivatives", "Give `samples=1000`, or return what it is from."
                _checks.refuse("function", must, f"one that returns {counted[0].dtype}", remedy)
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, float), result)

    return of


def _counts(leaves: Sequence[PyTree]) -> list[Array]:
    """Whole numbers and truths among results; JAX traces also those that depend on nothing."""
    return [leaf for leaf in leaves if isinstance(leaf, Tracer) and not jnp.issubdtype(leaf.dtype, jnp.inexact)]


def over_samples(of: Callable[[Array], PyTree], samples: Array, value: PyTree | None = None) -> Propagated:
    """A function over samples of the free numbers, with its value or its mean."""
    drawn = _on_host(eqx.filter_jit(jax.vmap(of))(samples))

    def of_samples(statistic: Callable[[np.ndarray], np.ndarray]) -> PyTree:
        return jax.tree.map(lambda a: np.asarray(statistic(a)), drawn)

    error = of_samples(lambda a: a.std(axis=0, ddof=1))
    lower, upper = (of_samples(functools.partial(np.quantile, q=q, axis=0)) for q in (0.025, 0.975))
    value = of_samples(lambda a: a.mean(axis=0)) if value is None else value
    return Propagated(value, error, lower, upper, drawn)


def _on_host(tree: PyTree) -> PyTree:
    return jax.tree.map(lambda leaf: np.asarray(leaf, float), tree)


def standard_error(slopes: Float[np.ndarray, "... free"], covariance: Float[np.ndarray, "free free"]) -> np.ndarray:
    """√(g C gᵀ) of derivatives g; infinite where they meet a parameter of infinite variance."""
    lost = ~np.isfinite(np.diag(covariance))
    finite = np.where(lost[:, None] | lost, 0.0, covariance)
    variance = np.einsum("...i,ij,...j->...", slopes, finite, slopes)
    return np.where(np.any((slopes != 0.0) & lost, axis=-1), np.inf, np.sqrt(np.maximum(variance, 0.0)))


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
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

    def plot(self) -> Figure:
        """The curve with its band, over the records."""
        from jaxdamp.plots import force_velocity

        return force_velocity(self.law, self.velocity, self.runs or None, bands=self)


def band(evidence: Evidence, law: AbstractDamper, velocities: Float[np.ndarray, " points"]) -> Band:
    """`FitResult.band`."""
    velocity = np.asarray(velocities, float)
    force = np.asarray(quasi_static(law, velocity).force, float)
    steps = 1 if count_states(law) == 0 else round(HELD / STEP)
    slopes = _printed_slopes(evidence, velocity, steps)
    if slopes is None:
        error = propagate(evidence, functools.partial(_held, velocity=velocity, steps=steps)).standard_error
    else:
        error = standard_error(slopes, evidence.covariance)
    width = evidence.quantile * np.asarray(error)
    return Band(law, velocity, force, force - width, force + width, tuple(evidence.problem.fitted_to))


def _held(law: AbstractDamper, velocity: Float[np.ndarray, " points"], steps: int) -> Float[Array, " points"]:
    """The forces [N] of a law after so many steps at constant velocities [m/s]."""

    def held(v: Array) -> Array:
        return march(law, jnp.asarray(STEP, v.dtype), jnp.zeros(steps + 1, v.dtype), jnp.full(steps + 1, v), 1)[-1]

    return jax.vmap(held)(jnp.asarray(velocity, float))


def _printed_slopes(
    evidence: Evidence, velocity: Float[np.ndarray, " points"], steps: int
) -> Float[np.ndarray, "points free"] | None:
    """The derivatives of the same forces by the free numbers, from the C program of the fit; None without one."""
    problem = evidence.problem
    free, columns = of_law(problem.free)
    values = np.asarray(evidence.minimum.values)
    if problem.per_record or not columns.any():
        return None
    shape = velocity.size, steps + 1
    last = np.zeros(shape)
    last[:, -1] = 1.0
    still, moving = np.zeros(shape), np.repeat(velocity[:, None], shape[1], axis=1)
    signals = (np.full(velocity.size, STEP), still, moving, still, last, np.arange(velocity.size))
    batch = Batch(*map(on_device, signals), fixed={}, per_record=(), substeps=1)
    printed = evaluator(free, [batch])
    if printed is None:
        return None
    slopes = np.zeros((velocity.size, values.size))
    slopes[:, columns] = printed(values[columns])[:, :-1].reshape(*shape, -1)[:, -1]
    return slopes

"""`fit`: weighted nonlinear least squares of a damper law over many bench records."""

import warnings as python_warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import scipy.optimize
import scipy.stats
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, AbstractMemoryless
from jaxdamp.identify.result import Estimate, FitResult, score
from jaxdamp.identify.traces import Batch, batches, is_memoryless
from jaxdamp.identify.uncertainty import uncertainty
from jaxdamp.parameters import FreeParameters, free_parameters


Start = AbstractDamper | type[AbstractDamper] | Callable[[np.ndarray, np.ndarray], AbstractDamper]


def fit(
    law: Start,
    runs: BenchRun | Sequence[BenchRun],
    *,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    weighting: str | Sequence[float] = "samples",
    force_noise: float | None = None,
    samples_per_cycle: int | None = 400,
    max_steps: int = 200,
) -> FitResult:
    """Fit a damper law to bench records by least squares on the force.

    Minimises Σ ((F_law − F_measured)/σ)² over all samples of all records, with Levenberg-Marquardt in coordinates
    that keep every parameter inside its domain, and Jacobians by forward-mode differentiation through the law and its
    states. Where the law is linear in everything free, the minimum is computed directly (bounded linear least
    squares).

    Laws with states start each record at rest, so its first half cycle is not compared; blocks of samples of slow
    records are averaged down to `samples_per_cycle`.

    Arguments:
        law: a law to start from; or a law class, or a function `(velocity, force) -> law`, which is given all samples
            and returns a start from the data.
        runs: one record or many.
        freeze: parameters to leave alone, by path, last part of a path, or pattern.
        bounds: extra limits `{name: (lower, upper)}` in the parameter's unit.
        weighting: `"samples"`, every sample counts the same; `"runs"`, every record counts the same, relative to its
            RMS force; or one standard deviation [N] for each record.
        force_noise: standard deviation [N] of the measured force where it is known. Otherwise the residual gives it,
            which makes the standard errors right only if the law can follow the data.
        samples_per_cycle: see above; `None` uses every sample.
        max_steps: of the search.

    Returns:
        The law, its parameters with standard errors, scores and warnings; a search that fails says so in `warnings`.

    Raises:
        ValueError: no records; names that fit no parameter; a start outside its bounds; a force that never varies.

    >>> from jaxdamp import bench, dampers
    >>> dyno = bench.VirtualDyno(dampers.Bilinear(2600.0, 1200.0), force_noise=5.0, seed=1)
    >>> runs = dyno.run([bench.SineTest(amplitude=0.02, frequency=2.0)])
    >>> result = fit(dampers.Bilinear, runs)
    >>> abs(result["rebound_rate"].value - 2600.0) < 4 * result["rebound_rate"].standard_error
    True
    """
    runs = (runs,) if isinstance(runs, BenchRun) else tuple(runs)
    if not runs:
        _checks.refuse("runs", "hold at least one record", "empty", "Read some with `bench.read`.")
    start = _started(law, runs)
    sigma = _sigmas(weighting, runs)
    free = free_parameters(start, freeze=freeze, bounds=bounds)
    made, _ = batches(start, runs, sigma, samples_per_cycle)
    level = float(np.sqrt(np.mean(np.concatenate([(r.force / s) ** 2 for r, s in zip(runs, sigma, strict=True)]))))
    if is_linear(start, free):
        values, converged, steps, said = *_solve_linear(free, made), 0, ""
    else:
        values, converged, steps, said = _search(free, made, level, max_steps)
    residual, jacobian = (np.asarray(a) for a in _linearised(free, values, made))
    used = np.concatenate([np.ravel(batch.weight) for batch in made]) > 0
    residual, jacobian = residual[used], jacobian[used]
    dof = max(residual.size - values.size, 1)
    variance = float(residual @ residual) / dof
    if force_noise is not None:
        _checks.positive("force_noise", force_noise)
        variance = force_noise**2 if weighting == "samples" else 1.0
    blind = uncertainty(jacobian, variance)
    estimates = _estimates(free, np.asarray(values), blind.covariance, dof)
    fitted = free.build(values)
    percent, rmse, scores = score(fitted, runs)
    notes = _warnings(estimates, converged, said, residual, force_noise)
    return FitResult(
        fitted, runs, estimates, blind.covariance, percent, rmse, scores, tuple(notes), converged, int(steps)
    )


def _started(law: Start, runs: Sequence[BenchRun]) -> AbstractDamper:
    """An instance to start from."""
    if isinstance(law, AbstractDamper):
        return law
    velocity = np.concatenate([run.velocity for run in runs])
    force = np.concatenate([run.force for run in runs])
    guess = law.guess if isinstance(law, type) and hasattr(law, "guess") else law  # type: ignore[attr-defined]
    if isinstance(guess, type):
        remedy = f"Pass an instance, `{guess.__name__}(...)`, as the start."
        _checks.refuse("law", "know how to start from data", f"the class {guess.__name__} without `guess`", remedy)
    with python_warnings.catch_warnings():
        python_warnings.simplefilter("ignore", np.exceptions.RankWarning)
        return guess(velocity, force)


def _sigmas(weighting: str | Sequence[float], runs: Sequence[BenchRun]) -> list[float]:
    """Standard deviation [N] by which each record's residuals are divided."""
    if isinstance(weighting, str):
        _checks.one_of("weighting", weighting, ["samples", "runs"])
        if weighting == "samples":
            return [1.0] * len(runs)
        return [float(np.sqrt(np.mean(run.force**2) * len(run))) for run in runs]
    sigma = [float(s) for s in weighting]
    if len(sigma) != len(runs):
        _checks.refuse("weighting", f"give one number for each of {len(runs)} records", f"{len(sigma)} numbers")
    _checks.positive("weighting", np.array(sigma))
    return sigma


def is_linear(law: AbstractDamper, free: FreeParameters) -> bool:
    """Whether the force is linear in all that is free, so that the least squares have a closed form."""

    def keeps(law: AbstractDamper) -> bool:
        inner = getattr(law, "terms", None) or ((law.law,) if hasattr(law, "law") else ())
        kept = isinstance(law, AbstractMemoryless) if not inner else getattr(law, "preserves_linearity", False)
        return kept and all(keeps(part) for part in inner)

    return keeps(law) and all(p.linear for p in free.chosen)


def _residual(free: FreeParameters, values: Array, made: Sequence[Batch]) -> Float[Array, " samples"]:
    law = free.build(values)
    return jnp.concatenate([jnp.ravel(batch.residual(law)) for batch in made])


@eqx.filter_jit
def _linearised(free: FreeParameters, values: Array, made: Sequence[Batch]) -> tuple[Array, Array]:
    """Residual and its Jacobian with respect to the physical values."""

    def both(values: Array) -> tuple[Array, Array]:
        residual = _residual(free, values, made)
        return residual, residual

    jacobian, residual = jax.jacfwd(both, has_aux=True)(values)
    return residual, jacobian


def _solve_linear(free: FreeParameters, made: Sequence[Batch]) -> tuple[Array, bool]:
    """Minimum of a linear least-squares problem within the domains."""
    residual, jacobian = (np.asarray(a) for a in _linearised(free, free.values, made))
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    lower, upper = free.limits()
    target = jacobian @ np.asarray(free.values) - residual
    if all(p.domain.name == "real" for p in free.chosen):
        values = np.linalg.lstsq(jacobian / scale, target, rcond=None)[0] / scale
        return jnp.asarray(values), True
    q, r = np.linalg.qr(jacobian / scale)
    solved = scipy.optimize.lsq_linear(r, q.T @ target, (lower * scale, upper * scale), method="bvls")
    tiny = 1e-9 * np.abs(np.asarray(free.values))
    return jnp.asarray(np.clip(solved.x / scale, lower + tiny, upper - tiny)), bool(solved.success)


@eqx.filter_jit
def _levenberg_marquardt(free: FreeParameters, made: Sequence[Batch], level: Array, max_steps: int) -> Any:
    def scaled(raw: Array, args: Any) -> Array:
        free, made, level = args
        return _residual(free, free.physical(raw), made) / level

    solver = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    solution = optx.least_squares(
        scaled, solver, free.raw, (free, made, level), options={"jac": "fwd"}, max_steps=max_steps, throw=False
    )
    return free.physical(solution.value), solution.result, solution.stats["num_steps"]


def _search(free: FreeParameters, made: Sequence[Batch], level: float, max_steps: int) -> tuple[Array, bool, int, str]:
    samples = sum(int(np.count_nonzero(batch.weight)) for batch in made)
    values, result, steps = _levenberg_marquardt(free, made, jnp.asarray(level * np.sqrt(samples)), max_steps)
    converged = bool(result == optx.RESULTS.successful)
    return values, converged, int(steps), "" if converged else str(optx.RESULTS[result])


def _estimates(
    free: FreeParameters, values: np.ndarray, covariance: np.ndarray, dof: int
) -> tuple[Estimate, ...]:
    """Values with standard errors, 95 % intervals by Student's t, and what is wrong with them."""
    lower, upper = free.limits()
    errors = np.sqrt(np.diag(covariance))
    reach = float(scipy.stats.t.ppf(0.975, dof))
    units = [p.unit for p in free.chosen for _ in range(max(p.value.size, 1))]
    meanings = [p.meaning for p in free.chosen for _ in range(max(p.value.size, 1))]
    rows = []
    for i, name in enumerate(free.names):
        value, error = float(values[i]), float(errors[i])
        start = abs(float(free.values[i]))
        width = upper[i] - lower[i]
        margin = 1e-3 * (width if np.isfinite(width) else start)
        bounded = value < lower[i] + margin or value > upper[i] - margin
        signed = np.isinf(lower[i]) and np.isinf(upper[i])
        weak = not np.isfinite(error) or (not signed and error > 0.5 * abs(value))
        note = "at a bound" if bounded else "not identifiable" if weak else ""
        interval = (value - reach * error, value + reach * error)
        rows.append(Estimate(name, value, units[i], error, interval, meanings[i], note))
    return tuple(rows)


def _warnings(
    estimates: Sequence[Estimate], converged: bool, said: str, residual: np.ndarray, force_noise: float | None
) -> list[str]:
    """What a user should know before trusting the numbers."""
    notes = []
    if not converged:
        notes.append(f"The search did not converge: {said} Try another start, bounds, or fewer free parameters.")
    for e in estimates:
        if e.note == "at a bound":
            notes.append(f"{e.name} = {e.value:.4g} {e.unit} is at a bound: its standard error means nothing.")
        elif e.note == "not identifiable":
            notes.append(
                f"{e.name} is not identifiable from these records (standard error {e.standard_error:.2g} {e.unit} for a"
                f" value of {e.value:.3g}): freeze it or add records that excite it."
            )
    centred = residual - residual.mean()
    memory = float(centred[1:] @ centred[:-1] / (centred @ centred)) if residual.size > 2 and centred.any() else 0.0
    if memory > 0.5 and force_noise is None:
        factor = np.sqrt((1 + memory) / (1 - memory)) if memory < 1 else np.inf
        notes.append(
            f"Neighbouring residuals are alike (correlation {memory:.2f}): the law misses something systematic, and"
            f" standard errors, which assume independent noise, are too small by about {factor:.0f} times."
        )
    return notes

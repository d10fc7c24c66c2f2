"""How what follows from a fitted law depends on the measured forces, through the fit itself."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import with_jacobian
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table
from jaxdamp.identify.criteria import Priors
from jaxdamp.identify.estimating import at_ends
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.propagation import Evidence
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.identify.traces import signals
from jaxdamp.parameters import FreeParameters


GAIN, OFFSET = 0.01, 10.0  # changes of the force that tables state: 1 %, 10 N
NEWTON_STEPS = 8
AT_MINIMUM = 1e-7  # length of the last Newton step, relative to the change that doubles the residual
SINGULAR = 1e-12  # smallest curvature, relative to the largest, both scaled, that determines a minimum


@final
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class RecordSensitivity(AbstractResult):
    """Exact derivatives of functions of a fitted law by the measured forces, all parameters fitted again.

    Attributes:
        records: names of the fitted records.
        values: the functions at the fitted law.
        by_gain: for each function its derivative by a factor on the force of each record, shape (records,).
        by_offset: its derivative by a force added to each record [1/N], shape (records,).
        by_sample: its derivative by the force of each sample that the fit compares [1/N], an array for each record.
        velocity: at these samples [m/s].
        stroke: at these samples [m].
        held: free numbers that stay at their bounds.
        warnings: doubts, in words.
    """

    records: tuple[str, ...]
    values: dict[str, float]
    by_gain: dict[str, Float[np.ndarray, " records"]]
    by_offset: dict[str, Float[np.ndarray, " records"]]
    by_sample: dict[str, tuple[Float[np.ndarray, " _"], ...]]
    velocity: tuple[Float[np.ndarray, " _"], ...]
    stroke: tuple[Float[np.ndarray, " _"], ...]
    held: tuple[str, ...]
    warnings: tuple[str, ...]

    def table(self) -> Table:
        """The change of each function for 1 % more force, and for 10 N, in each record."""
        columns = [Column("record")]
        for name in self.values:
            columns += [Column(f"{name}, +1 % force", "", "+.3g"), Column(f"{name}, +10 N", "", "+.3g")]
        rows = []
        for i, record in enumerate(self.records):
            cells = [(GAIN * self.by_gain[n][i], OFFSET * self.by_offset[n][i]) for n in self.values]
            rows.append((record, *(float(cell) for pair in cells for cell in pair)))
        return Table(
            "Change of what follows from the fit, for other forces in each record", tuple(columns), tuple(rows)
        )

    def content(self) -> Contents:
        """All derivatives as plain data, ready for JSON; numbers that are not finite are None."""
        return self._data(*(field.name for field in dataclasses.fields(self) if field.name != "warnings"))

    @property
    def summary(self) -> str:
        """The record that changes each function most."""
        most = []
        for name, slopes in self.by_gain.items():
            i = int(np.argmax(np.abs(slopes)))
            most.append(f"1 % more force in {self.records[i]} changes {name} by {GAIN * slopes[i]:+.3g}.")
        return " ".join(most)

    plot = drawn_by("record_sensitivity", "See `jaxdamp.plots.record_sensitivity`.")

    def __repr__(self) -> str:
        return "\n".join([self.table().to_text(), *(f"warning: {warning}" for warning in self.warnings)])


class _Minimum(NamedTuple):
    """The minimum of a sum of squares, refined, with what its derivatives need."""

    values: Float[np.ndarray, " free"]
    residual: Float[np.ndarray, " samples"]
    jacobian: Float[np.ndarray, "samples free"]
    hessian: Float[np.ndarray, "free free"]  # of half the sum of squares, with the curvature of the residuals
    moves: np.ndarray  # which numbers are not at a bound
    last_step: float  # relative to the change that doubles the residual


def sensitivity_to_records(
    evidence: Evidence, function: Callable[[PyTree], PyTree], runs: Sequence[Any], criterion: str
) -> RecordSensitivity:
    """`FitResult.sensitivity_to_records`.

    At the minimum the gradient Jᵀ r of half the sum of squares is zero for all numbers that are not at a bound. By the
    implicit function theorem they change by −H⁻¹ ∂(Jᵀ r)/∂force, where H is the whole matrix of second derivatives.
    """
    problem = evidence.problem
    _refuse_weights(problem, criterion)
    minimum = _refined(problem, evidence.minimum.values)
    names, values, slopes = _function(evidence, function, minimum.values)
    scale = 1.0 / np.sqrt(np.diag(minimum.hessian)[minimum.moves])
    inner = minimum.hessian[np.ix_(minimum.moves, minimum.moves)] * np.outer(scale, scale)
    adjoint = np.zeros(slopes.shape)
    adjoint[:, minimum.moves] = np.linalg.solve(inner, (slopes[:, minimum.moves] * scale).T).T * scale
    used, owner = problem.used, problem.owner[problem.used]
    channels = ("force", "weight", "velocity", "stroke")
    force, weight, velocity, stroke = (np.asarray(a, float)[used] for a in signals(problem.residuals, *channels))
    by_residual = (adjoint @ minimum.jacobian.T)[:, used]
    by_force = by_residual * weight
    weighed = by_residual * minimum.residual[used]
    of_record = [owner == i for i in range(len(runs))]
    pull = np.stack([weighed[:, k].sum(axis=1) for k in of_record])  # adjoint times the gradient of each record
    gain = np.stack([(by_force[:, k] * force[k]).sum(axis=1) for k in of_record])
    offset = np.stack([by_force[:, k].sum(axis=1) for k in of_record])
    if problem.each:  # each record is divided by its own RMS force, which changes too
        squares = np.array([np.sum(run.force**2) for run in runs])
        sums = np.array([np.sum(run.force) for run in runs])
        gain, offset = gain + 2.0 * pull, offset + 2.0 * pull * (sums / squares)[:, None]
        blocks = weight**2 * squares[owner]  # measured samples in each one that is compared
        by_force = by_force + 2.0 * pull[owner].T * blocks * force / squares[owner]
    warnings = ()
    if not minimum.last_step < AT_MINIMUM:
        warnings = ("The minimum lies at a kink of the law: its derivatives hold on one side only.",)
    held = np.array(problem.free.names)[~minimum.moves]
    return RecordSensitivity(
        records=tuple(run.name for run in runs),
        values=dict(zip(names, values.tolist(), strict=True)),
        by_gain=dict(zip(names, gain.T, strict=True)),
        by_offset=dict(zip(names, offset.T, strict=True)),
        by_sample={name: tuple(row[k] for k in of_record) for name, row in zip(names, by_force, strict=True)},
        velocity=tuple(velocity[k] for k in of_record),
        stroke=tuple(stroke[k] for k in of_record),
        held=tuple(map(str, held)),
        warnings=warnings,
    )


def _refuse_weights(problem: Problem, criterion: str) -> None:
    """Refuse a fit whose weights depend on the residual; rest that is left out, or periodic records, do not."""
    if problem.robust is not None or any(isinstance(part, Priors) for part in problem.residuals):
        remedy = "Fit with `loss='squares'` and without priors, whose weights depend on the residual."
        _checks.refuse("result", "be a fit by plain least squares", f"one by {criterion}", remedy)


def _refined(problem: Problem, values: np.ndarray) -> _Minimum:
    """The minimum by Newton's method from where the search ended, which stops at a fraction of the standard errors."""
    free, dtype = problem.free, problem.free.values.dtype
    moves, steps, length = _moving(problem, values), 0, np.inf
    while True:
        arrays = _second_order(free, jnp.asarray(values, dtype), problem.residuals)
        gradient, hessian, residual, jacobian = (np.asarray(a, np.float64) for a in arrays)
        inner, pull = hessian[np.ix_(moves, moves)], gradient[moves]
        size = np.sqrt(np.abs(np.diag(inner)))
        _check_curvature(inner, size, np.array(free.names)[moves])
        step = -np.linalg.solve(inner / np.outer(size, size), pull / size) / size
        squares = float(residual @ residual)
        length = 0.0 if problem.is_rounding(squares) else float(np.linalg.norm(step * size)) / np.sqrt(squares)
        if steps == NEWTON_STEPS or length < AT_MINIMUM:
            return _Minimum(values, residual, jacobian, hessian, moves, length)
        values, steps = values.copy(), steps + 1
        values[moves] += step


def _moving(problem: Problem, values: np.ndarray) -> np.ndarray:
    """Which numbers are not at a bound of their own."""
    ends, at_bounds = at_ends(problem.coordinates, values) != 0, problem.coordinates.at_ends(values) != 0
    shared = ends & (problem.coordinates.ordered | ~at_bounds)
    if shared.any():
        names = ", ".join(np.array(problem.free.names)[shared])
        remedy = "Fit with fewer free parameters."
        _checks.refuse("result", "be away from limits that join several parameters", f"at one: {names}", remedy)
    return ~ends


def _check_curvature(hessian: np.ndarray, size: np.ndarray, names: np.ndarray) -> None:
    """Refuse a minimum that the records do not determine."""
    flat = names[size == 0.0].tolist()
    if not flat:
        curvature, directions = np.linalg.eigh(hessian / np.outer(size, size))
        if curvature.size and curvature[0] <= SINGULAR * curvature[-1]:
            flat = names[np.abs(directions[:, 0]) > 0.1].tolist()
    if flat:
        remedy = "Freeze some of them, or add records that tell them apart."
        _checks.refuse("result", "determine its free parameters", f"one that does not: {', '.join(flat)}", remedy)


@compiled_for_loops
def _second_order(
    free: FreeParameters, values: Array, residuals: Sequence[AbstractResiduals]
) -> tuple[Array, Array, Array, Array]:
    """Gradient and second derivatives of half the sum of squares; residual and Jacobian."""

    def residual(values: Array) -> Array:
        model = free.build(values)
        return jnp.concatenate([part(model) for part in residuals])

    def gradient(values: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        together, jacobian = with_jacobian(residual)(values)
        pull = jacobian.T @ together
        return pull, (pull, together, jacobian)

    hessian, (pull, together, jacobian) = jax.jacfwd(gradient, has_aux=True)(values)
    return pull, hessian, together, jacobian


def _function(
    evidence: Evidence, function: Callable[[PyTree], PyTree], values: np.ndarray
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, values and derivatives of the functions by the free numbers."""
    names: list[str] = []

    def stacked(values: Array) -> Array:
        results = function(evidence.model(values))
        by_name = dict(results) if isinstance(results, Mapping) else {"value": results}
        for name, value in by_name.items():
            if jnp.shape(value) != ():
                remedy = "Return a number, or a dictionary of numbers such as the metrics of a `Ride`."
                _checks.refuse("function", f"give one number as {name!r}", f"of shape {jnp.shape(value)}", remedy)
        names[:] = [str(name) for name in by_name]
        return jnp.stack([jnp.asarray(value, float) for value in by_name.values()])

    centre = jnp.asarray(values, evidence.problem.free.values.dtype)
    at, slopes = compiled_for_loops(with_jacobian(stacked))(centre)
    return names, np.asarray(at, np.float64), np.asarray(slopes, np.float64)

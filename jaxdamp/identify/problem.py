"""A fit as a least-squares problem: residuals as functions of a model with free parameters."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxdamp import _checks
from jaxdamp._quickly import compiled_for_loops
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Reach, laws_inside, margins
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.parameters import Coordinates, FreeParameters
from jaxdamp.solve import BoundedLevenbergMarquardt, ImplicitWithinBounds


ROUNDING = 1e-8  # residual, relative to the force, below which there is nothing left to explain
SENSORS = "sensors."  # with which the paths of numbers begin that act on channels after a simulation


class Robust(NamedTuple):
    """How the errors of an M-estimate follow from the residuals that its weights leave.

    With the influence ψ(u) of a residual u and its weight w = ψ/u, the estimate has the covariance
    (Σ ψ' J Jᵀ)⁻¹ (Σ ψ² J Jᵀ) (Σ ψ' J Jᵀ)⁻¹, where ψ' and ψ² are means: of each record, whose noise may have a level of
    its own, or of all where records are short. Rows of derivatives are already weighted by √w.
    """

    factor: Float[np.ndarray, " samples"]  # √(ψ²/ψ'/(w u²)): from the RMS of a weighted residual to the noise
    root: Float[np.ndarray, " samples"]  # √(ψ'/w), by which the rows of derivatives are multiplied
    each: bool  # whether records have their own


class Problem(NamedTuple):
    """A fit to be solved, a pytree, and its residual function for a program of your own (`docs/from_jax.md`).

    `optimistix.least_squares(problem, problem.solver(), problem.start)` is the fit as a part of a JAX program, in the
    coordinates of `fit`; `problem.minimum(force)` gives the physical values for other measured forces.

    Attributes:
        free: the free parameters of the model, with their start.
        residuals: what is minimised, as a sum of squares.
        level: size of the measured forces in the units of the residuals, root of the sum of squares.
        runs: the records given, of a bench (`BenchRun`) or of a vehicle (`RideRecord`).
        sigma: standard deviation by which the residuals of each record are divided, infinite for one left out; of a
            vehicle, those of each channel.
        owner: the number of the record, or of the channel, that each sample of the residuals belongs to.
        reach: extent of the fitted records.
        law: the law or the vehicle to start from, with one value for each parameter.
        per_record: paths of the parameters with a value for each record.
        each: whether every record has its own noise level.
        sample_steps: time [s] from one sample of the residuals to the next, for each record.
        places: where the samples of each record of a bench are in the residuals.
        initial_state: how the records start, of `INITIAL_STATES`.
        robust: how standard errors follow from the residuals that the weights of a robust loss leave; None of squares.
        share_left_out: share of the samples that a robust loss gives less than half weight.
        anchor: values that free numbers keep where the records say nothing of them, and the weight of one unit of each
            beside the residuals; None for a fit without.
        noise_known: whether priors, if there are any, count relative to the noise that a fit has shown (`at_noise`).
    """

    free: FreeParameters
    residuals: tuple[AbstractResiduals, ...]
    level: float
    runs: tuple[Any, ...]
    sigma: tuple[float, ...]
    owner: Int[np.ndarray, " samples"]
    reach: Reach
    law: PyTree
    per_record: tuple[str, ...]
    each: bool
    sample_steps: tuple[float, ...] = ()
    places: tuple[slice, ...] = ()
    initial_state: str = "warm_up"
    robust: Robust | None = None
    share_left_out: float = 0.0
    anchor: tuple[Float[np.ndarray, " free"], Float[np.ndarray, " free"]] | None = None
    noise_known: bool = True

    def residual(self, values: Float[Array, " free"]) -> Float[Array, " samples"]:
        """All weighted residuals at these physical values of the free numbers (`free.values` at the start).

        They are what `fit` squares: from the initial states that the problem says, with the test machine and without
        the samples before a law with states has settled, whose residuals are zero. A pure function for `jax.jit`,
        `jax.vmap` and derivatives, forward and reverse.
        """
        model = self.free.build(values)
        return jnp.concatenate([part(model) for part in self.residuals])

    def __call__(
        self, y: Float[Array, " free"], force: Float[Array, " numbers"] | None = None
    ) -> Float[Array, " rows"]:
        """All weighted residuals at coordinates of the search, with a row for each number that has an anchor.

        Arguments:
            y: values of `coordinates`, as `start`.
            force: forces [N] in place of the measured ones, like `measured`; weights and starts stay.
        """
        problem, values = self if force is None else self.with_measured(force), self.coordinates.to_physical(y)
        residual = problem.residual(values)
        if self.anchor is None:
            return residual
        at, weight = self.anchor
        return jnp.concatenate([residual, weight * (values - at)])

    @property
    def start(self) -> Float[Array, " free"]:
        """The coordinates to start from."""
        return jnp.asarray(self.coordinates.from_physical(self.free.values))

    @property
    def measured(self) -> Float[Array, " numbers"]:
        """Measured forces [N] that the residuals are compared with: averaged blocks and padding as in `residual`."""
        return jnp.concatenate([part.measurements() for part in self.residuals])

    def with_measured(self, force: Float[Array, " numbers"]) -> "Problem":
        """The same with other measured forces [N], for derivatives and batches; `runs` and `sigma` stay."""
        ends = np.cumsum([part.measurements().size for part in self.residuals])[:-1]
        parts = zip(self.residuals, jnp.split(force, ends), strict=True)
        return self._replace(residuals=tuple(part.with_measurements(measured) for part, measured in parts))

    def margins(self, y: Float[Array, " free"]) -> Float[Array, " conditions"]:
        """By how much the law keeps its conditions between parameters at coordinates of the search."""
        return margins(self.coordinates.free.build(self.coordinates.to_physical(y)))

    @property
    def has_conditions(self) -> bool:
        """Whether the law has conditions between parameters."""
        return any(law.has_conditions() for _, law in laws_inside(self.free.tree))

    def solver(self, tolerance: float = 1e-4) -> BoundedLevenbergMarquardt:
        """The solver of `fit` inside a JAX program, with the bounds and conditions of this problem.

        Arguments:
            tolerance: length of the last step, in standard errors.

        Raises:
            ValueError: priors relative to a noise that is not known yet.
        """
        if not self.noise_known and any(part.relative for part in self.residuals):
            must = "know the noise of the records, relative to which priors count and which only a fit shows"
            _checks.refuse("problem", must, "new", "Take `problem.at_noise(identify.solve(problem).noise)`.")
        lower, upper = (jnp.asarray(side) for side in self.coordinates.bounds())
        conditions = self.margins if self.has_conditions else None
        return BoundedLevenbergMarquardt(
            lower=lower, upper=upper, conditions=conditions, tolerance=tolerance, level=self.level
        )

    def minimum(
        self, force: Float[Array, " numbers"] | None = None, *, tolerance: float = 1e-4, max_steps: int = 200
    ) -> Float[Array, " free"]:
        """The fitted physical values, as a part of a JAX program: for `jax.jit`, `jax.vmap` and derivatives.

        One search from the start, as `fit` with `starts=1`. Derivatives follow from the implicit function theorem, with
        numbers at bounds held there. The law is `free.build(values)`.

        Arguments:
            force: forces [N] in place of the measured ones, like `measured`.
            tolerance: length of the last step, in standard errors.
            max_steps: largest number of points tried.

        Returns:
            The values; not numbers where the search did not converge.

        Raises:
            ValueError: priors relative to a noise that is not known yet.

        >>> from jaxdamp import bench, dampers, identify
        >>> runs = bench.VirtualDyno(dampers.Linear(1500.0)).run([bench.SineTest(amplitude=0.02, frequency=2.0)])
        >>> problem = identify.prepare(dampers.Linear(1000.0), runs)
        >>> jax.vmap(problem.minimum)(jnp.outer(jnp.array([1.0, 1.1]), problem.measured)).round(3).tolist()
        [[1500.0], [1650.0]]
        """
        solver, adjoint = self.solver(tolerance), ImplicitWithinBounds()
        end = optx.least_squares(self, solver, self.start, force, max_steps=max_steps, adjoint=adjoint, throw=False)
        values = self.coordinates.to_physical(end.value)
        return jnp.where(end.result == optx.RESULTS.successful, values, jnp.nan)

    @property
    def coordinates(self) -> Coordinates:
        """The coordinates of a search within bounds."""
        return Coordinates(self.free, smooth="ordered")

    @property
    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples of all residuals count."""
        return np.concatenate([residuals.used() for residuals in self.residuals])

    @property
    def fitted_to(self) -> list[BenchRun]:
        """The records that are not left out."""
        return [run for run, s in zip(self.runs, self.sigma, strict=True) if np.isfinite(s)]

    def started_at(self, values: Float[np.ndarray, " free"]) -> "Problem":
        """The same with another start."""
        return self._replace(free=self.free.started_at(values))

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "Problem":
        """The same with the weight of every sample times a factor; the compiled programs are the same."""
        return self._replace(residuals=tuple(part.reweighted(weights) for part, weights in self.by_part(factor)))

    def at_noise(self, noise: float | None) -> "Problem":
        """The same with priors relative to this standard deviation of the noise of a weighted sample.

        Only a fit shows it: `problem.at_noise(identify.solve(problem).noise)`.

        Arguments:
            noise: in the unit of the residuals; None, of a problem without priors, leaves all as it is.
        """
        if noise is None:
            return self
        return self._replace(residuals=tuple(part.at_noise(noise) for part in self.residuals), noise_known=True)

    def by_part(
        self, values: Float[np.ndarray, " samples"]
    ) -> Iterator[tuple[AbstractResiduals, Float[np.ndarray, " part"]]]:
        """Each part of the residuals with its own of values at all samples, which may be changed in their place."""
        ends = np.cumsum([part.used().size for part in self.residuals])
        return zip(self.residuals, np.split(values, ends[:-1]), strict=True)

    def anchor_rows(self, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, "rows columns"]:
        """The Jacobian with the residual as last column of the numbers that have an anchor, none if there is none."""
        if self.anchor is None:
            return np.zeros((0, values.size + 1))
        at, weight = self.anchor
        return np.concatenate([np.diag(weight), (weight * (values - at))[:, None]], axis=1)

    def is_rounding(self, squares: float) -> bool:
        """Whether a sum of squares is so small that it consists of rounding errors, not of noise."""
        return squares <= (ROUNDING * self.level) ** 2


NUMBERS = ("free", "residuals", "level", "law", "anchor")  # fields of a problem that a program may trace


class _Fixed:
    """The other fields, which are the same if their values are."""

    def __init__(self, problem: Problem) -> None:
        self.fields = {name: value for name, value in problem._asdict().items() if name not in NUMBERS}

    def __repr__(self) -> str:
        names = ", ".join(run.name for run in self.fields["runs"])
        return f"<records {names}, and settings; for other forces, `jax.vmap(problem.minimum)(forces)`>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Fixed) and _same(tuple(self.fields.values()), tuple(other.fields.values()))

    def __hash__(self) -> int:
        plain = (value for value in self.fields.values() if isinstance(value, str | int | float))
        return hash((len(self.fields["runs"]), *plain))


def _same(one: PyTree, other: PyTree) -> bool:
    """Whether records and other fixed values are equal, which a record by itself is only to itself."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray | jax.Array):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if dataclasses.is_dataclass(one):
        one, other = vars(one), vars(other)
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(_same(value, other[key]) for key, value in one.items())
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


jax.tree_util.register_pytree_node(
    Problem,
    lambda problem: (tuple(getattr(problem, name) for name in NUMBERS), _Fixed(problem)),
    lambda fixed, numbers: Problem(**dict(zip(NUMBERS, numbers, strict=True)), **fixed.fields),
)


@compiled_for_loops
def linearised(
    free: FreeParameters, values: Float[Array, " free"], residuals: Sequence[AbstractResiduals]
) -> tuple[Float[Array, " samples"], Float[Array, "samples free"]]:
    """All residuals and their Jacobian with respect to the physical values, in one forward pass.

    Derivatives by the numbers of sensors need no simulation: they are taken apart, with what the simulation gave.
    """
    groups = zip(free.owners, free.followers, strict=True)  # a number with all that are tied to it
    later = np.array([all(path.startswith(SENSORS) for path in (p.path, *tied)) for p, tied in groups], bool)
    later &= not later.all()  # where nothing else is free there is nothing to be gained
    first, last = np.flatnonzero(~later), np.flatnonzero(later)

    def simulated(numbers: Array) -> tuple[Array, tuple[Array, list[PyTree]]]:
        model = free.build(values.at[first].set(numbers) if last.size else numbers)
        observed = [part.observed(model) for part in residuals]
        together = _together(residuals, model, observed)
        return together, (together, observed)

    jacobian, (together, observed) = jax.jacfwd(simulated, has_aux=True)(values[first] if last.size else values)
    if not last.size:
        return together, jacobian

    def sensed(numbers: Array) -> Array:
        moved = free.build(values.at[last].set(numbers))
        return _together(residuals, dataclasses.replace(free.build(values), sensors=moved.sensors), observed)

    both = jnp.concatenate([jacobian, jax.jacfwd(sensed)(values[last])], axis=1)
    return together, both[:, np.argsort(np.concatenate([first, last]))]


def _together(residuals: Sequence[AbstractResiduals], model: PyTree, observed: Sequence[PyTree]) -> Array:
    parts = zip(residuals, observed, strict=True)
    return jnp.concatenate([part.compared(model, channels) for part, channels in parts])

"""A fit as a least-squares problem: residuals as functions of a model with free parameters."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Reach
from jaxdamp.parameters import Coordinates, FreeParameters


ROUNDING = 1e-8  # residual, relative to the force, below which there is nothing left to explain


class AbstractResiduals(eqx.Module):
    """Measured numbers that a model should explain."""

    @abstractmethod
    def __call__(self, model: Any) -> Float[Array, " samples"]:
        """Weighted difference between model and measurement; zero for samples that are not used."""

    @abstractmethod
    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples are used; the others are padding, or before the model has settled."""

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "AbstractResiduals":
        """The same with every weight times a factor."""
        raise NotImplementedError(f"{type(self).__name__} cannot be reweighted.")

    @abstractmethod
    def total_weight(self) -> Float[Array, ""]:
        """Sum of the squared weights, the number of samples as measured where all weigh the same."""


class Problem(NamedTuple):
    """A fit to be solved, and its residuals for a program of your own (`docs/from_jax.md`).

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
        noise_factor: factor on the noise that weighted residuals show, because of a robust loss.
        share_left_out: share of the samples that a robust loss gives less than half weight.
        anchor: values that free numbers keep where the records say nothing of them, and the weight of one unit of each
            beside the residuals; None for a fit without.
    """

    free: FreeParameters
    residuals: tuple[AbstractResiduals, ...]
    level: float
    runs: tuple[Any, ...]
    sigma: tuple[float, ...]
    owner: Int[np.ndarray, " samples"]
    reach: Reach
    law: Any
    per_record: tuple[str, ...]
    each: bool
    sample_steps: tuple[float, ...] = ()
    places: tuple[slice, ...] = ()
    initial_state: str = "warm_up"
    noise_factor: float = 1.0
    share_left_out: float = 0.0
    anchor: tuple[Float[np.ndarray, " free"], Float[np.ndarray, " free"]] | None = None

    def residual(self, values: Float[Array, " free"]) -> Float[Array, " samples"]:
        """All weighted residuals at these physical values of the free numbers (`free.values` at the start).

        They are what `fit` squares: from the initial states that the problem says, with the test machine and without
        the samples before a law with states has settled, whose residuals are zero. A pure function for `jax.jit`,
        `jax.vmap` and derivatives, forward and reverse.
        """
        model = self.free.build(values)
        return jnp.concatenate([part(model) for part in self.residuals])

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
        sizes = [part.used().size for part in self.residuals]
        factors = np.split(factor, np.cumsum(sizes)[:-1])
        parts = (part.reweighted(own) for part, own in zip(self.residuals, factors, strict=True))
        return self._replace(residuals=tuple(parts))

    def anchored(
        self,
        values: Float[np.ndarray, " free"],
        residual: Float[np.ndarray, " samples"],
        jacobian: Float[np.ndarray, "samples free"],
    ) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows free"]]:
        """Residual and Jacobian at these values, with a row for each number that has an anchor."""
        if self.anchor is None:
            return residual, jacobian
        at, weight = self.anchor
        return np.concatenate([residual, weight * (values - at)]), np.concatenate([jacobian, np.diag(weight)])

    def is_rounding(self, squares: float) -> bool:
        """Whether a sum of squares is so small that it consists of rounding errors, not of noise."""
        return squares <= (ROUNDING * self.level) ** 2


@eqx.filter_jit
def linearised(
    free: FreeParameters, values: Float[Array, " free"], residuals: Sequence[AbstractResiduals]
) -> tuple[Float[Array, " samples"], Float[Array, "samples free"]]:
    """All residuals and their Jacobian with respect to the physical values, in one forward pass."""

    def both(values: Array) -> tuple[Array, Array]:
        model = free.build(values)
        together = jnp.concatenate([part(model) for part in residuals])
        return together, together

    jacobian, together = jax.jacfwd(both, has_aux=True)(values)
    return together, jacobian

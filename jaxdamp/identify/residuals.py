"""Residuals: measured numbers that a model should explain, and what else a fit squares."""

import dataclasses
from abc import abstractmethod
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxdamp.parameters import FreeParameters


W = TypeVar("W", bound="AbstractWeighted")  # not `Self`, which run-time type checks refuse


class AbstractResiduals(eqx.Module):
    """Measured numbers that a model should explain."""

    @abstractmethod
    def __call__(self, model: PyTree) -> Float[Array, " samples"]:
        """Weighted difference between model and measurement; zero for samples that are not used."""

    def observed(self, model: PyTree) -> PyTree:
        """What of the residuals a simulation gives, whatever the sensors add; nothing where none is needed."""

    def compared(self, model: PyTree, observed: PyTree) -> Float[Array, " samples"]:
        """The residuals from what `observed` gives and the sensors of the model."""
        return self(model)

    @abstractmethod
    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples are used; the others are padding, or before the model has settled."""

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "AbstractResiduals":
        """The same with every weight times a factor."""
        raise NotImplementedError(f"{type(self).__name__} cannot be reweighted.")

    @property
    def relative(self) -> bool:
        """Whether they count relative to the noise of the others, as what is known beforehand."""
        return False

    def at_noise(self, noise: float) -> "AbstractResiduals":
        """The same beside residuals with noise of this standard deviation."""
        del noise
        return self

    def measurements(self) -> Float[Array, " numbers"]:
        """The measured numbers, as the residuals are compared with them; none where they cannot be exchanged."""
        return jnp.zeros(0)

    def with_measurements(self, numbers: Float[Array, " numbers"]) -> "AbstractResiduals":
        """The same with other measured numbers."""
        return self

    def linear_rows(self, free: FreeParameters) -> Float[np.ndarray, "rows columns"] | None:
        """Derivatives by the free numbers and, last, the residual where these are zero; None where not linear."""
        del free


class AbstractWeighted(AbstractResiduals):
    """Channels of records, of which samples without weight do not count."""

    weight: eqx.AbstractVar[Float[Array, "..."]]

    def reweighted(self: W, factor: Float[np.ndarray, " samples"]) -> W:
        """The same with every weight times a factor."""
        weight = np.asarray(self.weight)
        return dataclasses.replace(self, weight=jnp.asarray(weight * factor.reshape(weight.shape), float))

    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples count."""
        return np.ravel(self.weight) > 0

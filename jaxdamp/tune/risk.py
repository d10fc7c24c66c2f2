"""How the values of a metric in several scenarios become one number: mean, worst case, or mean of the worst ones."""

import dataclasses
from collections.abc import Callable
from typing import TypeAlias, final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import largest
from jaxdamp._types import Scalar


Values: TypeAlias = Float[Array, " scenarios"]
Risk: TypeAlias = Callable[[Values, Values], Scalar]  # of the values and their weights, which add up to one
SHARPNESS = 100.0  # of the smooth maximum


def mean(values: Values, weights: Values) -> Scalar:
    """The weighted mean."""
    return jnp.sum(weights * values)


def worst(values: Values, weights: Values) -> Scalar:
    """A smooth maximum, whatever the weights: never below the largest value, and above it by ln(n)/100 at most.

    ln Σ exp(b x)/b with b = 100/|x|_max, so that all scenarios near the worst one take part in the derivative.
    """
    del weights
    size = jax.lax.stop_gradient(largest(jnp.abs(values)))
    scale = jnp.where(size > 0, size, 1.0) / SHARPNESS
    return scale * jax.scipy.special.logsumexp(values / scale)


def exact(risk: Risk) -> Risk:
    """The risk as it is printed: the true largest value in place of the smooth one of a search."""
    return (lambda values, weights: largest(values)) if risk is worst else risk


@final
@dataclasses.dataclass(frozen=True)
class CVaR:
    """Conditional value at risk: the mean of the worst share of the scenarios, by weight.

    Arguments:
        share: of all scenarios, above 0 and up to 1, which is the mean.

    >>> float(CVaR(0.5)(jnp.array([1.0, 4.0, 2.0, 3.0]), jnp.full(4, 0.25)))
    3.5
    """

    share: float

    def __post_init__(self) -> None:
        if not 0.0 < self.share <= 1.0:
            _checks.refuse("share", "be above 0 and up to 1", self.share, "0.1 is the worst tenth of the scenarios.")

    def __call__(self, values: Values, weights: Values) -> Scalar:
        """The mean of the worst share."""
        order = jnp.argsort(-jax.lax.stop_gradient(values))
        values, weights = values[order], weights[order]
        before = jnp.cumsum(weights) - weights
        return jnp.sum(jnp.clip(self.share - before, 0.0, weights) * values) / self.share


RISKS: dict[str, Risk] = {"mean": mean, "worst": worst}


def risk_of(risk: str | Risk) -> Risk:
    """The risk of a name, or the function itself.

    Raises:
        ValueError: an unknown name.
    """
    if not isinstance(risk, str):
        if not callable(risk):
            must = "be 'mean', 'worst', `tune.CVaR(share)`, or a function of values and weights"
            _checks.refuse("risk", must, _checks.described(risk), "Write `risk='worst'`.")
        return risk
    _checks.one_of("risk", risk, RISKS)
    return RISKS[risk]

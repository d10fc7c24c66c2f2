"""How a metric in several scenarios becomes one number."""

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


def mean(values: Values, weights: Values) -> Scalar:
    """The weighted mean."""
    return jnp.sum(weights * values)


def worst(values: Values, weights: Values) -> Scalar:
    """The largest value, whatever the weights, with the derivatives of its scenario."""
    del weights
    return largest(values)


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
        remedy = "0.1 is the worst tenth of the scenarios."
        _checks.positive("share", self.share, remedy)
        if not self.share <= 1.0:
            _checks.refuse("share", "be above 0 and up to 1", self.share, remedy)

    def __call__(self, values: Values, weights: Values) -> Scalar:
        """The mean of the worst share."""
        order = jnp.argsort(-jax.lax.stop_gradient(values))
        values, weights = values[order], weights[order]
        before = jnp.cumsum(weights) - weights
        return jnp.sum(jnp.clip(self.share - before, 0.0, weights) * values) / self.share


RISKS: dict[str, Risk] = {"mean": mean, "worst": worst}


def risk_of(risk: str | Risk) -> Risk:
    """The risk of a name, or the function itself."""
    if not isinstance(risk, str):
        if not callable(risk):
            must = "be 'mean', 'worst', `tune.CVaR(share)`, or a function of values and weights"
            _checks.refuse("risk", must, _checks.described(risk), "Write `risk='worst'`.")
        return risk
    _checks.one_of("risk", risk, RISKS)
    return RISKS[risk]

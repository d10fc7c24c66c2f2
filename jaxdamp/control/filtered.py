"""Skyhook of a velocity that is shaped over frequency."""

from typing import TypeAlias, final

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar
from jaxdamp.control.policies import AbstractPolicy, Signals
from jaxdamp.parameters import nonnegative, parameter, positive


@final
class BandSkyhook(AbstractPolicy):
    """F = g y, with y the velocity of the body in a band of frequencies: frequency-shaped skyhook.

        y = s ω_h / ((s + ω_l)(s + ω_h)) ż_b,   ω = 2π f,

    a high-pass and a low-pass of first order. What a sensor drifts and what the road does slowly lies below the band,
    the wheel hop above it. The filter is discretised exactly for a velocity that is straight between two samples, so
    it has no delay of its own. With a very low and a very high frequency it is `Skyhook`.

    Raises:
        ValueError: a band that ends where it begins or below.

    >>> shaped = BandSkyhook(3000.0, low=0.3, high=5.0).sampled(5e-3)
    >>> force, state = shaped(Signals(0.2, -0.1, 1.0, 0.01, 0.3), shaped.initial_state())
    >>> round(float(force), 2)  # the filter begins at rest
    44.61
    """

    gain: Number = parameter("N s/m", "force per velocity in the band", nonnegative, default=3000.0)
    low: Number = parameter("Hz", "where the band begins", positive, default=0.3)
    high: Number = parameter("Hz", "where the band ends", positive, default=8.0)

    def __check_init__(self) -> None:
        low, high = _checks.concrete(self.low), _checks.concrete(self.high)
        if low is not None and high is not None and not low < high:
            _checks.refuse("high", f"be above the beginning of the band, {float(low):g} Hz", float(high))

    def sampled(self, period: float) -> AbstractPolicy:
        """With the filter for this period, the difference of two lags: y = ω_h/(ω_h − ω_l) (y_h − y_l)."""
        gain = self.gain * self.high / (self.high - self.low)
        return _TwoLags(gain, _weights(self.high, period), _weights(self.low, period))

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """Refused: `sampled(period)` answers."""
        del seen, state
        _checks.refuse("policy", "know its period", "one that does not", "Call `policy.sampled(5e-3)` first.")


Weights: TypeAlias = tuple[Scalar, Scalar, Scalar]


def _weights(frequency: Scalar, period: float) -> Weights:
    """Of y, of u before and of u now in y after a period of y' = ω (u − y), for a u that is straight over it."""
    z = 2.0 * jnp.pi * frequency * period
    kept = jnp.exp(-z)
    mean = -jnp.expm1(-z) / z
    return kept, mean - kept, 1.0 - mean


@final
class _TwoLags(AbstractPolicy):
    """F = g (y_h − y_l), two lags of the velocity of the body."""

    gain: Scalar
    high: Weights
    low: Weights

    def initial_state(self) -> PyTree:
        """Velocity at the last sample, then both lags."""
        return 0.0, 0.0, 0.0

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        (last, *lags), velocity = state, seen.body_velocity
        high, low = (
            kept * lag + before * last + now * velocity
            for (kept, before, now), lag in zip((self.high, self.low), lags, strict=True)
        )
        return self.gain * (high - low), (velocity, high, low)

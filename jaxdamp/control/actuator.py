"""The actuator between two instants: a first-order lag, whose rate may be limited."""

from typing import final

import jax.numpy as jnp

from jaxdamp._limits import at_least, within
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.parameters import AbstractDeclared, parameter, positive


@final
class RateLimit(AbstractDeclared):
    """How fast a command can change, in its unit per second: u' = (u_target − u)/actuator_lag, within both limits.

    It is followed exactly over each step: first at the limit, then by the lag. A current rises by the voltage that is
    left and a valve closes against a spring, so that both limits may differ.

    >>> from jaxdamp.control import RateLimit
    >>> limit = RateLimit(rising=50.0, falling=100.0)
    """

    rising: Number = parameter("1/s", "fastest rise of the command, in its unit", positive, adjustable=False)
    falling: Number = parameter("1/s", "fastest fall of the command, in its unit", positive, adjustable=False)

    def followed(self, away: Scalar, dt: Scalar, lag: Scalar) -> Scalar:
        """How far the command is from its target a step of dt [s] later, if it is `away` now."""
        return self._path(away, dt, lag)[0]

    def resumed(self, away: Scalar, dt: Scalar, lag: Scalar) -> tuple[Scalar, Scalar]:
        """`away` at an instant, and how much more it was a step before, had it always gone to the same target.

        A lag shorter than the step is not resolved: the command then begins where its mean over the step is right if it
        runs straight, which it does at the limit.
        """
        after, mean, share = self._path(away, dt, lag)
        sign, limit = self._limit(away)
        slow = lag > dt
        left = limit * jnp.where(slow, lag, dt)  # where the limit is reached, going back
        back = sign * away * jnp.exp(dt / jnp.where(slow, lag, dt))
        beyond = back > left
        size = sign * away
        inside = jnp.where(beyond & (size < left), size, left)
        at_limit = dt - jnp.where(slow, lag, dt) * jnp.log(left / inside)
        rise = jnp.where(beyond, at_least(size, left) + limit * at_limit, back) - size
        begin = 2.0 * mean - after
        return jnp.where(slow, away, begin), jnp.where(slow, sign * rise, share * (begin - after))

    def _limit(self, away: Scalar) -> tuple[Scalar, Scalar]:
        """The sign of the way back, and the limit that it has."""
        above = away > 0.0
        return jnp.where(above, 1.0, -1.0), jnp.where(above, self.falling, self.rising)

    def _path(self, away: Scalar, dt: Scalar, lag: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """`away` after the step, its mean over it, and the share of the step that the limit lasts."""
        sign, limit = self._limit(away)
        needed = (sign * away - limit * lag) / limit
        time = within(needed, 0.0, dt)
        left = away - sign * limit * time
        remaining = jnp.where(needed < dt, decay(dt - time, lag), 1.0)
        mean = (away - 0.5 * sign * limit * time) * time / dt + left * lag / dt * (1.0 - remaining)
        return left * remaining, mean, time / dt


def decay(dt: ScalarLike, lag: ScalarLike) -> Scalar:
    """exp(−dt/lag), zero without a lag."""
    has_lag = jnp.asarray(lag) > 0.0
    return jnp.where(has_lag, jnp.exp(-dt / jnp.where(has_lag, lag, 1.0)), 0.0)

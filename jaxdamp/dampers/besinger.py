"""The seven-parameter law of Besinger, Cebon and Cole, as paper 001 uses it for a heavy vehicle."""

import dataclasses
from collections.abc import Sequence
from typing import final

import numpy as np

from jaxdamp._elementary import algebraic_sigmoid
from jaxdamp._limits import at_most
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp._warned import warn
from jaxdamp.dampers._guesses import secant_rate
from jaxdamp.dampers.base import AbstractMemoryless, Condition, Reach
from jaxdamp.dampers.degressive import plainer_curve
from jaxdamp.parameters import parameter, positive


def transition_rate(
    v: ScalarLike, compression_rate: ScalarLike, rebound_rate: ScalarLike, transition_velocity: ScalarLike
) -> Scalar:
    """C(v) = c₁ u/√(1+u²) + c₂ [N s/m], u = (v − α)/α, c₁ = (C_e − C_c)/2, c₂ = (C_e + C_c)/2.

    C goes from C_c far in compression to C_e far in rebound. Paper 001 prints c₁ twice; the second is c₂.
    """
    u = v * (1.0 / transition_velocity) - 1.0  # a product, since quotients are slow, also in derivatives
    c1 = 0.5 * (rebound_rate - compression_rate)
    c2 = 0.5 * (rebound_rate + compression_rate)
    return c1 * algebraic_sigmoid(u) + c2


LEAST_COMPRESSION = 0.0067  # C_c/C_e below which the force decreases with v in compression; exactly 0.00664
_STEEPEST = 0.5 * (np.sqrt(17.0) - 3.0)  # u at which the slope of C(v) v differs most from C(v)


def least_rebound(limit_velocity: ScalarLike, transition_velocity: ScalarLike) -> ScalarLike:
    """C_e/C_c below which the force decreases with v between zero and v_lim; zero if α is far above v_lim.

    d(C v)/dv = c₂ + c₁ g(u), g = u/√(1+u²) + (1+u)/√(1+u²)³, which grows up to u = (√17 − 3)/2, where g = 1.525.
    """
    u = limit_velocity / transition_velocity - 1.0
    u = 0.5 * (u + _STEEPEST - abs(u - _STEEPEST))  # the lesser of both
    g = u * (1.0 + u * u) ** -0.5 + (1.0 + u) * (1.0 + u * u) ** -1.5
    return 0.5 * (g - 1.0 + abs(g - 1.0)) / (g + 1.0)


@final
class Besinger(AbstractMemoryless):
    """Paper 001: F = C(v) v below the limit velocity, F = C_e v_open + C_b (v − v_open) above, when the valve is open.

    C(v) changes smoothly from C_c to C_e (`transition_rate`). The opening velocity is not an independent parameter:
    continuity at v_lim gives v_open = v_lim (C(v_lim) − C_b)/(C_e − C_b). With v_open = v_lim, as the paper's text
    suggests, the force jumps. The slope changes at v_lim. F must increase with v everywhere; other parameter sets are
    refused. C_c must be above 0.0067 C_e and, where v_lim is above α, C_e above up to 0.208 C_c (`least_rebound`).
    C_e must differ from C_b only for `opening_velocity` to exist, not for the force.

    Valid below 10 Hz and 1 m/s (paper 001); above 10 Hz, use it inside a `SeriesSpring` or a `Lag`. A fit needs data on
    both sides of v_lim and of α: a test at lower velocities does not determine C_b, C_e and α.

    >>> law = Besinger(14_400.0, 15_600.0, 3_600.0, limit_velocity=0.125, transition_velocity=0.7)
    >>> round(float(law.opening_velocity()), 6), round(float(law.force_velocity(0.3)), 4)
    (0.114783, 2457.3945)
    """

    compression_rate: Number = parameter("N s/m", "C_c, damping coefficient far in compression", positive)
    rebound_rate: Number = parameter("N s/m", "C_e, damping coefficient in rebound, valve closed", positive)
    blow_off_rate: Number = parameter("N s/m", "C_b, slope in rebound, valve open", positive)
    limit_velocity: Number = parameter("m/s", "v_lim, rebound velocity where the valve opens", positive)
    transition_velocity: Number = parameter(
        "m/s", "α, centre and width of the change from C_c to C_e", positive, adjustable=False
    )

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        closed = at_most(v, self.limit_velocity)
        rate = transition_rate(closed, self.compression_rate, self.rebound_rate, self.transition_velocity)
        return rate * closed + self.blow_off_rate * (v - closed)

    def conditions(self) -> tuple[Condition, ...]:
        """The force increases with the velocity."""
        falls = "Otherwise the force decreases with increasing velocity in {}."
        share = least_rebound(self.limit_velocity, self.transition_velocity)
        return (
            Condition(
                "compression_rate",
                LEAST_COMPRESSION * self.rebound_rate,
                f"{LEAST_COMPRESSION} rebound_rate",
                falls.format("compression"),
            ),
            Condition(
                "rebound_rate",
                share * self.compression_rate,
                "a share of compression_rate that limit_velocity / transition_velocity gives",
                falls.format("rebound"),
            ),
        )

    def other_starts(self, reach: Reach) -> list[dict[str, float]]:
        """α far below, within and above the velocities of the records; low and high limit velocities."""
        shares = (("transition_velocity", (0.03, 0.3, 1.0, 4.0)), ("limit_velocity", (0.2, 0.6, 0.97)))
        return [{name: share * reach.velocity} for name, parts in shares for share in parts]

    def opening_velocity(self) -> Scalar:
        """v_open [m/s], where the blow-off line meets the line C_e v."""
        at_limit = transition_rate(
            self.limit_velocity, self.compression_rate, self.rebound_rate, self.transition_velocity
        )
        return self.limit_velocity * (at_limit - self.blow_off_rate) / (self.rebound_rate - self.blow_off_rate)

    @classmethod
    def from_printed(
        cls, c_c: float, c_e: float, c_b: float, v_lim: float, alpha: float, v_open: float | None = None
    ) -> "Besinger":
        """The law for a parameter set of the formula as printed in paper 001, coefficients in N s/m, velocities in m/s.

        In the printed formula v_open is a free parameter (v_lim if left out), and the force then jumps at v_lim. This
        law derives v_open and is continuous. It equals the printed formula below v_lim and differs from it by the jump
        above. A warning states the jump.
        """
        law = cls(c_c, c_e, c_b, v_lim, alpha)
        v_open = v_lim if v_open is None else v_open
        above = c_e * v_open + c_b * (v_lim - v_open)
        below = float(law.force_velocity(v_lim))
        jump = above - below
        if abs(jump) > 1e-6 * abs(below):
            warn(
                f"The printed formula with v_open = {v_open:g} m/s jumps by {jump:+.4g} N ({100 * jump / below:+.2g} %)"
                f" at v_lim = {v_lim:g} m/s; continuity needs v_open = {float(law.opening_velocity()):.6g} m/s, which"
                " is used instead, because a jump causes errors in solvers and gradients."
            )
        return law

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "Besinger":
        """Start values from measured data: secant slopes; the rebound knee where the mean curve leaves them."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        top = max(float(velocity.max()), 1e-6)
        low = secant_rate(velocity, force, 1, 0.0, 0.1)
        knees = top * np.linspace(0.05, 0.9, 35)
        use = velocity > 0
        v, f = (velocity[use], force[use]) if use.any() else (np.array([top]), np.array([low * top]))
        best = (np.inf, low, 0.3 * low, 0.5 * top)
        for knee in knees:
            columns = np.stack([np.minimum(v, knee), np.maximum(v - knee, 0.0)], axis=1)
            slopes = np.linalg.lstsq(columns, f, rcond=None)[0]
            error = float(np.sum((columns @ slopes - f) ** 2))
            if error < best[0]:
                best = (error, float(slopes[0]), float(slopes[1]), float(knee))
        _, rebound, blow_off, knee = best
        transition = 0.3 * knee
        rebound = max(rebound, 1.0)
        compression = max(secant_rate(velocity, force, -1), 0.02 * rebound)
        # if the force decreases in rebound, as with stick-slip friction, the law must still have an increasing force
        rebound = max(rebound, 1.1 * float(least_rebound(knee, transition)) * compression)
        return cls(
            compression_rate=compression,
            rebound_rate=rebound,
            blow_off_rate=float(np.clip(blow_off, 0.05 * rebound, None)),
            limit_velocity=knee,
            transition_velocity=transition,
        )

    def plainer(self, undetermined: Sequence[str], fastest: float) -> AbstractMemoryless:
        """Without blow-off where it is not known; else a curve that bends less, or straight lines."""
        determined = 5 - len(self.without_effect(fastest)) - len(undetermined)
        if not {"blow_off_rate", "limit_velocity"}.isdisjoint(undetermined):
            limit = 2.0 * fastest
            rate = transition_rate(limit, self.compression_rate, self.rebound_rate, self.transition_velocity)
            return dataclasses.replace(self, blow_off_rate=rate, limit_velocity=limit)
        return plainer_curve(self, determined, fastest)

    def without_effect(self, fastest: float) -> tuple[str, ...]:
        """The blow-off, if the valve opens at none of these velocities."""
        return ("blow_off_rate", "limit_velocity") if self.limit_velocity > fastest else ()

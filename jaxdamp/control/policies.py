"""What a controller wants of a damper: the classic policies, each a demanded force.

A semi-active damper can only resist its motion, and between its softest and its hardest command. So a policy demands
the force that it would like, and the controller commands what comes nearest (`Controlled`). The on-off laws of the
literature are the same laws with a very large gain: where the damper can resist at all, it is set to its hardest.
Signals and forces have the signs of the library: heights and velocities up, the stroke positive in extension, the force
positive where it resists extension, which pulls the body down and the wheel up.
"""

from abc import abstractmethod
from typing import NamedTuple, TypeAlias, final

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar
from jaxdamp.parameters import AbstractDeclared, interval, nonnegative, parameter, positive, real


class Signals(NamedTuple):
    """What a controller knows of one damper, after its sensors.

    Attributes:
        body_velocity: of the body above the damper, up [m/s].
        wheel_velocity: of the wheel below, up [m/s].
        body_acceleration: of the body above, up [m/s²].
        stroke: deflection between them, extension positive [m].
        velocity: its rate [m/s].
        pitch_velocity: part of the body's velocity that comes from its pitch, up at this damper [m/s].
        roll_velocity: part that comes from its roll.
        tyre_deflection: height of the wheel below over the road, from rest [m]; zero of a damper above no wheel.
    """

    body_velocity: Scalar
    wheel_velocity: Scalar
    body_acceleration: Scalar
    stroke: Scalar
    velocity: Scalar
    pitch_velocity: Scalar = 0.0  # pyright: ignore[reportAssignmentType]
    roll_velocity: Scalar = 0.0  # pyright: ignore[reportAssignmentType]
    tyre_deflection: Scalar = 0.0  # pyright: ignore[reportAssignmentType]

    @property
    def heave_velocity(self) -> Scalar:
        """Part of the body's velocity that is not of pitch or roll [m/s]: that of its centre of gravity."""
        return self.body_velocity - self.pitch_velocity - self.roll_velocity


class AbstractPolicy(AbstractDeclared):
    """A demanded force from the signals of one damper: derive your own, with parameters as a law has them.

    It may hold any equinox module, such as a network, and may have states that it carries from sample to sample.
    """

    def sampled(self, period: float) -> "AbstractPolicy":
        """The same policy for samples every `period` [s]: what depends on the period is computed here, once a run.

        A policy with filters, integrators or buffers returns one that has their numbers; others are as they are.
        """
        del period
        return self

    def initial_state(self) -> PyTree:
        """What it remembers before the first sample: arrays, or nothing."""
        return ()

    @abstractmethod
    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N], positive where it resists extension, and its state after this sample."""


@final
class Skyhook(AbstractPolicy):
    """F = g (ż_b + τ z̈_b): a damper between the body and the sky, which it is not fixed to.

    With τ = 0 it is linear skyhook, clipped to what the damper can do; with a very large gain (1e9) it is two-state
    skyhook, hard where ż_b v > 0. With a large gain and τ = 1/α it is mixed skyhook and acceleration-driven damping of
    crossover α [rad/s]: of ż_b and z̈_b/α the greater has the say, which is the sign of their sum (Savaresi and Spelta,
    Mixed sky-hook and ADD, J. Dyn. Syst. Meas. Control 129, 2007).

    >>> from jaxdamp.control import Signals
    >>> force, _ = Skyhook(3000.0)(Signals(0.2, -0.1, 1.0, 0.01, 0.3), ())
    >>> float(force)
    600.0
    """

    gain: Number = parameter("N s/m", "force per velocity of the body", nonnegative, default=3000.0)
    lead: Number = parameter("s", "share of the acceleration of the body", nonnegative, default=0.0)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        return self.gain * (seen.body_velocity + self.lead * seen.body_acceleration), state


@final
class Groundhook(AbstractPolicy):
    """F = −g ż_w: a damper between the wheel and the ground; two-state with a very large gain."""

    gain: Number = parameter("N s/m", "force per velocity of the wheel", nonnegative, default=3000.0)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        return -self.gain * seen.wheel_velocity, state


@final
class HybridHook(AbstractPolicy):
    """F = g (σ ż_b − (1 − σ) ż_w): skyhook and groundhook by shares σ and 1 − σ."""

    gain: Number = parameter("N s/m", "force per velocity", nonnegative, default=3000.0)
    share: Number = parameter("", "share of skyhook", interval(0.0, 1.0), default=0.5)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        mixed = self.share * seen.body_velocity - (1.0 - self.share) * seen.wheel_velocity
        return self.gain * mixed, state


@final
class AccelerationDriven(AbstractPolicy):
    """F = g z̈_b with a very large gain: ADD, hard where z̈_b v > 0, which needs no velocity of the body.

    Savaresi, Silani and Bittanti, Acceleration-driven-damper (ADD), J. Dyn. Syst. Meas. Control 127, 2005.
    """

    gain: Number = parameter("kg", "force per acceleration of the body", nonnegative, default=1e9)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        return self.gain * seen.body_acceleration, state


@final
class PowerDriven(AbstractPolicy):
    """F = −k x: the force that takes away that of the spring, so that nothing is left on the body: PDD.

    Morselli and Zanasi, Control of port Hamiltonian systems by dissipative devices, Mechatronics 18, 2008.
    """

    stiffness: Number = parameter("N/m", "rate of the suspension spring", nonnegative)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        return -self.stiffness * seen.stroke, state


@final
class StateFeedback(AbstractPolicy):
    """F = g_b ż_b + g_w ż_w + g_x x + g_v v + g_a z̈_b + g_t d: linear feedback, such as `control.lqr` finds it."""

    body_velocity: Number = parameter("N s/m", "force per velocity of the body", real, default=0.0)
    wheel_velocity: Number = parameter("N s/m", "force per velocity of the wheel", real, default=0.0)
    body_acceleration: Number = parameter("kg", "force per acceleration of the body", real, default=0.0)
    stroke: Number = parameter("N/m", "force per stroke", real, default=0.0)
    velocity: Number = parameter("N s/m", "force per rate of the stroke", real, default=0.0)
    tyre_deflection: Number = parameter("N/m", "force per deflection of the tyre", real, default=0.0)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        force = self.body_velocity * seen.body_velocity + self.wheel_velocity * seen.wheel_velocity
        force = force + self.body_acceleration * seen.body_acceleration
        force = force + self.stroke * seen.stroke + self.velocity * seen.velocity
        return force + self.tyre_deflection * seen.tyre_deflection, state


@final
class ModalSkyhook(AbstractPolicy):
    """F = g_h ż_h + g_p ż_p + g_r ż_r: skyhook with a gain for each of heave, pitch and roll.

    ż_h, ż_p and ż_r are the parts of the body's velocity at the damper, so no lever arms are needed: at a damper a_i
    ahead of the centre of gravity ż_p = a_i θ̇, and all of them together give the moment Σ a_i² g_p θ̇. Equal gains are
    `Skyhook`.
    """

    heave: Number = parameter("N s/m", "force per velocity of heave", nonnegative, default=3000.0)
    pitch: Number = parameter("N s/m", "force per velocity of pitch at the damper", nonnegative, default=3000.0)
    roll: Number = parameter("N s/m", "force per velocity of roll at the damper", nonnegative, default=3000.0)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        turning = self.pitch * seen.pitch_velocity + self.roll * seen.roll_velocity
        return self.heave * seen.heave_velocity + turning, state


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
    decay = jnp.exp(-z)
    mean = -jnp.expm1(-z) / z
    return decay, mean - decay, 1.0 - mean


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
            filtered * lag + before * last + now * velocity
            for (filtered, before, now), lag in zip((self.high, self.low), lags, strict=True)
        )
        return self.gain * (high - low), (velocity, high, low)

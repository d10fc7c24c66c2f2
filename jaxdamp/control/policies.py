"""What a controller wants of a damper: the classic policies, each a demanded force.

A semi-active damper can only resist its motion, and between its softest and its hardest command. So a policy demands
the force that it would like, and the controller commands what comes nearest (`Controlled`). The on-off laws of the
literature are the same laws with a very large gain: where the damper can resist at all, it is set to its hardest.
Signals and forces have the signs of the library: heights and velocities up, the stroke positive in extension, the force
positive where it resists extension, which pulls the body down and the wheel up.
"""

from abc import abstractmethod
from typing import NamedTuple, final

from jaxtyping import PyTree

from jaxdamp._types import Number, Scalar
from jaxdamp.parameters import Module, check_parameters, interval, nonnegative, parameter, readable, real


class Signals(NamedTuple):
    """What a controller knows of one damper, after its sensors.

    Attributes:
        body_velocity: of the body above the damper, up [m/s].
        wheel_velocity: of the wheel below, up [m/s].
        body_acceleration: of the body above, up [m/s²].
        stroke: deflection between them, extension positive [m].
        velocity: its rate [m/s].
    """

    body_velocity: Scalar
    wheel_velocity: Scalar
    body_acceleration: Scalar
    stroke: Scalar
    velocity: Scalar


class AbstractPolicy(Module):
    """A demanded force from the signals of one damper: derive your own, with parameters as a law has them.

    It may hold any equinox module, such as a network, and may have states that it carries from sample to sample.
    """

    def __check_init__(self) -> None:
        check_parameters(self)

    def __repr__(self) -> str:
        return readable(self)

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
class Hybrid(AbstractPolicy):
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
    """F = g_b ż_b + g_w ż_w + g_x x + g_v v + g_a z̈_b: linear feedback, such as a clipped LQR."""

    body_velocity: Number = parameter("N s/m", "force per velocity of the body", real, default=0.0)
    wheel_velocity: Number = parameter("N s/m", "force per velocity of the wheel", real, default=0.0)
    body_acceleration: Number = parameter("kg", "force per acceleration of the body", real, default=0.0)
    stroke: Number = parameter("N/m", "force per stroke", real, default=0.0)
    velocity: Number = parameter("N s/m", "force per rate of the stroke", real, default=0.0)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        force = self.body_velocity * seen.body_velocity + self.wheel_velocity * seen.wheel_velocity
        force = force + self.body_acceleration * seen.body_acceleration
        return force + self.stroke * seen.stroke + self.velocity * seen.velocity, state

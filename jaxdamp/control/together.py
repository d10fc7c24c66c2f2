"""Policies that see all dampers of a vehicle together."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import final

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._types import Scalar, Vector
from jaxdamp._vectors import scalars
from jaxdamp.control.policies import AbstractPolicy, Signals
from jaxdamp.parameters import AbstractDeclared, parameter, real


class AbstractVehiclePolicy(AbstractDeclared):
    """Demanded forces of all dampers from the signals of all of them: derive your own as an `AbstractPolicy`.

    Signals and forces are by the names of the dampers, such as `front_damper`, in the order of the vehicle.
    """

    def sampled(self, period: float) -> "AbstractVehiclePolicy":
        """The same policy for samples every `period` [s], as `AbstractPolicy.sampled`."""
        del period
        return self

    def initial_state(self, dampers: Sequence[str]) -> PyTree:
        """What it remembers of dampers of these names before the first sample: arrays, or nothing."""
        del dampers
        return ()

    @abstractmethod
    def __call__(self, seen: Mapping[str, Signals], state: PyTree) -> tuple[dict[str, Scalar], PyTree]:
        """The demanded force of each damper [N], and its state after this sample."""


@final
class EachDamper(AbstractVehiclePolicy):
    """A policy for each damper, which sees its own signals only."""

    policies: dict[str, AbstractPolicy]  # by the names of the dampers

    def sampled(self, period: float) -> "EachDamper":
        """With all of them sampled."""
        return EachDamper({name: policy.sampled(period) for name, policy in self.policies.items()})

    def initial_state(self, dampers: Sequence[str]) -> PyTree:
        """The state of each policy."""
        return {name: self.policies[name].initial_state() for name in dampers}

    def __call__(self, seen: Mapping[str, Signals], state: PyTree) -> tuple[dict[str, Scalar], PyTree]:
        """The demanded forces [N]."""
        pairs = {name: self.policies[name](signals, state[name]) for name, signals in seen.items()}
        return {name: pair[0] for name, pair in pairs.items()}, {name: pair[1] for name, pair in pairs.items()}


@final
class VehicleFeedback(AbstractVehiclePolicy):
    """F_i = Σ_j (B_ij ż_b,j + W_ij ż_w,j + X_ij x_j + T_ij d_j): linear feedback of all dampers, such as a clipped LQR.

    Rows and columns are dampers in the order of the vehicle; `control.lqr` finds the gains.
    """

    body_velocity: Float[Array, "dampers dampers"] = parameter("N s/m", "force per velocity of the body", real)
    wheel_velocity: Float[Array, "dampers dampers"] = parameter("N s/m", "force per velocity of the wheel", real)
    stroke: Float[Array, "dampers dampers"] = parameter("N/m", "force per stroke", real)
    tyre_deflection: Float[Array, "dampers dampers"] = parameter("N/m", "force per deflection of the tyre", real)

    def initial_state(self, dampers: Sequence[str]) -> PyTree:
        """Nothing; other numbers of dampers than of gains are refused."""
        if self.stroke.shape != (len(dampers), len(dampers)):
            must = f"have gains of shape ({len(dampers)}, {len(dampers)}) for {', '.join(dampers)}"
            _checks.refuse("policy", must, self.stroke.shape)
        return ()

    def __call__(self, seen: Mapping[str, Signals], state: PyTree) -> tuple[dict[str, Scalar], PyTree]:
        """The demanded forces [N]."""
        forces = {}
        for i, name in enumerate(seen):
            parts = (
                self.body_velocity[i, j] * one.body_velocity
                + self.wheel_velocity[i, j] * one.wheel_velocity
                + self.stroke[i, j] * one.stroke
                + self.tyre_deflection[i, j] * one.tyre_deflection
                for j, one in enumerate(seen.values())
            )
            forces[name] = sum(parts, start=0.0 * seen[name].stroke)
        return forces, state


@final
class Preview(AbstractVehiclePolicy):
    """A policy for every damper, and at the rear what the front wheel has met: F_r = F − Σ_j g_j ż_wf(t − delay + j T).

    The wheel behind meets the road of the front one a delay of wheelbase/speed later. So with j = 0 the velocity of
    the front wheel stands for that of the road under the rear wheel now, with j for that of j periods T later: several
    gains look ahead. A single gain is one of the rear wheel; a shorter delay makes up for a slow valve.

    Arguments:
        policy: of each damper.
        delay: wheelbase/speed [s], or less, a whole number of periods.

    Raises:
        ValueError: a delay of no whole periods, more gains than it has periods; a vehicle without a front damper of the
            same name for a rear one.
    """

    policy: AbstractPolicy
    gains: Vector = parameter("N s/m", "force at the rear per velocity of the front wheel, period by period ahead")
    delay: float = eqx.field(static=True)

    def sampled(self, period: float) -> "AbstractVehiclePolicy":
        """With a buffer of whole samples."""
        count = round(self.delay / period)
        if self.delay < 0.0 or abs(count * period - self.delay) > 1e-6 * period:
            nearest = f"Its nearest is {max(count, 0) * period:g} s."
            _checks.refuse("delay", f"be a whole number of periods of {period:g} s", self.delay, nearest)
        if self.gains.shape[0] > count + 1:
            must = f"be {count + 1} numbers or fewer, of which the last sees the front wheel now"
            _checks.refuse("gains", must, self.gains.shape[0])
        return _Buffered(self.policy.sampled(period), scalars(self.gains), count)

    def initial_state(self, dampers: Sequence[str]) -> PyTree:
        """Refused: `sampled(period)` answers."""
        del dampers
        _checks.refuse("policy", "know its period", "one that does not", "Call `policy.sampled(5e-3)` first.")

    def __call__(self, seen: Mapping[str, Signals], state: PyTree) -> tuple[dict[str, Scalar], PyTree]:
        """Refused, as the state."""
        return self.initial_state(list(seen))


@final
class _Buffered(AbstractVehiclePolicy):
    """`Preview` with the velocities of the front wheels of the last `count` samples, the oldest first."""

    policy: AbstractPolicy
    gains: tuple[Scalar, ...]
    count: int = eqx.field(static=True)

    def initial_state(self, dampers: Sequence[str]) -> PyTree:
        """Of the policies, and the front wheels at rest."""
        rear = {name: name.replace("rear", "front") for name in dampers if "rear" in name}
        if not rear or not {*rear.values()} <= {*dampers}:
            _checks.refuse("policy", "have a front damper for each rear one of the vehicle", ", ".join(dampers))
        states = {name: self.policy.initial_state() for name in dampers}
        return states, {name: (0.0,) * self.count for name in rear}

    def __call__(self, seen: Mapping[str, Signals], state: PyTree) -> tuple[dict[str, Scalar], PyTree]:
        """The demanded forces [N]."""
        states, ahead = state
        pairs = {name: self.policy(signals, states[name]) for name, signals in seen.items()}
        forces, after = ({name: pair[i] for name, pair in pairs.items()} for i in range(2))
        buffers = {}
        for name, past in ahead.items():
            met = *past, seen[name.replace("rear", "front")].wheel_velocity
            buffers[name] = met[1:]
            forces[name] = forces[name] - sum(g * v for g, v in zip(self.gains, met, strict=False))
        return forces, (after, buffers)

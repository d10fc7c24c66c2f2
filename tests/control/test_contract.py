"""All policies satisfy the contract of policies, and policies that are broken on purpose do not."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.control import (
    AbstractPolicy,
    AccelerationDriven,
    BandSkyhook,
    Groundhook,
    HybridHook,
    ModalSkyhook,
    PowerDriven,
    Preview,
    Skyhook,
    StateFeedback,
    VehicleFeedback,
)
from jaxdamp.parameters import parameter, positive
from jaxdamp.testing import POLICY_CHECKS, check_policy


class _Network(AbstractPolicy):
    """A network with a memory of the last body velocity."""

    layers: eqx.nn.MLP

    def initial_state(self):
        return {"before": 0.0}

    def __call__(self, seen, state):
        inputs = jnp.stack([seen.body_velocity, seen.body_velocity - state["before"], seen.velocity])
        return 1e3 * self.layers(inputs), {"before": seen.body_velocity}


POLICIES = {
    "skyhook": Skyhook(3000.0, 0.01),
    "mixed": Skyhook(1e9, 0.08),
    "groundhook": Groundhook(3000.0),
    "hybrid": HybridHook(3000.0, 0.4),
    "acceleration-driven": AccelerationDriven(),
    "power-driven": PowerDriven(20e3),
    "feedback": StateFeedback(1e3, -2e3, 30.0, -1e4, 500.0, 2e4),
    "band": BandSkyhook(3000.0, 0.3, 8.0),
    "modal": ModalSkyhook(3000.0, 2000.0, 1000.0),
    "preview": Preview(Skyhook(2000.0), [-500.0, 300.0], delay=0.02),
    "vehicle feedback": VehicleFeedback(
        *(jnp.asarray(scale * (np.eye(2) + 0.2), float) for scale in (1e3, -2e3, -1e4, 2e4))
    ),
    "network": _Network(eqx.nn.MLP(3, "scalar", 4, 1, jnp.tanh, key=jax.random.key(0))),
}
PLAIN = ("skyhook", "preview", "network")  # a formula, memory of its own, a module without a file


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in PLAIN)) for name in POLICIES]
)
def test_every_policy_satisfies_the_contract(name):
    unwritten = name == "network"  # a module of equinox
    check_policy(POLICIES[name], leave_out=["file", "driven"] if unwritten else ["driven"])


@pytest.mark.slow
@pytest.mark.parametrize("name", POLICIES)
def test_every_policy_drives(name):
    check_policy(POLICIES[name], leave_out=set(POLICY_CHECKS) - {"driven"})


class _Broken(AbstractPolicy):
    gain: jax.Array = parameter("N s/m", "force per velocity", positive, default=1000.0)


class _TwoForces(_Broken):
    def __call__(self, seen, state):
        return self.gain * jnp.stack([seen.velocity, seen.body_velocity]), state


class _Growing(_Broken):
    def initial_state(self):
        return jnp.zeros(2)

    def __call__(self, seen, state):
        return self.gain * state[0], jnp.concatenate([seen.velocity[None], state])


class _Nameless(AbstractPolicy):
    gain: jax.Array = parameter("N s/m", "", positive, default=1000.0)

    def __call__(self, seen, state):
        return self.gain * seen.velocity, state


class _Quotient(_Broken):
    def __call__(self, seen, state):
        return self.gain * seen.body_velocity**2 / seen.velocity, state


class _Remembering(_Broken):
    calls: ClassVar[list[int]] = []  # outside its state

    def __call__(self, seen, state):
        self.calls.append(0)
        return self.gain * seen.velocity * len(self.calls), state


class _WithoutGradient(_Broken):
    def __call__(self, seen, state):
        return jax.lax.stop_gradient(self.gain) * seen.velocity, state


class _Imprecise(_Broken):
    def __call__(self, seen, state):
        return self.gain * ((1e5 + seen.velocity) ** 2 - 1e10) / 2e5, state


@pytest.mark.parametrize(
    ("policy", "broken"),
    [
        (_TwoForces, "shapes"),
        (_Growing, "shapes"),
        (_Nameless, "declared"),
        (_Quotient, "finite"),
        (_Remembering, "compiled"),
        (_WithoutGradient, "derivatives"),
        (_Imprecise, "single precision"),
    ],
)
def test_the_contract_refuses_broken_policies(policy, broken):
    leave_out = set(POLICY_CHECKS) - {"shapes", "declared", broken}
    with pytest.raises(AssertionError, match=f"{policy.__name__} breaks '{broken}'"):
        check_policy(policy(), leave_out=leave_out)


def test_what_is_no_policy_is_refused():
    with pytest.raises(ValueError, match="policy"):
        check_policy(_Network)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="`leave_out` must be one of"):
        check_policy(Skyhook(), leave_out=["speed"])

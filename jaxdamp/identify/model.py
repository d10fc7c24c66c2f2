"""What explains the records of a bench: a law, or a law on a machine that adds to its force."""

from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, State
from jaxdamp.dampers import AbstractDamper, FittedRange, with_fitted_range
from jaxdamp.identify.initial_states import Cycle, periodic_state
from jaxdamp.parameters import Module
from jaxdamp.rig import Rig, march


@final
class OnRig(Module):
    """A law on a machine; paths of parameters begin with `law.` and `rig.`."""

    law: AbstractDamper
    rig: Rig


Model = AbstractDamper | OnRig


def on_rig(law: AbstractDamper, rig: Rig | None) -> Model:
    """The law, on the machine if there is one."""
    return law if rig is None else OnRig(law, rig)


def law_of(model: Model) -> AbstractDamper:
    """The law itself."""
    return model.law if isinstance(model, OnRig) else model


def rig_of(model: Model) -> Rig | None:
    """The machine, if there is one."""
    return model.rig if isinstance(model, OnRig) else None


def effects_of(model: Model) -> tuple[str, ...]:
    """What of the machine depends on more than the instant (`Rig.effects`); asked of known numbers, not traced ones."""
    return model.rig.effects() if isinstance(model, OnRig) else ()


def is_memoryless(model: Model) -> bool:
    """Whether the force depends on stroke and velocity of the instant alone."""
    return law_of(model).initial_state().size == 0 and not effects_of(model)


def can_rest(model: Model) -> bool:
    """Whether the law has states, which rest can tell of: friction that holds, a force that relaxes.

    Without them its force at rest is one number, while dry friction holds any force up to its own.
    """
    return law_of(model).initial_state().size > 0


def with_range(model: Model, fitted_to: FittedRange) -> Model:
    """The same with the range that the law was fitted to."""
    return on_rig(with_fitted_range(law_of(model), fitted_to), rig_of(model))


def blind_end(model: Model, dt: float) -> int:
    """So many samples at the end of a record cannot be predicted: their force needs the motion behind the end."""
    if not effects_of(model):
        return 0
    assert isinstance(model, OnRig)
    return 2 + int(np.ceil(np.max(np.abs(np.asarray(model.rig.force_delay))) / dt))


def marched(
    model: Model,
    effects: tuple[str, ...],
    dt: Array,
    stroke: Float[Array, " time"],
    velocity: Float[Array, " time"],
    temperature: Float[Array, " time"] | None,
    substeps: int,
    state: State | None,
) -> Float[Array, " time"]:
    """Force [N] in a record with this motion, for use inside compiled functions, from this state if one is given."""
    if isinstance(model, AbstractDamper):
        return march(model, dt, stroke, velocity, substeps, temperature, state)
    return model.rig.march(model.law, effects, dt, stroke, velocity, temperature, substeps, state).force


def initial_state(
    model: Model, effects: tuple[str, ...], cycle: Cycle, temperature: Float[Array, " time"] | None
) -> tuple[State, Scalar]:
    """The states at the start of a record: periodic, or at rest; and how much they still change over the cycle."""
    if isinstance(model, OnRig):
        before = [jnp.concatenate([channel[:-1], channel]) for channel in (cycle.stroke, cycle.velocity)]
        stroke, velocity = model.rig.delayed_motion(effects, cycle.dt, *before)
        again = -cycle.stroke.size
        cycle = cycle._replace(stroke=stroke[again:] - model.rig.stroke_offset, velocity=velocity[again:])
    law = law_of(model)
    if temperature is not None and law.traits().temperature_dependent:
        law = law.at_temperature(temperature[0])
    state, change = periodic_state(law, cycle)
    return jnp.where(cycle.periodic, state, law.initial_state()), jnp.where(cycle.periodic, change, 0.0)

"""Notes on a response: laws beyond the range of their fit, tyres in tension."""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._types import Signal
from jaxdamp.dampers import AbstractDamper, Motion, RangeUse, has_fitted_range, range_use, sentence
from jaxdamp.vehicles import AbstractVehicle, ChannelKind, PortForm, System


def range_uses(
    vehicle: AbstractVehicle,
    form: PortForm,
    motion: Float[Array, "time n"],
    road: Float[Array, "time wheels"],
    road_rate: Float[Array, "time wheels"],
    port_force: Float[Array, "time ports"],
) -> dict[str, list[RangeUse]]:
    """What each damper did beside what its law was fitted to, by the name of the damper.

    Arguments:
        vehicle: with its laws.
        form: its matrices.
        motion: coordinates and their rates [m, m/s] at each instant.
        road: heights [m].
        road_rate: their rates [m/s].
        port_force: force of each element [N].

    Returns:
        The dampers whose law has a range; empty if none has one, or while JAX traces the run.
    """
    tree: PyTree = (vehicle, motion)
    if not has_fitted_range(vehicle) or any(_checks.concrete(leaf) is None for leaf in jax.tree.leaves(tree)):
        return {}
    position, rate = jnp.split(motion, 2, axis=1)
    strokes, velocities = (np.asarray(form.at_ports(*at), dtype=float) for at in ((position, road), (rate, road_rate)))
    forces = np.asarray(port_force, dtype=float)
    uses_of = {}
    for i, (name, law) in enumerate(named_laws(vehicle).items()):
        uses = range_use(law, Motion(strokes[:, i], velocities[:, i], forces[:, i]))
        if uses:
            uses_of[name] = uses
    return uses_of


def named_laws(vehicle: AbstractVehicle) -> dict[str, AbstractDamper]:
    """The law at each port by the name of its element, such as "front_damper".

    Arguments:
        vehicle: the vehicle.
    """
    return dict(zip(vehicle.layout.ports, vehicle.elements(), strict=True))


def range_sentences(uses: dict[str, Sequence[RangeUse]] | dict[str, list[RangeUse]]) -> tuple[str, ...]:
    """A sentence for each damper that leaves its range.

    Arguments:
        uses: by the name of the damper.
    """
    texts = (sentence(name.replace("_", " "), of_damper) for name, of_damper in uses.items())
    return tuple(text for text in texts if text)


LEAST = 1e-3  # of the static load, by which a load must be below zero


def tyres_in_tension(
    system: System, time: Float[np.ndarray, " time"], channel: Callable[[str], Signal]
) -> tuple[str, ...]:
    """Linear tyres that pulled on the road: how far below zero their load went, when, and for how long."""
    layout, pulled = system.layout, []
    loads = [c for c in layout.channels if c.kind is ChannelKind.TYRE_LOAD]  # in the order of the wheels
    for beyond, static, lifts in zip(loads, np.asarray(system.static_loads), layout.lifts, strict=True):
        load = static + np.asarray(channel(beyond.name))
        worst = int(np.argmin(load))
        if static > 0.0 and not lifts and load[worst] < -LEAST * static:
            share = 100.0 * float(np.mean(load < 0.0))
            pulled.append(
                f"{beyond.place.replace('_', ' ') + ' ' if beyond.place else ''}{load[worst] / 1e3:.3g} kN at "
                f"{time[worst]:.3f} s (static load {static / 1e3:.3g} kN, below zero in {share:.2g} % of the run)"
            )
    if not pulled:
        return ()
    remedy = "Pass `tyre_lifts=True` to the vehicle if its wheels can leave the road."
    return (f"Wheel loads fell below zero, as linear tyres pull on the road: {'; '.join(pulled)}. {remedy}",)

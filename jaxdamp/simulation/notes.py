"""Notes on a response: laws beyond their fit or their strokes, tyres in tension, commands at their limits."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._types import Signal
from jaxdamp.control import ControlLoop, outer_forces
from jaxdamp.dampers import AbstractDamper, Motion, RangeUse, has_fitted_range, range_use, sentence
from jaxdamp.vehicles import AbstractVehicle, ChannelKind, PortForm, System


class Delivery(NamedTuple):
    """What a damper gave of the force that a controller demanded of it.

    Attributes:
        share: mean of force × demand over the mean of demand²; 1 where each demand was met, near 0 of on-off policies,
            which demand far more than there is.
        resisting: share of the time in which the demand resisted the motion of the damper, which alone it can do.
    """

    share: float
    resisting: float


def deliveries(channel: Callable[[str], Signal], dampers: Sequence[str]) -> dict[str, Delivery]:
    """What controlled dampers gave of what was demanded of them.

    Arguments:
        channel: the values of a channel by its name.
        dampers: names of those under control.
    """
    by_damper = {}
    for name in dampers:
        demand, force, rate = (np.asarray(channel(f"{name}_{word}")) for word in ("demand", "force", "velocity"))
        share = np.mean(force * demand) / np.mean(demand**2) if np.any(demand) else 1.0
        by_damper[name] = Delivery(float(share), float(np.mean(demand * rate >= 0.0)))
    return by_damper


FAR = 0.01  # share of the time outside the fitted range from which a verdict cannot be trusted


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
    form, motion, road, road_rate, forces = jax.tree.map(np.asarray, (form, motion, road, road_rate, port_force))
    count = motion.shape[1] // 2
    pairs = (motion[:, :count], road), (motion[:, count:], road_rate)
    strokes, velocities = (np.asarray(form.at_ports(*pair)) for pair in pairs)
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


def over_runs(runs: Sequence[Mapping[str, Sequence[RangeUse]]]) -> dict[str, list[RangeUse]]:
    """The uses of each damper in several runs of one length as one: the extremes, and the mean share of the time.

    Arguments:
        runs: uses by the name of the damper, of one vehicle on several roads.
    """
    together: dict[str, dict[tuple[str, str], list[RangeUse]]] = {}
    for uses in runs:
        for name, of_damper in uses.items():
            for use in of_damper:
                together.setdefault(name, {}).setdefault((use.law, use.quantity), []).append(use)
    return {name: [_over_runs(same) for same in groups.values()] for name, groups in together.items()}


def _over_runs(uses: Sequence[RangeUse]) -> RangeUse:
    used = min(use.used[0] for use in uses), max(use.used[1] for use in uses)
    shares = [use.share for use in uses if use.share is not None]
    return uses[0]._replace(used=used, share=sum(shares) / len(uses) if shares else None)


def range_sentences(uses: Mapping[str, Sequence[RangeUse]]) -> tuple[str, ...]:
    """A sentence for each damper that leaves its range.

    Arguments:
        uses: by the name of the damper.
    """
    texts = (sentence(name.replace("_", " "), of_damper) for name, of_damper in uses.items())
    return tuple(text for text in texts if text)


def without_motion(motion: Float[np.ndarray, "time n"], road: Float[np.ndarray, "time wheels"]) -> tuple[str, ...]:
    """A sentence on a run in which nothing moves, as where it ends before the bump of its road."""
    if np.any(road != road[0]) or np.any(motion != motion[0]):
        return ()
    return ("Nothing moves, as the road stays level. If it has a bump later, pass a longer `duration`.",)


def beyond_strokes(
    system: System, motion: Float[np.ndarray, "time n"], road: Float[np.ndarray, "time wheels"]
) -> tuple[str, ...]:
    """A sentence on each damper that was longer or shorter than its law can be, such as a tube without oil or gas left.

    Arguments:
        system: the vehicle.
        motion: coordinates and their rates [m, m/s] at each instant.
        road: heights [m].
    """
    limits = [np.array([[*map(float, term.stroke_limits)] for term in law.side_by_side()]) for law in system.laws]
    if not any(np.isfinite(each).any() for each in limits):
        return ()
    form = jax.tree.map(np.asarray, system.form)
    strokes, texts = np.asarray(form.at_ports(motion[:, : motion.shape[1] // 2], road)), []
    for name, each, stroke in zip(system.layout.ports, limits, strokes.T, strict=True):
        low, high = each[:, 0].max(), each[:, 1].min()
        if share := float(np.mean((stroke < low) | (stroke > high))):
            texts.append(
                f"The {name.replace('_', ' ')} moved from {stroke.min():.3g} to {stroke.max():.3g} m, but its law is "
                f"valid from {low:.3g} to {high:.3g} m ({100.0 * share:.2g} % of the run outside). Add a `BumpStop`, "
                "or state the volumes at this static position."
            )
    return tuple(texts)


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


ALWAYS, OFTEN = 0.9, 0.05  # shares of the time that are said: at an end of the levels, at the limit of the rate
NEAR = 0.05  # of the range of the levels: nearer to an end, the limits of a command are rounded


def commands_at_limits(
    system: System, dt: float, every: int, commands: Float[np.ndarray, "time commands"]
) -> tuple[str, ...]:
    """Dampers whose commands stood at one end of their levels most of the time, or changed as fast as they can.

    Arguments:
        system: the vehicle with its controller.
        dt: spacing of the instants [s].
        every: of how many instants of the run one is saved.
        commands: of the dampers, then the demanded forces [N].
    """
    control: ControlLoop = system.control
    texts = []
    for number, (port, levels) in enumerate(zip(control.ports, control.levels(system.laws), strict=True)):
        command, name = commands[:, number], system.layout.ports[port].replace("_", " ")
        low, high = float(levels[0]), float(levels[-1])
        near = NEAR * (high - low)
        for word, level, at_end in (("lowest", low, command < low + near), ("highest", high, command > high - near)):
            if (share := float(np.mean(at_end))) > ALWAYS:
                here, there = outer_forces(system.laws[port], control.still)[:: 1 if word == "lowest" else -1]
                at_most = "no softer" if here < there else "no harder"
                texts.append(
                    f"The command of the {name} stood at its {word} level, {level:g}, {100.0 * share:.0f} % of the "
                    f"time: the damper can be {at_most} than it is there."
                )
        if control.rate_limit is not None and len(command) > 1:
            rate = np.diff(command) / dt
            rising, falling = float(control.rate_limit.rising), float(control.rate_limit.falling)
            share = float(np.mean((rate > 0.999 * rising) | (rate < -0.999 * falling)))
            if share > OFTEN:
                texts.append(
                    f"The command of the {name} changed as fast as its actuator can, {rising:g} up and {falling:g} "
                    f"down per second, {'at least ' * (every > 1)}{100.0 * share:.0f} % of the time."
                )
    return tuple(texts)


COUNTED_LATE, AIM = 0.005, 0.0025  # relative errors of an RMS: from which on one is said, and that of the step advised


def jumps_counted_late(
    system: System,
    dt: float,
    every: int,
    commands: Float[np.ndarray, "time commands"],
    channel: Callable[[str], Signal],
) -> tuple[str, ...]:
    """The acceleration whose RMS misses most as it is counted just before each jump of a command, where that shows.

    Between a sample before a jump and one after it counts the mean of both squares; the value after it is continued
    from the two instants that follow.

    Arguments:
        system: the vehicle with its controller.
        dt: spacing of the instants [s].
        every: of how many instants of the run one is saved; nothing is said of a run that saved only some.
        commands: of the dampers, then the demanded forces [N].
        channel: the values of a channel by its name.
    """
    control: ControlLoop = system.control
    if every > 1 or float(control.actuator_lag) > 0.0 or control.rate_limit is not None or len(commands) < 4:
        return ()
    jumps = np.flatnonzero(np.any(np.diff(commands[:-1, : len(control.ports)], axis=0) != 0.0, axis=1))
    errors = {}
    for name in (c.name for c in system.layout.channels if c.kind is ChannelKind.ACCELERATION):
        values = np.asarray(channel(name), float)
        after = 2.0 * values[jumps + 1] - values[jumps + 2]
        errors[name] = float(0.25 * np.sum(values[jumps] ** 2 - after**2) / max(np.sum(values**2), 1e-300))
    name, error = max(errors.items(), key=lambda pair: abs(pair[1]), default=("", 0.0))
    if abs(error) < COUNTED_LATE:
        return ()
    parts = next((n for n in (2, 5, 10, 20, 50) if n * AIM >= abs(error)), 100)  # of a step: samples stay at instants
    return (
        f"The commands jump, as the actuators have no lag, and channels are those just before each jump: the RMS of "
        f"`{name}` is about {100.0 * abs(error):.2g} % too {'large' if error > 0 else 'small'} for that. Pass "
        f"`dt={dt / parts:g}`, or the `actuator_lag` that the valve has.",
    )


def far_outside(uses: Mapping[str, Sequence[RangeUse]]) -> list[str]:
    """By how much each damper leaves the range of its law, where it does so for 1 % of the time or more.

    As in "front damper at 5.6 times the velocity and 1.8 times the stroke of its records, 46 % of the time".

    Arguments:
        uses: by the name of the damper.
    """
    texts = []
    for name, of_damper in uses.items():
        far = [use for use in of_damper if use.outside and use.times is not None and (use.share or 0.0) >= FAR]
        fast = any(use.quantity == "velocity" for use in far)
        far = [use for use in far if use.quantity != "force" or not fast]  # a force follows from the velocity
        if far:
            times = " and ".join(f"{use.times:.2g} times the {use.quantity}" for use in far)
            share = 100.0 * max(use.share or 0.0 for use in far)
            texts.append(f"{name.replace('_', ' ')} at {times} of its records, {share:.0f} % of the time")
    return texts

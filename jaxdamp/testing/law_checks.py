"""The contract of damper laws: each check takes a law and raises an `AssertionError` if it is violated."""

from collections.abc import Callable, Collection
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks, roads
from jaxdamp._field_types import check_module
from jaxdamp.dampers import (
    AbstractDamper,
    Bushing,
    FrequencySelective,
    Heated,
    Lag,
    Linear,
    Linkage,
    MotionRatio,
    Play,
    Scheduled,
    SeriesSpring,
    Spring,
    StrokeDependent,
    StrokeScaled,
    Sum,
    TemperatureScaled,
    Thinned,
)
from jaxdamp.parameters import free_parameters
from jaxdamp.rig import march
from jaxdamp.simulation import Ride
from jaxdamp.testing import _declared, _physics
from jaxdamp.testing._probes import require, require_equal
from jaxdamp.vehicles import Corner, HalfCar


Wrap = Callable[[AbstractDamper], AbstractDamper]
Laws = dict[str, Any]  # by slot

WRAPPERS: dict[str, Wrap] = {
    "0.7 * law": lambda law: 0.7 * law,
    "law + Spring(...) + law": lambda law: Sum((law, Spring(1e3), law)),
    "MotionRatio(law, ...)": lambda law: MotionRatio(law, 0.8),
    "Linkage(law, ...)": lambda law: Linkage(law, [-0.004, 0.0, 0.005], [0.7, 0.8, 0.9]),
    "TemperatureScaled(law, ...)": lambda law: TemperatureScaled(law, 313.15),
    "Scheduled((law, law), ...)": lambda law: Scheduled((law, law), [0.0, 1.0], 0.4),
    "StrokeScaled(law, ...)": lambda law: StrokeScaled(law, -3.0, 200.0),
    "Thinned(law, ...)": lambda law: Thinned(law, 0.2, 0.05),
    "Heated(law, ...)": lambda law: Heated(law, 0.01, 1.0, heat_capacity=10.0),
    "Lag(law, ...)": lambda law: Lag(law, 0.004),
}
IN_SERIES: dict[str, Wrap] = {
    "SeriesSpring(law, ...)": lambda law: SeriesSpring(law, 5e5),
    "Bushing(law, ...)": lambda law: Bushing(law, 2e6, 6e5, 800.0),
    "Play(law, ...)": lambda law: Play(law, 5e5, 2e-4),
}
WITHOUT_STATES: dict[str, Wrap] = {
    "StrokeDependent((law, law), ...)": lambda law: StrokeDependent((law, law), [-0.01, 0.01]),
    "FrequencySelective(law, ...)": lambda law: FrequencySelective(law, Linear(500.0), 0.03, 0.003),
}
SLOTS = ("damper", "extra_spring", "bump_stop", "friction")  # of a corner: four laws can share a car
METRICS = ("rms_sprung_acceleration", "rms_front_dynamic_tyre_load", "rms_rear_dynamic_tyre_load")


def expected_forces(force: np.ndarray, stroke: np.ndarray) -> dict[str, np.ndarray]:
    """Forces [N] of the wrappers that follow at every instant from that of the law, in the same motion."""
    return {
        "0.7 * law": 0.7 * force,
        "law + Spring(...) + law": 2.0 * force + 1e3 * stroke,
        "TemperatureScaled(law, ...)": (1.0 - 0.002 * 20.0) * force,
        "StrokeScaled(law, ...)": np.exp((200.0 * stroke - 3.0) * stroke) * force,
        "Scheduled((law, law), ...)": force,
    }


@eqx.filter_jit
def _forces(laws: tuple[AbstractDamper, ...]) -> tuple[Array, Array]:
    """A short motion's strokes [m], and the force [N] of each law in it, shape (laws, time)."""
    t = 1e-3 * jnp.arange(25.0)
    x, v = 0.006 * jnp.sin(60.0 * t), 0.36 * jnp.cos(60.0 * t)
    return x, jnp.stack([march(law, jnp.asarray(1e-3), x, v, 1) for law in laws])


def _resists_more_the_faster(law: AbstractDamper) -> bool:
    """Whether the force at rest grows with the velocity, as a law in series with a spring must."""
    state, zero = law.initial_state(), jnp.zeros(())
    force = [float(law.force(zero, jnp.asarray(v), state)) for v in (-2.0, -0.5, -0.1, 0.0, 0.1, 0.5, 2.0)]
    return bool(np.all(np.diff(force) > 0.0))


def check_inside_wrappers(law: AbstractDamper) -> None:
    """Every wrapper takes the law, or refuses it as its traits say, and gives finite forces with it.

    Arguments:
        law: the damper law.
    """
    stateless, feed_through = law.initial_state().size == 0, law.traits().has_feed_through
    wrapped = {name: wrap(law) for name, wrap in WRAPPERS.items()}
    for name, wrap in (IN_SERIES | WITHOUT_STATES).items():
        fits, why = (feed_through, "feed-through") if name in IN_SERIES else (stateless, "states")
        if fits and (name not in IN_SERIES or _resists_more_the_faster(law)):
            wrapped[name] = wrap(law)
        elif not fits:
            try:
                wrap(law)
            except ValueError:
                continue
            raise AssertionError(f"`{name}` takes the law, which it must refuse for its {why}.")
    stroke, forces = (np.asarray(a) for a in _forces((law, *wrapped.values())))
    bare, by_wrapper = forces[0], dict(zip(wrapped, forces[1:], strict=True))
    for name, force in by_wrapper.items():
        require(np.all(np.isfinite(force)), f"`{name}` has forces that are not finite: {force}.")
    for name, expected in expected_forces(bare, stroke).items():
        atol = 1e-9 * float(np.max(np.abs(expected)))
        require_equal(by_wrapper[name], expected, f"`{name}` must follow from the law's own force.", atol=atol)


def half_car(front: Laws, rear: Laws) -> HalfCar:
    """A car that is symmetric but for its laws, given by the slot of a corner."""
    ahead, behind = (Corner(40.0, 23.5e3, 190e3, **laws) for laws in (front, rear))
    return HalfCar(580.0, 1100.0, 1.2, 1.2, ahead, behind)


def two_bumps() -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and heights [m] of two short bumps, one under each axle, the rear one later."""
    time = 1e-3 * np.arange(51)
    share = np.clip((time[:, None] - np.array([0.002, 0.012])) / 0.03, 0.0, 1.0)
    return time, 0.01 * (1.0 - np.cos(2 * np.pi * share))


def _ride(front: Laws, rear: Laws, heights: np.ndarray) -> np.ndarray:
    """The metrics of a ride, at a step that steep laws bear."""
    road = roads.from_profile(two_bumps()[0], heights)
    metrics = Ride(half_car(front, rear), road, metrics=list(METRICS), substeps=64)()
    return np.array([float(metrics[name]) for name in METRICS])


def check_alike_ports(*laws: AbstractDamper, rtol: float = 1e-9) -> None:
    """Two of each law with different numbers at the ends of a half car, stacked and computed as one batch.

    If front and rear of car and road are exchanged, the results must be exchanged too: no end may use the parameters of
    the other.

    Arguments:
        laws: up to four laws, which share the car.
        rtol: relative difference of the two rides that is allowed.
    """
    _, heights = two_bumps()
    one: Laws = dict(zip(SLOTS, laws, strict=False))
    free = {slot: free_parameters(law) for slot, law in one.items()}
    other: Laws = {slot: f.build(f.values * 1.02) for slot, f in free.items()}
    there, back, same = _ride(one, other, heights), _ride(other, one, heights[:, ::-1]), _ride(one, one, heights)
    require(np.all(np.isfinite(there)), f"In a half car {METRICS} are {there}.")
    difference = np.abs(there / back[[0, 2, 1]] - 1.0)
    message = f"{METRICS} change by {difference} of themselves when front and rear are exchanged."
    require(np.all(difference <= rtol), f"Several laws of one kind must act as each alone, but {message}")
    effect = abs(there[2] / same[2] - 1.0)
    require(effect > 5 * rtol, f"Numbers 2 % larger at the rear change the rear tyre's load by {effect:.1g} only.")


CHECKS: dict[str, Callable[[AbstractDamper], None]] = {
    "shapes": _declared.check_shapes,
    "refusals": _declared.check_refusals,
    "parameters": _declared.check_parameters,
    "text": _declared.check_text,
    "file": _declared.check_file,
    "finite": _physics.check_finite,
    "traits": _declared.check_traits,
    "rest": _physics.check_rest,
    "continuous": _physics.check_continuous,
    "passive": _physics.check_passive,
    "compiled": _physics.check_compiled,
    "batched": _physics.check_batched,
    "derivatives": _physics.check_derivatives,
    "step": _physics.check_step,
    "prediction": _physics.check_prediction,
    "single precision": _physics.check_single_precision,
    "inside wrappers": check_inside_wrappers,
    "alike ports": check_alike_ports,
}


def check_law(law: AbstractDamper, *, leave_out: Collection[str] = ()) -> None:
    """Check that a law satisfies the contract of damper laws, so that it works everywhere the laws of the library do.

    The checks take ten to thirty seconds, mainly for compiling. Their names are:

    - `"shapes"`, `"refusals"`: one force and as many rates as states; states of another length are refused by name.
    - `"parameters"`, `"text"`, `"file"`: every parameter has a unit, a meaning and a domain that is enforced; the law
      prints, and is the same after writing and reading as JSON.
    - `"traits"`: the declared traits agree with the forces.
    - `"finite"`, `"continuous"`: value, slope and derivatives are finite everywhere, and the force has no jump.
    - `"rest"`, `"passive"`: no force at rest; neither sines nor random motions gain energy from the law.
    - `"compiled"`, `"batched"`, `"single precision"`: the same numbers compiled (to 1e-12, derivatives to 1e-9), in a
      batch, and in single precision.
    - `"derivatives"`: forward mode, reverse mode and differences agree in every parameter.
    - `"step"`, `"prediction"`: the step converges with second order to an independent integration of the rates, and
      the states at rest stay.
    - `"inside wrappers"`, `"alike ports"`: it works in every wrapper, and twice in a half car with different
      parameters.

    Arguments:
        law: the law with realistic parameters: knees between 0.01 and 1 m/s, strokes of about 10 mm.
        leave_out: names of checks that the law cannot satisfy by its nature: `["rest"]` for a gas spring, `["passive"]`
            for an active law.

    Raises:
        AssertionError: what is wrong, in a sentence that begins with the class and the name of the check.
        ValueError: something that is not a law, an unknown name of a check.

    >>> from jaxdamp.dampers import GasSpring
    >>> check_law(GasSpring(2e6, 6e-5, 1e-4), leave_out=set(CHECKS) - {"shapes", "text", "file"})
    """
    check_module("law", law, (AbstractDamper,), "check_law(law)")
    for name in leave_out:
        _checks.one_of("leave_out", name, CHECKS)
    with jax.enable_x64(True):
        law = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf), float), law)
        for name, check in CHECKS.items():
            if name in leave_out:
                continue
            try:
                check(law)
            except AssertionError as error:
                raise AssertionError(f"{type(law).__name__} breaks {name!r}: {error}") from error

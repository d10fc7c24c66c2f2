"""The work all peers share: many cars over one road, each with dampers of its own; the RMS of body acceleration.

Masses, springs and the road are common. Parameters are drawn as a table of shape (cars, parameters), in SI units, whose
columns `names` names. The road is given at instants and straight between them; the RMS is that of the vertical
acceleration of the body at all instants, both ends included.
"""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import roads, simulate
from jaxdamp.dampers import AbstractDamper, Besinger, BoucWen, Lag, SeriesSpring
from jaxdamp.simulation import AbstractEngine, Adaptive
from jaxdamp.vehicles import AbstractVehicle
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000


SPEED = 20.0  # m/s

Parameters = Float[np.ndarray, "cars parameters"]
Heights = Float[np.ndarray, "time wheels"]
Results = Float[np.ndarray, " cars"]
Law = AbstractDamper | tuple[AbstractDamper, ...]


@dataclass(frozen=True)
class Case:
    """Ranges of the parameters by name, and the law or laws they make."""

    ranges: dict[str, tuple[float, float]]
    law: Callable[..., Law]


_BESINGER = {
    "compression_rate": (1e3, 2e3),
    "rebound_rate": (2e3, 4e3),
    "blow_off_rate": (500.0, 1e3),
    "limit_velocity": (0.1, 0.3),
    "transition_velocity": (0.3, 0.9),
}
_BOUC_WEN = {
    "viscous_rate": (1e3, 2e3),
    "stiffness": (1e3, 5e3),
    "yield_force": (150.0, 400.0),
    "yield_displacement": (0.5e-3, 2e-3),
    "shape": (0.55, 0.95),
    "exponent": (1.5, 3.0),
}

CASES = {
    "besinger": Case(_BESINGER, Besinger),
    "lag": Case(_BESINGER | {"lag_time": (2e-3, 8e-3)}, lambda *p: Lag(Besinger(*p[:5]), p[5])),
    "series_spring": Case(
        _BESINGER | {"stiffness": (1e6, 3e6), "cubic_stiffness": (0.5e8, 1.5e8)},
        lambda *p: SeriesSpring(Besinger(*p[:5]), p[5], p[6]),
    ),
    "bouc_wen": Case(_BOUC_WEN, BoucWen),
    "half_car": Case(
        {f"{end}_{name}": span for end in ("front", "rear") for name, span in _BESINGER.items()},
        lambda *p: (Besinger(*p[:5]), Besinger(*p[5:])),
    ),
}


def names(case: str) -> list[str]:
    """The columns of a table of parameters."""
    return list(CASES[case].ranges)


def draw(case: str, cars: int, seed: int = 0) -> Parameters:
    """Parameters of so many cars, uniform over their ranges."""
    low, high = np.array(list(CASES[case].ranges.values())).T
    return np.random.default_rng(seed).uniform(low, high, (cars, low.size))


def law(case: str, parameters: Float[np.ndarray, "*cars parameters"] | Array) -> Law:
    """The law of one row, or of a table with leaves of shape (cars,); front and rear laws for the half car."""
    numbers = jnp.asarray(parameters)

    def build(row: Array) -> Law:
        return CASES[case].law(*row)

    return build(numbers) if numbers.ndim == 1 else eqx.filter_vmap(build)(numbers)


def vehicle(law: Law | None, case: str) -> AbstractVehicle:
    """The car of a case with a law, or with the preset's own dampers."""
    if case != "half_car":
        assert law is None or isinstance(law, AbstractDamper)
        return quarter_car_000(law)
    car = half_car_002()
    return car if law is None else eqx.tree_at(lambda car: (car.front.damper, car.rear.damper), car, law)


def heights(case: str, duration: float = 10.0, dt: float = 1e-3, seed: int = 0) -> Heights:
    """A road of class C at 20 m/s at the instants [m]; the rear wheel of the half car follows the front one."""
    road = roads.iso8608("C", speed=SPEED, seed=seed)
    if case == "half_car":
        road = roads.delayed(road, positions=vehicle(None, case).axle_positions, speed=SPEED)
    return np.asarray(road.height(jnp.arange(round(duration / dt) + 1.0) * dt))


def refined(heights: Heights, factor: int) -> Heights:
    """The same road, straight between the old instants, at `factor` times as many."""
    instants = np.arange(heights.shape[0])
    between = np.linspace(0, instants[-1], instants[-1] * factor + 1)
    return np.stack([np.interp(between, instants, track) for track in heights.T], axis=1)


def simulated(
    case: str, parameters: Parameters, heights: Heights, dt: float, engine: AbstractEngine | None = None
) -> Results:
    """The RMS by `jaxdamp.simulate`, one car after the other."""
    road = roads.from_profile(np.arange(heights.shape[0]) * dt, heights)
    duration = (heights.shape[0] - 1) * dt
    found = []
    for row in parameters:
        car = vehicle(law(case, row), case)
        response = simulate(car, road, duration=duration, dt=dt, engine=engine)
        found.append(np.sqrt(np.mean(np.square(response["sprung_acceleration"]))))
    return np.array(found)


def reference(case: str, parameters: Parameters, heights: Heights, dt: float) -> Results:
    """The RMS to about eight digits, by adaptive integration from instant to instant; for a few cars."""
    return simulated(case, parameters, heights, dt, Adaptive(rtol=1e-10, atol=1e-12))


def errors(found: Results, exact: Results) -> Results:
    """Relative errors."""
    return np.abs(found / exact - 1.0)


def in_double_precision() -> None:
    """All peers compute in double precision; call it before anything else of JAX."""
    jax.config.update("jax_enable_x64", True)

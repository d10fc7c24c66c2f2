"""Every law keeps the contract; laws that are broken on purpose do not."""

import inspect
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers
from jaxdamp.dampers import (
    AbstractDamper,
    AbstractMemoryless,
    Besinger,
    Bilinear,
    CoulombFriction,
    Lag,
    Linear,
    MotionRatio,
    PiecewiseLinear,
    Polynomial,
    PowerLaw,
    SegmentedPolynomial,
    SeriesSpring,
    Table,
)
from jaxdamp.parameters import parameter, positive

from . import contract


def degressive(knee_width=1e-3, offset=0.0):
    return PowerLaw(1800.0, 0.4, 900.0, 0.5, offset, 0.7 * offset, knee_width=knee_width)


def slopes(knee_width=0.0):
    return PiecewiseLinear([-0.35, -0.08, 0.06, 0.3], [700.0, 1100.0, 2300.0, 3600.0, 1500.0], knee_width)


def segmented():
    v = np.linspace(-1.2, 1.1, 400)
    return SegmentedPolynomial.guess(v, 1500.0 * np.tanh(3.0 * v) + np.where(v > 0, 1400.0, 500.0) * v)


LAWS = {
    "linear": lambda: Linear(2500.0),
    "bilinear, sharp": lambda: Bilinear(2600.0, 1200.0),
    "bilinear, rounded": lambda: Bilinear(2600.0, 1200.0, knee_width=0.02),
    "slopes, sharp": slopes,
    "slopes, rounded": lambda: slopes(0.02),
    "slopes, no knot": lambda: PiecewiseLinear([], [1500.0]),
    "slopes, falling": lambda: PiecewiseLinear([-0.2, 0.2], [900.0, 2500.0, -300.0], monotone=False),
    "power 0.4, offsets": lambda: degressive(offset=30.0),
    "power 0.65": lambda: PowerLaw(2600.0, 0.65, 1550.0, 0.65),
    "power 1": lambda: PowerLaw(2500.0, 1.0, 1300.0, 1.0),
    "power 1.8": lambda: PowerLaw(3000.0, 1.8, 2500.0, 1.8, 50.0, 20.0),
    "polynomial": lambda: Polynomial([2500.0, 300.0, -400.0, 50.0, 80.0], (-1.5, 1.2)),
    "segmented polynomial": segmented,
    "table": lambda: Table(
        [-1.1, -0.4, -0.1, 0.0, 0.05, 0.3, 1.0], [-1400.0, -800.0, -450.0, 0.0, 300.0, 1500.0, 2900.0]
    ),
    "table of two": lambda: Table([-1.0, 1.0], [-1500.0, 1500.0]),
    "Besinger, published": lambda: Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.7),
    "Besinger, narrow": lambda: Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.07),
    "Besinger, car": lambda: Besinger(900.0, 2800.0, 700.0, 0.25, 0.05),
    "friction": lambda: CoulombFriction(40.0, 0.004),
    "series spring, stiff": lambda: SeriesSpring(Linear(15_000.0), 1.5e7),
    "series spring, soft cubic": lambda: SeriesSpring(Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.7), 1.5e5, 1.2e8),
    "series spring, power": lambda: SeriesSpring(degressive(knee_width=0.01), 8e5),
    "series spring, sum": lambda: SeriesSpring(slopes(0.02) + CoulombFriction(40.0, 0.02), 5e5),
    "lag": lambda: Lag(Linear(2500.0), 0.004),
    "lag, slopes": lambda: Lag(slopes(), 0.003),
    "lag, power": lambda: Lag(degressive(knee_width=0.01), 0.002),
    "lag of friction": lambda: Lag(Linear(2000.0) + CoulombFriction(60.0, 0.01), 0.004),
    "lag of lag": lambda: Lag(Lag(Linear(2000.0), 0.002), 0.004),
    "motion ratio": lambda: MotionRatio(slopes(), 0.7),
    "motion ratio of series spring": lambda: MotionRatio(SeriesSpring(Bilinear(2600.0, 1200.0), 4e5), 0.8),
    "scaled": lambda: 1.3 * Besinger(900.0, 2800.0, 700.0, 0.25, 0.05),
    "sum": lambda: Linear(900.0) + 0.5 * slopes(0.01) + CoulombFriction(30.0, 0.01),
    "sum of lags": lambda: Lag(Linear(900.0), 0.01) + Linear(300.0) + MotionRatio(Lag(slopes(0.02), 0.003), 0.9),
    "series spring of lag": lambda: SeriesSpring(Linear(2000.0) + 0.5 * Lag(Linear(900.0), 0.01), 5e5),
}


def _parts(law):
    yield law
    for value in vars(law).values():
        for part in value if isinstance(value, tuple) else [value]:
            if isinstance(part, AbstractDamper):
                yield from _parts(part)


def test_every_law_is_held_to_the_contract():
    exported = {c for c in vars(dampers).values() if inspect.isclass(c) and issubclass(c, AbstractDamper)}
    assert {c.__name__ for c in exported} <= set(dampers.__all__)
    held = {type(part) for make in LAWS.values() for part in _parts(make())}
    assert {c for c in exported if not inspect.isabstract(c)} <= held


@pytest.mark.parametrize("name", LAWS)
def test_contract(name):
    law = LAWS[name]()
    for check in contract.CHECKS.values():
        check(law)


# ---- laws that break it


class _Jumping(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return self.rate * v + jnp.where(v > 0.0123, 5.0, 0.0)


class _Active(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return -self.rate * v


class _InfiniteSlope(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "size", positive)

    def force_velocity(self, v):
        return self.rate * jnp.sign(v) * jnp.sqrt(jnp.abs(v))


class _Preloaded(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return self.rate * v - 1.0


class _WithoutGradient(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return jax.lax.stop_gradient(self.rate) * v


class _Nameless(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "", positive)

    def force_velocity(self, v):
        return self.rate * v


@final
class _FixedStep(AbstractDamper):
    """A lag whose step takes every dt for a millisecond."""

    rate: jax.Array = parameter("N s/m", "slope", positive)

    def initial_state(self):
        return jnp.zeros(1)

    def force(self, x, v, state):
        return state[0]

    def state_rate(self, x, v, state):
        return (self.rate * v - state) / 0.004

    def advance(self, x0, v0, x1, v1, state, dt):
        return state + 1e-3 * self.state_rate(x1, v1, state)


@pytest.mark.parametrize(
    ("broken", "check"),
    [
        (_Jumping, contract.check_continuous),
        (_Active, contract.check_passive),
        (_InfiniteSlope, contract.check_finite),
        (_Preloaded, contract.check_rest),
        (_WithoutGradient, contract.check_derivatives),
        (_Nameless, contract.check_parameter_table),
        (_FixedStep, contract.check_advance),
    ],
)
def test_broken_law_fails(broken, check):
    with pytest.raises(AssertionError):
        check(broken(1000.0))

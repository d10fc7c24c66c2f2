from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import DigressiveProgressive
from jaxdamp.identify import fit
from jaxdamp.parameters import get


NUMBERS: dict[str, Any] = {
    "rebound_bleed_rate": 8000.0,
    "rebound_blow_off_velocity": 0.1,
    "rebound_blow_off_rate": 900.0,
    "compression_bleed_rate": 5000.0,
    "compression_blow_off_velocity": 0.06,
    "compression_blow_off_rate": 500.0,
    "rebound_progressivity": 300.0,
    "compression_progressivity": 200.0,
}
# v, force by hand: c₀ min(v, v_b) + c₂ (v - v_b) + c₃ v²
POINTS = [
    (0.05, 400.0 + 0.75),
    (0.1, 800.0 + 3.0),
    (0.6, 800.0 + 450.0 + 108.0),
    (-0.03, -150.0 - 0.18),
    (-1.06, -300.0 - 500.0 - 224.72),
    (0.0, 0.0),
]


@pytest.mark.parametrize(("v", "force"), POINTS)
def test_force(v, force):
    np.testing.assert_allclose(DigressiveProgressive(**NUMBERS).force_velocity(v), force, rtol=1e-13)


def test_slopes_beside_the_knees():
    slope = jax.jit(jax.vmap(jax.grad(DigressiveProgressive(**NUMBERS).force_velocity)))
    found = slope(jnp.array([0.1 - 1e-9, 0.1 + 1e-9, -0.06 + 1e-9, -0.06 - 1e-9, 1e-9, -1e-9]))
    np.testing.assert_allclose(found, [8060.0, 960.0, 5024.0, 524.0, 8000.0, 5000.0], rtol=1e-6)


def test_rounded_knee():
    sharp, rounded = (DigressiveProgressive(**NUMBERS, knee_width=w) for w in (0.0, 0.01))
    # at the knee max(u, 0) grows by w ln 2, and loses its value at v = 0, w ln(1 + exp(-10))
    lift = 0.01 * (np.log(2.0) - np.log1p(np.exp(-10.0)))
    np.testing.assert_allclose(rounded.force_velocity(0.1), 803.0 - 7100.0 * lift, rtol=1e-12)
    np.testing.assert_allclose(rounded.force_velocity(0.5), sharp.force_velocity(0.5), rtol=1e-3)
    assert rounded.force_velocity(0.0) == 0.0
    slope = jax.grad(rounded.force_velocity)
    assert abs(slope(0.1 + 1e-7) - slope(0.1 - 1e-7)) < 1.0


def test_guess_and_fit():
    law = DigressiveProgressive(**NUMBERS)
    runs = VirtualDyno(law, force_noise=5.0, seed=2).run(SineTest(0.02, 8.0))
    v, force = (np.concatenate([getattr(run, name) for run in runs]) for name in ("velocity", "force"))
    start = DigressiveProgressive.guess(v, force)
    for name in ("rebound_blow_off_velocity", "compression_blow_off_velocity"):
        np.testing.assert_allclose(getattr(start, name), NUMBERS[name], rtol=0.2)
    result = fit(DigressiveProgressive, runs)
    for name, value in NUMBERS.items():
        np.testing.assert_allclose(get(result.law, name), value, rtol=0.08, err_msg=name)


def test_known_blow_off_velocities_give_a_closed_form():
    runs = VirtualDyno(DigressiveProgressive(**NUMBERS), force_noise=5.0, seed=2).run(SineTest(0.02, 8.0))
    begin: dict[str, Any] = {name: value if name.endswith("velocity") else 1.0 for name, value in NUMBERS.items()}
    result = fit(DigressiveProgressive(**begin), runs, freeze=["*blow_off_velocity"])
    v, force = (np.concatenate([np.asarray(getattr(run, name)) for run in runs]) for name in ("velocity", "force"))
    columns = []
    for side, knee in ((1, 0.1), (-1, 0.06)):
        u = np.maximum(side * v, 0.0)
        columns += [side * np.minimum(u, knee), side * np.maximum(u - knee, 0.0), side * u * u]
    expected = np.linalg.lstsq(np.stack(columns, axis=1), force, rcond=None)[0]
    names = ["bleed_rate", "blow_off_rate", "progressivity"]
    found = [get(result.law, f"{side}_{name}") for side in ("rebound", "compression") for name in names]
    np.testing.assert_allclose(found, expected, rtol=0.02)

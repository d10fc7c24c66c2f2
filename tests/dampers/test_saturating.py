from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Saturating
from jaxdamp.identify import fit
from jaxdamp.parameters import get, replace


NUMBERS: dict[str, Any] = {
    "rebound_force": 900.0,
    "rebound_rate": 9000.0,
    "compression_force": 400.0,
    "compression_rate": 6000.0,
    "rebound_high_rate": 700.0,
    "compression_high_rate": 300.0,
}


# u = c₀ v/F_s is 1 at 0.1 m/s in rebound and -1.5 at -0.1 m/s in compression; tanh, arctan and roots by hand
@pytest.mark.parametrize(
    ("shape", "at_plus", "at_minus"),
    [
        ("tanh", 900 * 0.761594155956 + 70, -400 * 0.905148253645 - 30),
        ("arctan", 900 * 0.639092926772 + 70, -400 * 0.744477692536 - 30),
        ("algebraic", 900 * 0.707106781187 + 70, -400 * 0.832050294338 - 30),
    ],
)
def test_force(shape, at_plus, at_minus):
    law = Saturating(**NUMBERS, shape=shape)
    np.testing.assert_allclose(law.force_velocity(0.1), at_plus, rtol=1e-9)
    np.testing.assert_allclose(law.force_velocity(-0.1), at_minus, rtol=1e-9)
    assert law.force_velocity(0.0) == 0.0


@pytest.mark.parametrize("shape", ["tanh", "arctan", "algebraic"])
def test_slopes_at_rest_and_far_away(shape):
    slope = jax.jit(jax.vmap(jax.grad(Saturating(**NUMBERS, shape=shape).force_velocity)))
    expected = [9700.0, 6300.0, 700.0, 300.0]
    np.testing.assert_allclose(slope(jnp.array([1e-9, -1e-9, 1e3, -1e3])), expected, rtol=1e-4)


def test_equal_slopes_at_rest_make_the_slope_continuous():
    law = Saturating(900.0, 9000.0, 400.0, 9400.0, 700.0, 300.0, shape="algebraic")
    slope = jax.grad(law.force_velocity)
    assert abs(slope(1e-7) - slope(-1e-7)) < 1e-6
    assert abs(slope(0.0) - 9700.0) < 1e-9


@pytest.mark.parametrize("shape", ["tanh", "arctan", "algebraic"])
def test_guess_is_near(shape):
    law = Saturating(**NUMBERS, shape=shape)
    v = np.sin(np.linspace(0.0, 20.0, 4001))
    noise = 10.0 * np.random.default_rng(3).standard_normal(v.size)
    start = Saturating.guess(v, np.asarray(jax.jit(jax.vmap(law.force_velocity))(jnp.asarray(v))) + noise, shape)
    assert start.shape == shape
    for name, value in NUMBERS.items():
        np.testing.assert_allclose(getattr(start, name), value, rtol=0.25)


def test_fit_finds_the_numbers():
    runs = VirtualDyno(Saturating(**NUMBERS), force_noise=5.0, seed=4).run(SineTest(0.02, 6.0))
    result = fit(Saturating, runs)
    for name, value in NUMBERS.items():
        np.testing.assert_allclose(get(result.law, name), value, rtol=0.03)


def test_the_slopes_far_away_alone_have_a_closed_form():
    law = Saturating(**NUMBERS)
    runs = VirtualDyno(law, seed=4).run(SineTest(0.02, 6.0))
    others = [name for name in NUMBERS if not name.endswith("high_rate")]
    result = fit(replace(law, {"*high_rate": 5.0}), runs, freeze=others)
    found = [get(result.law, name) for name in ("rebound_high_rate", "compression_high_rate")]
    np.testing.assert_allclose(found, [700.0, 300.0], rtol=1e-3)


def test_an_unknown_shape_is_refused():
    with pytest.raises(ValueError, match=r"`shape` must be one of .* but is 'tahn'. Did you mean 'tanh'"):
        Saturating(**NUMBERS, shape="tahn")
    with pytest.raises(ValueError, match="`shape` must be one of"):
        Saturating.guess(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9), "step")

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import class_limits, road_class
from jaxdamp.roads.assessment import ROUGHNESS_PSD, displacement_psd


def test_limits_of_the_standard():
    # G_d(n0) in 1e-6 m^3: A below 32, B 32-128, C 128-512, D 512-2048, E to 8192, F to 32768, G to 131072, H above
    limits = [32, 128, 512, 2048, 8192, 32768, 131072]
    for letter, low, high in zip("ABCDEFGH", [0, *limits], [*limits, np.inf], strict=True):
        assert class_limits(letter) == pytest.approx((1e-6 * low, 1e-6 * high), rel=1e-14)
        if 0 < low and high < np.inf:
            assert ROUGHNESS_PSD[letter] == pytest.approx(1e-6 * np.sqrt(low * high), rel=1e-14)


def test_class_of_a_roughness():
    for letter, mean in ROUGHNESS_PSD.items():
        assert road_class(mean) == letter
        low, high = class_limits(letter)
        assert road_class(max(1.0001 * low, 1e-9)) == letter
        assert road_class(min(0.9999 * high, 5.0)) == letter
    assert road_class(32e-6) == "B"


def test_the_table_over_radians_is_another_reference():
    # 1e-6 m^3 at 1 rad/m for class A: 16e-6 at 0.1 cycle/m = 0.628 rad/m, and per rad/m instead of per cycle/m
    at_one = displacement_psd(jnp.array([1 / (2 * np.pi)]), jnp.array(16e-6), jnp.array(2.0)) / (2 * np.pi)
    assert float(at_one[0]) == pytest.approx(1e-6, rel=0.01)


def test_errors():
    with pytest.raises(ValueError, match=r"`road_class` must be one of.*'I'"):
        class_limits("I")
    with pytest.raises(ValueError, match=r"`roughness_psd` must be positive and finite, but is 0.0"):
        road_class(0.0)

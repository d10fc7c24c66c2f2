import numpy as np
import pytest

from jaxdamp import roads


def test_is_half_the_one_sided_velocity_spectrum_of_the_class():
    # G_v(n) = (2 pi n)^2 G_d(n) is constant for waviness 2; in frequency G_v V, of which the two-sided density is half
    spatial_frequency = 0.37
    displacement = 256e-6 * (spatial_frequency / 0.1) ** -2
    one_sided = (2 * np.pi * spatial_frequency) ** 2 * displacement * 20.0
    assert float(roads.white("C", speed=20.0).velocity_psd) == pytest.approx(one_sided / 2, rel=1e-12)
    assert float(roads.white("C", speed=20.0).one_sided_velocity_psd) == pytest.approx(one_sided, rel=1e-12)
    assert float(roads.white(256e-6, speed=20.0).velocity_psd) == pytest.approx(one_sided / 2, rel=1e-12)


def test_refuses_what_is_no_road():
    with pytest.raises(ValueError, match=r"`speed` must be positive.*-3"):
        roads.white("C", speed=-3.0)
    with pytest.raises(ValueError, match=r"`road_class` must be one of.*'J'"):
        roads.white("J", speed=20.0)

import numpy as np

from jaxdamp.dampers import Bilinear


def test_error_of_the_rounding_is_bounded():
    sharp, rounded = Bilinear(2600.0, 1200.0), Bilinear(2600.0, 1200.0, knee_width=0.04)
    errors = [float(rounded.force_velocity(v) - sharp.force_velocity(v)) for v in np.linspace(-5.0, 5.0, 101)]
    bound = 1400.0 * 0.04 / 2
    assert np.max(np.abs(errors)) <= bound
    np.testing.assert_allclose(errors[0], -bound, rtol=0.01)


def test_sides():
    law = Bilinear(2600.0, 1200.0)
    np.testing.assert_allclose([law.force_velocity(v) for v in (0.3, -0.3)], [780.0, -360.0], rtol=1e-14)


def test_guess():
    v = np.linspace(-1.0, 1.0, 101)
    law = Bilinear.guess(v, np.where(v > 0, 2600.0, 1200.0) * v)
    np.testing.assert_allclose([law.rebound_rate, law.compression_rate], [2600.0, 1200.0], rtol=1e-12)

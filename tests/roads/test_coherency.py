import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, special

from jaxdamp.roads import coherency


@pytest.mark.parametrize("waviness", [1.5, 2.0, 2.5, 3.0])
@pytest.mark.parametrize("n", [0.02, 0.1, 0.4, 1.0])
def test_equals_direct_quadrature_of_an_isotropic_surface(n, waviness):
    # a surface spectrum |k|^-(w+1) seen along a line is the power law n^-w; the cross spectrum of two lines at a
    # distance B along y is its Fourier integral over the lateral frequency m
    track = 1.6

    def density(m):
        return (n**2 + m**2) ** (-0.5 * (waviness + 1.0))

    along, _ = integrate.quad(density, 0.0, np.inf, epsrel=1e-12)
    across, _ = integrate.quad(
        density, 0.0, np.inf, weight="cos", wvar=2 * np.pi * track, epsabs=1e-11 * along, limlst=500
    )
    gamma = float(coherency(jnp.array([n]), track, waviness)[0])
    assert gamma == pytest.approx(across / along, abs=1e-8)


@pytest.mark.parametrize("waviness", [1.0, 2.0, 2.7])
def test_equals_the_bessel_function_of_scipy(waviness):
    n = np.geomspace(1e-5, 10.0, 200)
    x = 2 * np.pi * 1.5 * n
    expected = 2 * (x / 2) ** (waviness / 2) * special.kv(waviness / 2, x) / special.gamma(waviness / 2)
    np.testing.assert_allclose(coherency(n, 1.5, waviness), expected, rtol=1e-12)


def test_frequencies_of_any_shape():
    x = 2 * np.pi * 0.1 * 1.5
    alone = coherency(0.1, 1.5)
    assert alone.shape == () and float(alone) == pytest.approx(x * special.kv(1, x), rel=1e-12)
    table = np.array([[0.01, 0.1, 1.0], [0.02, 0.2, 2.0]])
    np.testing.assert_array_equal(coherency(table, 1.5), coherency(table.ravel(), 1.5).reshape(2, 3))


def test_long_waves_are_alike_short_ones_are_not():
    gamma = coherency(jnp.array([1e-9, 1e-3, 0.1, 10.0]), 1.5)
    assert np.all(np.diff(gamma) < 0) and np.all(gamma <= 1.0)
    assert float(gamma[0]) == pytest.approx(1.0, abs=1e-7) and float(gamma[-1]) < 1e-30


@pytest.mark.parametrize("argument", [0, 1, 2])
def test_gradients_equal_differences(argument, check_gradient):
    given = [0.13, 1.5, 2.2]

    def gamma(value):
        n, track, waviness = (value if i == argument else given[i] for i in range(3))
        return coherency(jnp.reshape(jnp.asarray(n, float), (1,)), track, waviness)[0]

    check_gradient(gamma, given[argument])


def test_errors():
    n = jnp.array([0.1])
    for arguments, message in (
        ((n, 0.0), r"`track_width` must be positive and finite, but is 0.0"),
        ((-n, 1.5), r"`spatial_frequency` must be positive"),
        ((n, 1.5, 0.0), r"`waviness` must be positive and finite, but is 0.0.*standard uses 2"),
    ):
        with pytest.raises(ValueError, match=message):
            coherency(*arguments)

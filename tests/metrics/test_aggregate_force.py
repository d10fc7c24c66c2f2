import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import aggregate_force, aggregate_force_percentile


TIME = np.arange(2000) * 0.01


def test_a_place_is_passed_by_all_axles():
    # the load of each axle is a function of the place alone: the sum is known without any interpolation
    delays = np.array([0.0, 0.25, 0.372])
    place = TIME[None, :] - delays[:, None]
    loads = np.array([[30.0], [40.0], [50.0]]) + 5.0 * np.sin(2.0 * place) * np.array([[1.0], [-2.0], [0.5]])
    result = aggregate_force(loads, delays, 0.01)
    assert result.shape == (2000 - 38,)
    s = np.sin(2.0 * TIME[: 2000 - 38])
    expected = (30 + 5 * s) ** 4 + (40 - 10 * s) ** 4 + (50 + 2.5 * s) ** 4
    # the third axle passes between samples 0.01 s apart, joined by straight lines: 2.5 (2 * 0.01)^2/8 of some 50
    np.testing.assert_allclose(result, expected, rtol=4 * 1.3e-4 / 50)
    np.testing.assert_allclose(aggregate_force(loads, delays, 0.01, 1), 120 - 2.5 * s, atol=1.3e-4)


def test_whole_delays_are_exact_whatever_the_rounding():
    loads = np.arange(1.0, 41.0).reshape(2, 20)
    result = aggregate_force(loads, [0.0, 0.3], 0.1, 1)  # 0.3/0.1 is not quite 3
    np.testing.assert_array_equal(result, loads[0, :17] + loads[1, 3:])


def test_a_lifted_tyre_does_not_wear():
    result = aggregate_force(np.array([[2.0, -3.0, 1.0]]), [0.0], 0.1)
    np.testing.assert_array_equal(result, [16.0, 0.0, 1.0])
    gradient = jax.jit(jax.grad(lambda loads: jnp.sum(aggregate_force(loads, [0.0], 0.1))))(
        jnp.array([[2.0, -3.0, 0.0]])
    )
    np.testing.assert_array_equal(gradient, [[32.0, 0.0, 0.0]])


def test_percentile(rng):
    places = 5.0 + 2.0 * rng.standard_normal(100_000)
    assert float(aggregate_force_percentile(places)) == pytest.approx(np.percentile(places, 95), rel=1e-12)
    assert float(aggregate_force_percentile(places, gaussian=True)) == pytest.approx(5.0 + 1.644854 * 2.0, rel=0.01)
    assert float(aggregate_force_percentile(places, 50.0, gaussian=True)) == pytest.approx(places.mean(), rel=1e-12)


def test_spatial_repeatability_shows():
    # two axles whose load peaks at the same places wear them more than two that alternate
    wave = 0.3 * np.sin(2 * np.pi * TIME)
    same = np.stack([1.0 + wave, 1.0 + 0.3 * np.sin(2 * np.pi * (TIME - 0.5))])
    opposed = np.stack([1.0 + wave, 1.0 - 0.3 * np.sin(2 * np.pi * (TIME - 0.5))])
    worst = [float(aggregate_force_percentile(aggregate_force(loads, [0.0, 0.5], 0.01))) for loads in (same, opposed)]
    # the wear of both together, averaged over the places, is the same
    assert worst[0] > 1.5 * worst[1]


def test_compiles_and_has_gradients(rng):
    loads = jnp.asarray(3.0 + rng.random((2, 60)))
    direction = jnp.asarray(rng.standard_normal((2, 60)))

    def metric(loads):
        places = aggregate_force(loads, [0.0, 0.125], 0.01)
        return aggregate_force_percentile(places) + aggregate_force_percentile(places, gaussian=True)

    slope = jnp.sum(jax.jit(jax.grad(metric))(loads) * direction)
    difference = (metric(loads + 1e-6 * direction) - metric(loads - 1e-6 * direction)) / 2e-6
    assert float(slope) == pytest.approx(float(difference), rel=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"delays": [0.0]}, r"`delays` must hold one value per axle \(2\), but is of shape \(1,\)"),
        ({"delays": [0.0, -0.1]}, r"`delays` must be finite and not negative.*the axle that comes first"),
        ({"delays": [0.0, 2.0]}, r"`delays` must end before the record does \(0.9 s\)"),
        ({"dt": -0.1}, r"`dt` must be positive and finite"),
        ({"exponent": 0.5}, r"`exponent` must be at least 1, but is 0.5"),
        ({"tyre_loads": np.ones(9)}, r"`tyre_loads` must have the axes axle and time, but is of shape \(9,\)"),
    ],
)
def test_errors(change, message, unchecked):
    with pytest.raises(ValueError, match=message):
        aggregate_force(**{"tyre_loads": np.ones((2, 9)), "delays": [0.0, 0.1], "dt": 0.1, **change})


def test_errors_of_the_percentile():
    for level in (0.0, 100.0, 950.0):
        with pytest.raises(ValueError, match=r"`percentile` must lie between 0 and 100"):
            aggregate_force_percentile(np.ones(9), level)
    with pytest.raises(ValueError, match=r"`delays` must be known, with `dt`.*but is traced"):
        jax.jit(lambda d: aggregate_force(jnp.ones((2, 9)), d, 0.1))(jnp.array([0.0, 0.1]))

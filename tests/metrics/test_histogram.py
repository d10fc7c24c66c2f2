import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import dissipated_power, dissipation_histogram, velocity_histogram


EDGES = np.array([-np.inf, -0.3, -0.1, 0.0, 0.1, 0.3, np.inf])


@pytest.fixture
def motion(rng):
    velocity = 0.2 * rng.standard_normal(5000)
    return 1500.0 * velocity + 200.0 * np.tanh(velocity / 0.02), velocity


def test_counts_equal_numpy(motion):
    force, velocity = motion
    finite = np.linspace(-0.5, 0.5, 12)
    np.testing.assert_allclose(
        velocity_histogram(velocity, finite), np.histogram(velocity, finite)[0] / 5000, rtol=1e-12
    )
    energy = np.histogram(velocity, finite, weights=force * velocity)[0] / np.sum(force * velocity)
    np.testing.assert_allclose(dissipation_histogram(force, velocity, finite), energy, rtol=1e-10)


def test_an_edge_belongs_to_the_range_above():
    np.testing.assert_array_equal(velocity_histogram(np.array([0.0, 0.1, 0.3, 0.3]), [0.0, 0.1, 0.3]), [0.25, 0.25])


@pytest.mark.parametrize("width", [0.0, 0.01, 0.1])
def test_shares_add_up(motion, width):
    force, velocity = motion
    assert float(jnp.sum(velocity_histogram(velocity, EDGES, width=width))) == pytest.approx(1.0, rel=1e-12)
    shares = dissipation_histogram(force, velocity, EDGES, width=width)
    assert float(jnp.sum(shares)) == pytest.approx(1.0, rel=1e-12)
    assert np.all(shares > 0)


def test_sine_of_a_linear_damper():
    # the share of the energy below v = V sin(a): (2 a - sin 2 a)/pi
    velocity = 0.4 * np.sin(2 * np.pi * (np.arange(100_000) + 0.5) / 100_000)
    angle = np.arcsin(0.1 / 0.4)
    shares = dissipation_histogram(1500.0 * velocity, velocity, [-np.inf, -0.1, 0.1, np.inf])
    assert float(shares[1]) == pytest.approx((2 * angle - np.sin(2 * angle)) / np.pi, rel=1e-3)
    assert float(shares[0]) == pytest.approx(float(shares[2]), rel=1e-9)
    assert float(velocity_histogram(velocity, [-0.1, 0.1])[0]) == pytest.approx(2 * angle / np.pi, rel=1e-3)


def test_smooth_shares_come_near_to_counts(motion):
    _, velocity = motion
    counted, smooth = velocity_histogram(velocity, EDGES), velocity_histogram(velocity, EDGES, width=0.005)
    np.testing.assert_allclose(smooth, counted, atol=0.005)
    assert not np.allclose(smooth, counted, atol=1e-6)


def test_gradients(motion):
    force, velocity = (jnp.asarray(part[:200]) for part in motion)
    direction = jnp.cos(jnp.arange(200.0))
    hard = jax.jit(jax.grad(lambda v: velocity_histogram(v, EDGES)[3]))(velocity)
    np.testing.assert_array_equal(hard, np.zeros(200))

    def share(v):
        return dissipation_histogram(force, v, EDGES, width=0.02)[4] + velocity_histogram(v, EDGES, width=0.02)[4]

    slope = jax.jit(jax.grad(share))(velocity) @ direction
    difference = (share(velocity + 1e-6 * direction) - share(velocity - 1e-6 * direction)) / 2e-6
    assert float(slope) == pytest.approx(float(difference), rel=1e-6)


def test_share_of_the_power(motion):
    force, velocity = motion
    fast = float(dissipation_histogram(force, velocity, [0.3, np.inf])[0])
    expected = np.mean(np.where(velocity >= 0.3, force * velocity, 0.0)) / float(dissipated_power(force, velocity))
    assert fast == pytest.approx(expected, rel=1e-3)  # the trapezoidal rule halves the two ends


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        (np.array([0.0]), r"`edges` must hold two or more velocities, but is of shape \(1,\)"),
        (np.array([0.0, 0.2, 0.1]), r"`edges` must increase, but is \[0.  0.2 0.1\]. Sort them"),
        (np.array([0.0, np.nan, 0.1]), r"`edges` must increase"),
    ],
)
def test_errors_of_edges(edges, message):
    with pytest.raises(ValueError, match=message):
        velocity_histogram(np.ones(9), edges)


def test_errors(unchecked):
    with pytest.raises(ValueError, match=r"`width` must be finite and not negative, but is -0.1"):
        velocity_histogram(np.ones(9), EDGES, width=-0.1)
    with pytest.raises(ValueError, match=r"`velocity` must be as long as `force`"):
        dissipation_histogram(np.ones(9), np.ones(8), EDGES)

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import from_profile


POSITION = 0.05 * np.arange(400)


@pytest.fixture
def heights(rng):
    return 0.01 * rng.standard_normal(400)


def test_over_time_equals_numpy_interpolation(heights, rng):
    time = np.sort(rng.uniform(0.0, POSITION[-1], 1000))
    road = from_profile(POSITION, heights)
    np.testing.assert_allclose(road.height(time)[:, 0], np.interp(time, POSITION, heights), atol=1e-14)


def test_over_distance_equals_numpy_interpolation(heights):
    time = np.linspace(0.0, POSITION[-1] / 7.0, 777)
    road = from_profile(POSITION, heights, speed=7.0)
    np.testing.assert_allclose(road.height(time)[:, 0], np.interp(7.0 * time, POSITION, heights), atol=1e-14)


def test_samples_are_returned_at_their_own_times(heights):
    for dt in (0.001, 0.1, 1.0 / 3.0):
        road = from_profile(dt * np.arange(400), heights)
        np.testing.assert_allclose(road.height(dt * np.arange(400))[:, 0], heights, atol=1e-14)


def test_first_sample_is_at_time_zero(heights):
    shifted = from_profile(1200.0 + POSITION, heights, speed=7.0)
    time = np.linspace(0.0, 2.0, 300)
    np.testing.assert_allclose(
        shifted.height(time), from_profile(POSITION, heights, speed=7.0).height(time), atol=1e-11
    )


def test_heights_above_sea_level_are_told_of_in_single_precision(heights):
    from_profile(POSITION, 250.0 + heights)
    with jax.enable_x64(False):
        from_profile(POSITION, 5.0 + heights)
        with pytest.warns(UserWarning, match=r"`height` reaches 250 m, .* rounds to 30 µm.* Subtract the height"):
            from_profile(POSITION, 250.0 + heights)


def test_tracks_are_columns(heights):
    road = from_profile(POSITION, np.column_stack([heights, -2.0 * heights]))
    height = road.height(POSITION)
    assert height.shape == (400, 2)
    np.testing.assert_allclose(height[:, 1], -2.0 * height[:, 0], atol=1e-15)


def test_periodic_profile_repeats_and_closes_the_gap(heights):
    road = from_profile(POSITION, heights, periodic=True)
    assert road.duration == pytest.approx(20.0)
    time = np.linspace(0.0, 19.99, 600)
    np.testing.assert_allclose(road.height(time + 60.0), road.height(time), atol=1e-12)
    np.testing.assert_allclose(road.height(time - 20.0), road.height(time), atol=1e-12)
    half_way = road.height(np.array([POSITION[-1] + 0.025]))[0, 0]
    assert half_way == pytest.approx(0.5 * (heights[-1] + heights[0]), abs=1e-14)


def test_ramp_fades_in(heights):
    plain, faded = from_profile(POSITION, heights), from_profile(POSITION, heights, ramp=2.0)
    time = np.array([0.0, 1.0, 2.0, 3.0])
    expected = np.array([0.0, 0.5, 1.0, 1.0]) * np.asarray(plain.height(time)[:, 0])
    np.testing.assert_allclose(faded.height(time)[:, 0], expected, atol=1e-15)


def test_grid_and_duration(heights):
    assert from_profile(POSITION, heights).grid == pytest.approx(0.05)
    road = from_profile(POSITION, heights, speed=10.0)
    assert road.grid == pytest.approx(0.005)
    assert road.duration == pytest.approx(1.995)


def test_grid_and_duration_are_unknown_where_speed_is_traced(heights):
    seen = []

    def height(speed):
        road = from_profile(POSITION, heights, speed=speed)
        seen.append((road.grid, road.duration))
        return road.height(jnp.array([0.5]))[0, 0]

    jax.grad(height)(10.0)
    assert seen == [(None, None)]


def test_gradient_in_speed_is_slope_times_time(heights):
    t = 1.234
    gradient = jax.jit(jax.grad(lambda v: from_profile(POSITION, heights, speed=v).height(jnp.array([t]))[0, 0]))(7.0)
    left = int(t * 7.0 / 0.05)
    assert gradient == pytest.approx((heights[left + 1] - heights[left]) / 0.05 * t, rel=1e-9)


def test_gradient_in_heights_is_the_interpolation_weight(heights):
    weights = jax.jit(jax.grad(lambda h: from_profile(POSITION, h).height(jnp.array([0.0625]))[0, 0]))(
        jnp.asarray(heights)
    )
    expected = np.zeros(400)
    expected[1:3] = 0.75, 0.25
    np.testing.assert_allclose(weights, expected, atol=1e-12)


@pytest.mark.parametrize(("time", "span"), [([0.0, 20.0], "from 0 to 20 s"), ([-0.1, 1.0], "from -0.1 to 1 s")])
def test_times_beyond_the_record_are_refused(heights, time, span):
    with pytest.raises(
        ValueError, match=rf"`time` must stay within this road.*from 0 to 19.95 s, but is {span}.*shorter"
    ):
        from_profile(POSITION, heights).height(np.array(time))


def test_rounding_at_the_end_is_not_refused(heights):
    height = from_profile(POSITION, heights).height(np.array([-1e-12, POSITION[-1] + 1e-9]))
    np.testing.assert_allclose(height[:, 0], heights[[0, -1]], atol=1e-8)


def test_rounding_at_the_end_of_a_long_record_is_not_refused_in_single_precision(heights):
    with jax.enable_x64(False):
        road = from_profile(0.01 * np.arange(40_000), np.tile(heights, 100))
        end = np.nextafter(np.float32(399.99), np.float32(400.0))
        for height in (road.height, jax.jit(road.height)):
            np.testing.assert_allclose(height(np.array([end]))[0, 0], heights[-1], rtol=0.05)
        with pytest.raises(ValueError, match="`time` must stay within this road"):
            road.height(np.array([400.0]))


def test_traced_times_beyond_the_record_give_nan_and_only_they(heights):
    road = from_profile(POSITION, heights)
    height = eqx.filter_jit(road.height)(jnp.array([-1.0, 5.0, 19.95, 21.0]))[:, 0]
    np.testing.assert_array_equal(np.isnan(height), [True, False, False, True])


BAD = np.where(np.arange(400) >= 17, np.nan, 0.0)


@pytest.mark.parametrize(
    ("position", "height", "options", "message"),
    [
        (
            POSITION,
            BAD,
            {},
            r"`height` must be finite, but is NaN or infinite at 383 samples, first at sample 17.*fill",
        ),
        (BAD, POSITION, {}, r"`position` must be finite.*first at sample 17.*Cut or fill the gaps"),
        (POSITION[::-1], POSITION, {}, r"`position` must increase.*19.95 followed by 19.9 at sample 1.*Sort"),
        (
            np.repeat(POSITION[:200], 2),
            POSITION,
            {},
            r"`position` must increase.*0 followed by 0 at sample 1.*repeated",
        ),
        (POSITION**1.1, POSITION, {}, r"`position` must increase in equal steps, but is stepped by 0.037.*Resample"),
        (POSITION, POSITION[:-1], {}, r"`height` must hold one value per position \(400\), but is of shape \(399,\)"),
        (POSITION, 1.0, {}, r"`height` must hold one value per position \(400\), but is of shape \(\)"),
        (POSITION, np.zeros((400, 2, 2)), {}, r"`height` must hold one value per.*\(400, 2, 2\).*\[samples, wheels\]"),
        (POSITION[:1], POSITION[:1], {}, r"`position` must hold at least two samples in a row, but is of shape \(1,\)"),
        (POSITION.reshape(200, 2), POSITION, {}, r"`position` must .* in a row, but is of shape \(200, 2\)"),
        (
            POSITION,
            POSITION,
            {"speed": -20.0},
            r"`speed` must be positive and finite, but is -20.0.*reverse the arrays",
        ),
        (POSITION, POSITION, {"ramp": -1.0}, r"`ramp` must be finite and not negative, but is -1.0.*Use 0"),
    ],
)
def test_errors(position, height, options, message, unchecked):
    with pytest.raises(ValueError, match=message):
        from_profile(position, height, **options)

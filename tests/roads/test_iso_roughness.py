import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal, stats

from jaxdamp.roads import iso8608, iso8608_filtered, two_track


CLASS_C, N0, LOW, HIGH = 256e-6, 0.1, 0.011, 2.83
VARIANCE = CLASS_C * N0**2 * (1 / LOW - 1 / HIGH)  # integral of G_d(n0) (n/n0)^-2


@pytest.mark.parametrize("length", [1000.0, pytest.param(12_000.0, marks=pytest.mark.slow)])
def test_equals_the_plain_sum_of_cosines(length):
    # few times are summed, many interpolated after a Fourier transform
    road = iso8608("C", 20.0, seed=4, ramp=0.0, length=length)
    time = np.linspace(-3.0, 1.2 * length / 20.0, 300)
    angle = 2 * np.pi * np.asarray(road.spatial_frequency)[None] * 20.0 * time[:, None] + np.asarray(road.phase)[None]
    plain = np.cos(angle) @ np.asarray(road.amplitude)
    for some in (slice(50), slice(None)):
        np.testing.assert_allclose(road.height(time[some])[:, 0], plain[some], atol=1e-10 * plain.std())


@pytest.mark.parametrize("size", [1, 1024, 1025, 4097])
def test_any_number_of_samples(size):
    road = iso8608("C", 20.0, seed=4)
    time = 0.001 * np.arange(size)
    np.testing.assert_allclose(road.height(time)[-1], road.height(time[-1:])[0], atol=1e-13)
    assert road.height(time).shape == (size, 1)


def test_every_line_has_the_density_of_the_class():
    # one full period, twice as dense as the shortest wave needs: the discrete spectrum is that of the cosines
    length, speed, samples = 1000.0, 20.0, 6000
    road = iso8608("C", speed, seed=2, length=length, ramp=0.0, amplitudes="fixed")
    z = np.asarray(road.height(length / speed * np.arange(samples) / samples)[:, 0])
    density = 2 * np.abs(np.fft.rfft(z) / samples) ** 2 * length
    n = np.arange(density.size) / length
    whole = (n > LOW + 1 / length) & (n < HIGH - 1 / length)
    np.testing.assert_allclose(density[whole], CLASS_C * (n[whole] / N0) ** -2, rtol=0.006)  # curvature across a line
    np.testing.assert_allclose(density[whole][50:], CLASS_C * (n[whole][50:] / N0) ** -2, rtol=2e-4)
    assert density[(n < LOW - 1 / length) | (n > HIGH + 1 / length)].max() < 1e-20


@pytest.mark.parametrize(
    ("letter", "psd"), [("A", 16e-6), ("B", 64e-6), ("C", 256e-6), ("D", 1024e-6), ("H", 0.262144)]
)
def test_variance_is_the_integral_of_the_density(letter, psd):
    road = iso8608(letter, 20.0, seed=0, ramp=0.0, amplitudes="fixed")
    assert float(jnp.sum(road.amplitude**2) / 2) == pytest.approx(psd * VARIANCE / CLASS_C, rel=1e-6)
    time = 50.0 * np.arange(8192) / 8192
    z = road.height(time)
    assert float(jnp.mean(z**2)) == pytest.approx(psd * VARIANCE / CLASS_C, rel=1e-6)


@pytest.mark.parametrize("waviness", [1.0, 1.5, 2.5])
def test_variance_for_other_waviness(waviness):
    def integral(n):
        return np.log(n) if waviness == 1.0 else n ** (1 - waviness) / (1 - waviness)

    road = iso8608(CLASS_C, 20.0, seed=0, waviness=waviness, amplitudes="fixed")
    expected = CLASS_C * N0**waviness * (integral(HIGH) - integral(LOW))
    assert float(jnp.sum(road.amplitude**2) / 2) == pytest.approx(expected, rel=2e-6)  # Simpson's rule


@pytest.mark.parametrize("speed", [10.0, 30.0])
def test_welch_estimate_has_level_and_slope_of_the_class(speed):
    # 99 half-overlapped Hann segments count as about 2 * 50 / (1 + 2 * (1/6)^2) = 95 independent averages
    segment, segments = 256, 99
    step = 0.125 / speed  # 4 cycle/m Nyquist
    road = iso8608("C", speed, seed=7, length=4000.0, ramp=0.0)
    z = road.height(step * np.arange(segment * (segments + 1) // 2))[:, 0]
    frequency, psd = signal.welch(z, 1 / step, nperseg=segment, window="hann")
    chosen = (frequency > 16 * frequency[1]) & (frequency < 0.9 * HIGH * speed)
    f, ratio = frequency[chosen], psd[chosen] / (CLASS_C * (frequency[chosen] / speed / N0) ** -2 / speed)
    scatter = 1 / np.sqrt(95)
    correlated = np.sqrt(1 + 2 * (4 / 9 + 1 / 36))  # neighbouring Hann bins
    leakage = 3 * 0.33 / 16**2  # of a Hann window into a spectrum f^-2, 16 bins from zero
    assert abs(ratio.mean() - 1) < 4 * scatter * correlated / np.sqrt(f.size) + leakage
    slope, _ = np.polyfit(np.log(f), np.log(psd[chosen]), 1)
    spread = scatter * correlated / np.sqrt(f.size * np.log(f).var())
    assert abs(slope + 2) < 4 * spread


def body_acceleration(frequency):
    """Gain from height to acceleration of a quarter car, (m/s^2)/m."""
    s = 2j * np.pi * frequency
    strut, tyre = 20e3 + 1500 * s, 180e3
    matrix = np.array([[300 * s**2 + strut, -strut], [-strut, 40 * s**2 + strut + tyre]]).transpose(2, 0, 1)
    return np.abs(s**2 * np.linalg.solve(matrix, np.array([[0.0], [tyre]]) * np.ones((s.size, 1, 1)))[:, 0, 0])


@pytest.mark.slow
def test_the_rms_of_a_run_scatters_over_seeds_as_that_of_a_gaussian_road():
    """The share p_i of each line is exponentially distributed: std of the RMS sqrt(sum p_i^2)/2, 2.3 % here."""
    road = iso8608("C", 20.0, seed=0, amplitudes="fixed")
    gain = body_acceleration(np.asarray(road.spatial_frequency) * 20.0)
    power = (gain * np.asarray(road.amplitude)) ** 2 / 2
    expected = np.sqrt(np.sum(power**2)) / np.sum(power) / 2
    assert expected == pytest.approx(0.023, abs=0.002)
    keys = jax.random.split(jax.random.key(1), 400)
    relative = np.asarray(jax.jit(jax.vmap(lambda key: iso8608("C", 20.0, seed=key).relative_amplitude))(keys))
    rms = np.sqrt((relative**2) @ power)
    assert rms.std() / rms.mean() == pytest.approx(expected, rel=4 / np.sqrt(2 * 400))
    assert np.mean(rms**2) == pytest.approx(np.sum(power), rel=4 * 2 * expected / np.sqrt(400))
    # the road of a shaping filter scatters alike
    time, rate = 50.0 * np.arange(5000) / 5000, body_acceleration(np.fft.rfftfreq(5000, 0.01)[1:])
    filtered = jax.jit(jax.vmap(lambda key: iso8608_filtered("C", 20.0, 50.0, seed=key).height(time)[:, 0]))(keys[:200])
    seen = np.sqrt(np.sum((np.abs(np.fft.rfft(np.asarray(filtered), axis=1)[:, 1:]) * rate) ** 2, axis=1))
    assert seen.std() / seen.mean() == pytest.approx(expected, rel=4 / np.sqrt(2 * 200))


def test_the_old_road_of_a_seed_has_fixed_amplitudes():
    # heights of the version in which amplitudes were always fixed
    time, road = np.array([1.0, 17.3, 49.9]), iso8608("C", 20.0, seed=1, amplitudes="fixed")
    old = [
        (road, [-0.004691782566144477, -0.0011719035263176695, 0.004394702226805999]),
        (road.reseeded(4711), [-0.011860184756568614, 0.02782376468658153, 0.026240258940935637]),
    ]
    for one, heights in old:
        np.testing.assert_allclose(one.height(time)[:, 0], heights, atol=1e-12)
    right = [-0.016493868960613223, -0.005614093683806623, 0.005878599988785342]
    np.testing.assert_allclose(two_track(road, track_width=1.5, seed=2).height(time)[:, 1], right, atol=1e-12)
    np.testing.assert_array_equal(road.phase, iso8608("C", 20.0, seed=1).phase)


def test_reseeded_roads_are_drawn_anew_with_the_same_distribution():
    road, other = iso8608("C", 20.0, seed=1), iso8608("C", 20.0, seed=2)
    drawn = road.reseeded(9)
    sizes = np.asarray(drawn.relative_amplitude)
    assert stats.kstest(sizes**2, "expon").pvalue > 1e-3
    for another in (road, other.reseeded(9)):
        assert abs(np.corrcoef(sizes, another.relative_amplitude)[0, 1]) < 4 / np.sqrt(sizes.size)
    np.testing.assert_array_equal(road.reseeded(9).height(np.ones(1)), drawn.height(np.ones(1)))


def test_velocity_density_is_constant():
    # G_v = (2 pi n)^2 G_d = 4 pi^2 n0^2 G_d(n0): the mean square slope is that times the band
    road = iso8608("C", 20.0, seed=0, amplitudes="fixed")
    slope = jnp.sum((2 * jnp.pi * road.spatial_frequency * road.amplitude) ** 2) / 2
    assert float(slope) == pytest.approx(4 * np.pi**2 * N0**2 * CLASS_C * (HIGH - LOW), rel=2e-3)


@pytest.mark.parametrize("amplitudes", [pytest.param("fixed", marks=pytest.mark.slow), "random"])
def test_kurtosis_over_seeds_is_the_stated_one(amplitudes):
    road = iso8608("C", 20.0, seed=0, amplitudes="fixed")
    share = np.asarray(road.amplitude**2 / jnp.sum(road.amplitude**2))
    expected = 3 - 1.5 * np.sum(share**2)
    assert expected == pytest.approx(2.96, abs=0.005)
    expected = 3.0 if amplitudes == "random" else expected
    keys = jax.random.split(jax.random.key(0), 400)
    time = jnp.linspace(0.0, 45.0, 10)  # 100 m apart: nearly independent
    z = np.asarray(
        jax.jit(jax.vmap(lambda key: iso8608("C", 20.0, seed=key, ramp=0.0, amplitudes=amplitudes).height(time)[:, 0]))(
            keys
        )
    )
    kurtosis = np.mean(z**4) / np.mean(z**2) ** 2
    assert abs(kurtosis - expected) < 4 * np.sqrt(24 / z.size)
    assert abs(z.mean()) < 4 * np.sqrt(VARIANCE / z.size)
    assert np.mean(z**2) == pytest.approx(VARIANCE, rel=4 * np.sqrt(2 / z.size))


def test_repeats_after_its_length():
    road = iso8608("C", 25.0, seed=1, length=200.0, ramp=0.0)
    assert road.duration == 8.0
    assert road.grid is None
    time = np.linspace(0.0, 8.0, 100)
    np.testing.assert_allclose(road.height(time + 8.0), road.height(time), atol=1e-12)
    assert float(jnp.max(jnp.abs(road.height(time + 4.0) - road.height(time)))) > 0.005


def test_duration_lengthens_the_road():
    assert iso8608("C", 20.0, seed=1).duration == 50.0
    assert iso8608("C", 20.0, 10.0, seed=1).duration == 50.0
    assert iso8608("C", 20.0, 75.0, seed=1).duration == 75.0


def test_twice_the_speed_is_the_same_ground():
    slow, fast = iso8608("C", 10.0, seed=1, ramp=0.0), iso8608("C", 20.0, seed=1, ramp=0.0)
    time = np.linspace(0.0, 5.0, 100)
    np.testing.assert_allclose(fast.height(time), slow.height(2 * time), atol=1e-13)


def test_gradient_in_speed_equals_difference():
    time = 0.002 * jnp.arange(1000.0)
    road = iso8608("C", 20.0, seed=1)

    def roughness(speed):
        return jnp.sum(eqx.tree_at(lambda r: r.driven_at, road, jnp.asarray(speed)).height(time) ** 2)

    def through_constructor(speed):
        return jnp.sum(iso8608("C", speed, seed=1).height(time) ** 2)

    h = 1e-5
    slopes = [jax.grad(roughness), jax.jacfwd(roughness), jax.grad(through_constructor)]
    values = jax.jit(jax.vmap(roughness))(jnp.array([20.0 - h, 20.0 + h]))
    difference = (values[1] - values[0]) / (2 * h)
    assert abs(difference) > 1e-4
    np.testing.assert_allclose(jax.jit(lambda v: jnp.stack([f(v) for f in slopes]))(20.0), difference, rtol=1e-6)


def test_gradient_in_waviness_equals_difference():
    time = 0.01 * jnp.arange(300.0)

    def energy(w):
        return jnp.sum(iso8608("C", 20.0, seed=1, waviness=w, length=100.0).height(time) ** 2)

    h = 1e-5
    values, slopes = jax.jit(jax.vmap(jax.value_and_grad(energy)))(jnp.array([2.0 - h, 2.0, 2.0 + h]))
    np.testing.assert_allclose(slopes[1], (values[2] - values[0]) / (2 * h), rtol=1e-7)


def test_seeds_reproduce_and_differ():
    time = jnp.linspace(0.0, 20.0, 200)
    np.testing.assert_array_equal(iso8608("C", 20.0, seed=5).height(time), iso8608("C", 20.0, seed=5).height(time))
    same = iso8608("C", 20.0, seed=jax.random.key(5))
    np.testing.assert_array_equal(iso8608("C", 20.0, seed=5).phase, same.phase)
    phase = np.stack([iso8608("C", 20.0, seed=seed).phase for seed in (5, 6)])
    assert abs(np.corrcoef(phase)[0, 1]) < 4 / np.sqrt(phase.shape[1])
    assert stats.kstest(phase.ravel() / (2 * np.pi), "uniform").pvalue > 1e-4


def test_letter_and_number_are_the_same_road():
    time = jnp.linspace(0.0, 20.0, 200)
    np.testing.assert_array_equal(iso8608("B", 20.0, seed=5).height(time), iso8608(64e-6, 20.0, seed=5).height(time))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"road_class": "c"},
            r"`road_class` must be one of 'A', 'B'.*'H', or a number, but is 'c'. Did you mean 'C'\?",
        ),
        ({"road_class": "class D"}, r"but is 'class D'. Did you mean 'D'\?"),
        ({"road_class": "J"}, r"but is 'J'. Did you mean 'H'\?"),
        ({"road_class": ""}, r"but is ''. Did you mean 'A'\?"),
        ({"road_class": 256.0}, r"`road_class` must be below 1 m\^3, but is 256.0.*write 256e-6, not 256"),
        ({"road_class": -1e-6}, r"`road_class` must be positive and finite, but is -1e-06.*G_d\(n0\) in m\^3"),
        ({"speed": -20.0}, r"`speed` must be positive and finite, but is -20.0.*driven forwards"),
        ({"waviness": -2.0}, r"`waviness` must be finite and not negative, but is -2.0.*standard uses 2"),
        ({"ramp": -1.0}, r"`ramp` must be finite and not negative, but is -1.0.*Use 0"),
        ({"duration": 0.0}, r"`duration` must be positive and finite, but is 0.0"),
        ({"length": -5.0}, r"`length` must be positive and finite, but is -5.0"),
        ({"length": 50.0}, r"`length` must be at least 90.9091 m, the longest wave.*is 50.0 m.*Make it longer"),
        ({"length": 500.0, "duration": 30.0}, r"`length` must be at least 600 m.*is 500.0 m.*Make it longer"),
        ({"minimum_spatial_frequency": 0.0}, r"`minimum_spatial_frequency` must be positive and finite, but is 0.0"),
        ({"amplitudes": "gaussian"}, r"`amplitudes` must be one of 'random', 'fixed', but is 'gaussian'"),
        ({"maximum_spatial_frequency": np.inf}, r"`maximum_spatial_frequency` must be finite, but is inf"),
        ({"maximum_spatial_frequency": 0.01}, r"`minimum_spatial_frequency` must be below.*0.011 cycle/m.*Exchange"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        iso8608(**{"road_class": "C", "speed": 20.0, "seed": 0, **arguments})


def test_duration_needs_a_known_speed():
    with pytest.raises(ValueError, match=r"`duration` must be left out where `speed` is traced.*10.0 s.*give `length`"):
        jax.grad(lambda v: jnp.sum(iso8608("C", v, 10.0, seed=0).height(jnp.zeros(1))))(20.0)

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal, special

from jaxdamp.roads import cosine_bump, delayed, iso8608, sine, two_track


SPEED, TRACK = 20.0, 1.5


def gamma(n, track=TRACK):
    x = 2 * np.pi * track * n
    return x * special.kv(1, x)


def spectra(seed, length=1000.0, samples=6000):
    """Lines of both tracks over one period, of fixed amplitudes, and the spatial frequencies well within the band."""
    surface = iso8608("C", SPEED, seed=2, length=length, ramp=0.0, amplitudes="fixed")
    road = two_track(surface, track_width=TRACK, seed=seed)
    z = np.asarray(road.height(length / SPEED * np.arange(samples) / samples))
    n = np.arange(samples // 2 + 1) / length
    inside = (n > 0.013) & (n < 2.8)
    return n[inside], np.fft.rfft(z, axis=0)[inside] / samples


def test_with_fixed_amplitudes_tracks_heave_and_roll_have_exactly_their_spectra():
    n, lines = spectra(seed=7)
    power = np.abs(lines) ** 2
    # the phases are in double precision and the sum is exact to 1e-12 of the largest line, 1e-3 m; the least is 3e-6 m
    np.testing.assert_allclose(power[:, 1], power[:, 0], rtol=1e-5)
    np.testing.assert_allclose(np.abs(lines.sum(axis=1) / 2) ** 2, power[:, 0] * (1 + gamma(n)) / 2, rtol=1e-5)
    np.testing.assert_allclose(np.abs(lines[:, 0] - lines[:, 1]) ** 2, power[:, 0] * 2 * (1 - gamma(n)), rtol=1e-4)


@pytest.mark.parametrize("seed", [3, 4])  # also the one of the left track
def test_random_tracks_have_the_spectrum_and_coherency_on_average_also_drawn_anew(seed):
    road: Any = two_track(iso8608("C", SPEED, seed=3), track_width=TRACK, seed=seed)
    drawn: Any = road.reseeded(8)
    n = np.asarray(road.roads[0].spatial_frequency)
    for left, right in (road.roads, drawn.roads):
        a, b = (np.asarray(r.relative_amplitude) * np.exp(1j * np.asarray(r.phase)) for r in (left, right))
        for low, high in ((0.011, 0.2), (0.2, 0.6), (0.6, 2.9)):
            some = (n > low) & (n < high)
            cross, scatter = np.mean((a * np.conj(b))[some]), 4 / np.sqrt(some.sum())
            assert abs(cross - np.mean(gamma(n[some]))) < scatter
            assert abs(np.mean(np.abs(b[some]) ** 2) - 1) < scatter
    assert abs(np.corrcoef(drawn.roads[0].relative_amplitude, road.roads[0].relative_amplitude)[0, 1]) < 0.08
    same: Any = two_track(road.roads[0], road.roads[0]).reseeded(8)
    np.testing.assert_array_equal(same.roads[0].relative_amplitude, same.roads[1].relative_amplitude)


@pytest.mark.parametrize("amplitudes", ["random", "fixed"])
def test_tracks_of_independent_surfaces_stay_independent_drawn_anew(amplitudes):
    roads = [
        two_track(iso8608("C", SPEED, seed=s, amplitudes=amplitudes), track_width=TRACK, seed=s + 5) for s in (1, 2)
    ]
    drawn: list[Any] = [road.reseeded(seed) for road, seed in zip((*roads, roads[0]), (3, 3, 4), strict=True)]
    lines = [np.asarray(r.relative_amplitude) * np.exp(1j * np.asarray(r.phase)) for d in drawn for r in d.roads]
    across = np.abs(lines @ np.conj(lines).T / lines[0].size)[np.kron(np.eye(3), np.ones((2, 2))) == 0]
    assert np.max(across) < 4 / np.sqrt(lines[0].size)
    assert eqx.tree_equal(roads[0].reseeded(3), drawn[0])


def test_neither_track_leads():
    # the imaginary part of the cross spectrum, +-sqrt(1 - gamma^2) by line, averages out like a random walk
    n, lines = spectra(seed=7)
    cross = lines[:, 0] * np.conj(lines[:, 1]) / np.abs(lines[:, 0]) ** 2
    assert abs(cross.imag.mean()) < 4 * np.sqrt(np.mean(1 - gamma(n) ** 2) / n.size)
    side = cross.imag > 0
    changes = np.mean(side[1:] != side[:-1])
    assert abs(changes - 0.5) < 4 * 0.5 / np.sqrt(n.size)


@pytest.mark.slow
def test_coherence_estimated_from_samples_is_gamma_squared():
    # 4 km in half-overlapped segments of 64 m: about 4000/64 * 1.9 = 118 independent averages
    spacing, segment, averages = 0.2, 320, 118
    road = two_track(iso8608("C", SPEED, seed=3, length=4000.0, ramp=0.0), track_width=TRACK, seed=4)
    z = np.asarray(road.height(np.arange(20_000) * spacing / SPEED))
    n, coherence = signal.coherence(z[:, 0], z[:, 1], fs=1 / spacing, nperseg=segment)
    chosen = (n > 0.06) & (n < 1.0)  # from the fourth line of a segment: leakage below
    n, coherence = n[chosen], coherence[chosen]
    # within a Hann line of width 1.5/64 cycle/m gamma^2 changes little; the estimate is biased by (1 - C)^2/averages
    expected = gamma(n) ** 2
    bias = (1 - expected) ** 2 / averages
    # without coherence only the imaginary part of the cross spectrum is random: chi squared of one degree of freedom
    bound = 5 * (1 - expected) * np.sqrt(2 * expected / averages) + 16 / averages
    assert np.all(np.abs(coherence - expected - bias) < bound)
    assert abs(np.mean(coherence - expected - bias)) < 0.01


def test_seeds_reproduce_and_differ():
    time = jnp.linspace(0.0, 5.0, 200)
    road = iso8608("C", SPEED, seed=3)
    one, same, other = (two_track(road, track_width=TRACK, seed=seed).height(time) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, same)
    np.testing.assert_array_equal(one[:, 0], other[:, 0])
    assert np.max(np.abs(one[:, 1] - other[:, 1])) > 1e-4


@pytest.mark.parametrize(
    "argument", ["track_width", *(pytest.param(name, marks=pytest.mark.slow) for name in ("speed", "waviness"))]
)
def test_gradients_equal_differences(argument, check_gradient):
    given = {"track_width": 1.5, "speed": 20.0, "waviness": 2.1}
    time = jnp.linspace(0.0, 1.0, 41)

    def difference_of_tracks(value):
        values = {**given, argument: value}
        track = values.pop("track_width")
        z = two_track(iso8608("C", seed=3, length=200.0, **values), track_width=track, seed=5).height(time)
        return jnp.sum((z[:, 0] - z[:, 1]) ** 2)

    check_gradient(difference_of_tracks, given[argument])


def test_any_two_roads_beside_each_other():
    time = np.linspace(0.0, 2.0, 100)
    left, right = cosine_bump(0.06, duration=0.5), sine(0.01, frequency=2.0)
    road = two_track(left, right)
    np.testing.assert_array_equal(road.height(time), np.hstack([left.height(time), right.height(time)]))
    assert road.wheels == 2 and road.grid is None and road.duration is None


ROAD = iso8608("C", SPEED, seed=3, length=100.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((ROAD, None, None, 1), r"`right` must be given, or `track_width` with `seed`.*neither was given"),
        ((ROAD, ROAD, 1.5, 1), r"`right` must be.*not both, but is a road, and track_width 1.5 m as well"),
        ((ROAD, None, 1.5, None), r"`seed` must be given with `track_width`, but is None"),
        ((ROAD, ROAD, None, 1), r"`seed` must be left out when `right` is given, but is 1"),
        ((ROAD, None, -1.5, 1), r"`track_width` must be positive and finite, but is -1.5"),
        ((sine(0.1, frequency=1.0), None, 1.5, 1), r"`left` must be a road made by `iso8608`.*a Sine.*second track"),
        (
            (delayed(ROAD, delays=[0.0, 0.1]), ROAD, None, None),
            r"`left` must be a road with a single track.*one with 2",
        ),
        ((ROAD, two_track(ROAD, ROAD), None, None), r"`right` must be.*single track.*delayed\(two_track"),
    ],
)
def test_errors(arguments, message):
    left, right, track_width, seed = arguments
    with pytest.raises(ValueError, match=message):
        two_track(left, right, track_width=track_width, seed=seed)

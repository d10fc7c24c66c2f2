import jax
import numpy as np
import pytest

from jaxdamp.roads import cosine_bump, delayed, from_profile, iso8608, joined, sine, superposed, two_track


def test_heights_add_and_the_shortest_road_ends_it():
    record = from_profile(0.1 * np.arange(100), 0.01 * np.sin(np.arange(100.0)), speed=10.0)
    surface = iso8608("C", 10.0, seed=1, length=200.0)
    road = superposed(record, surface, cosine_bump(0.1, start=0.2, duration=0.3))
    time = np.linspace(0.0, 0.9, 50)
    np.testing.assert_allclose(road.height(time), sum(part.height(time) for part in road.roads), atol=1e-16)
    assert road.duration == pytest.approx(0.99) and road.grid == pytest.approx(0.01)
    assert [float(t) for t in road.span] == pytest.approx([0.0, 0.99])


def test_a_closed_lap_repeats_until_the_longer_record_ends():
    lap = from_profile(0.1 * np.arange(50), 0.01 * np.sin(np.arange(50.0)), periodic=True)
    record = from_profile(0.1 * np.arange(201), np.zeros(201))
    road = superposed(lap, record)
    assert road.duration == road.span[1] == superposed(road, lap).duration == two_track(lap, record).duration == 20.0
    assert joined(road, sine(0.01, frequency=1.0)).at == 20.0
    assert jax.jit(lambda: superposed(road, lap).duration)() == 20.0
    assert superposed(lap, lap).duration == 5.0
    # a random road may not repeat, and ends it before
    assert superposed(lap, record, iso8608("C", 10.0, seed=1, length=100.0)).duration == 10.0


def test_axles_must_be_as_far_apart():
    one, late = (delayed(sine(0.01, frequency=1.0), delays=delays) for delays in ([0.0, 0.125], [0.3, 0.425]))
    assert superposed(one, late).wheels == 2  # the rear axle follows the front alike
    with pytest.raises(ValueError, match=r"columns alike: .* axles, 0, 0.125 s late, but is .* 0, 0.2 s late"):
        superposed(one, delayed(sine(0.01, frequency=2.0), delays=[0.0, 0.2]))


def test_tracks_must_be_equal():
    wave = sine(0.01, frequency=1.0)
    assert superposed(two_track(wave, wave), two_track(wave, wave)).wheels == 2
    with pytest.raises(ValueError, match=r"`roads` must have equal numbers of tracks, but is \[2, 1\]"):
        superposed(two_track(wave, wave), wave)
    with pytest.raises(ValueError, match=r"`roads` must hold at least one road"):
        superposed()

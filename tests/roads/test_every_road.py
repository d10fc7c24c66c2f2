"""What holds for all roads."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import roads
from jaxdamp._guesses import shared_names


TIME = jnp.linspace(0.0, 1.0, 301)


def test_height_has_a_column_for_each_wheel_and_none_is_level(make):
    road = make(0.02)
    height = road.height(TIME)
    assert height.shape == (301, road.wheels)
    assert height.dtype == jnp.float64
    assert np.all(np.isfinite(height))
    assert np.all(np.ptp(height, axis=0) > 1e-5)


def test_each_height_depends_on_its_own_time_only(make):
    road = make(0.02)
    np.testing.assert_allclose(road.height(TIME[::-1]), road.height(TIME)[::-1], atol=1e-14)


def test_has_a_height_wherever_its_span_says(make):
    road = make(0.02)
    first, last = (float(time) for time in road.span)
    assert first <= 0.0 and last >= 1.0
    assert np.all(np.isfinite(road.height(np.linspace(max(first, -3.0), min(last, 50.0), 301))))


def test_every_road_is_linear_in_its_size(make):
    np.testing.assert_allclose(make(0.06).height(TIME), 3.0 * make(0.02).height(TIME), rtol=1e-10, atol=1e-15)


def test_starts_at_height_zero(make):
    np.testing.assert_allclose(make(0.02).height(TIME)[0], 0.0, atol=1e-15)


def test_compiled_equals_plain(make):
    road = make(0.02)
    compiled = eqx.filter_jit(lambda road, time: road.height(time))(road, TIME)
    np.testing.assert_allclose(compiled, road.height(TIME), rtol=1e-12, atol=1e-15)


def test_batch_equals_loop_and_gradients_in_size_equal_differences_in_both_modes(make):
    def energy(a):
        height = make(a).height(TIME)
        return jnp.sum(height**2), height

    def all_of_it(a):
        forward, _ = jax.jacfwd(energy, has_aux=True)(a)
        return *jax.value_and_grad(energy, has_aux=True)(a), forward

    a, h = 0.02, 1e-6
    sizes = jnp.array([a - h, a, a + h])
    (values, batch), reverse, forward = jax.jit(jax.vmap(all_of_it))(sizes)
    loop = jnp.stack([make(float(a)).height(TIME) for a in sizes])
    np.testing.assert_allclose(batch, loop, rtol=1e-11, atol=1e-15)
    difference = (values[2] - values[0]) / (2.0 * h)
    np.testing.assert_allclose(reverse[1], difference, rtol=1e-7)
    np.testing.assert_allclose(forward[1], difference, rtol=1e-7)


def test_numpy_times_are_accepted(make):
    road = make(0.02)
    np.testing.assert_array_equal(road.height(np.asarray(TIME)), road.height(TIME))


def test_a_single_time_has_a_height_for_each_wheel_and_the_method_compiles(make):
    road, whole = make(0.02), make(0.02).height(TIME)
    for height in (road.height, jax.jit(road.height)):
        np.testing.assert_allclose(height(0.5), whole[150], rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(jax.vmap(road.height)(TIME[150:152]), whole[150:152], rtol=1e-11, atol=1e-13)
    assert jax.eval_shape(road.height, TIME.reshape(7, 43)).shape == (7, 43, road.wheels)


def test_whole_numbers_are_accepted():
    np.testing.assert_array_equal(roads.sine(1, frequency=2).height(TIME), roads.sine(1.0, frequency=2.0).height(TIME))
    iso = roads.iso8608("C", 20, 10, seed=0)
    np.testing.assert_array_equal(iso.height(TIME), roads.iso8608("C", 20.0, seed=0).height(TIME))


def test_names():
    of_the_design = (
        "iso8608 cosine_bump pothole step sine sweep_sine band_limited from_profile read_crg delayed two_track"
    )
    assert set(roads.__all__) >= set(of_the_design.split())
    assert all(hasattr(roads, name) for name in roads.__all__ + shared_names(roads))


SPEEDS = {"cosine_bump": 10.0, "pothole": 10.0, "profile": 10.0, "delayed": 10.0, "contact_patch": 10.0}
SPEEDS |= dict.fromkeys(["iso8608", "iso8608_filtered", "two_track", "car", "joined"], 20.0)


def test_says_its_speed_and_what_its_columns_are(request, make):
    road = make(0.02)
    columns, wanted = road.columns, SPEEDS.get(request.node.callspec.params["make"])
    assert columns.tracks * (1 if columns.delays is None else columns.delays.size) == road.wheels
    np.testing.assert_array_equal(road.speed, wanted)


SURFACE = roads.iso8608("C", 20.0, seed=3, length=200.0)
EVENT = roads.cosine_bump(0.05, duration=0.2)
PLATFORMS = roads.from_profile(np.arange(100) * 0.01, np.zeros((100, 3)))
WRAPPERS = {
    "contact_patch": lambda road: roads.contact_patch(road, length=0.15, speed=20.0),
    "rolling_disc": lambda road: roads.rolling_disc(road, radius=0.3, speed=20.0, points=5),
    "superposed": lambda road: roads.superposed(road, road),
    "joined": lambda road: roads.joined(road, road, at=0.5),
}


@pytest.mark.parametrize("name", WRAPPERS)
def test_what_is_made_of_roads_passes_their_speed_and_columns_on(name):
    wrap = WRAPPERS[name]
    two = roads.two_track(SURFACE, SURFACE)
    kept = [] if name == "joined" else [roads.delayed(two, positions=[0.0, 2.0])]
    for road in (SURFACE, two, roads.in_phase(two), *kept, PLATFORMS):
        found, wanted = wrap(road), road.columns
        assert (found.columns.kind, found.columns.tracks, found.wheels) == (wanted.kind, wanted.tracks, road.wheels)
        if road.speed is not None:
            np.testing.assert_array_equal(found.speed, 20.0)
    kinds = [r.columns.kind for r in (SURFACE, roads.in_phase(two), PLATFORMS, roads.delayed(two, delays=[0.0, 1.0]))]
    assert kinds == ["road", "in phase", "by wheel", "delayed"]


def test_the_speed_is_that_of_the_roads_that_have_one():
    slower = roads.iso8608("C", 10.0, seed=3, length=200.0)
    for road in (roads.superposed(EVENT, SURFACE), roads.joined(SURFACE, EVENT, at=1.0)):
        np.testing.assert_array_equal(road.speed, 20.0)
    assert roads.superposed(EVENT, EVENT).speed is None
    assert roads.superposed(SURFACE, slower).speed is None and roads.joined(SURFACE, slower, at=1.0).speed is None
    for call in (WRAPPERS["contact_patch"], WRAPPERS["rolling_disc"]):
        with pytest.raises(ValueError, match=r"`speed` must be that of the road, 10.0 m/s, but is 20.0 m/s"):
            call(slower)
    traced = jax.jit(lambda v: roads.superposed(EVENT, roads.iso8608("C", v, seed=3, length=200.0)).speed)
    assert float(traced(17.0)) == 17.0


@pytest.mark.parametrize(
    "make",
    [
        lambda speed: roads.iso8608("C", speed, seed=1),
        lambda speed: roads.iso8608_filtered("C", speed, seed=1, length=100.0),
        lambda speed: roads.white("C", speed),
        lambda speed: roads.from_profile(np.arange(3.0), np.arange(3.0), speed),
        lambda speed: roads.cosine_bump(0.1, length=1.0, speed=speed),
        lambda speed: roads.contact_patch(EVENT, length=0.1, speed=speed),
    ],
)
def test_a_speed_is_one_number(make, unchecked):
    with pytest.raises(ValueError, match=r"`speed` must be one number, but is of shape \(2,\).*`jax.vmap` for many"):
        make(np.array([10.0, 20.0]))


def test_columns_of_different_wheels_do_not_go_together():
    two, moved = roads.two_track(SURFACE, SURFACE), roads.from_profile(np.arange(100) * 0.01, np.zeros((100, 2)))
    with pytest.raises(ValueError, match=r"`roads` must have columns alike: two tracks .*, but is 2 columns over time"):
        roads.superposed(two, moved)
    with pytest.raises(ValueError, match=r"`second` must have columns alike: one track, but is one track, in phase"):
        roads.joined(SURFACE, roads.in_phase(SURFACE), at=1.0)
    with pytest.raises(ValueError, match=r"`right` must have columns alike"):
        roads.two_track(SURFACE, roads.in_phase(SURFACE))
    assert roads.two_track(roads.in_phase(SURFACE), roads.in_phase(SURFACE)).columns.kind == "in phase"

"""Every road is written as JSON and read back."""

import inspect
import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial

from jaxdamp import roads
from jaxdamp.export import from_json, to_json
from jaxdamp.export._rebuild import known_classes

from .conftest import ROADS


def same(a, b):
    return jax.tree.structure(a) == jax.tree.structure(b) and all(
        np.asarray(x).tobytes() == np.asarray(y).tobytes()
        for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
    )


MORE_ROADS = {
    "in_phase": lambda a: roads.in_phase(roads.sine(a, frequency=2.0)),
    "rolling_disc": lambda a: roads.rolling_disc(roads.step(a, start=0.2, ramp=0.1), radius=0.3, speed=10.0),
    "triangular_bump": lambda a: roads.triangular_bump(a, duration=0.2),
    "wave_course": lambda a: roads.wave_course(a, 5.0, 10.0),
    "white": lambda a: roads.white("C", 20.0),
}


@pytest.mark.parametrize("name", [*ROADS, *MORE_ROADS])
def test_every_road_comes_back_bit_for_bit(name):
    road = (ROADS | MORE_ROADS)[name](0.05)
    text = to_json(road)
    assert json.loads(text)["format"] == "jaxdamp road"
    assert same(from_json(text), road) and to_json(from_json(text)) == text


def test_no_road_is_left_out():
    made = {type(make(0.05)) for make in (ROADS | MORE_ROADS).values()}
    classes = {
        kind
        for kind in known_classes().values()
        if kind.__module__.startswith("jaxdamp.roads.")
        and issubclass(kind, (roads.AbstractRoad, roads.WhiteRoad))
        and not inspect.isabstract(kind)
    }
    assert classes == made


def test_a_road_of_a_function_of_ones_own_says_that_it_cannot_be_written():
    road = eqx.tree_at(lambda r: r.shape, roads.cosine_bump(0.05, duration=0.2), Partial(jnp.sin))
    with pytest.raises(ValueError, match=r"`Bump\.shape` must be a function of this package.*from_profile"):
        to_json(road)

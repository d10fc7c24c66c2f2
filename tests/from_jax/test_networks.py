"""A law with a network of equinox: trained by one's own program, left alone by fits, and refused by files."""

import copy
import pickle
from typing import Any

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractMemoryless, Lag, Linear
from jaxdamp.export import to_json
from jaxdamp.parameters import get
from jaxdamp.vehicles.presets import quarter_car_000


class Learnt(AbstractMemoryless):
    """A law whose force is that of a network."""

    net: eqx.nn.MLP

    def __init__(self, activation: Any = jax.numpy.tanh) -> None:
        self.net = eqx.nn.MLP("scalar", "scalar", 4, 1, activation, key=jax.random.key(0))

    def force_velocity(self, v):
        return 100.0 * self.net(jax.numpy.asarray(v))


TIME = 2e-3 * np.arange(251)
VELOCITY = 0.12 * np.sin(12.0 * TIME)
RUN = BenchRun("sine", TIME, 0.01 * (1.0 - np.cos(12.0 * TIME)), VELOCITY, 1500.0 * VELOCITY)


def test_a_fit_names_the_network_that_it_leaves_as_it_was():
    start = Lag(Linear(1000.0) + Learnt(), 1e-3)
    found = identify.fit(start, [RUN], freeze=["lag_time"])
    assert eqx.tree_equal(get(found.law, "law.terms.1.net"), get(start, "law.terms.1.net"))
    (said,) = [note for note in found.warnings if "`law.terms.1.net` (13 numbers)" in note]
    assert "as it was" in said and "optax" in said


def test_a_fit_of_a_network_alone_says_what_is_missing():
    with pytest.raises(ValueError, match=r"`law` must have parameters.*Declare its numbers by `parameter"):
        identify.fit(Learnt(), [RUN])


@pytest.mark.parametrize("activation", [jax.nn.relu, jax.nn.softplus, jax.numpy.tanh, jax.lax.tanh])
def test_a_law_with_a_network_is_pickled_and_copied_with_its_functions(activation):
    law = Lag(Linear(1000.0) + Learnt(activation), 1e-3)
    car = quarter_car_000(law)
    for again in (pickle.loads(pickle.dumps(car)), copy.deepcopy(car)):
        assert eqx.tree_equal(again, car)
        assert jax.tree.structure(again) == jax.tree.structure(car)
        assert get(again, "damper.law.terms.1.net").activation is activation


def test_a_file_of_a_network_is_refused_with_a_way_that_works(tmp_path):
    with pytest.raises(ValueError, match="tree_serialise_leaves"):
        to_json(Learnt())
    eqx.tree_serialise_leaves(tmp_path / "law.eqx", Learnt())
    again = eqx.tree_deserialise_leaves(tmp_path / "law.eqx", jax.tree.map(lambda leaf: leaf, Learnt()))
    assert eqx.tree_equal(again, Learnt())

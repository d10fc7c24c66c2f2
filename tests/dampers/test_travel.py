"""Every law of the contract can be pickled and copied: equal, of one structure, its range with it."""

import copy
import pickle

import equinox as eqx
import jax
import numpy as np

from jaxdamp import parameters
from jaxdamp.dampers import FittedRange, with_fitted_range

from .test_contract import LAWS


SLOW = FittedRange(velocity=(-0.1, 0.2))


def test_every_law_travels_with_its_range():
    for name, make in LAWS.items():
        law = with_fitted_range(make(), SLOW)
        for again in (pickle.loads(pickle.dumps(law)), copy.deepcopy(law)):
            structure = jax.tree.structure(again)
            assert structure == jax.tree.structure(law) and hash(structure) == hash(jax.tree.structure(law)), name
            assert bool(eqx.tree_equal(law, again)) and again.fitted_to == SLOW, name
            for one, other in zip(parameters.parameters(law), parameters.parameters(again), strict=True):
                assert one.domain is other.domain, f"{name}: {one.path}"
                assert np.asarray(one.value).tobytes() == np.asarray(other.value).tobytes(), f"{name}: {one.path}"

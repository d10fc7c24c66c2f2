"""Run-time checks of types name the argument that has a wrong shape."""

import sys

import jax.numpy as jnp
import pytest

from .test_contract import LAWS


@pytest.mark.slow  # as the slow tests run with these checks, see `.ci/run`
@pytest.mark.skipif(
    not any(type(finder).__module__.startswith("jaxtyping") for finder in sys.meta_path),
    reason="no run-time checks of types: --jaxtyping-packages=jaxdamp.dampers,beartype.beartype",
)
def test_arrays_in_place_of_numbers_are_named():
    for make in LAWS.values():
        law = make()
        for method in (law.force, law.state_rate):
            with pytest.raises(Exception, match=r"`v`|'v'"):
                method(jnp.zeros(()), jnp.zeros(3), law.initial_state())

"""A plain test that compiles more than its share of programs fails (`pytest_pyfunc_call` in `tests/conftest.py`)."""

import jax.numpy as jnp
import numpy as np
import pytest


@pytest.mark.xfail(raises=pytest.fail.Exception, strict=True)
def test_a_test_of_many_small_programs_fails():
    for size in range(2000, 2004):
        jnp.sin(np.zeros(size))


def test_a_test_of_few_programs_does_not():
    for size in range(2010, 2014):
        jnp.sin(np.zeros(size))

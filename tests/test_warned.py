"""Warnings name the line of the user's code, whatever stands between it and the library."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import sweep
from jaxdamp.dampers import FittedRange, Lag, Linear, OutsideFittedRangeWarning, with_fitted_range
from jaxdamp.rig import StartsInMotionWarning, respond


TIME = np.linspace(0.0, 0.1, 101)
STROKE = 0.01 * np.sin(40.0 * TIME)
NARROW = with_fitted_range(Linear(1000.0), FittedRange(velocity=(-0.1, 0.1)))
CALLS: dict[type[Warning], Callable[[], object]] = {
    StartsInMotionWarning: lambda: respond(Lag(Linear(1000.0), 0.004), TIME, STROKE),
    OutsideFittedRangeWarning: lambda: respond(NARROW, TIME, STROKE),
    UserWarning: lambda: sweep(lambda point: {"root": jnp.sqrt(point["a"])}, {"a": [-1.0, 1.0]}),
}


@pytest.mark.parametrize("kind", CALLS)
def test_a_warning_names_the_line_of_the_call(kind: type[Warning]) -> None:
    with pytest.warns(kind) as caught:
        CALLS[kind]()
    assert {warning.filename for warning in caught} == {__file__}

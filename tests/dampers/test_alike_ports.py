"""Laws of one kind at several ports are stacked and computed together, as if each were called by itself.

Every law is held to this by `check_alike_ports` in `test_contract.py`; here three that once could not be stacked.
"""

import numpy as np
import pytest

from jaxdamp import roads, simulate
from jaxdamp.parameters import free_parameters
from jaxdamp.testing.law_checks import SLOTS, half_car, two_bumps
from jaxdamp.vehicles.port_form import Ports

from .test_contract import LAWS


ONCE_CRASHED = ["scheduled", "network and spring", "lag of a network"]


@pytest.mark.slow
def test_laws_that_could_not_be_stacked():
    """`simulate`, against the same laws of which one is wrapped, so that each is called by itself."""
    front = {slot: LAWS[name]() for slot, name in zip(SLOTS, ONCE_CRASHED, strict=False)}
    free = {slot: free_parameters(law) for slot, law in front.items()}
    rear = {slot: f.build(f.values * 1.02) for slot, f in free.items()}
    apart = {slot: 1.0 * law for slot, law in rear.items()}
    assert [len(kind) for kind in Ports([*front.values(), *rear.values()]).members] == [2, 2, 2]
    assert len(Ports([*front.values(), *apart.values()]).members) == 6
    road = roads.from_profile(*two_bumps())
    together, separate = (
        np.asarray(simulate(half_car(front, laws), road, substeps=1).motion) for laws in (rear, apart)
    )
    scale = np.max(np.abs(separate), axis=0)
    assert np.all(scale > 1e-4)
    np.testing.assert_allclose(together / scale, separate / scale, atol=1e-11)

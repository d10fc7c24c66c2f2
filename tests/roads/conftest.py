import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest

from jaxdamp import roads


PROFILE = 0.01 * np.sin(0.3 * np.arange(200) ** 1.1)

# One road of each kind, made from one number (roughly its size) so that it can be scaled, batched and differentiated.
ROADS = {
    "cosine_bump": lambda a: roads.cosine_bump(a, start=0.2, length=5.0, speed=10.0),
    "step": lambda a: roads.step(a, start=0.2, ramp=0.1),
    "sine": lambda a: roads.sine(a, frequency=3.0, ramp=0.3),
    "band_limited_rms": lambda a: roads.band_limited(1.0, 20.0, rms=a, duration=2.0, dt=0.01, seed=3),
    "band_limited_peak": lambda a: roads.band_limited(1.0, 20.0, peak_to_peak=a, duration=2.0, dt=0.01, seed=3),
    "iso8608": lambda a: roads.iso8608(a**2, 20.0, seed=3),
    "profile": lambda a: roads.from_profile(0.1 * np.arange(200), a * jnp.asarray(PROFILE), speed=10.0),
}


@pytest.fixture(params=ROADS)
def make(request):
    return ROADS[request.param]


@pytest.fixture
def unchecked():
    """Turns the run-time checks of shapes off, to see what a user without them sees."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)

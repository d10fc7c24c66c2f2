import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest

from jaxdamp import roads


PROFILE = 0.01 * np.sin(0.3 * np.arange(200) ** 1.1)

# One road of each kind, made from one number (roughly its size) so that it can be scaled, batched and differentiated.
ROADS = {
    "cosine_bump": lambda a: roads.cosine_bump(a, start=0.2, length=5.0, speed=10.0),
    "smooth_cosine_bump": lambda a: roads.cosine_bump(a, start=0.2, duration=0.5, smooth=True),
    "half_sine_bump": lambda a: roads.half_sine_bump(a, start=0.2, duration=0.5),
    "trapezoid_bump": lambda a: roads.trapezoid_bump(a, start=0.2, duration=0.5, rounding=0.05),
    "pothole": lambda a: roads.pothole(a, start=0.4, length=2.0, speed=10.0),
    "step": lambda a: roads.step(a, start=0.2, ramp=0.1),
    "smooth_step": lambda a: roads.step(a, start=0.2, ramp=0.1, smooth=True),
    "sine": lambda a: roads.sine(a, frequency=3.0, ramp=0.3),
    "sweep_sine": lambda a: roads.sweep_sine(1.0, 9.0, amplitude=a, duration=0.9, sweep="logarithmic"),
    "band_limited_rms": lambda a: roads.band_limited(1.0, 20.0, rms=a, duration=2.0, dt=0.01, seed=3),
    "band_limited_peak": lambda a: roads.band_limited(1.0, 20.0, peak_to_peak=a, duration=2.0, dt=0.01, seed=3),
    "iso8608": lambda a: roads.iso8608(a**2, 20.0, seed=3, length=200.0),
    "iso8608_filtered": lambda a: roads.iso8608_filtered(a**2, 20.0, seed=3, length=60.0),
    "profile": lambda a: roads.from_profile(0.1 * np.arange(200), a * jnp.asarray(PROFILE), speed=10.0),
    "two_track": lambda a: roads.two_track(roads.iso8608(a**2, 20.0, seed=3, length=200.0), track_width=1.5, seed=4),
    "two_roads": lambda a: roads.two_track(roads.cosine_bump(a, start=0.2, duration=0.4), roads.sine(a, frequency=2.0)),
    "delayed": lambda a: roads.delayed(
        roads.from_profile(0.1 * np.arange(200), a * jnp.asarray(PROFILE), speed=10.0), positions=[0.0, 2.0, 3.0]
    ),
    "car": lambda a: roads.delayed(
        roads.two_track(roads.iso8608(a**2, 20.0, seed=3, length=200.0), track_width=1.5, seed=4), delays=[0.0, 0.1]
    ),
    "contact_patch": lambda a: roads.contact_patch(roads.step(a, start=0.2, ramp=0.1), length=0.2, speed=10.0),
    "joined": lambda a: roads.joined(
        roads.step(a, start=0.1, ramp=0.2), roads.iso8608(a**2, 20.0, seed=3, length=200.0), at=0.5
    ),
    "superposed": lambda a: roads.superposed(
        roads.sine(a, frequency=2.0), roads.cosine_bump(a, duration=0.1, start=0.3)
    ),
}


@pytest.fixture
def check_gradient():
    """Compares the gradient of a function of one number with a central difference."""

    def check(function, at, step=1e-6, rtol=1e-6):
        h = step * at
        values, slopes = jax.jit(jax.vmap(jax.value_and_grad(function)))(jnp.array([at - h, at, at + h]))
        difference = (values[2] - values[0]) / (2.0 * h)
        assert abs(float(difference)) * at > 1e-6 * abs(float(values[1]))  # depends on the argument at all
        np.testing.assert_allclose(slopes[1], difference, rtol=rtol)

    return check


@pytest.fixture(params=ROADS)
def make(request):
    return ROADS[request.param]


@pytest.fixture
def unchecked():
    """Turns the run-time checks of shapes off, to see what a user without them sees."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)

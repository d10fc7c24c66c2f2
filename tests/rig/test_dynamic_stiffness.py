"""Dynamic stiffness of laws: closed forms, long runs, derivatives, what does not settle."""

import jax
import numpy as np
import pytest

from jaxdamp import dampers
from jaxdamp._status import Status
from jaxdamp.dampers import CoulombFriction, Linear, MonoTube, SeriesSpring, Spring
from jaxdamp.rig import dynamic_stiffness, respond


FREQUENCY = np.array([0.5, 4.0, 30.0])
SIZES = np.array([[0.001], [0.01]])


def test_a_maxwell_element_and_friction_in_closed_form() -> None:
    """K* = iωc/(1 + iωc/k) with states, and 4 F/(πX) of friction without, at every amplitude."""
    c, k = 2000.0, 4e5
    omega = 2 * np.pi * FREQUENCY
    result = dynamic_stiffness(SeriesSpring(Linear(c), k), FREQUENCY, SIZES, substeps=8)
    exact = 1j * omega * c / (1 + 1j * omega * c / k)
    np.testing.assert_allclose(result.complex_stiffness, np.broadcast_to(exact, (2, 3)), rtol=2e-5)
    np.testing.assert_allclose(result.damping, np.broadcast_to(exact.imag / omega, (2, 3)), rtol=2e-5)
    assert set(result.status) == {Status.CONVERGED}
    friction = dynamic_stiffness(Spring(1e4) + CoulombFriction(80.0, 1e-5), FREQUENCY, SIZES, samples=1024)
    exact = np.broadcast_to(1e4 + 4j * 80.0 / (np.pi * SIZES), (2, 3))
    np.testing.assert_allclose(friction.complex_stiffness, exact, rtol=1e-4)
    assert friction.stable.all()


def test_hysteresis_after_many_cycles() -> None:
    """The steady loop is that of a long run, and its derivative that of differences."""
    law = dampers.BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)
    frequency, amplitude = 2.0, 0.008

    def damping(amplitude: float) -> tuple[jax.Array, jax.Array]:
        result = dynamic_stiffness(law, [frequency], amplitude, substeps=2)
        return result.damping[0], result.force[0]

    derived = jax.jit(jax.value_and_grad(damping, has_aux=True))
    (_, steady), derivative = derived(amplitude)
    phase = 2 * np.pi * np.arange(20 * 512 + 1) / 512
    velocity = 2 * np.pi * frequency * amplitude * np.cos(phase)
    force = respond(law, phase / (2 * np.pi * frequency), amplitude * np.sin(phase), velocity,
                    state=law.initial_state())  # fmt: skip
    np.testing.assert_allclose(steady, force[-513:-1:2], atol=1e-6 * np.ptp(force))
    slope = (derived(amplitude + 1e-6)[0][0] - derived(amplitude - 1e-6)[0][0]) / 2e-6
    assert float(derivative) == pytest.approx(float(slope), rel=1e-4)


def test_what_means_nothing_is_refused() -> None:
    """Frequencies and amplitudes that are not positive, or too many steps."""
    with pytest.raises(ValueError, match="frequency"):
        dynamic_stiffness(Linear(1000.0), [0.0], 0.01)
    with pytest.raises(ValueError, match="frequency"):
        dynamic_stiffness(SeriesSpring(Linear(1000.0), 1e5), [1e-3], 0.01)
    with pytest.raises(ValueError, match="amplitude"):
        dynamic_stiffness(Linear(1000.0), FREQUENCY, [0.01, 0.02])


@pytest.mark.parametrize(("amplitude", "mean"), [(0.1, 0.0), (0.001, 0.2)])
def test_strokes_outside_the_limits_are_refused(amplitude, mean):
    with pytest.raises(ValueError, match=r"`amplitude` must keep the stroke from -0\.57 to 0\.07359 m for MonoTube"):
        dynamic_stiffness(MonoTube.reference(), [1.0], amplitude, mean=mean)

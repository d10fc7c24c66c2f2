"""Numbers by hand, work of a cycle by quadrature, the limit of a sharp sign."""

import numpy as np
import pytest
from scipy.integrate import quad

from jaxdamp import respond
from jaxdamp.dampers import HyperbolicTangent
from jaxdamp.parameters import parameters

from .motions import last_cycle, work
from .single_precision import single_precision_error


LAW = HyperbolicTangent(900.0, 500.0, 400.0, 30.0, 0.6, -80.0)


@pytest.mark.parametrize(
    ("x", "v", "expected"),
    [
        (0.02, 0.1, 90.0 + 10.0 + 400.0 * np.tanh(3.6) - 80.0),
        (-0.02, 0.1, 90.0 - 10.0 + 400.0 * np.tanh(2.4) - 80.0),
        (0.02, -0.01, -9.0 + 10.0 + 400.0 * np.tanh(0.3) - 80.0),
        (0.0, 0.0, -80.0),
    ],
)
def test_away_from_mid_stroke_it_is_the_printed_formula(x, v, expected):
    np.testing.assert_allclose(LAW.force_stroke_velocity(x, v), expected, rtol=1e-12)


@pytest.mark.parametrize("frequency", [0.5, 6.0])
@pytest.mark.parametrize("offset", [0.6, -0.6, 3.0])
def test_work_of_a_cycle(frequency, offset):
    law, w = HyperbolicTangent(900.0, 500.0, 400.0, 30.0, offset, -80.0, 2e-3), 2 * np.pi * frequency

    def power(angle):
        x, v = 0.01 * np.sin(angle), 0.01 * w * np.cos(angle)
        return (900.0 * v + 400.0 * np.tanh(30.0 * v + offset * np.tanh(x / 2e-3))) * v / w

    expected = quad(power, 0.0, 2 * np.pi, points=[0.0, np.pi, np.pi / 2, 1.5 * np.pi], limit=400)[0]
    _, v, force = last_cycle(law, frequency, 0.01)
    np.testing.assert_allclose(work(frequency, v, force), expected, rtol=1e-6)
    assert expected > 0.0


def test_guess_from_a_loop():
    _, v, force = last_cycle(LAW, 3.0, 0.015)
    start = HyperbolicTangent.guess(v, force)
    np.testing.assert_allclose(start.yield_force, 400.0, rtol=0.3)
    np.testing.assert_allclose(start.static_force, -80.0, rtol=0.3)


@pytest.mark.parametrize("v", [np.zeros(50), np.linspace(-1, 1, 50)])
def test_guess_is_a_law_whatever_the_data(v):
    law = HyperbolicTangent.guess(v, -500.0 * v)
    numbers = {p.path: np.asarray(p.value) for p in parameters(law)}
    assert all(np.all(np.isfinite(value)) for value in numbers.values()), numbers
    assert numbers["yield_force"] > 0.0 and numbers["viscous_rate"] >= 0.0
    t = np.linspace(0.0, 0.2, 201)
    force = respond(law, t, 0.01 * np.sin(30.0 * t), 0.3 * np.cos(30.0 * t))
    assert np.all(np.isfinite(force)) and np.mean(force[100:] * np.cos(30.0 * t)[100:]) > 0.0


def test_single_precision():
    assert single_precision_error(lambda: HyperbolicTangent(900.0, 500.0, 400.0, 30.0, 0.6)) < 1e-4

"""Paper 003: pitch of the M113 on its road wheels."""

import jax
import numpy as np
import pytest

from jaxdamp import dampers, simulate
from jaxdamp.parameters import replace
from jaxdamp.vehicles import TrackedHull, linearise, modes
from jaxdamp.vehicles.presets import m113_003, m113_chrono

from .fleet import tracks


HULL = m113_003()
PAPER = [(11.5e3, 23e3, 18.23), (12.5e3, 20.5e3, 15.66), (16e3, 16e3, 14.18)]  # its two pairs, and equal ones


@pytest.mark.parametrize(("decrement", "mean", "ratio"), [(12.0, 15.13, 0.36777), (15.0, 16.29, 0.39580)])
def test_required_damping_and_its_damping_ratio(decrement, mean, ratio):
    found = HULL.required_damping(decrement)
    assert float(found) / 1e3 == pytest.approx(mean, abs=5e-3)
    assert float(HULL.pitch_frequency()) == pytest.approx(6.860, abs=5e-4)
    assert float(HULL.pitch_decay(found, found).whole) == pytest.approx(decrement, rel=1e-12)
    pinned = replace(m113_003(dampers.Linear(found)), {"sprung_mass": 1e12})
    assert modes(pinned).damping_ratio[1] == pytest.approx(ratio, abs=6e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("compression", "rebound", "decrement", "with_heave"),
    [(11.5e3, 23e3, 18.23, 17.14), (12.5e3, 20.5e3, 15.66, 15.09), (16e3, 16e3, 14.18, 14.05)],
)
def test_decrements_by_formula_and_by_free_decay(compression, rebound, decrement, with_heave):
    """Simulated with a hull too heavy to heave: amplitudes at the turning points of pitch, from nose up.

    And with one that heaves: the docstring of `pitch_decay` says by how much the formula is above that.
    """
    decay = HULL.pitch_decay(compression, rebound)
    assert float(decay.whole) == pytest.approx(decrement, abs=6e-3)
    heavy = replace(m113_003(dampers.Bilinear(rebound, compression)), {"sprung_mass": 1e12})
    response = simulate(heavy, tracks(np.zeros((1401, 5))), start={"pitch": 0.02})
    pitch = np.asarray(response["pitch"])
    assert np.abs(response["z_sprung"]).max() < 1e-6
    down = pitch.min()
    up = pitch[np.argmin(pitch) :].max()
    assert 0.02 / -down == pytest.approx(float(decay.nose_down), rel=2e-3)
    assert -down / up == pytest.approx(float(decay.nose_up), rel=2e-3)
    assert 0.02 / up == pytest.approx(decrement, rel=2e-3)
    free = replace(heavy, {"sprung_mass": HULL.sprung_mass})
    pitch = np.asarray(simulate(free, tracks(np.zeros((1401, 5))), start={"pitch": 0.02})["pitch"])
    assert 0.02 / pitch[np.argmin(pitch) :].max() == pytest.approx(with_heave, abs=6e-3)


def test_split_keeps_the_decay_of_the_nose_down_half_only():
    """Equations 15 and 16 with r = 0.5 and the paper's 16.5: 11.4 and 22.8, where it prints 11.5 and 23."""
    compression, rebound = HULL.split_damping(16.5e3, 0.5)
    assert (float(compression), float(rebound)) == pytest.approx((11.43e3, 22.85e3), abs=10.0)
    split, mean = HULL.pitch_decay(compression, rebound), HULL.pitch_decay(16.5e3, 16.5e3)
    assert float(split.nose_down) == pytest.approx(float(mean.nose_down), rel=1e-12)
    assert float(split.nose_up) > 1.05 * float(mean.nose_up)


def test_required_damping_answers_to_the_centre_of_gravity():
    """5 cm ahead: 15.37 and 16.55 kN s/m; and derivatives agree with differences."""

    @jax.jit
    def required(shift, decrement):
        return replace(HULL, {"wheel_positions": HULL.wheel_positions - shift}).required_damping(decrement)

    # wheel 3 then is 5 cm behind the centre of gravity
    assert [float(required(0.05, d)) / 1e3 for d in (12.0, 15.0)] == pytest.approx([15.37, 16.55], rel=1e-3)
    for argument in (0, 1):
        slope = jax.grad(required, argument)(0.03, 13.0)
        step = np.eye(2)[argument] * 1e-4
        difference = (required(0.03 + step[0], 13.0 + step[1]) - required(0.03 - step[0], 13.0 - step[1])) / 2e-4
        assert float(slope) == pytest.approx(float(difference), rel=1e-6)


def test_chrono_set():
    hull = m113_chrono()
    frequency = modes(hull).undamped_frequency
    # 2.69e6 N m/rad and 3.01e6 N/m of the model, nearly uncoupled
    np.testing.assert_allclose(frequency, [1.579, 3.125], rtol=2e-3)
    np.testing.assert_allclose(np.asarray(linearise(hull).behind)[-1], 2.667, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"wheel_positions": [1.0, 1.2, -1.0]},
            r"`TrackedHull.wheel_positions` must hold two or more decreasing positions",
        ),
        ({"damped": (1, 4)}, r"`TrackedHull.damped` must hold numbers of wheels, 1 to 3"),
        ({"wheel_rate": 0.0}, r"`TrackedHull.wheel_rate` must be positive"),
    ],
)
def test_refuses_what_cannot_be(change, message):
    values = {"sprung_mass": 5e3, "pitch_inertia": 1e4, "wheel_positions": [1.0, 0.0, -1.0], "wheel_rate": 1e5}
    with pytest.raises(ValueError, match=message):
        TrackedHull(**(values | {"damper": dampers.Linear(1e4), "damped": (1, 3)} | change))


def test_formulas_outside_their_validity_are_refused():
    hull = m113_003()
    with pytest.raises(ValueError, match=r"`decrement` must be above 1, but is 0\.5"):
        hull.required_damping(0.5)
    with pytest.raises(ValueError, match=r"must be below critical damping, but is \d.* times it"):
        hull.pitch_decay(1e5, 1e5)
    with pytest.raises(ValueError, match=r"`compression` must be finite and not negative, but is -1000"):
        hull.pitch_decay(-1e3, 1e3)

"""Records begin at rest at their first stroke, whatever computes them; starts that warnings name are right."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import bench, respond
from jaxdamp.dampers import (
    AbstractStateful,
    Bilinear,
    GasSpring,
    Heated,
    Lag,
    Linear,
    MonoTube,
    Play,
    Scheduled,
    SeriesSpring,
    TemperatureScaled,
    TwinTube,
)
from jaxdamp.identify import predict_runs
from jaxdamp.parameters import parameter
from jaxdamp.rig import Rig, StartsInMotionWarning, quasi_static
from jaxdamp.simulation import Adaptive


GAS = GasSpring(2e6, 6e-5, 1e-4)
STATIC = [
    MonoTube.reference(),
    TwinTube.reference(),
    Lag(Linear(2000.0) + GAS, 0.004),
    SeriesSpring(Linear(2000.0) + GAS, 4e5),
    Play(Linear(2000.0) + GAS, 4e5, 1e-4),
]


@pytest.mark.parametrize("law", STATIC, ids=lambda law: type(law).__name__)
def test_a_law_with_a_static_force_has_it_from_the_first_sample(law):
    time, still, none = np.arange(20) * 1e-3, np.full(20, -0.02), np.zeros(20)
    rest = float(law.force(-0.02, 0.0, law.state_at_rest(jnp.asarray(-0.02))))
    assert abs(rest) > 10.0
    np.testing.assert_allclose(respond(law, time, still, none), rest, rtol=1e-6)
    np.testing.assert_allclose(Rig(stroke_offset=0.01).force(law, time, still + 0.01, none), rest, rtol=1e-6)
    moved = -0.02 + 0.005 * (1.0 - np.cos(20.0 * time))
    run = bench.BenchRun("slow", time, moved, 0.1 * np.sin(20.0 * time), np.ones(20))
    assert predict_runs(law, [run], "rest")[0][0] == pytest.approx(rest, rel=1e-6)


def test_a_solver_of_diffrax_begins_at_rest_too():
    time, law = np.arange(20) * 1e-3, STATIC[2]
    still, none = np.full(20, -0.02), np.zeros(20)
    adaptive = respond(law, time, still, none, engine=Adaptive())
    np.testing.assert_allclose(adaptive, respond(law, time, still, none), rtol=1e-5)


def test_the_start_that_the_warning_names_is_that_of_a_lead_in():
    law, dt, w = MonoTube.reference(), 2e-4, 2 * np.pi

    def sine(phase, count):
        t = np.arange(count) * dt
        return t, 0.05 * np.sin(phase + w * t), 0.05 * w * np.cos(phase + w * t)

    begin = -np.pi / 3
    time, stroke, velocity = sine(begin, 500)
    with pytest.warns(StartsInMotionWarning, match=r"quasi_static\(law, velocity\[:1\], stroke=-0\.0433\)\.states"):
        led_in = respond(law, *sine(begin - w, 15000))[5000]
    state = quasi_static(law, velocity[:1], stroke=float(stroke[0])).states[0]
    assert respond(law, time, stroke, velocity, state=state)[0] == pytest.approx(float(led_in), rel=2e-3)


def test_heat_neither_moves_in_a_held_curve_nor_makes_a_record_begin_wrong():
    time = np.arange(500) * 1e-3
    stroke, velocity = 0.05 * np.sin(6.0 * time), 0.3 * np.cos(6.0 * time)
    warm = Heated(Linear(2000.0), initial_rise=20.0)
    for law in (
        Heated(Bilinear(2000.0, 900.0), initial_rise=20.0),
        1.0 * warm,
        Scheduled((warm, Heated(Linear(900.0))), levels=[0.0, 2.0], command=0.0),  # the other has no share
    ):
        assert respond(law, time, stroke, velocity)[0] == pytest.approx(600.0 * np.exp(-0.04))  # and warns of nothing
        held = quasi_static(law, np.array([-0.3, 0.3]))
        assert held.settled.all() and held.force[1] == pytest.approx(600.0 * np.exp(-0.04))
        np.testing.assert_allclose(held.states, 20.0)
        assert respond(law, time, stroke, velocity, temperature=330.0).shape == time.shape


def test_states_that_do_not_settle_are_no_start():
    curve = quasi_static(Lag(Linear(1000.0), 1e6), np.array([0.5]))
    assert not curve.settled[0] and np.all(np.isnan(curve.states)) and np.isnan(curve.force[0])


def test_a_measured_temperature_is_behind_the_delay_for_the_law_too():
    time = np.arange(1000) * 1e-3
    motion = 0.02 * np.sin(12.0 * time), 0.24 * np.cos(12.0 * time)
    warm, late = 300.0 + 20.0 * np.sin(3.0 * time), {"force_delay": 5e-3}
    outside = Rig(temperature_slope=0.003, **late).readings(Linear(2000.0), time, *motion, temperature=warm)
    law = TemperatureScaled(Linear(2000.0), 293.15, sensitivity=0.003)
    inside = Rig(**late).readings(law, time, *motion, temperature=warm)
    np.testing.assert_allclose(inside.force, outside.force, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(inside.temperature, warm, rtol=1e-6)


class _Vector(AbstractStateful):
    """A force of shape (1,), an easy slip of a law of one's own."""

    rate: float = parameter("N s/m", "c")

    def initial_state(self):
        return jnp.zeros(1)

    def force(self, x, v, state):
        return self.rate * state

    def state_rate(self, x, v, state):
        return (v - state) / 0.01


def test_what_is_refused():
    time, none = np.arange(100) * 1e-2, np.zeros(100)
    law = Lag(Linear(2000.0), 0.004)
    wrong: list[Any] = [2.5, "4"]
    whole: Any = np.int64(2)
    assert respond(law, time, none, none, substeps=whole).shape == time.shape
    for substeps in wrong:
        with pytest.raises(ValueError, match="`substeps` must be a whole number"):
            respond(law, time, none, none, substeps=substeps)
    with pytest.raises(ValueError, match=r"`law` must give one number as force, but is _Vector, which gives \(1,\)"):
        respond(_Vector(2000.0), time, none, none)
    with pytest.raises(ValueError, match=r"`TemperatureScaled.temperature` must be in kelvin, above 150, but is 60"):
        TemperatureScaled(Linear(2000.0), 60.0)
    with pytest.raises(ValueError, match=r"`Heated.reference_temperature` must be in kelvin"):
        Heated(Linear(2000.0), reference_temperature=20.0)
    with pytest.raises(ValueError, match=r"`Rig.reference_temperature` must be in kelvin"):
        Rig(temperature_slope=0.002, reference_temperature=20.0)
    with pytest.raises(ValueError, match=r"`stroke` must stay from .* for MonoTube"):
        quasi_static(MonoTube.reference(), np.array([0.1]), stroke=0.2)

"""What engines and fits ask of a law, through wrappers and sums."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import (
    BoucWen,
    Bushing,
    GasSpring,
    Heated,
    KaradayiMasada,
    Lag,
    Linear,
    ModifiedBoucWen,
    MonoTube,
    MotionRatio,
    Play,
    Scheduled,
    SeriesSpring,
    Spring,
    StrokeDependent,
    TemperatureScaled,
)
from jaxdamp.identify import prepare
from jaxdamp.identify.traces import Batch
from jaxdamp.vehicles.port_form import Ports

from .test_contract import network


def test_states_may_be_extrapolated_whatever_the_order_of_wrappers():
    lag = Lag(Linear(900.0), 0.01)
    foreseen = [lag, Scheduled((lag, lag), [0, 1], 0.5), Lag(Scheduled((Linear(900.0),) * 2, [0, 1], 0.5), 0.01)]
    foreseen += [2.0 * lag + Spring(1e3), MotionRatio(lag, 0.8), TemperatureScaled(lag, 300.0)]
    stepped = [Linear(900.0), network(), Lag(network(), 0.01), Scheduled((network(),) * 2, [0, 1], 0.5)]
    assert all(law.traits().extrapolable_states for law in foreseen)
    assert [law.traits().extrapolable_states for law in stepped] == [True, False, False, False]  # the first has none
    assert Ports([*foreseen, *stepped]).smooth == (True,) * (len(foreseen) + 1) + (False,) * 3


def test_wrappers_predict_as_the_law_inside_does():
    law = BoucWen(800.0, 0.0, 300.0, 1e-3)
    state, way = jnp.array([0.3]), (0.0, 0.2, 2.2e-4, 0.24)
    cheap = law.predict(*way, state, 1e-3)
    assert abs(float(cheap[0] - law.advance(*way, state, 1e-3)[0])) > 1e-6  # they can be told apart
    wrapped = [2.0 * law, law + Spring(2e3), Spring(2e3) + 0.5 * law, TemperatureScaled(law, 300.0)]
    wrapped += [Scheduled((law, law), [0, 1], 0.5), MotionRatio(law, 1.0)]
    for outer in wrapped:
        np.testing.assert_allclose(outer.predict(*way, state, 1e-3), cheap, rtol=1e-14)
    halved = MotionRatio(law, 0.5).predict(*way, state, 1e-3)
    np.testing.assert_allclose(halved, law.predict(0.0, 0.1, 1.1e-4, 0.12, state, 1e-3), rtol=1e-14)


def test_the_velocity_must_be_answered_at_once_somewhere():
    late = [
        Lag(Linear(900.0), 0.01),
        MonoTube.reference(),
        network(),
        Spring(1e3),
        Bushing(Linear(900.0), 2e6, 6e5, 8e2),
    ]
    for law in late:
        wrapped = (2.0 * law, MotionRatio(law, 0.8), law + law, Scheduled((law, law), [0, 1], 0.5))
        assert not any(one.traits().has_feed_through for one in (law, *wrapped))
        assert (law + Linear(5.0)).traits().has_feed_through


def test_a_law_at_rest_depends_on_the_stroke_as_its_parts_do():
    slack = [
        Lag(Linear(1e3), 0.01),
        KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 1e6, 3e-4),
        Scheduled((Linear(1.0), Linear(2.0)), [0, 1], 0.5),
        0.5 * (Linear(1.0) + network()),
    ]
    stiff = [2.0 * Spring(1e3), MotionRatio(Linear(1.0) + GasSpring(2e6, 6e-5, 1e-4), 0.8), ModifiedBoucWen.prototype()]
    stiff += [Lag(Spring(1e3), 0.01), SeriesSpring(Linear(1.0) + Spring(1e3), 1e6)]
    assert not any(law.traits().stroke_dependent_at_rest for law in slack)
    assert all(law.traits().stroke_dependent_at_rest for law in stiff)


def test_a_law_between_strokes_depends_on_the_stroke_though_its_laws_do_not():
    law = StrokeDependent((Linear(3000.0), Linear(1000.0)), [-0.06, -0.04])
    assert law.traits().stroke_dependent and not Linear(1.0).traits().stroke_dependent
    assert TemperatureScaled(law, 300.0).traits().stroke_dependent


def test_linearity_passes_through_linear_wrappers_only():
    law = Linear(900.0) + Spring(1e3)
    assert all(one.traits().linear_in_parameters for one in (law, 2.0 * law, Lag(MotionRatio(law, 0.8), 0.01)))
    assert not any(one.traits().linear_in_parameters for one in (Bushing(law, 2e6, 6e5, 8e2), Lag(network(), 0.01)))


def test_wrappers_around_a_sum_are_seen_through_term_by_term():
    law = MotionRatio(2.0 * (Linear(900.0) + Lag(Linear(500.0), 1e-3)) + BoucWen(800.0, 0.0, 300.0, 1e-3), 0.8)
    terms = law.side_by_side()
    assert [term.traits().extrapolable_states for term in terms] == [True, True, False]
    state, way = law.initial_state() + 0.1, (0.003, -0.2)
    states = [state[:0], state[:1], state[1:]]
    forces = [term.force(*way, own) for term, own in zip(terms, states, strict=True)]
    np.testing.assert_allclose(sum(forces), law.force(*way, state), rtol=1e-14)
    schedule = Scheduled((Linear(1.0) + Spring(2.0), Linear(3.0) + Spring(4.0)), [0, 1], 0.5)
    assert [type(term) for term in schedule.side_by_side()] == [Linear, Spring]
    whole = Bushing(Linear(900.0) + Spring(1.0), 2e6, 6e5, 800.0)
    assert whole.side_by_side() == (whole,)


def test_laws_around_a_mono_tube_take_its_short_steps_and_write_out_no_iterations():
    tube = MonoTube.reference()
    outer = [2.0 * tube, Linear(20.0) + tube, MotionRatio(tube, 0.8), Heated(tube), Play(tube + Linear(20.0), 1e6, 0.0)]
    assert not Linear(20.0).traits().solves_equation
    for law in outer:
        assert law.traits().solves_equation
        assert law.traits().step_angle == tube.traits().step_angle < Linear(20.0).traits().step_angle


def test_a_fit_takes_steps_of_the_angle_also_in_a_coarse_record():
    (run,) = VirtualDyno(Linear(1000.0), 100.0).run(SineTest(0.02, 1.0, cycles=2))
    for law in (MonoTube.reference(), Lag(Linear(1000.0), 0.002)):
        (batch,) = prepare(law, [run], samples_per_cycle=50).residuals
        assert isinstance(batch, Batch)
        angle = 2.0 * np.pi * float(batch.dt[0]) / batch.substeps
        assert 0.6 * law.traits().step_angle < angle <= law.traits().step_angle


def test_stroke_limits_are_those_at_the_wheel():
    tube = MonoTube.reference()
    low, high = (float(limit) for limit in tube.stroke_limits)
    law = MotionRatio(2.0 * (tube + Linear(1.0)), 0.5)
    np.testing.assert_allclose(np.array(law.stroke_limits), (2.0 * low, 2.0 * high))
    np.testing.assert_allclose(np.array((tube + Linear(1.0)).stroke_limits), (low, high))
    assert Linear(1.0).stroke_limits == (-np.inf, np.inf)
    time = np.linspace(0.0, 1.0, 101)
    respond(law, time, 1.8 * high * time**2)
    with pytest.raises(ValueError, match=r"`stroke` must stay from -1.14 to 0.1472 m for MotionRatio"):
        respond(law, time, 2.2 * high * time**2)

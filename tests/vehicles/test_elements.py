"""Elements at ports: tyres in the air, nonlinear springs, where the vehicle comes to rest."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

from jaxdamp import Ride, dampers, roads, simulate
from jaxdamp.metrics import Metric
from jaxdamp.parameters import replace
from jaxdamp.vehicles import CubicSpring, QuarterCar, linearise, oscillations, static_equilibrium
from jaxdamp.vehicles.frame import LOAD_AT_LIFT_OFF, LiftOff
from jaxdamp.vehicles.port_form import Ports

from .fleet import full_quarter_car


GRAVITY = 9.80665
JUMP = roads.cosine_bump(0.12, start=0.1, duration=0.12)


@pytest.fixture(scope="module")
def flight():
    """A car with everything thrown into the air by a bump."""
    return simulate(full_quarter_car(), JUMP, duration=1.2, dt=5e-4)


def test_the_tyre_never_pulls_and_leaves_the_road(flight):
    load = np.asarray(flight["dynamic_tyre_load"]) + 340.0 * GRAVITY
    assert load.min() > -1e-9 and np.mean(load < 1.0) > 0.05
    assert np.asarray(flight["relative_tyre_load"]).min() == pytest.approx(-1.0, abs=1e-3)


def test_in_the_air_all_falls_freely(flight):
    """Momentum: m_s z̈_s + m_u z̈_u is the contact force less the weight, so in the air −(m_s + m_u) g."""
    momentum = 300.0 * np.asarray(flight["sprung_acceleration"]) + 40.0 * np.asarray(flight["unsprung_acceleration"])
    np.testing.assert_allclose(momentum, flight["dynamic_tyre_load"], atol=1e-6)
    stretch = np.asarray(flight["z_unsprung"]) - flight["z_road"]
    air = stretch > 1.3 * 340.0 * GRAVITY / 180e3
    assert air.sum() > 50
    np.testing.assert_allclose(momentum[air], -340.0 * GRAVITY, rtol=1e-6)
    # The centre of gravity flies a parabola; the engine cancels the linear tyre to second order in the step.
    centre = (300.0 * np.asarray(flight.motion[:, 2]) + 40.0 * np.asarray(flight.motion[:, 3])) / 340.0
    both = air[1:] & air[:-1]
    np.testing.assert_allclose(np.diff(centre)[both], -GRAVITY * 5e-4, rtol=1e-3)


def test_every_element_was_at_work_and_the_energy_closes(flight):
    taken = {name: float(energy) for name, energy in flight.absorbed_by().items()}
    assert set(taken) == {"damper", "extra_spring", "bump_stop", "friction", "lift_off"}
    assert taken["damper"] > 1.0 and taken["friction"] > 0.1 and np.abs(flight["bump_stop_force"]).max() > 100.0
    parts = flight.energy_balance()
    assert abs(float(parts["error"])) < 2e-3 * float(parts["absorbed"] + parts["dashpots"])


@pytest.mark.slow
def test_on_the_road_a_tyre_that_can_lift_is_the_linear_one():
    gentle = roads.cosine_bump(0.01, start=0.1, duration=0.3)
    cars = [full_quarter_car(tyre_lifts=lifts) for lifts in (True, False)]
    runs = [simulate(car, gentle, duration=1.2, dt=5e-4) for car in cars]
    np.testing.assert_allclose(runs[0].motion, runs[1].motion, atol=1e-9)


def test_lift_off_is_linear_then_constant():
    law = LiftOff(180e3, 300.0, 3000.0)
    for d, v in ((-0.05, 0.0), (0.005, 0.2), (-0.01, -1.0)):
        assert float(law.force_stroke_velocity(d, v)) == pytest.approx(0.0, abs=1e-9)
    for d, v in ((0.05, 0.0), (0.03, 2.0), (0.0, 15.0)):
        total = 180e3 * d + 300.0 * v + float(law.force_stroke_velocity(d, v))
        assert total == pytest.approx(3000.0, rel=1e-9) and float(law.contact_force(d, v)) < 1e-6
    assert float(law.force_stroke_velocity(0.0, 0.0)) == 0.0
    assert float(law.contact_force(3000.0 / 180e3, 0.0)) == pytest.approx(3000.0 * LOAD_AT_LIFT_OFF, rel=1e-12)
    slope = jax.vmap(jax.grad(lambda d: law.force_stroke_velocity(d, 0.0)))(jnp.linspace(-0.05, 0.05, 401))
    assert np.all(np.isfinite(slope)) and np.all(np.diff(slope) <= 1e-6)


def springs(stroke):
    """Force of the springs of the car with everything and a gas spring [N], written by hand."""
    cubic = -4e4 * stroke**2 + 2e6 * stroke**3
    return 20e3 * stroke + cubic - (8e6 * (1e-4 / (1e-4 + 3e-4 * stroke)) ** 1.3 - 101_325.0) * 3e-4


def gas_car():
    gas = dampers.GasSpring(8e6, 1e-4, 3e-4) + CubicSpring(-4e4, 2e6)
    return full_quarter_car(extra_spring=gas, bump_stop=None, friction=None)


def test_rest_with_nonlinear_springs_is_where_the_forces_balance():
    lifted = scipy.optimize.root_scalar(springs, bracket=(0.0, 0.2), xtol=1e-14).root
    assert lifted > 0.03
    found = static_equilibrium(gas_car(), [0.1])
    assert float(found["z_unsprung"]) == pytest.approx(0.1, abs=1e-12)
    assert float(found["z_sprung"]) == pytest.approx(0.1 + lifted, abs=1e-11)


def test_starts_at_rest_and_stays_there():
    response = simulate(gas_car(), roads.from_profile(np.linspace(0, 1, 101), np.full(101, 0.1)), duration=0.3)
    assert np.abs(response["sprung_acceleration"]).max() < 1e-8
    np.testing.assert_allclose(response.motion, np.asarray(response.motion)[:1].repeat(301, axis=0), atol=1e-11)


def test_rest_is_differentiable_both_ways():
    car = gas_car()

    @jax.jit
    def height(pressure):
        return static_equilibrium(replace(car, {"extra_spring.terms.0.pressure": pressure}))["z_sprung"]

    difference = (float(height(8.01e6)) - float(height(7.99e6))) / 2e4
    slopes = jax.jit(lambda pressure: (jax.grad(height)(pressure), jax.jacfwd(height)(pressure)))(8e6)
    assert [float(slope) for slope in slopes] == pytest.approx([difference, difference], rel=1e-5)


PULLS = dampers.Linear(120.0) + dampers.Spring(500.0, -50.0)
TUBE = dampers.MonoTube.reference()
LEVELS = [0.0, 1.0]
WITH_STATES = {  # each is PULLS at rest, or a tube its gas spring
    "lag": dampers.Lag(PULLS, 0.01),
    "series": dampers.SeriesSpring(PULLS, 1e10, 1e12),
    "play": dampers.Play(PULLS, 1e10, 0.0),
    "bushing": dampers.Bushing(PULLS, 2e10, 1e10, 1e4),
    "frequency": dampers.FrequencySelective(PULLS, dampers.Linear(100.0), 0.04, 0.001),
    "scheduled": dampers.Scheduled((2.0 * dampers.Lag(PULLS, 0.02), dampers.Scaled(PULLS, 0.0)), LEVELS, 0.5, "force"),
    "hot": dampers.Heated(dampers.MotionRatio(dampers.Lag(4.0 * PULLS, 0.01), 0.5), sensitivity=0.0)
    + dampers.Spring(0.0, 50.0),
    "mono": TUBE,
    "twin": dampers.TwinTube.reference(),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in ("mono", "twin"))) for name in WITH_STATES]
)
def test_at_rest_the_states_of_a_law_stand_still_with_its_static_force(name):
    law, x = WITH_STATES[name], jnp.asarray(0.02)
    tubes = ("mono", "twin")
    plain = law.incompressible() if name in tubes else PULLS

    @jax.jit
    def at_rest(x):
        def force(x):
            return law.force(x, 0.0, law.state_at_rest(x))

        rates = law.state_rate(x, 0.0, law.state_at_rest(x))
        return force(x), jax.grad(force)(x), plain.force(x, 0.0, jnp.zeros(0)), rates

    force, slope, expected, rates = at_rest(x)
    assert float(force) == pytest.approx(float(expected), rel=1e-3 if name in tubes else 1e-6)
    by_stroke = jax.grad(lambda x: plain.force(x, 0.0, jnp.zeros(0)))(x)
    assert float(slope) == pytest.approx(float(by_stroke), rel=5e-3 if name in tubes else 1e-6)
    np.testing.assert_allclose(rates, 0.0, atol=1e-5)


def test_a_play_at_rest_is_loaded_or_hangs_free_in_its_clearance():
    def deflection(spring):
        law = dampers.Play(dampers.Linear(100.0) + spring, 1e5, 1e-3)
        return jax.value_and_grad(lambda x: law.state_at_rest(x)[0])(jnp.asarray(5e-4))

    for spring, expected in (
        (dampers.Spring(0.0, -500.0), (-6e-3, 0.0)),
        (dampers.Spring(1e3), (5e-4, 1.0)),
        (dampers.Spring(0.0), (0.0, 0.0)),
    ):
        assert [*map(float, deflection(spring))] == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_a_car_rests_on_static_forces_in_laws_with_states_and_stays_there():
    names = ("lag", "series", "bushing", "scheduled")
    stop = dampers.BumpStop(0.002, 2e5, end="both")
    laws = [dampers.Sum(tuple(WITH_STATES[name] for name in names)), 4.0 * PULLS]
    with_states, plain = (QuarterCar(350.0, 35.0, 22e3, 200e3, law, bump_stop=stop) for law in laws)
    lifted = float(static_equilibrium(plain)["z_sprung"])
    assert lifted > 0.003 and float(static_equilibrium(with_states)["z_sprung"]) == pytest.approx(lifted, rel=1e-6)
    found = np.sort(oscillations(with_states).frequency)
    np.testing.assert_allclose(found, np.sort(oscillations(plain).frequency), rtol=0.02)
    flat = roads.in_phase(roads.sine(0.0, frequency=1.0))
    motion = np.asarray(simulate(with_states, flat, duration=0.3).motion)
    np.testing.assert_allclose(motion, motion[:1].repeat(301, axis=0), atol=1e-9)
    ride = Ride(with_states, flat, duration=0.3, metrics=[Metric("z_sprung", "maximum", name="height")])
    assert float(ride({})["height"]) == pytest.approx(lifted, rel=1e-6)


def test_no_equilibrium_is_said():
    falling = CubicSpring(-1e9, 0.0) + dampers.Spring(0.0, -2e5)
    car = full_quarter_car(extra_spring=falling, bump_stop=None, tyre_lifts=False)
    for call in (static_equilibrium, linearise, lambda car: simulate(car, JUMP, duration=0.2)):
        with pytest.raises(ValueError, match=r"`vehicle` must have a static equilibrium"):
            call(car)
    with pytest.raises(ValueError, match=r"`road` must hold a height for each of 1 wheel"):
        static_equilibrium(full_quarter_car(), [0.0, 0.1])


def test_laws_of_one_kind_are_one_batch():
    laws = [
        dampers.Linear(100.0),
        dampers.Lag(dampers.Linear(50.0), 0.01),
        dampers.Linear(300.0),
        CubicSpring(0.0, 5.0),
    ]
    laws += [dampers.Lag(dampers.Linear(70.0), 0.02), dampers.Bilinear(1.0, 2.0), dampers.Bilinear(3.0, 4.0)]
    ports = Ports(laws)
    assert ports.members == ((0, 2), (1, 4), (3,), (5, 6))
    x0, v0, x1, v1 = np.random.default_rng(1).normal(size=(4, 7))
    before, after = (jnp.asarray(x0), jnp.asarray(v0)), (jnp.asarray(x1), jnp.asarray(v1))
    states = ports.advance(*before, *after, ports.initial(), jnp.asarray(1e-3))
    moves = np.stack([x0, v0, x1, v1], axis=1)
    alone = [law.advance(a, b, c, d, law.initial_state(), 1e-3) for law, (a, b, c, d) in zip(laws, moves, strict=True)]
    for mine, other in zip(ports.by_port(states), alone, strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-14)
    forces = [float(law.force(x, v, s)) for law, x, v, s in zip(laws, x1, v1, alone, strict=True)]
    np.testing.assert_allclose(ports.force(jnp.asarray(x1), jnp.asarray(v1), states), forces, rtol=1e-14)
    assert Ports([]).force(jnp.zeros(0), jnp.zeros(0), []).shape == (0,)


def test_motion_ratio_acts_twice():
    direct = QuarterCar(300.0, 40.0, 20e3, 180e3, dampers.Linear(0.8**2 * 2000.0))
    levered = replace_damper(direct, dampers.MotionRatio(dampers.Linear(2000.0), 0.8))
    runs = [simulate(car, JUMP, duration=0.4) for car in (direct, levered)]
    np.testing.assert_allclose(runs[0].motion, runs[1].motion, atol=1e-12)


def replace_damper(car, damper):
    return QuarterCar(car.sprung_mass, car.unsprung_mass, car.spring_rate, car.tyre_stiffness, damper)

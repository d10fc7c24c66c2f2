"""Statistical linearisation: against closed forms, an own fixed point, simulations and difference quotients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

import jaxdamp
from jaxdamp import Ride, dampers, roads
from jaxdamp.parameters import replace
from jaxdamp.vehicles import CubicSpring, QuarterCar, equivalent_dampers, stationary_rms
from jaxdamp.vehicles.gaussian import gaussian_points
from jaxdamp.vehicles.presets import half_car_002, m113_003, quarter_car_000
from jaxdamp.vehicles.statistical import nonlinear_variables


ROAD = roads.white("C", 20.0)
FRICTION = dampers.Linear(1500.0) + dampers.CoulombFriction(150.0, 0.005)
METRIC = "rms_sprung_acceleration"


def acceleration(law: dampers.AbstractDamper, road: roads.WhiteRoad = ROAD) -> float:
    return float(stationary_rms(quarter_car_000(law), road.velocity_psd)["sprung_acceleration"])


@pytest.mark.parametrize("width", [1e-3, 0.025, 0.2, 5.0])
def test_the_points_resolve_friction_however_steep_it_is(width):
    t, weights = gaussian_points(1)
    found = float(np.sum(weights * t[:, 0] * np.tanh(t[:, 0] / width)))
    density = lambda v: v * np.tanh(v / width) * np.exp(-0.5 * v * v) / np.sqrt(0.5 * np.pi)  # noqa: E731
    exact = (
        scipy.integrate.quad(density, 0.0, min(width, 1.0))[0] + scipy.integrate.quad(density, min(width, 1.0), 12)[0]
    )
    assert found == pytest.approx(exact, rel=5e-6)


@pytest.mark.parametrize("variables", [1, 2, 3, 4])
def test_points_are_uncorrelated_with_variance_one(variables):
    t, weights = gaussian_points(variables)
    np.testing.assert_allclose(weights @ t, 0.0, atol=1e-12)
    np.testing.assert_allclose((t * weights[:, None]).T @ t, np.eye(variables), atol=1e-12)


def test_which_variables_a_law_is_not_linear_in():
    assert nonlinear_variables(dampers.Linear(1.0)) == ()
    assert nonlinear_variables(dampers.CoulombFriction(1.0, 0.01)) == (0,)
    assert nonlinear_variables(dampers.Lag(dampers.CoulombFriction(1.0, 0.01), 0.01)) == (0,)
    assert nonlinear_variables(dampers.Dahl(1e5, 50.0)) == (0, 2)
    assert nonlinear_variables(dampers.GasSpring(2e6, 6e-5, 1e-4)) == (1,)


def test_laws_of_the_velocity_reach_the_values_of_an_independent_quadrature():
    """Numbers of another programme; three roads of a minute each gave 0.972 to 0.999, 1.038 to 1.069 and so on."""
    besinger = {blow_off: dampers.Besinger(1600.0, 4200.0, blow_off, 0.13, 0.05) for blow_off in (300.0, 900.0, 2700.0)}
    assert acceleration(dampers.Linear(1500.0)) == pytest.approx(1.110, abs=6e-4)
    assert acceleration(FRICTION) == pytest.approx(0.995, abs=1.5e-3)
    assert acceleration(dampers.Bilinear(4000.0, 1000.0)) == pytest.approx(0.929, abs=6e-4)
    assert [acceleration(law) for law in besinger.values()] == pytest.approx([1.065, 1.017, 0.934], abs=2e-3)


def test_friction_is_a_damper_of_slope_sqrt_2_over_pi_times_force_over_velocity():
    steep = dampers.Linear(1500.0) + dampers.CoulombFriction(150.0, 1e-4)
    found = equivalent_dampers(quarter_car_000(steep), ROAD.velocity_psd)["damper"]
    assert float(found.slope) == pytest.approx(
        1500.0 + np.sqrt(2.0 / np.pi) * 150.0 / float(found.velocity_rms), rel=1e-5
    )
    same = quarter_car_000(dampers.Linear(found.slope))
    assert float(stationary_rms(same, ROAD.velocity_psd)["sprung_acceleration"]) == pytest.approx(
        acceleration(steep), rel=1e-8
    )
    assert found.words() == f"Gaussian, equivalent slope {found.slope:.0f} N s/m at 0.24 m/s RMS"


def test_a_damper_is_as_hot_as_its_losses_make_it():
    """ϑ = c σ² τ/C, c = c₀ exp(−κ ϑ): far from what one stroke adds, so that none was found."""
    law = dampers.Heated(dampers.Linear(3000.0), sensitivity=0.004, cooling_time=600.0, static_force_slope=-0.5)
    found = equivalent_dampers(quarter_car_000(law), ROAD.velocity_psd)["damper"]
    rise = float(found.slope * found.velocity_rms**2) * 600.0 / 1000.0
    assert rise > 50.0 and float(found.slope) == pytest.approx(3000.0 * np.exp(-0.004 * rise), rel=1e-8)
    same = equivalent_dampers(quarter_car_000(dampers.Linear(found.slope)), ROAD.velocity_psd)["damper"]
    assert float(found.velocity_rms) == pytest.approx(float(same.velocity_rms), rel=1e-8)


@pytest.mark.parametrize("road", [roads.white("A", 5.0), roads.white(1e-12, 1.0)])
@pytest.mark.parametrize(
    "law", [FRICTION, pytest.param(dampers.Linear(1500.0) + dampers.Dahl(5e5, 150.0), marks=pytest.mark.slow)]
)
def test_friction_that_sticks_is_finite(law, road):
    rms = stationary_rms(quarter_car_000(law), road.velocity_psd)
    linear = stationary_rms(quarter_car_000(dampers.Linear(1500.0)), road.velocity_psd)
    assert all(np.isfinite(float(value)) for value in rms.values())
    assert float(rms["damper_velocity"]) < float(linear["damper_velocity"])


HYSTERESIS = {
    "Dahl": dampers.Linear(1500.0) + dampers.Dahl(5e5, 150.0),
    "Bouc-Wen": dampers.BoucWen(1500.0, 0.0, 150.0, 1e-3),
    "LuGre": dampers.LuGre(5e5, 300.0, 1500.0, 150.0, 200.0, 0.01),
    "series spring": dampers.SeriesSpring(FRICTION, 5e5),
}


@pytest.mark.parametrize(
    "name", ["Dahl", "Bouc-Wen", *(pytest.param(name, marks=pytest.mark.slow) for name in ("LuGre", "series spring"))]
)
@pytest.mark.exhaustive_cases("Bouc-Wen")
def test_laws_with_states_are_near_a_simulation(name):
    """The car with the equivalent linear damper on the same road says how far the road is from its expectation."""
    car, dt = quarter_car_000(HYSTERESIS[name]), 2e-3
    found = equivalent_dampers(car, ROAD.velocity_psd)["damper"]
    rises = np.sqrt(float(ROAD.velocity_psd) * dt) * np.random.default_rng(1).standard_normal(20_000)
    height = np.concatenate([[0.0], np.cumsum(rises)])
    driven = roads.from_profile(dt * np.arange(height.size), height)
    run, linear = (
        float(Ride(vehicle, driven, metrics=[METRIC], duration=40.0, dt=dt)()[METRIC])
        for vehicle in (car, quarter_car_000(dampers.Linear(found.slope)))
    )
    expected = run / linear * acceleration(dampers.Linear(float(found.slope)))
    assert acceleration(HYSTERESIS[name]) == pytest.approx(expected, rel=0.05)


def test_the_slope_is_that_of_differences():
    def rms(force):
        car = quarter_car_000(replace(FRICTION, {"terms.1.friction_force": force}))
        return stationary_rms(car, ROAD.velocity_psd)["sprung_acceleration"]

    derived = jax.jit(jax.value_and_grad(rms))
    ahead, behind = (float(derived(force)[0]) for force in (150.5, 149.5))
    assert float(derived(150.0)[1]) == pytest.approx(ahead - behind, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["friction", "Dahl"])
def test_derivatives_are_those_of_difference_quotients_in_both_modes_first_and_second(name):
    law = {
        "friction": FRICTION,
        "Dahl": HYSTERESIS["Dahl"],
    }[name]
    car, path = quarter_car_000(law), "damper.terms.1.friction_force"

    def rms(force):
        return stationary_rms(replace(car, {path: force}), ROAD.velocity_psd)["sprung_acceleration"]

    # One program: value, slope in both modes, and the second derivative forward over reverse.
    derived = jax.jit(lambda force: jax.jvp(jax.value_and_grad(rms), (force,), (jnp.ones(()),)))
    step = 0.5
    values = [float(derived(jnp.asarray(150.0 + i * step))[0][0]) for i in (-1, 0, 1)]
    first, second = (values[2] - values[0]) / (2 * step), (values[2] - 2 * values[1] + values[0]) / step**2
    (_, reverse), (forward, curved) = derived(jnp.asarray(150.0))
    assert float(forward) == pytest.approx(first, rel=1e-5)
    assert float(reverse) == pytest.approx(first, rel=1e-5)
    assert float(curved) == pytest.approx(second, rel=1e-3)


@pytest.mark.slow
def test_a_sweep_and_vmap_give_the_numbers_of_single_cars():
    ride, forces = Ride(quarter_car_000(FRICTION), ROAD, metrics=[METRIC]), [20.0, 150.0, 400.0]
    path = "damper.terms.1.friction_force"
    alone = [acceleration(replace(FRICTION, {path.removeprefix("damper."): force})) for force in forces]
    np.testing.assert_allclose(jaxdamp.sweep(ride, {path: forces})[METRIC], alone, rtol=1e-9)
    np.testing.assert_allclose(jax.vmap(lambda force: ride({path: force})[METRIC])(jnp.array(forces)), alone, rtol=1e-9)
    assert alone[0] > alone[1]


@pytest.mark.slow
def test_single_precision_is_finite_and_near_double():
    single = jax.tree.map(lambda a: a.astype(jnp.float32), quarter_car_000(HYSTERESIS["Dahl"]))
    with jax.enable_x64(False):
        found = float(stationary_rms(single, float(ROAD.velocity_psd))["sprung_acceleration"])
    assert found == pytest.approx(acceleration(HYSTERESIS["Dahl"]), rel=1e-3)


@pytest.mark.slow
def test_two_dampers_of_a_half_car_have_their_own_slopes():
    car, road = half_car_002(dampers.Linear(1000.0) + dampers.CoulombFriction(80.0, 0.005)), roads.white("C", 15.0)
    found = equivalent_dampers(car, road.velocity_psd, speed=15.0)
    assert float(found["front_damper"].slope) != pytest.approx(float(found["rear_damper"].slope), rel=1e-3)
    for damper in found.values():
        friction = 80.0 * np.sqrt(2.0 / np.pi) / float(damper.velocity_rms)
        assert float(damper.slope) == pytest.approx(1000.0 + friction, rel=2e-3)


def test_a_cubic_spring_is_a_linear_one_of_three_times_its_stiffness_and_mean_square():
    road, cubic = ROAD.velocity_psd, 2e6
    rms = stationary_rms(
        QuarterCar(300.0, 40.0, 20e3, 180e3, dampers.Linear(1500.0), extra_spring=CubicSpring(0.0, cubic)), road
    )
    stiffness = 20e3 + 3.0 * cubic * float(rms["stroke"]) ** 2
    same = stationary_rms(QuarterCar(300.0, 40.0, stiffness, 180e3, dampers.Linear(1500.0)), road)
    assert float(rms["sprung_acceleration"]) == pytest.approx(float(same["sprung_acceleration"]), rel=1e-6)
    assert stiffness > 20.5e3


def test_friction_between_wheel_and_road_is_refused_by_name_with_the_line_to_write():
    with pytest.raises(ValueError, match=r"wheel_1_damper has no finite RMS.*CoulombFriction.*Drive over.*iso8608\("):
        Ride(m113_003(dampers.CoulombFriction(100.0, 0.01)), ROAD)()


def test_a_ride_names_its_equivalent_dampers_only_on_a_white_road():
    ride = Ride(quarter_car_000(FRICTION), ROAD, metrics=[METRIC])
    assert float(ride.equivalent_dampers()["damper"].slope) == pytest.approx(2009.0, abs=3.0)
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    assert Ride(quarter_car_000(), bump, metrics=[METRIC], duration=1.0).equivalent_dampers() == {}

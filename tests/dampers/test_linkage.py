"""A motion ratio over the stroke: against closed forms, the constant ratio, virtual work and an independent solver."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import root_scalar

from jaxdamp import respond, roads, simulate
from jaxdamp.dampers import (
    BoucWen,
    Heated,
    Lag,
    Linear,
    Linkage,
    MonoTube,
    MotionRatio,
    PowerLaw,
    SeriesSpring,
    Spring,
    range_use,
    with_fitted_range,
)
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.parameters import replace
from jaxdamp.simulation import substeps_needed
from jaxdamp.vehicles import Axle, Corner, FullCar, HalfCar, QuarterCar, linearise, static_equilibrium


TRAVEL, RATIO = np.array([-0.08, -0.03, 0.01, 0.06]), np.array([0.92, 0.85, 0.7, 0.55])
SECOND = np.array([0.0, 1.0])
FLAT = roads.from_profile(SECOND, np.zeros(2))
T = np.linspace(0.0, 0.5, 2001)
X, V = 0.07 * np.sin(20.0 * T), 1.4 * np.cos(20.0 * T)


@eqx.filter_jit
def _levered(law, x):
    return jax.vmap(law.lever)(x)


def levered(law, x):
    """Damper travel and ratio at each wheel travel, as arrays of NumPy."""
    travel, ratio = _levered(law, jnp.asarray(x))
    return np.asarray(travel), np.asarray(ratio)


def ratio_by_hand(x):
    return np.interp(x, TRAVEL, RATIO)


def travel_by_hand(x):
    """The integral of the ratio, exact by trapezoids that end at its knees."""
    ends = np.sort([0.0, x, *TRAVEL[(np.minimum(0.0, x) < TRAVEL) & (np.maximum(0.0, x) > TRAVEL)]])
    return np.copysign(np.trapezoid(ratio_by_hand(ends), ends), x)


def test_the_damper_travel_is_the_integral_of_the_ratio():
    law, at = Linkage(Linear(1.0), TRAVEL, RATIO), np.array([-0.2, -0.08, -0.05, -0.01, 0.004, 0.01, 0.05, 0.2])
    travel, ratio = levered(law, at)
    np.testing.assert_allclose(ratio, ratio_by_hand(at), rtol=1e-14)
    np.testing.assert_allclose(travel, [travel_by_hand(x) for x in at], rtol=1e-13)
    np.testing.assert_allclose(travel[2], quad(ratio_by_hand, 0.0, at[2], points=[-0.03])[0], rtol=1e-12)
    assert float(law.lever(0.0)[0]) == 0.0
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.grad(lambda x: law.lever(x)[0])))(at), ratio, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(jax.vmap(law.wheel_travel))(jnp.asarray(travel)), at, rtol=1e-13)


def test_all_points_on_one_side_of_zero():
    law = Linkage(Linear(1.0), [0.1, 0.2], [0.5, 1.5])
    travel, ratio = levered(law, [-0.1, 0.0, 0.1, 0.15, 0.3])
    np.testing.assert_allclose(travel, [-0.05, 0.0, 0.05, 0.0875, 0.3], rtol=1e-14)
    np.testing.assert_allclose(ratio, [0.5, 0.5, 0.5, 1.0, 1.5], rtol=1e-14)


def test_a_table_of_a_trailing_arm_has_the_length_of_its_damper():
    # Project Chrono, M113_TranslationalDamperSuspension_Left.json, forward and up from the wheel [m]
    pivot, on_hull, on_arm = np.array([0.288, 0.134]), np.array([-0.3, 0.3]), np.array([0.184, -0.106])

    def turned(point, angle):
        turn = np.moveaxis(np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]), 2, 0)
        return pivot + turn @ (point - pivot)

    def travel_and_length(angle):
        return -turned(np.zeros(2), angle)[:, 1], np.linalg.norm(turned(on_arm, angle) - on_hull, axis=1)

    travel, length = travel_and_length(np.radians(np.linspace(25.0, -25.0, 51)))
    law = Linkage(Linear(1.0), travel, np.gradient(length, travel, edge_order=2))
    assert float(law.lever(0.0)[1]) == pytest.approx(0.25071181204 / 0.288, rel=1e-4)  # the arms of both forces
    between, exact = travel_and_length(np.radians(np.linspace(24.3, -24.3, 77)))
    (designed,) = travel_and_length(np.zeros(1))[1]
    np.testing.assert_allclose(levered(law, between)[0], exact - designed, atol=2e-5)


def test_equal_ratios_are_a_motion_ratio():
    inner = SeriesSpring(PowerLaw(1800.0, 0.6, 900.0, 0.6, knee_width=0.01), 4e5) + Spring(2e4, -300.0)
    constant, curve = MotionRatio(inner, 0.8), Linkage(inner, TRAVEL, np.full(4, 0.8))
    np.testing.assert_allclose(respond(curve, T, X, V), respond(constant, T, X, V), rtol=1e-13)


@pytest.mark.parametrize("inner", [BoucWen(800.0, 2e4, 300.0, 1e-3), Lag(Linear(1500.0), 0.004) + Spring(2e4)])
def test_the_work_at_the_wheel_is_that_at_the_damper(inner):
    law = Linkage(inner, TRAVEL, RATIO)
    s, r = levered(law, X)
    wheel, damper = np.asarray(respond(law, T, X, V)), np.asarray(respond(inner, T, s, r * V))
    np.testing.assert_allclose(wheel * V, damper * r * V, rtol=1e-11, atol=1e-9)
    works = np.trapezoid(wheel, X), np.trapezoid(damper, s)
    assert works[1] > 10.0  # J
    np.testing.assert_allclose(works[0], works[1], rtol=1e-4)


def test_a_spring_stores_at_the_wheel_what_it_stores_itself():
    law = Linkage(Spring(3e4, -500.0), TRAVEL, RATIO)
    for x in (-0.1, 0.005, 0.09):
        ends = [p for p in TRAVEL if 0.0 < p / x < 1.0]
        stored = quad(lambda x: float(law.force(x, 0.0, law.initial_state())), 0.0, x, points=ends)[0]
        np.testing.assert_allclose(stored, (0.5 * 3e4 * travel_by_hand(x) - 500.0) * travel_by_hand(x), rtol=1e-10)


@pytest.mark.slow
def test_a_quarter_car_agrees_with_an_independent_solver():
    valve, lag, spring = PowerLaw(1500.0, 1.5, 900.0, 1.5, knee_width=0.1), 0.004, 6e3
    law = Linkage(valve + Lag(Linear(800.0), lag) + Spring(spring), TRAVEL, RATIO)
    car, start = QuarterCar(300.0, 40.0, 20e3, 180e3, law), {"z_sprung": 0.07, "z_unsprung": 0.01}

    def rates(t, y):
        z_s, z_u, v_s, v_u, lagged = y
        x, v = z_s - z_u, v_s - v_u
        ratio, u = ratio_by_hand(x), ratio_by_hand(x) * v
        damper = (1500.0 if u > 0 else 900.0) * u * (u * u + 0.01) ** 0.25 + lagged + spring * travel_by_hand(x)
        force = 20e3 * x + ratio * damper
        return [v_s, v_u, -force / 300.0, (force - 180e3 * z_u) / 40.0, (800.0 * u - lagged) / lag]

    exact = solve_ivp(
        rates, (0.0, 1.0), [0.07, 0.01, 0, 0, 0], "DOP853", np.linspace(0, 1, 501), rtol=1e-10, atol=1e-12
    )
    errors = []
    for dt in (2e-3, 1e-3):
        found = simulate(car, FLAT, duration=1.0, dt=dt, start=start)["stroke"]
        errors.append(np.max(np.abs(found[:: round(2e-3 / dt)] - (exact.y[0] - exact.y[1]))))
    assert np.ptp(exact.y[0] - exact.y[1]) > 0.09  # over all the points
    assert errors[1] < 1e-5 and errors[1] < 0.35 * errors[0], errors


@pytest.mark.slow
def test_derivatives_with_respect_to_the_ratios_agree_with_differences():
    car = QuarterCar(300.0, 40.0, 20e3, 180e3, Linkage(Lag(Linear(1500.0), 0.004) + Spring(6e3), TRAVEL, RATIO))
    bump = roads.cosine_bump(0.05, start=0.0, duration=0.1)

    def energy(ratio):
        run = simulate(replace(car, {"damper.ratio": ratio}), bump, duration=0.3, dt=1e-3, substeps=1)
        return jnp.sum(run["sprung_acceleration"] ** 2)

    along = np.cos(np.arange(4.0))  # shows each slope
    derived = jax.jit(lambda ratio: (*jax.value_and_grad(energy)(ratio), jax.jvp(energy, (ratio,), (along,))[1]))
    _, reverse, forward = derived(RATIO)
    np.testing.assert_allclose(reverse @ along, forward, rtol=1e-10)
    steps = 1e-5 * np.eye(4)
    differences = [float(derived(RATIO + step)[0] - derived(RATIO - step)[0]) / 2e-5 for step in steps]
    assert np.all(np.abs(reverse) > 0.01)
    np.testing.assert_allclose(reverse, differences, rtol=1e-5)


def test_linearised_about_the_working_point():
    spring, damper = Linkage(Spring(3e4, -2500.0), TRAVEL, RATIO), Linkage(Linear(1500.0), TRAVEL, RATIO)
    car = QuarterCar(300.0, 40.0, 20e3, 180e3, damper, extra_spring=spring)

    def force(x):
        return 20e3 * x + ratio_by_hand(x) * (3e4 * travel_by_hand(x) - 2500.0)

    rest = root_scalar(force, bracket=(0.0, 0.2), xtol=1e-14).root
    assert 0.02 < rest < 0.05  # the ratio differs there from that at zero
    matrix = np.asarray(linearise(car).state_matrix)
    np.testing.assert_allclose(-300.0 * matrix[2, 2], 1500.0 * ratio_by_hand(rest) ** 2, rtol=1e-9)
    slope = (force(rest + 1e-6) - force(rest - 1e-6)) / 2e-6
    np.testing.assert_allclose(-300.0 * matrix[2, 0], slope, rtol=1e-7)
    bend = np.diff(RATIO)[2] / np.diff(TRAVEL)[2] * (3e4 * travel_by_hand(rest) - 2500.0)
    np.testing.assert_allclose(slope, 20e3 + 3e4 * ratio_by_hand(rest) ** 2 + bend, rtol=1e-7)


def test_a_force_at_rest_moves_with_the_ratio():
    assert not Linkage(Linear(1.0), TRAVEL, RATIO).traits().stroke_dependent_at_rest
    law = Linkage(Linear(1500.0) + Spring(0.0, -300.0), TRAVEL, RATIO)
    assert law.traits().stroke_dependent_at_rest
    rest = simulate(QuarterCar(300.0, 40.0, 20e3, 180e3, law), FLAT, duration=0.01)
    x = float(rest["stroke"][0])
    np.testing.assert_allclose(20e3 * x, 300.0 * ratio_by_hand(x), rtol=1e-9)
    warm = Heated(Linear(1500.0), static_force_slope=-5.0, initial_rise=60.0)  # its gas pushes with 300 N
    position = static_equilibrium(QuarterCar(300.0, 40.0, 20e3, 180e3, Linkage(warm, TRAVEL, RATIO)))
    assert float(position["z_sprung"] - position["z_unsprung"]) == pytest.approx(x, rel=1e-9)


@pytest.mark.slow
def test_a_step_is_divided_for_the_largest_ratio():
    inner, largest = Lag(Linear(4e3), 0.004) + Linear(60e3), 1.5

    def car(law):
        return QuarterCar(300.0, 40.0, 20e3, 180e3, law)

    steep = 2.0 * Linkage(inner, [-0.06, 0.0, 0.06], [largest, 0.3, largest])
    assert substeps_needed(car(2.0 * MotionRatio(inner, 0.3)), 1e-3) == 1
    needed = substeps_needed(car(steep), 1e-3)
    assert needed == substeps_needed(car(2.0 * MotionRatio(inner, largest)), 1e-3) > 1
    runs = [simulate(car(steep), FLAT, duration=0.3, dt=dt, start={"z_sprung": 0.07})["stroke"] for dt in (1e-3, 1e-4)]
    np.testing.assert_allclose(runs[0], runs[1][::10], atol=1e-4)


@pytest.mark.slow
def test_half_and_full_cars_that_only_heave_are_quarter_cars():
    law, start = Linkage(Lag(Linear(1500.0), 0.004) + Spring(6e3, -400.0), TRAVEL, RATIO), {"z_sprung": 0.07}
    corner = Corner(40.0, 20e3, 180e3, law)
    axle = Axle(corner, 1.5, 1e4)
    cars = {
        1: QuarterCar(300.0, 40.0, 20e3, 180e3, law),
        2: HalfCar(600.0, 1100.0, 1.2, 1.2, corner, corner),
        4: FullCar(1200.0, 2200.0, 500.0, 1.2, 1.2, axle, axle),
    }
    flat = {wheels: roads.from_profile(SECOND, np.zeros((2, wheels))) for wheels in cars}
    quarter, half, full = (simulate(car, flat[n], duration=0.3, start=start) for n, car in cars.items())
    for other in (half["front_stroke"], half["rear_stroke"], full["front_left_stroke"], full["rear_right_stroke"]):
        np.testing.assert_allclose(other, quarter["stroke"], atol=1e-9)


def test_the_range_is_judged_at_the_damper():
    law = Linkage(
        with_fitted_range(Linear(1500.0) + Spring(1e3), velocity=(-1.0, 1.0), stroke=(-0.05, 0.05)), TRAVEL, RATIO
    )
    s, r = levered(law, X)
    ((_, inner),) = law.motion_inside(Motion(X, V, 1000.0 * r))
    found = np.stack([channel for channel in (inner.stroke, inner.velocity, inner.force) if channel is not None])
    np.testing.assert_allclose(found, [s, r * V, np.full_like(X, 1000.0)])
    ((_, inner),) = law.motion_inside(Motion(velocity=V))
    assert inner.stroke is None and inner.force is None and inner.velocity is not None
    np.testing.assert_allclose(inner.velocity, ratio_by_hand(0.0) * V)
    uses = {use.quantity: use for use in range_use(law, Motion(X, V))}
    np.testing.assert_allclose(uses["stroke"].used, (s.min(), s.max()))
    np.testing.assert_allclose(uses["velocity"].used, ((r * V).min(), (r * V).max()))


def test_stroke_limits_are_those_at_the_wheel():
    tube = MonoTube.reference()
    limits = np.array([float(limit) for limit in tube.stroke_limits])
    for law in (Linkage(tube, TRAVEL, RATIO), Linkage(2.0 * tube, [-0.5, 0.5], [0.3, 1.2])):
        ends = [law.lever(x)[0] for x in law.stroke_limits]
        np.testing.assert_allclose(ends, limits, rtol=1e-12)
    assert [float(limit) for limit in Linkage(Linear(1.0), TRAVEL, RATIO).stroke_limits] == [-np.inf, np.inf]
    with pytest.raises(ValueError, match=r"`stroke` must stay from .* m for Linkage"):
        respond(Linkage(tube, TRAVEL, RATIO), T, 10.0 * X, 10.0 * V)


@pytest.mark.parametrize(
    ("travel", "ratio", "words"),
    [
        ([0.0], [0.8], "`ratio` must hold two or more ratios, one for each wheel travel"),
        ([0.0, 0.1], [0.8], "`ratio` must hold two or more ratios"),
        ([0.1, 0.0], [0.8, 0.9], r"`Linkage\.travel` must be strictly increasing"),
        ([0.0, 0.1], [0.8, -0.9], r"`Linkage\.ratio` must be positive"),
    ],
)
def test_refusals(travel, ratio, words):
    with pytest.raises(ValueError, match=words):
        Linkage(Linear(1.0), travel, ratio)

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from jaxdamp import dampers, roads, vehicles
from jaxdamp.parameters import replace
from jaxdamp.vehicles import QuarterCar, linearise, stationary_rms
from jaxdamp.vehicles.gaussian import lyapunov
from jaxdamp.vehicles.presets import quarter_car_000


def closed_forms(ms, mu, k, kt, c):
    """Mean squares of acceleration, stroke and tyre load for white road velocity of two-sided density one."""
    m = ms + mu
    acceleration = 0.5 * (kt * c / ms**2 + m * k**2 / (c * ms**2))
    tyre = m**3 * k**2 / (kt**2 * c * ms**2) - 2 * mu * m * k / (kt * c * ms) + mu / c + m**2 * c / (kt * ms**2)
    return acceleration, m / (2 * c), 0.5 * kt**2 * tyre


def draws(count):
    rng = np.random.default_rng(7)
    low, high = np.array([150.0, 20.0, 8e3, 1e5, 500.0]), np.array([1500.0, 150.0, 9e4, 4e5, 9e3])
    return [tuple(low + (high - low) * rng.random(5)) for _ in range(count)]


def test_undamped_modes_of_paper_000():
    form = quarter_car_000().port_form()
    squares = scipy.linalg.eigh(np.asarray(form.stiffness), np.asarray(form.mass), eigvals_only=True)
    np.testing.assert_allclose(np.sqrt(squares) / (2 * np.pi), [0.995137, 7.550899], atol=1e-6)
    np.testing.assert_array_equal(form.stiffness, form.stiffness.T)


def test_damped_modes_of_paper_000():
    poles = np.linalg.eigvals(np.asarray(linearise(quarter_car_000()).state_matrix))
    poles = poles[poles.imag > 0]
    poles = poles[np.argsort(np.abs(poles))]
    np.testing.assert_allclose(np.abs(poles) / (2 * np.pi), [1.0012, 7.5053], atol=1e-4)
    np.testing.assert_allclose(-poles.real / np.abs(poles), [0.1016, 0.2206], atol=1e-4)


@pytest.mark.parametrize("values", draws(5))
def test_stationary_response_is_the_closed_form(values):
    ms, mu, k, kt, c = values
    rms = stationary_rms(QuarterCar(ms, mu, k, kt, dampers.Linear(c)))
    found = [float(rms[name]) ** 2 for name in ("sprung_acceleration", "stroke", "dynamic_tyre_load")]
    np.testing.assert_allclose(found, closed_forms(*values), rtol=1e-10)


def test_figures_of_paper_000_on_class_c():
    rms = stationary_rms(quarter_car_000(), roads.white("C", 20.0).velocity_psd)
    found = [float(rms[name]) for name in ("sprung_acceleration", "stroke", "dynamic_tyre_load")]
    np.testing.assert_allclose(found, [0.9287, 0.01637, 1414.5], rtol=4e-4)


@pytest.mark.parametrize(
    ("channel", "best"), [("sprung_acceleration", 4656.373930627), ("dynamic_tyre_load", 5536.51355)]
)
@pytest.mark.exhaustive_cases("dynamic_tyre_load-5536.51355")
def test_gradient_vanishes_at_the_best_coefficient_and_agrees_with_differences(channel, best):
    car = quarter_car_000()

    @jax.jit
    def rms(c):
        return stationary_rms(replace(car, {"damper.rate": c}))[channel]

    slope = jax.grad(rms)
    scale = float(rms(2500.0)) / 2500.0
    assert abs(float(slope(best))) < 1e-9 * scale
    h = 5.0
    near, far = ((float(rms(2500.0 + s)) - float(rms(2500.0 - s))) / (2 * s) for s in (h, 2 * h))
    assert float(slope(2500.0)) == pytest.approx((4 * near - far) / 3, rel=1e-7)
    assert float(jax.jacfwd(rms)(2500.0)) == pytest.approx(float(slope(2500.0)), rel=1e-12)


def test_lyapunov_solution_is_that_of_scipy(rng):
    a = rng.normal(size=(6, 6)) - 4 * np.eye(6)
    q = rng.normal(size=(6, 3))
    q = q @ q.T
    expected = scipy.linalg.solve_continuous_lyapunov(a, -q)
    found, ends = lyapunov(jnp.asarray(a), jnp.asarray(q))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    rates = np.logspace(-6, 5, 6)  # slow and fast motions side by side: in P, q over the sum of their rates
    found, ends_slowly = lyapunov(jnp.asarray(np.diag(-rates)), jnp.asarray(q))
    np.testing.assert_allclose(found, q / (rates[:, None] + rates), rtol=1e-9)
    assert ends and ends_slowly
    undamped, unexcited = jnp.array([[0.0, 1.0], [-4.0, 0.0]]), jnp.array([[-1.0, 0.0], [0.0, 0.0]])
    assert [bool(lyapunov(a, jnp.diag(jnp.array([1.0, 0.0])))[1]) for a in (undamped, -unexcited, unexcited)] == [
        False,
        False,
        True,
    ]


@pytest.mark.slow
def test_states_of_a_law_take_part():
    """A Maxwell element between the masses, its state space written by hand."""
    ms, mu, k, kt, c, ks = 400.0, 40.0, 2e4, 2e5, 1500.0, 4e5
    # states: stroke, body velocity, tyre deflection, wheel velocity, spring force of the element; input road velocity
    a = np.array(
        [
            [0, 1, 0, -1, 0],
            [-k / ms, 0, 0, 0, -1 / ms],
            [0, 0, 0, 1, 0],
            [k / mu, 0, -kt / mu, 0, 1 / mu],
            [0, ks, 0, -ks, -ks / c],
        ]
    )
    b = np.array([[0.0], [0], [-1], [0], [0]])
    p = scipy.linalg.solve_continuous_lyapunov(a, -b @ b.T)
    rms = stationary_rms(QuarterCar(ms, mu, k, kt, dampers.SeriesSpring(dampers.Linear(c), ks)))
    assert float(rms["stroke"]) == pytest.approx(np.sqrt(p[0, 0]), rel=1e-9)
    assert float(rms["damper_force"]) == pytest.approx(np.sqrt(p[4, 4]), rel=1e-9)
    assert float(rms["sprung_acceleration"]) == pytest.approx(np.sqrt(a[1] @ p @ a[1]), rel=1e-9)


def test_white_noise_through_the_tyre_damping_has_no_rms():
    car = replace(quarter_car_000(), {"tyre_damping": 100.0})
    rms = stationary_rms(car)
    assert np.isinf(rms["dynamic_tyre_load"])
    assert np.isfinite(rms["sprung_acceleration"])


def test_settles_on_the_road_it_stands_on():
    settled = linearise(quarter_car_000()).settled()
    np.testing.assert_allclose(settled, [[1.0], [1.0], [0.0], [0.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sprung_mass": -300.0}, r"`QuarterCar.sprung_mass` must be positive \[kg\], but is -300.0"),
        ({"spring_rate": np.nan}, r"`QuarterCar.spring_rate` must be finite, but is nan"),
        ({"tyre_damping": -1.0}, r"`QuarterCar.tyre_damping` must be not negative"),
    ],
)
def test_refuses_what_cannot_be(change, message):
    values = {"sprung_mass": 300.0, "unsprung_mass": 40.0, "spring_rate": 2e4, "tyre_stiffness": 2e5}
    with pytest.raises(ValueError, match=message):
        vehicles.QuarterCar(**(values | change), damper=dampers.Linear(1500.0))

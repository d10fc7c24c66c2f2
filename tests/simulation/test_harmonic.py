"""The steady response to a sine: closed forms, SciPy, long simulations, literature, derivatives, what is refused."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from jaxdamp import dampers, roads, simulate, vehicles
from jaxdamp._status import Status
from jaxdamp.dampers import CoulombFriction, Linear
from jaxdamp.simulation import harmonic_response
from jaxdamp.vehicles import Body, CubicSpring, Element, Frame, LumpedVehicle, QuarterCar, Wheel
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000


FREQUENCY = np.linspace(0.6, 14.0, 7)
MASS, RATE = 1.0, 400.0  # of an oscillator on a moving ground: 3.18 Hz
FRICTION = quarter_car_000(Linear(1200.0) + CoulombFriction(60.0, 0.02))


def oscillator(law: dampers.AbstractDamper, damping: float = 0.0) -> LumpedVehicle:
    """A mass on a spring, a dashpot and a law, whose deflection is `stroke`."""
    body = Body("mass", MASS)
    return LumpedVehicle(Frame((body,), (), (Wheel("", body.at(), RATE, damping, elements=(Element("law", law),)),)))


@pytest.mark.parametrize(
    ("car", "speed"), [(quarter_car_000(), None), pytest.param(half_car_002(), 12.0, marks=pytest.mark.slow)]
)
def test_linear_vehicles_have_the_frequency_response_in_closed_form(car: Any, speed: float | None) -> None:
    """With the delay between two axles, amplitude by amplitude."""
    result = harmonic_response(car, FREQUENCY, np.array([[0.01], [0.03]]), speed=speed, substeps=32)
    exact = vehicles.frequency_response(car, FREQUENCY, speed=speed)
    assert all(status is Status.CONVERGED for status in result.status)
    for channel, gain in exact.items():
        scale = np.abs(gain).max()
        error = np.abs(np.asarray(result.gain(channel)) - np.asarray(gain)).max()
        assert error < 1e-8 * scale, channel
        assert np.nanmax(np.asarray(result.distortion(channel))) < 1e-8
    poles = np.linalg.eigvals(np.asarray(vehicles.linearise(car).state_matrix))
    largest = np.abs(np.exp(poles[:, None] / FREQUENCY)).max(axis=0)
    np.testing.assert_allclose(np.abs(result.multipliers[..., 0]), [largest, largest], rtol=1e-6)


@pytest.mark.slow
def test_the_same_by_shooting_with_scipy() -> None:
    """Friction and a hardening spring, by an independent formula of the car."""
    frequency, amplitude = 1.4, 0.015
    law = Linear(1200.0) + CoulombFriction(60.0, 0.05)
    car = QuarterCar(300.0, 40.0, 20e3, 180e3, law, extra_spring=CubicSpring(0.0, 4e6), tyre_damping=100.0)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        phase = 2 * np.pi * frequency * t
        road, rise = amplitude * np.sin(phase), 2 * np.pi * frequency * amplitude * np.cos(phase)
        x, v = y[0] - y[1], y[2] - y[3]
        force = 20e3 * x + 4e6 * x**3 + 1200.0 * v + 60.0 * np.tanh(v / 0.05)
        tyre = 180e3 * (road - y[1]) + 100.0 * (rise - y[3])
        return np.array([y[2], y[3], -force / 300.0, (force + tyre) / 40.0])

    def carried(y: np.ndarray, **options: Any) -> Any:
        return solve_ivp(rates, (0.0, 1.0 / frequency), y, "DOP853", rtol=1e-9, atol=1e-11, **options)

    result = harmonic_response(car, [frequency], amplitude, substeps=16)
    start = np.array([float(result[name][0, 0]) for name in ("z_sprung", "z_unsprung")] + [0.0, 0.0])
    steady = root(lambda y: carried(y).y[:, -1] - y, start, tol=1e-9).x
    time = np.arange(256) / 256.0 / frequency
    motion = carried(steady, t_eval=time).y
    np.testing.assert_allclose(result["z_sprung"][0], motion[0], atol=3e-6 * np.ptp(motion[0]))
    np.testing.assert_allclose(result["stroke"][0], motion[0] - motion[1], atol=3e-6 * np.ptp(motion[0]))


@pytest.mark.slow
def test_coulomb_friction_as_in_the_solution_of_den_hartog() -> None:
    """Amplitude of the deflection on a ground that moves with P/m ω²: motion without stops."""
    ratio, share = np.array([0.6, 0.75, 1.25, 1.6]), 0.4  # ω/ω_n, friction over P
    omega, force = ratio * np.sqrt(RATE / MASS), 4.0
    result = harmonic_response(
        oscillator(CoulombFriction(share * force, 1e-5)), omega / (2 * np.pi), force / (MASS * omega**2), substeps=64
    )
    gain = 1.0 / (1.0 - ratio**2)
    stop = np.sin(np.pi / ratio) / (ratio * (1.0 + np.cos(np.pi / ratio)))
    exact = force / RATE * np.sqrt(gain**2 - (share * stop) ** 2)
    np.testing.assert_allclose(result.peak("stroke"), exact, rtol=2e-3)


def test_a_hardening_spring_jumps_where_duffing_says() -> None:
    """The sweep up climbs the backbone ω² = ω_n² + ¾ k₃ a²/m to a = P/(c ω); the sweep down stays below."""
    damping, cubic, force = 0.8, 4e4, 0.8
    car = oscillator(CubicSpring(0.0, cubic), damping)

    def above(a: float) -> float:
        return damping * a * np.sqrt((RATE + 0.75 * cubic * a * a) / MASS) - force

    peak = float(brentq(above, 1e-3, 1.0))  # pyright: ignore[reportArgumentType]
    jump = np.sqrt((RATE + 0.75 * cubic * peak**2) / MASS) / (2 * np.pi)
    frequency = jump * np.linspace(0.8, 1.06, 53)
    both = np.concatenate([frequency, frequency[::-1]])
    result = harmonic_response(car, both, force / (MASS * (2 * np.pi * both) ** 2), substeps=1)
    up, down = np.split(np.asarray(np.abs(result.harmonics("stroke")[:, 1])), 2)
    assert result.stable.all()
    assert up.max() == pytest.approx(peak, rel=0.02)
    assert frequency[np.argmax(up)] == pytest.approx(jump, rel=0.02)
    bend, drag = 0.75 * cubic / MASS, (damping * 2 * np.pi * frequency / MASS) ** 2
    off = RATE / MASS - (2 * np.pi * frequency) ** 2
    curves = zip(2 * bend * off, off**2 + drag, strict=True)  # of the amplitude squared, a cubic equation
    roots = [np.roots([bend**2, square, linear, -((force / MASS) ** 2)]) for square, linear in curves]
    expected = np.flatnonzero([np.all(np.abs(np.imag(root)) < 1e-9 * np.abs(root)) for root in roots])
    several = np.flatnonzero(up > 1.2 * down[::-1])  # two steady motions at one frequency
    assert np.all(np.diff(several) == 1) and expected.size > 2
    assert np.abs(several[[0, -1]] - expected[[0, -1]]).max() <= 1, (several, expected)
    np.testing.assert_allclose(up[-3:], down[2::-1], rtol=1e-6)
    third = 0.25 * cubic * peak**2 / (9 * MASS * (2 * np.pi * jump) ** 2 - RATE - 1.5 * cubic * peak**2)
    assert np.asarray(result.distortion("stroke")).max() == pytest.approx(third, rel=0.05)


def response(values: Any) -> Any:
    """The largest gain of three by friction and amplitude."""
    car = quarter_car_000(Linear(1200.0) + CoulombFriction(values[0], 0.02))
    return jnp.max(jnp.abs(harmonic_response(car, [0.9, 1.0, 1.1], values[1], substeps=2).gain("z_sprung")))


def test_slopes_are_those_of_differences() -> None:
    derived, at, h = jax.jit(jax.value_and_grad(response)), np.array([60.0, 0.01]), np.array([1e-3, 1e-6])
    differences = [float(derived(at + step)[0] - derived(at - step)[0]) / (2 * step.max()) for step in np.diag(h)]
    np.testing.assert_allclose(derived(at)[1], differences, rtol=1e-5)


@pytest.mark.slow
def test_derivatives_are_those_of_differences() -> None:
    """Reverse, forward and second ones, by friction and amplitude."""
    # One program: value and reverse slopes, and along each axis the forward slope and the change of the reverse ones.
    derived = jax.jit(
        lambda at: jax.vmap(lambda axis: jax.jvp(jax.value_and_grad(response), (at,), (axis,)))(jnp.eye(2))
    )
    at, h = np.array([60.0, 0.01]), np.array([1e-3, 1e-6])
    (_, reverse), (forward, bend) = derived(at)
    ahead, behind = ([derived(at + sign * step)[0] for step in np.diag(h)] for sign in (1.0, -1.0))
    differences = [float(a[0][0] - b[0][0]) / (2 * size) for a, b, size in zip(ahead, behind, h, strict=True)]
    np.testing.assert_allclose(reverse[0], differences, rtol=1e-5)
    np.testing.assert_allclose(forward, reverse[0], rtol=1e-9)
    np.testing.assert_allclose(bend[0], (ahead[0][1][0] - behind[0][1][0]) / (2 * h[0]), rtol=1e-4)


def test_what_is_not_steady_is_not_a_number() -> None:
    """A motion that grows is marked as unstable; arguments that mean nothing are refused."""
    frequency = np.array([0.9, 1.2])
    push = dampers.Scaled(Linear(2.0), -1.0, allow_active=True)
    growing = harmonic_response(oscillator(CubicSpring(10.0, 0.0) + push), [8.0], 0.01, substeps=4)
    assert set(growing.status) == {Status.UNSTABLE}
    assert "unstable" in growing.warnings[0]
    away = oscillator(CubicSpring(-400.0, 0.0) + push)  # it leaves its well
    lost = harmonic_response(away, [3.18], 2.0, substeps=4)
    assert lost.status == (Status.NOT_STEADY,)
    assert not lost.converged
    assert np.isnan(np.asarray(lost.gain("stroke"))).all()
    with pytest.raises(ValueError, match="amplitude"):
        harmonic_response(FRICTION, frequency, [0.01, 0.02, 0.03])
    with pytest.raises(ValueError, match="amplitude"):
        harmonic_response(FRICTION, frequency, 0.0)
    with pytest.raises(ValueError, match="speed"):
        harmonic_response(half_car_002(), frequency, 0.01)
    with pytest.raises(ValueError, match="substeps"):
        jax.jit(lambda a: harmonic_response(quarter_car_000(Linear(a)), frequency, 0.01).cycles)(1000.0)


LAWS: dict[str, Any] = {
    "friction": FRICTION,
    "hysteresis": quarter_car_000(dampers.BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)),
    "blow-off": quarter_car_000(dampers.Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.7) * 0.2),
    "bump stop": QuarterCar(
        300.0, 40.0, 20e3, 180e3, Linear(800.0), bump_stop=dampers.BumpStop(clearance=0.03, stiffness=5e4)
    ),
    "series spring": quarter_car_000(dampers.SeriesSpring(Linear(1500.0), 2e5)),
    "gas spring": QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(800.0), extra_spring=dampers.GasSpring(2e6, 6e-5, 1e-4)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_as_after_two_hundred_cycles(name: str) -> None:
    """Of a simulation from rest, at a frequency near the resonance of the body."""
    car, frequency, amplitude = LAWS[name], 1.25, 0.02
    result = harmonic_response(car, [frequency], amplitude)
    dt = 1.0 / frequency / 1024
    road = roads.sine(amplitude, frequency=frequency)
    response = simulate(car, road, duration=200.0 / frequency, dt=dt)
    for channel in ("z_sprung", "sprung_acceleration", "stroke", "dynamic_tyre_load"):
        last = np.asarray(response[channel])[-1025:-1:4]
        np.testing.assert_allclose(result[channel][0], last, atol=0.01 * np.abs(last).max(), err_msg=channel)

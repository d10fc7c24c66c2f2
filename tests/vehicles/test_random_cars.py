"""Random cars on random roads against equations written by hand and integrated by SciPy."""

import numpy as np
import pytest
import scipy.integrate
from hypothesis import HealthCheck, Phase, given, settings, strategies as st

from jaxdamp import roads, simulate
from jaxdamp.parameters import replace
from jaxdamp.vehicles.presets import half_car_002

from .fleet import bumps, full_quarter_car


pytestmark = pytest.mark.slow

GRAVITY = 9.80665
TIME = np.linspace(0.0, 0.4, 1601)  # steps of 0.25 ms
QUARTER, HALF = full_quarter_car(), half_car_002()
DRAWN = settings(
    max_examples=50,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def between(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def bump(height, start, width):
    def at(t):
        s = np.clip((t - start) / width, 0.0, 1.0)
        return 0.5 * height * (1 - np.cos(2 * np.pi * s)), np.pi * height / width * np.sin(2 * np.pi * s)

    return at


def integrated(field, size):
    solved = scipy.integrate.solve_ivp(
        field, (0.0, TIME[-1]), np.zeros(size), "DOP853", TIME, rtol=1e-10, atol=1e-12, max_step=5e-3
    )
    assert solved.success
    return solved.y.T


def close(found, exact, share):
    """Every coordinate within a share of the largest of its kind: the scheme is of second order in 0.25 ms."""
    half = exact.shape[1] // 2
    for part in (slice(0, half), slice(half, None)):
        np.testing.assert_allclose(found[:, part], exact[:, part], rtol=0, atol=share * np.abs(exact[:, part]).max())


def softplus(u, width):
    return width * np.logaddexp(0.0, u / width)


def contact(penetration_of, width):
    share = np.clip(penetration_of / width, 0.0, 1.0)
    return share * (penetration_of - 0.5 * width * share), share


@DRAWN
@given(
    masses=st.tuples(between(200, 600), between(25, 60)),
    rates=st.tuples(between(1e4, 4e4), between(1.2e5, 2.5e5), between(0.0, 300.0)),
    damper=st.tuples(between(800, 3500), between(400, 2500)),
    friction=st.tuples(between(5.0, 150.0), between(0.02, 0.1)),
    spring=st.tuples(between(-5e4, 0.0), between(0.0, 4e6)),
    stop=st.tuples(between(0.02, 0.06), between(1e4, 6e4), between(0.0, 1e7), between(0.0, 300.0)),
    road=st.tuples(between(0.005, 0.07) | between(-0.07, -0.005), between(0.1, 0.3)),
)
def test_quarter_cars_with_everything(masses, rates, damper, friction, spring, stop, road):
    (ms, mu), (k, kt, ct), (cr, cc), (fc, vf) = masses, rates, damper, friction
    (k2, k3), (gap, s1, s3, sc), (height, width) = spring, stop, road
    under, weight = bump(height, 0.03, width), (ms + mu) * GRAVITY

    def push(outward, speed):
        d, gate = contact(outward - gap, 1e-3)
        return max((s1 + s3 * d * d) * d + sc * gate * speed, 0.0)

    def field(t, y):
        z, slope = under(t)
        x, v = y[0] - y[1], y[2] - y[3]
        smooth = 0.5 * (cr + cc) * v + 0.5 * (cr - cc) * (np.sqrt(v * v + 0.02**2) - 0.02)
        force = k * x + k2 * x**2 + k3 * x**3 + smooth + fc * np.tanh(v / vf) + push(x, v) - push(-x, -v)
        linear = kt * (y[1] - z) + ct * (y[3] - slope)
        tyre = weight - softplus(weight - linear, 0.01 * weight)
        return [y[2], y[3], -force / ms, (force - tyre) / mu]

    car = replace(
        QUARTER,
        {
            "sprung_mass": ms,
            "unsprung_mass": mu,
            "spring_rate": k,
            "tyre_stiffness": kt,
            "tyre_damping": ct,
            "damper.rebound_rate": cr,
            "damper.compression_rate": cc,
            "friction.friction_force": fc,
            "friction.friction_velocity": vf,
            "extra_spring.quadratic_stiffness": k2,
            "extra_spring.cubic_stiffness": k3,
            "bump_stop.clearance": gap,
            "bump_stop.stiffness": s1,
            "bump_stop.cubic_stiffness": s3,
            "bump_stop.damping": sc,
        },
    )
    run = simulate(car, roads.cosine_bump(height, start=0.03, duration=width), duration=0.4, dt=2.5e-4)
    close(np.asarray(run.motion), integrated(field, 4), 2e-3)


@settings(DRAWN, max_examples=12)
@given(
    body=st.tuples(between(400, 900), between(500, 2000), between(0.8, 1.6), between(0.8, 1.6)),
    damping=between(500, 3000),
    rates=st.tuples(between(1.5e4, 4e4), between(1.5e5, 2.5e5)),
    road=st.tuples(between(0.01, 0.06), between(0.1, 0.3), between(0.02, 0.15)),
)
def test_half_cars_with_a_delay(body, damping, rates, road):
    (m, j, ahead, behind), (k, kt), (height, width, delay) = body, rates, road
    front, rear = bump(height, 0.03, width), bump(height, 0.03 + delay, width)

    def field(t, y):
        f, r = (
            k * (y[0] + x * y[1] - y[2 + i]) + damping * (y[4] + x * y[5] - y[6 + i])
            for i, x in enumerate((ahead, -behind))
        )
        tyres = [kt * (y[2 + i] - end(t)[0]) for i, end in enumerate((front, rear))]
        wheels = [(f - tyres[0]) / 40.0, (r - tyres[1]) / 40.0]
        return [*y[4:], -(f + r) / m, (-ahead * f + behind * r) / j, *wheels]

    values = {"sprung_mass": m, "pitch_inertia": j, "front_distance": ahead, "rear_distance": behind}
    for end in ("front", "rear"):
        values |= {f"{end}.spring_rate": k, f"{end}.tyre_stiffness": kt, f"{end}.damper.rate": damping}
    heights = bumps([0.03, 0.03 + delay], count=TIME.size, height=height, width=width, dt=2.5e-4)
    run = simulate(replace(HALF, values), roads.from_profile(TIME, heights), dt=2.5e-4)
    close(np.asarray(run.motion), integrated(field, 8), 1e-3)

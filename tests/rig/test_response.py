import warnings

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import AbstractStateful, Bilinear, Dahl, Lag, Linear, PiecewiseLinear, SeriesSpring
from jaxdamp.rig import StartsInMotionWarning, quasi_static
from jaxdamp.simulation import Adaptive, Exponential


W = 2 * np.pi * 8.0


def sine(dt, duration=0.25):
    t = np.arange(round(duration / dt) + 1) * dt
    return t, 0.01 * (1 - np.cos(W * t)), 0.01 * W * np.sin(W * t)


def test_memoryless_law():
    t, x, v = sine(1e-3)
    force = respond(Bilinear(2600.0, 1200.0), t, x, v)
    np.testing.assert_allclose(force, np.where(v > 0, 2600.0, 1200.0) * v, rtol=1e-13)


def test_velocity_from_the_stroke():
    t, x, v = sine(1e-4)
    force = respond(Linear(2000.0), t, x)
    np.testing.assert_allclose(force[1:-1], 2000.0 * v[1:-1], atol=1e-2)


@pytest.mark.parametrize(
    "law",
    [
        Lag(Bilinear(2600.0, 1200.0, 0.02), 0.004),
        pytest.param(SeriesSpring(Bilinear(2600.0, 1200.0, 0.02), 4e5, 1e9), marks=pytest.mark.slow),
        pytest.param(Lag(Linear(1500.0), 0.01) + SeriesSpring(Linear(800.0), 1e5), marks=pytest.mark.slow),
    ],
)
def test_against_an_independent_solver(law):
    t, x, v = sine(1e-3)
    rate = eqx.filter_jit(law.state_rate)
    exact = solve_ivp(
        lambda t, y: np.asarray(
            rate(jnp.asarray(0.01 * (1 - np.cos(W * t))), jnp.asarray(0.01 * W * np.sin(W * t)), jnp.asarray(y))
        ),
        (0.0, t[-1]),
        np.asarray(law.initial_state()),
        "LSODA",
        t,
        rtol=1e-10,
        atol=1e-13,
    )
    expected = jax.jit(jax.vmap(law.force))(jnp.asarray(x), jnp.asarray(v), jnp.asarray(exact.y.T))
    size = np.max(np.abs(expected))
    errors = [np.max(np.abs(respond(law, t, x, v, substeps=n) - expected)) / size for n in (1, 2, 4)]
    assert errors[0] < 2e-3
    np.testing.assert_allclose([errors[0] / errors[1], errors[1] / errors[2]], 4.0, rtol=0.3)


def test_substeps_change_nothing_without_states():
    t, x, v = sine(1e-3)
    law = PiecewiseLinear([-0.1, 0.1], [500.0, 2000.0, 800.0])
    np.testing.assert_array_equal(respond(law, t, x, v, substeps=4), respond(law, t, x, v))


@pytest.mark.parametrize("length", [2, 3, 4, 5, 6])
def test_short_records(length):
    t, x, v = (a[:length] for a in sine(1e-3))
    assert respond(Lag(Linear(2000.0), 0.004), t, x, v, substeps=3).shape == (length,)


HYSTERETIC = Lag(Bilinear(2600.0, 1200.0), 0.004) + Dahl(4e4, 40.0)


def test_a_record_in_pieces_is_the_whole_record():
    t, x, v = sine(1e-3)
    whole, last = respond(HYSTERETIC, t, x, v, return_state=True)
    first, state = respond(HYSTERETIC, t[:101], x[:101], v[:101], return_state=True)
    second, end = respond(HYSTERETIC, t[100:], x[100:], v[100:], state=state, return_state=True)
    size = np.max(np.abs(whole))
    np.testing.assert_allclose(np.concatenate([first, second[1:]]), whole, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(end, last, rtol=1e-10)
    force, none = respond(Linear(2.0), t, x, v, return_state=True)
    assert none.shape == (0,) and force.shape == t.shape


def test_a_record_that_begins_in_motion_is_named_and_two_starts_mend_it():
    t, x, v = sine(1e-3)
    settled = respond(HYSTERETIC, t, x, v)[125 + 30 :]  # in the second cycle
    moving = t[30:126] - t[30], x[30:126], v[30:126]
    with pytest.warns(StartsInMotionWarning, match=r"begins at 0.5\d* m/s, but the states of Sum start at rest"):
        at_rest = respond(HYSTERETIC, *moving)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        respond(Linear(2.0), *moving)  # has no states
        respond(HYSTERETIC, t, x, v)  # begins at rest
        np.testing.assert_array_equal(respond(HYSTERETIC, *moving, state=HYSTERETIC.initial_state()), at_rest)
        held = quasi_static(HYSTERETIC, moving[2][:1])
        _, after = respond(HYSTERETIC, t[:156], x[:156], v[:156], return_state=True)
        forces = [respond(HYSTERETIC, *moving, state=state) for state in (after, held.states[0])]
    cycle, held, rest = (np.max(np.abs(force - settled)) / np.max(settled) for force in (*forces, at_rest))
    assert cycle < 1e-9 and held < 0.2 and rest > 0.5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"state": np.zeros(3)}, r"`state` must have the shape \(2,\) for Sum, but is of shape \(3,\)"),
        ({"state": np.array([np.nan, 0.0])}, "`state` must be finite"),
        ({"state": np.zeros(2), "engine": Exponential()}, "`state` must be left out beside an engine"),
        ({"return_state": True, "engine": Exponential()}, "`return_state` must be left out beside an engine"),
    ],
)
def test_states_that_cannot_be_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        respond(HYSTERETIC, *sine(1e-3), **options)


def test_inside_compiled_and_batched_functions():
    t, x, v = sine(1e-3)

    def peak(rate):
        return jnp.max(respond(Lag(Linear(rate), 0.004), t, x, v))

    rates = jnp.array([1000.0, 2000.0])
    np.testing.assert_allclose(jax.jit(jax.vmap(peak))(rates), [peak(r) for r in rates], rtol=1e-12)


def test_time_in_single_precision():
    t = np.arange(20_000, dtype=np.float32) * np.float32(1e-3)
    x = np.zeros_like(t)
    law = jax.tree.map(lambda a: a.astype(jnp.float32), Linear(2.0))
    assert respond(law, jnp.asarray(t), jnp.asarray(x), jnp.asarray(x)).dtype == jnp.float32


def test_times_of_day_in_single_precision():
    t, x, v = sine(1e-3)
    with jax.enable_x64(False):
        law = Lag(Linear(1500.0), 0.01)
        np.testing.assert_array_equal(respond(law, t + 1.7e9, x, v), respond(law, (t + 1.7e9) - 1.7e9, x, v))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stroke": np.zeros(5)}, r"`stroke` must be as long as `time`, two or more, but is of shape \(5,\) for time"),
        ({"time": np.zeros(1), "stroke": np.zeros(1)}, "`stroke` must be as long as `time`, two or more"),
        ({"velocity": np.zeros(3)}, r"`velocity` must be as long as `time`, but is of shape \(3,\)"),
        ({"stroke": np.array([0.0, np.nan, 0.0, 0.0])}, "`stroke` must be finite.*Remove or interpolate the missing"),
        ({"velocity": np.array([0.0, np.inf, 0.0, 0.0])}, "`velocity` must be finite"),
        (
            {"time": np.array([0.0, 0.1, 0.3, 0.4])},
            r"`time` must increase in equal steps, but is stepping from 0\.1 to",
        ),
        ({"time": np.array([0.3, 0.2, 0.1, 0.0])}, "Resample the record to a uniform rate"),
        ({"time": np.zeros(4)}, "`time` must increase"),
        ({"substeps": 0}, "`substeps` must be 1 or more, but is 0"),
    ],
)
def test_refusals(change, message):
    arguments = {"time": np.linspace(0.0, 0.3, 4), "stroke": np.zeros(4), "velocity": np.zeros(4)} | change
    lengths = {np.shape(arguments[name]) for name in ("time", "stroke", "velocity")}
    with pytest.raises((ValueError, TypeError), match=message if len(lengths) == 1 else None):
        respond(Linear(1.0), **arguments)


# ---- solvers of diffrax


def test_a_solver_finds_the_same_force():
    t, x, v = sine(1e-3)
    law = Lag(Linear(1500.0), 0.01) + SeriesSpring(Bilinear(2600.0, 1200.0, 0.02), 4e5)
    found = respond(law, t, x, v, engine=Adaptive(diffrax.Kvaerno5(), 1e-9, 1e-12))
    fine = np.asarray(respond(law, t, x, v, engine=Exponential(substeps=16)))
    np.testing.assert_array_equal(fine, respond(law, t, x, v, substeps=16))
    np.testing.assert_allclose(found, fine, atol=1e-4 * np.max(np.abs(fine)))


def test_a_solver_is_not_needed_without_states():
    t, x, v = sine(1e-3)
    solved = respond(Bilinear(2600.0, 1200.0), t, x, v, engine=Adaptive())
    np.testing.assert_array_equal(solved, respond(Bilinear(2600.0, 1200.0), t, x, v))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (lambda: {"engine": Adaptive(), "substeps": 2}, "`substeps` must be left out beside an engine"),
        (lambda: {"engine": Adaptive(rtol=0.0)}, "`rtol` must be positive"),
        (lambda: {"engine": Adaptive(atol=-1.0)}, "`atol` must be positive"),
        (lambda: {"engine": Adaptive("Tsit5")}, "`solver` must be a solver of diffrax, but is"),  # type: ignore[arg-type]
        (lambda: {"engine": Exponential(dt=1e-3)}, "`engine` must have no step of its own on the rig"),
        (
            lambda: {"engine": Adaptive()},
            r"`engine` must reach the end, but is one with Tsit5, which says: .*maximum number.*Kvaerno5",
        ),
    ],
)
def test_an_engine_that_cannot_work_says_so(options, message):
    t, x, v = (a[:3] for a in sine(1e-3))
    with pytest.raises(ValueError, match=message):
        respond(Lag(Linear(1.0), 1e-9), t, x, v, **options())


# ---- constant velocity


@pytest.mark.parametrize(
    "law",
    [
        Bilinear(2600.0, 1200.0),
        Lag(Bilinear(2600.0, 1200.0), 0.5),
        SeriesSpring(Bilinear(2600.0, 1200.0), 1e4),
        Lag(SeriesSpring(Bilinear(1300.0, 600.0), 1e6), 0.004) + Bilinear(1300.0, 600.0),
    ],
)
def test_settled_force_is_the_curve_without_hysteresis(law):
    v = np.array([-0.6, -0.1, 0.0, 0.2, 1.0])
    np.testing.assert_allclose(quasi_static(law, v).force, np.where(v > 0, 2600.0, 1200.0) * v, rtol=1e-6, atol=1e-9)


def test_each_velocity_is_judged_by_itself():
    """A bristle slides off after about σ/(σ₀ v) seconds: far too long where the motion is slowest."""
    law = Dahl(stiffness=2e5, friction_force=200.0) + Linear(1000.0)
    v = np.array([-0.1, -1e-6, 0.0, 1e-6, 1e-3, 0.1])
    curve = quasi_static(law, v)
    assert curve.settled.tolist() == [True, False, True, False, True, True]
    expected = np.where(curve.settled, 1000.0 * v + 200.0 * np.sign(v), np.nan)
    np.testing.assert_allclose(curve.force, expected, rtol=1e-4)
    assert curve.note.startswith("No force at 2 of 6 velocities, at -1e-06 and at 1e-06 m/s: the force still")


def test_a_law_that_never_settles_has_no_curve_and_says_so_in_words():
    curve = quasi_static(Lag(Linear(1000.0), lag_time=1e3), np.linspace(-0.5, 0.5, 400))
    assert not curve.settled.any() and np.isnan(curve.force).all()
    assert "No force at 400 of 400 velocities, from -0.5 to 0.5 m/s" in curve.note and len(curve.note) < 200


class _RunsAway(AbstractStateful):
    """Grows without end above 0.5 m/s, and needs minutes to settle below."""

    def initial_state(self):
        return jnp.zeros(1)

    def force(self, x, v, state):
        return 1000.0 * state[0]

    def state_rate(self, x, v, state):
        return jnp.where(v > 0.5, 1.0 + 0.3 * state, 0.01 * (v - state))


def test_a_point_that_runs_away_does_not_settle_the_others():
    """The tolerance is relative to settled forces: a force that grows without end must not excuse slow ones."""
    assert not quasi_static(_RunsAway(), np.array([0.1, 1.0])).settled.any()


@pytest.mark.parametrize(("v", "message"), [(np.zeros(0), "one or more"), (np.array([0.0, np.nan]), "be finite")])
def test_quasi_static_refuses(v, message):
    with pytest.raises(ValueError, match=message):
        quasi_static(Linear(1000.0), v)

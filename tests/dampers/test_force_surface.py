"""Surfaces over stroke and velocity: NumPy's Chebyshev series, recovery from data, what is refused outside them."""

import re
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import chebyshev

from jaxdamp import respond, simulate
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import ForceSurface, Lag, Linear
from jaxdamp.export import from_json, to_json
from jaxdamp.identify import fit
from jaxdamp.rig import quasi_static
from jaxdamp.roads import cosine_bump
from jaxdamp.vehicles.presets import quarter_car_000

from .cars import simulated_and_integrated
from .single_precision import single_precision_error


STROKE, VELOCITY = (-0.03, 0.05), (-0.8, 0.6)
COVERED = r"ForceSurface is valid for x from -0\.03 to 0\.05 m, v from -0\.8 to 0\.6 m/s.*`?outside=\"hold\"`?"


def surface(outside="nan", **settings):
    coefficients = np.random.default_rng(2).normal(0.0, 300.0, (4, 5))
    return ForceSurface(coefficients, STROKE, VELOCITY, outside=outside, **settings)


def forces(law, x, v):
    return np.asarray(jax.jit(jax.vmap(law.force_stroke_velocity))(jnp.asarray(x), jnp.asarray(v)))


def analytic(x, v):
    return 2000.0 * v + 4e4 * x * v**2 - 800.0 * v**3 + 3000.0 * x


def multisine(seed=1, duration=8.0):
    """Stroke and velocity of four sines of frequencies without a common measure."""
    t, rng = np.arange(0.0, duration, 2e-3), np.random.default_rng(seed)
    x, v = np.zeros(t.size), np.zeros(t.size)
    for amplitude, frequency in ((0.02, 0.7), (0.01, 1.9), (0.008, 4.3), (0.004, 7.1)):
        angle = 2 * np.pi * frequency * t + rng.uniform(0, 2 * np.pi)
        x, v = x + amplitude * np.sin(angle), v + 2 * np.pi * frequency * amplitude * np.cos(angle)
    return t, x, v


def single_sine():
    t = np.arange(4000) * 1e-3
    return 0.02 * np.sin(12.0 * t), 0.24 * np.cos(12.0 * t)


def test_equals_numpy(rng):
    law = surface()
    x, v = rng.uniform(*STROKE, 300), rng.uniform(*VELOCITY, 300)
    expected = chebyshev.chebval2d((x - 0.01) / 0.04, (v + 0.1) / 0.7, np.asarray(law.coefficients))
    np.testing.assert_allclose(forces(law, x, v), expected, atol=1e-11 * np.abs(expected).max())
    flat = ForceSurface([[250.0]], STROKE, VELOCITY)
    np.testing.assert_allclose(forces(flat, x, v), 250.0)


def test_recovers_an_analytic_surface():
    _, x, v = multisine()
    law = ForceSurface.guess(v, analytic(x, v), x, degrees=(2, 4))
    assert np.allclose(law.stroke_range, [x.min() - 0.01 * np.ptp(x), x.max() + 0.01 * np.ptp(x)])
    grid = np.meshgrid(np.linspace(x.min(), x.max(), 20), np.linspace(v.min(), v.max(), 20))
    x, v = (a.ravel() for a in grid)
    np.testing.assert_allclose(forces(law, x, v), analytic(x, v), atol=1e-7)


def test_noise_is_averaged():
    _, x, v = multisine()
    noise = 20.0 * np.random.default_rng(5).standard_normal(x.size)
    law = ForceSurface.guess(v, analytic(x, v) + noise, x, degrees=(3, 5))
    # 24 coefficients on 4000 samples leave 20 N · √(24/4000) = 1.5 N
    assert np.sqrt(np.mean((forces(law, x, v) - analytic(x, v)) ** 2)) < 2.0


def test_single_sine_is_rank_deficient():
    x, v = single_sine()
    clean, noise = analytic(x, v), 5.0 * np.random.default_rng(6).standard_normal(x.size)
    with pytest.warns(
        np.exceptions.RankWarning, match="do not determine 8 of 24 combinations .* are on one ellipse. Add records"
    ):
        law = ForceSurface.guess(v, clean + noise, x, degrees=(3, 5))
    assert np.sqrt(np.mean((forces(law, x, v) - clean) ** 2)) < 1.0
    assert np.max(np.abs(law.coefficients)) < np.max(np.abs(clean))
    with pytest.warns(np.exceptions.RankWarning):
        unridged = ForceSurface.guess(v, clean + noise, x, degrees=(3, 5), ridge=0.0)
    assert np.max(np.abs(unridged.coefficients)) < np.max(np.abs(clean))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, x, v = multisine()
        ForceSurface.guess(v, analytic(x, v), x, degrees=(3, 5))


def test_a_ridge_draws_the_coefficients_to_zero():
    _, x, v = multisine()
    laws = [ForceSurface.guess(v, analytic(x, v), x, (1, 2), ridge=ridge) for ridge in (0, 1e-4, 1e-2, 1)]
    assert np.all(np.diff([float(np.linalg.norm(law.coefficients)) for law in laws]) < 0)
    # the same by rows of its own for the ridge of 0.01, which is 0.1 of the largest singular value
    law = laws[2]
    u, w = ((2 * a - r.sum()) / np.ptp(r) for a, r in ((x, law.stroke_range), (v, law.velocity_range)))
    basis = chebyshev.chebvander2d(u, w, (1, 2))
    rows = 0.1 * np.linalg.norm(basis, 2) * np.eye(6)
    target = np.concatenate([analytic(x, v), np.zeros(6)])
    expected = np.linalg.lstsq(np.concatenate([basis, rows]), target, rcond=None)[0]
    np.testing.assert_allclose(np.ravel(law.coefficients), expected, rtol=1e-8, atol=1e-8)


def test_cross_validation_beats_no_ridge_where_data_are_thin():
    x, v = single_sine()
    x = x + 2e-4 * np.random.default_rng(3).standard_normal(x.size)  # noise of the stroke hides the missing rank
    noisy = analytic(x, v) + 200.0 * np.random.default_rng(4).standard_normal(x.size)
    beside = np.linspace(0.3, 0.9, 7)
    errors = []
    for ridge in (None, 0.0):
        with pytest.warns(np.exceptions.RankWarning):
            law = ForceSurface.guess(v, noisy, x, degrees=(4, 5), ridge=ridge)
        errors.append(
            np.max(np.abs(forces(law, 0.02 * beside, 0.24 * beside) - analytic(0.02 * beside, 0.24 * beside)))
        )
    assert errors[0] < 0.5 * errors[1]


# ---- outside the data


@pytest.mark.parametrize(("x", "v"), [(0.051, 0.0), (-0.031, 0.1), (0.0, 0.61), (0.0, -0.81)])
def test_outside_is_refused_at_once_where_known_and_nan_in_compiled_code(x, v):
    law = surface()
    name = "x" if v in (0.0, 0.1) else "v"
    with pytest.raises(
        ValueError, match=rf"`{name}` must lie inside the data, {name} from .* but is .*outside=\"hold\""
    ):
        law.force(x, v, law.initial_state())
    assert np.isnan(forces(law, [x], [v])).all()
    assert np.all(np.isfinite(forces(law, [STROKE[0], STROKE[1]], [VELOCITY[0], VELOCITY[1]])))


@pytest.mark.slow
def test_everything_that_runs_it_refuses_in_words():
    law, t = surface(), np.arange(500) / 500
    with pytest.raises(ValueError, match="`law` must give a finite force over the whole motion.* samples. " + COVERED):
        respond(law, t, 0.06 * np.sin(9 * t), 0.54 * np.cos(9 * t))
    curve = quasi_static(law, np.array([0.0, 0.7]))
    assert curve.settled.tolist() == [True, False]
    assert re.search("No force at 1 of 2 velocities, at 0.7 m/s: .* no finite force. " + COVERED, curve.note)
    with pytest.raises(ValueError, match="`vehicle` must have a finite response.*" + COVERED):
        simulate(quarter_car_000(0.1 * law + Linear(100.0)), cosine_bump(0.3, start=0.02, duration=0.1), duration=0.5)
    with pytest.raises(ValueError, match="`vehicle` must have a static equilibrium.*" + COVERED):
        simulate(quarter_car_000(5.0 * law), cosine_bump(0.3, start=0.02, duration=0.1), duration=0.5)
    with pytest.raises(ValueError, match="`law` must give a finite force over the whole programme.*" + COVERED):
        VirtualDyno(law).run(SineTest(amplitude=0.06, frequency=2.0))
    run = BenchRun.from_arrays("wide", t, 0.06 * np.sin(9 * t), 800 * np.cos(9 * t), 0.54 * np.cos(9 * t))
    with pytest.raises(ValueError, match="`law` must give finite forces and derivatives.*" + COVERED):
        fit(law, run)
    narrow = BenchRun.from_arrays("narrow", t, 0.02 * np.sin(9 * t), 800 * np.cos(9 * t), 0.18 * np.cos(9 * t))
    result = fit(ForceSurface([[0.0, 1000.0]], STROKE, VELOCITY), narrow)
    with pytest.raises(ValueError, match="`law` must give a finite force over the record 'wide'.*" + COVERED):
        result.score([run])


def test_held_outside_with_consent():
    law, inside = surface("hold", outside_rate=700.0), surface()
    at_edge = forces(inside, [0.05, 0.02, -0.03], [0.1, 0.6, -0.8])
    np.testing.assert_allclose(
        forces(law, [0.9, 0.02, -3.0], [0.1, 1.6, -1.8]), at_edge + np.array([0.0, 700.0, -700.0]), rtol=1e-12
    )
    x, v = np.linspace(-0.03, 0.05, 30), np.linspace(-0.8, 0.6, 30)
    np.testing.assert_allclose(forces(law, x, v), forces(inside, x, v), atol=1e-9)
    assert float(law.force(0.9, 0.1, law.initial_state())) == pytest.approx(at_edge[0])
    assert repr(from_json(to_json(law))) == repr(law) and "outside='hold'" in repr(law)
    run = simulate(
        quarter_car_000(Linear(1500.0) + 0.1 * law), cosine_bump(0.3, start=0.02, duration=0.1), duration=0.5
    )
    assert np.max(np.abs(run["stroke"])) > 0.05


def test_guess_takes_the_rate_outside_from_the_data():
    _, x, v = multisine()
    force = analytic(x, v)
    law = ForceSurface.guess(v, force, x, outside="hold")
    assert float(law.outside_rate) == pytest.approx(float(force @ v / (v @ v)))
    assert float(ForceSurface.guess(v, -force, x).outside_rate) == 0.0


@pytest.mark.exhaustive
def test_quarter_car():
    law = ForceSurface([[0.0, 900.0], [0.0, 200.0]], (-0.06, 0.06), (-1.0, 1.0))
    found, expected = simulated_and_integrated(
        law, lambda x, v: 900.0 * v + 200.0 * x / 0.06 * v, amplitude=0.015, frequency=1.5
    )
    assert np.ptp(expected) > 0.03
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_single_precision():
    coefficients = surface().coefficients.tolist()
    assert single_precision_error(lambda: ForceSurface(coefficients, STROKE, VELOCITY)) < 1e-5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 2.0], STROKE, VELOCITY), "`coefficients` must have a row and a column for each degree"),
        (([[1.0]], (0.1, 0.1), VELOCITY), r"`ForceSurface\.stroke_range` must be a low and a high end"),
        (([[1.0]], STROKE, (0.1, 0.3)), r"`ForceSurface\.velocity_range` must be a low and a high end with zero"),
        (([[1.0]], STROKE, VELOCITY, -1.0), r"`ForceSurface\.outside_rate` must be not negative"),
        (([[1.0]], STROKE, VELOCITY, 0.0, "held"), "`outside` must be one of 'nan', 'hold'.*Did you mean 'hold'"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ValueError, match=message):
        ForceSurface(*arguments)


def test_refusals_of_guess():
    x, v = single_sine()
    with pytest.raises(ValueError, match="`degrees` must be two whole numbers"):
        ForceSurface.guess(v, 1000.0 * v, x, degrees=(-1, 2))
    with pytest.raises(ValueError, match="`ridge` must be finite and not negative"):
        ForceSurface.guess(v, 1000.0 * v, x, ridge=-1.0)
    with pytest.raises(ValueError, match="`force` must have at least 5041 samples"):
        ForceSurface.guess(v, 1000.0 * v, x, degrees=(70, 70))
    with pytest.raises(ValueError, match=r"`stroke` must vary, but is 0\.01 throughout"):
        ForceSurface.guess(v, 1000.0 * v, np.full(x.size, 0.01))


def test_a_lag_around_it_stays_refusing():
    law, t = Lag(surface(), 0.01), np.arange(500) / 500
    with pytest.raises(ValueError, match=COVERED):
        respond(law, t, 0.06 * np.sin(9 * t), 0.54 * np.cos(9 * t))

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from jaxdamp.dampers import Bilinear, Lag, Linear, StrokeDependent, Table
from jaxdamp.parameters import parameters

from .cars import simulated_and_integrated
from .motions import last_cycle, work


STROKE = [-0.08, -0.03, 0.0, 0.02, 0.07]
VELOCITY = [-1.0, -0.3, -0.05, 0.0, 0.1, 0.4, 1.2]


def _grid():
    x, v = np.array(STROKE)[:, None], np.array(VELOCITY)
    return (1.0 + 80.0 * x * x + 3.0 * x) * (900.0 * np.tanh(5.0 * v) + 500.0 * v)


def _forces(law, x, v):
    forces = jax.vmap(lambda law, x, v: law.force(x, v, law.initial_state()), in_axes=(None, 0, 0))
    return jax.jit(forces)(law, jnp.asarray(x), jnp.asarray(v))


def test_bilinear_interpolation_on_a_grid(rng):
    x, v = rng.uniform(-0.08, 0.07, 500), rng.uniform(-1.0, 1.2, 500)
    expected = RegularGridInterpolator((STROKE, VELOCITY), _grid())(np.stack([x, v], axis=1))
    np.testing.assert_allclose(_forces(StrokeDependent.from_grid(STROKE, VELOCITY, _grid()), x, v), expected, rtol=1e-9)


def test_beyond_the_grid():
    law, grid = StrokeDependent.from_grid(STROKE, VELOCITY, _grid()), _grid()
    np.testing.assert_allclose(_forces(law, [-0.5, 0.5], [0.1, 0.1]), [grid[0, 4], grid[-1, 4]], rtol=1e-11)
    slope = (grid[2, -1] - grid[2, -2]) / 0.8
    np.testing.assert_allclose(_forces(law, [0.0], [2.2]), [grid[2, -1] + slope], rtol=1e-11)


def test_laws_of_one_kind_and_of_several_agree():
    cold, warm = Linear(900.0), Linear(2000.0)
    same = StrokeDependent((cold, warm), [-0.01, 0.02])
    mixed = StrokeDependent((cold, Table([-1.0, 1.0], [-2000.0, 2000.0])), [-0.01, 0.02])
    x, v = np.linspace(-0.03, 0.04, 15), np.linspace(-1.5, 1.5, 15)
    np.testing.assert_allclose(_forces(same, x, v), _forces(mixed, x, v), rtol=1e-11, atol=1e-9)
    assert [p.path for p in parameters(same)] == ["laws.0.rate", "laws.1.rate"]


def test_one_law_holds_everywhere():
    np.testing.assert_allclose(_forces(StrokeDependent((Linear(900.0),), [0.0]), [-1.0, 1.0], [0.5, 0.5]), 450.0)


def test_hydraulic_stop():
    law = Bilinear(2000.0, 1000.0)
    stop = StrokeDependent((3.0 * law, law), [-0.06, -0.04])
    found = _forces(stop, [-0.1, -0.06, -0.045, -0.04, 0.03], [-1.0, -1.0, -1.0, 0.5, 0.5])
    np.testing.assert_allclose(found, [-3000.0, -3000.0, -1500.0, 1000.0, 1000.0], rtol=1e-12)


@pytest.fixture
def shock(data):
    """The front shock of a HMMWV: other slopes where the length is below that at which the bump zone begins."""
    published = json.loads((data / "damper_curves" / "chrono_damper_curves.json").read_text())["HMMWV_piecewise_Nspm"]
    front = published["front"]
    middle, inner = Bilinear(front["ms_reb"], front["ms_comp"]), Bilinear(front["bump_reb"], front["bump_comp"])
    at_rest = 0.36  # m, length at stroke zero
    border = published["bump_engage_len_m"][0] - at_rest
    return StrokeDependent((inner, middle), [border - 5e-4, border + 5e-4])


def test_shock_with_a_bump_zone(shock):
    # lengths 310, 324.104 and 350 mm, 0.5 m/s each way; the figures are the published slopes halved, and their mean
    x = np.array([0.310, 0.324104, 0.350]) - 0.36
    rebound, compression = _forces(shock, x, np.full(3, 0.5)), _forces(shock, x, np.full(3, -0.5))
    np.testing.assert_allclose(rebound, [30034.2522, 20632.1302, 11230.0083], atol=0.01)
    np.testing.assert_allclose(compression, [-2948.2603, -4604.5223, -6260.7844], atol=0.01)


def test_work_of_the_shock(shock):
    # sine about stroke zero of 60 mm: inner slopes where sin < -35.896/60, outer elsewhere
    frequency, amplitude, border = 1.0, 0.06, 0.324104 - 0.36
    w, start = 2 * np.pi * frequency, np.arcsin(-border / amplitude)
    # ∫ c X² ω cos² over the phases inside the zone: from -π/2 - (π/2 - start) to -start
    inside = 0.5 * (np.pi / 2 - start) - 0.25 * np.sin(2 * start)
    outside = np.pi / 2 - inside
    slopes = (60068.504405 + 5896.52053445) * inside + (22460.01658875 + 12521.5687025) * outside
    _, v, force = last_cycle(shock, frequency, amplitude, cycles=1)
    np.testing.assert_allclose(work(frequency, v, force), slopes * w * amplitude**2, rtol=1e-3)


@pytest.mark.slow
def test_quarter_car():
    law = StrokeDependent((Linear(4000.0), Linear(1000.0), Linear(2500.0)), [-0.03, 0.0, 0.02])

    def force(x, v):
        return np.interp(x, [-0.03, 0.0, 0.02], [4000.0, 1000.0, 2500.0]) * v

    found, expected = simulated_and_integrated(law, force, amplitude=0.03, frequency=1.5)
    assert np.ptp(expected) > 0.05
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_single_precision():
    with jax.enable_x64(False):
        law = StrokeDependent.from_grid(STROKE, VELOCITY, _grid().tolist())
        slopes = jax.value_and_grad(lambda x, v: law.force(x, v, law.initial_state()), argnums=(0, 1))
        x, v = np.meshgrid(np.array([*STROKE, 1e3], np.float32), np.array([*VELOCITY, -1e3], np.float32))
        found = jax.jit(jax.vmap(slopes))(x.ravel(), v.ravel())
    assert found[0].dtype == jnp.float32
    assert all(np.all(np.isfinite(a)) for a in jax.tree.leaves(found))


@pytest.mark.parametrize(
    ("laws", "stroke", "message"),
    [
        ((Linear(1.0), Linear(2.0)), [0.0], r"`stroke` must contain one stroke for each law"),
        ((), [], r"`stroke` must contain one stroke for each law"),
        ((Linear(1.0), Linear(2.0)), [0.1, 0.0], r"`StrokeDependent\.stroke` must be strictly increasing"),
        (
            (Linear(1.0), Lag(Linear(2.0), 0.01)),
            [0.0, 0.1],
            r"`laws\[1\]` must be without states, but is a Lag",
        ),
    ],
)
def test_refusals(laws, stroke, message):
    with pytest.raises(ValueError, match=message):
        StrokeDependent(laws, stroke)


def test_a_grid_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"`force` must have one row for each stroke"):
        StrokeDependent.from_grid([0.0, 0.1], [-1.0, 1.0], [[-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])

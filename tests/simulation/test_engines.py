"""Engines: what a caller chooses, which derivatives pass, and how vectors lie in memory."""

from typing import Any, cast, final

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, configuration, dampers, metrics, roads, simulate, sweep
from jaxdamp._vectors import MemoryLayout
from jaxdamp.simulation import AbstractFixedStep, AbstractStepper, Adaptive, Equations, Exponential
from jaxdamp.simulation.equations import RoadInput
from jaxdamp.simulation.fixed_step import _over
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000


pytestmark = pytest.mark.users_flags

BUMP = roads.cosine_bump(0.05, start=0.02, duration=0.1)
CAR = quarter_car_000(dampers.Lag(dampers.Linear(2500.0), 0.004))
RMS = "rms_sprung_acceleration"


@final
class TwoStep(AbstractStepper):
    """Adams-Bashforth of second order, which remembers the rates of the step before."""

    equations: Equations
    dt: jax.Array

    def _rates(self, now, begin, end):
        return self.equations.rates(now.motion, now.states, begin._replace(rate=(end.height - begin.height) / self.dt))

    def start(self, motion, road):
        now = self.equations.at_rest(motion, road)
        return now._replace(memory=self._rates(now, road, road))

    def __call__(self, now, begin, end):
        rates = self._rates(now, begin, end)
        before, y = now.memory, (now.motion, now.states)
        motion, states = jax.tree.map(lambda y, a, b: y + self.dt * (1.5 * a - 0.5 * b), y, rates, before)
        return self.equations.at(motion, states, end, memory=rates)


@final
class AdamsBashforth(AbstractFixedStep):
    substeps: int = 1

    @property
    def derivatives(self):
        return ("forward",)

    @property
    def spacing(self):
        return 2e-3

    @property
    def step_count(self):
        return self.substeps

    def stepper(self, equations, dt):
        return TwoStep(equations, dt)


# ---- what a caller chooses


def test_a_step_of_the_engine_is_the_spacing_of_the_instants():
    asked, own = simulate(CAR, BUMP, duration=0.1, dt=2e-3), simulate(CAR, BUMP, duration=0.1, engine=Exponential(2e-3))
    np.testing.assert_array_equal(asked.motion, own.motion)
    assert Ride(CAR, BUMP, duration=0.1, engine=Exponential(2e-3, 3)).substeps == 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"engine": Exponential(dt=1e-3), "dt": 2e-3}, r"`dt` must be left out, or be that of the engine, 0\.001 s"),
        ({"engine": Exponential(), "substeps": 2}, r"`substeps` must be left out beside an engine.*Exponential\("),
    ],
)
def test_refusals(options, message):
    for drive in (simulate, Ride):
        with pytest.raises(ValueError, match=message):
            drive(CAR, BUMP, duration=0.1, **options)


def test_engines_refuse_what_they_cannot_be():
    with pytest.raises(ValueError, match=r"`solver` must be a solver of diffrax.*Kvaerno5"):
        Adaptive("Tsit5")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="`substeps` must be a whole number, 1 or more, but is 0"):
        Exponential(substeps=0)
    with pytest.raises(ValueError, match="`engine` must not be given on a white road"):
        Ride(CAR, roads.white("C", 20.0), engine=Exponential())


class Seen:
    """Steps that note the road, the last four of them."""

    dt = np.asarray(1e-3)

    def __call__(self, now, begin, end):
        return jnp.concatenate([now[1:], jnp.stack([begin.height, end.height, begin.rate, end.rate])[None]])


def test_the_road_and_its_rate_are_straight_over_the_steps_between_two_instants():
    ends = np.array([0.02, -0.3]), np.array([0.05, 0.7])
    begin, end = (RoadInput(*map(jnp.asarray, one)) for one in ends)
    seen = cast(Any, _over)(Seen(), jnp.zeros((4, 4)), begin, end, 4)
    height, rate = np.linspace(*ends, 5).T
    np.testing.assert_allclose(seen, np.stack([height[:-1], height[1:], rate[:-1], rate[1:]], axis=1), rtol=1e-12)


# ---- rides


@pytest.mark.slow
def test_a_ride_by_the_adaptive_engine_is_its_run():
    """Windows, weightings, gathered terms and whole records, of two axles."""
    road = roads.delayed(BUMP, positions=[0.0, 0.2], speed=20.0)
    wanted = [
        RMS,
        "weighted_rms_sprung_acceleration",
        metrics.Metric("pitch", metrics.percentile(80), window=(0.02, 0.06)),
    ]
    found = Ride(half_car_002(), road, metrics=wanted, duration=0.08, engine=Adaptive(rtol=1e-6))()
    expected = simulate(half_car_002(), road, duration=0.08, engine=Adaptive(rtol=1e-6)).metrics(wanted)
    assert list(found) == list(expected)
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-9, err_msg=name)


@pytest.mark.slow
def test_an_engine_of_ones_own_with_a_memory_converges_in_a_run_and_a_ride():
    exact = simulate(CAR, BUMP, duration=0.1, dt=2e-3, engine=Adaptive())
    engines = [AdamsBashforth(substeps) for substeps in (8, 16)]
    runs = [simulate(CAR, BUMP, duration=0.1, engine=engine) for engine in engines]
    coarse, fine = (np.max(np.abs(run["stroke"] - exact["stroke"])) for run in runs)
    assert runs[0].time.size == 51 and 3.0 < coarse / fine < 5.0
    ride = Ride(CAR, BUMP, metrics=[RMS], duration=0.1, engine=engines[0])
    rms = float(runs[0].metrics([RMS])[RMS])
    assert float(ride()[RMS]) == pytest.approx(rms, rel=1e-12)
    drive = jax.jit(jax.vmap(lambda rate: ride.side_by_side()({"rate": rate})[RMS]))
    assert float(drive(jnp.array([1500.0, 2500.0]))[1]) == pytest.approx(rms, rel=1e-12)
    with pytest.raises(ValueError, match=r"`gradients` must be a mode that passes through Ride of a QuarterCar.*Adams"):
        sweep(ride, {"rate": [1500.0]}, gradients="reverse")


# ---- derivatives


def level(engine):
    ride = Ride(CAR, BUMP, metrics=[RMS], duration=0.05, engine=engine)
    return lambda rate: ride({"rate": rate})[RMS]


def test_derivatives_that_do_not_pass_are_named_with_the_remedy():
    with pytest.raises(ValueError, match=r"Adaptive.*reverse.*mode='reverse'.*Exponential"):
        jax.grad(level(Adaptive()))(2500.0)
    with pytest.raises(TypeError, match=r"Adaptive\(.*passes no forward derivatives.*jax\.grad.*Exponential"):
        jax.jacfwd(level(Adaptive(mode="reverse")))(2500.0)
    ride = Ride(CAR, BUMP, metrics=[RMS], duration=0.05, engine=Adaptive(mode="reverse"))
    with pytest.raises(
        ValueError, match=r"`gradients` must be left out for Ride.*Adaptive.*mode='reverse'.*Exponential"
    ):
        sweep(ride, {"rate": [1500.0]}, gradients=True)


@pytest.mark.slow
def test_derivatives_of_both_engines_and_differences_agree():
    forward = float(jax.jit(jax.jacfwd(level(Adaptive())))(2500.0))
    assert float(jax.jit(jax.grad(level(Adaptive(mode="reverse"))))(2500.0)) == pytest.approx(forward, rel=1e-8)
    exponential = level(Exponential(substeps=4))
    for mode in (jax.jacfwd, jax.grad):
        assert float(jax.jit(mode(exponential))(2500.0)) == pytest.approx(forward, rel=1e-4)
    drive = jax.jit(level(Adaptive(rtol=1e-11, atol=1e-13)))
    difference = (drive(2550.0) - drive(2450.0)) / 100.0
    assert forward == pytest.approx(float(difference), rel=1e-5)
    ride = Ride(CAR, BUMP, metrics=[RMS], duration=0.05, engine=Adaptive())
    axes = {"rate": [2500.0], "sprung_mass": [1200.0], "lag_time": [0.004]}  # so many that reverse would be cheaper
    data = sweep(ride, axes, gradients=True)
    assert float(data[f"d_{RMS}"].values.ravel()[0]) == pytest.approx(forward, rel=1e-8)


# ---- memory


def test_the_layout_is_chosen_when_a_ride_is_made_whatever_the_environment_says_later(monkeypatch):
    ride = Ride(CAR, BUMP, metrics=[RMS], duration=0.05)
    small = MemoryLayout.SCALARS if configuration.target().fused_loops else MemoryLayout.ARRAY
    assert (ride.layout, ride.side_by_side().layout) == (small, MemoryLayout.LANES)
    before = configuration.target()
    monkeypatch.setenv("XLA_FLAGS", "" if before.fused_loops else "xla_cpu_small_while_loop_byte_threshold=16777216")
    assert configuration.target() == before
    assert Ride(CAR, BUMP, metrics=[RMS], duration=0.05).layout is ride.layout
    adaptive = Ride(CAR, BUMP, metrics=[RMS], duration=0.05, engine=Adaptive())
    assert adaptive.side_by_side().layout is MemoryLayout.ARRAY


def test_all_layouts_give_the_same_ride():
    values = []
    for layout in MemoryLayout:
        ride = Ride(CAR, BUMP, metrics=[RMS, "working_space_rms"], duration=0.05)
        object.__setattr__(ride, "layout", layout)
        values.append(list(ride().values()))
    np.testing.assert_allclose(values[1:], [values[0]] * 2, rtol=1e-9, atol=1e-12)

"""A second call compiles nothing, with other numbers of the same kind."""

import functools
from typing import Any

import jax
import numpy as np
import pytest
from diffrax import Tsit5

from jaxdamp import Ride, bench, identify, respond, roads, simulate, sweep, tune
from jaxdamp.bench import BenchSet, SineTest
from jaxdamp.dampers import Bilinear, BoucWen, Lag, Linear, PiecewiseLinear, Spring
from jaxdamp.rig import Rig
from jaxdamp.simulation import Adaptive, Exponential
from jaxdamp.vehicles import frequency_response, spectral_rms
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000


COMPILED = "/jax/core/compile/backend_compile_duration"
compilations: list[str] = []


def _note(event: str, duration_secs: float, **kwargs: str | int) -> None:
    del duration_secs, kwargs
    if event == COMPILED:
        compilations.append(event)


@pytest.fixture(scope="module", autouse=True)
def counted():
    ride()
    jax.monitoring.register_event_duration_secs_listener(_note)


def in_calls(call, arguments):
    """How many programs each of several calls compiled."""
    counts = []
    for argument in arguments:
        before = len(compilations)
        jax.block_until_ready(call(argument))
        counts.append(len(compilations) - before)
    return counts


def swept(rate):
    ride = Ride(quarter_car_000(Bilinear(rate, 900.0)), BUMP, duration=0.05, metrics=["rms_sprung_acceleration"])
    return sweep(ride, {"rebound_rate": [rate, 2.0 * rate]}, gradients=True)["rms_sprung_acceleration"].values


BUMP = roads.cosine_bump(0.03, start=0.0, duration=0.03)
ROAD = roads.delayed(BUMP, positions=[0.0, 0.2], speed=20.0)
TIME = 1e-3 * np.arange(101)


@functools.cache  # made before calls are counted, and not while tests are collected
def ride() -> Ride:
    return Ride(quarter_car_000(Bilinear(1500.0, 900.0)), BUMP, duration=0.05, metrics=["rms_sprung_acceleration"])


CALLS = {
    "simulate": lambda rate: simulate(half_car_002(Lag(Bilinear(rate, 900.0), 4e-3)), ROAD, duration=0.05).motion,
    "Ride": lambda rate: Ride(half_car_002(Lag(Bilinear(rate, 900.0), 4e-3)), ROAD, duration=0.05)(),
    "respond": lambda rate: respond(
        BoucWen(rate, 0.0, 300.0, 1e-3) + Spring(rate), TIME, 1e-5 * rate * np.sin(30 * TIME)
    ),
    "simulate by an engine": lambda rate: (
        simulate(quarter_car_000(Bilinear(rate, 900.0)), BUMP, duration=0.05, engine=Exponential(1e-3, 2)).motion
    ),
    "simulate by a solver": lambda rate: (
        simulate(
            quarter_car_000(Bilinear(rate, 900.0)), BUMP, duration=0.05, engine=Adaptive(Tsit5(), rtol=1e-4)
        ).motion
    ),
    "Ride by a solver": lambda rate: Ride(
        quarter_car_000(Bilinear(rate, 900.0)), BUMP, duration=0.05, metrics=["working_space_rms"], engine=Adaptive()
    )(),
    "respond by a solver": lambda rate: respond(
        Lag(Bilinear(rate, 900.0), 4e-3), TIME, 1e-5 * rate * np.sin(30 * TIME), engine=Adaptive()
    ),
    "a ride called with numbers": lambda rate: ride()({"rebound_rate": rate, "sprung_mass": int(rate) // 5}),
    "sweep": swept,
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in ("sweep", "respond by a solver"))) for name in CALLS],
)
@pytest.mark.exhaustive_cases("Ride by a solver", "simulate by a solver", "simulate by an engine")
def test_of_a_law_with_other_numbers(name):
    first, *others = in_calls(CALLS[name], [1500.0, 1700.0, 1900.0])
    assert first > 0 and others == [0, 0]


def test_of_a_record_that_goes_on_from_a_state():
    law, stroke = BoucWen(1500.0, 0.0, 300.0, 1e-3) + Spring(1500.0), 0.01 * (1.0 - np.cos(30.0 * TIME))
    _, goes_on = in_calls(lambda state: respond(law, TIME, stroke, state=state), [None, np.array([1e-4])])
    assert goes_on == 0


def test_of_a_sweep_of_few_points_with_options_of_its_own(monkeypatch):
    monkeypatch.delenv("XLA_FLAGS")  # which states those of all tests
    first, second = in_calls(swept, [1400.0, 1600.0])
    assert first > 0 and second == 0


OF_A_LENGTH = {
    "respond": (2, lambda count: respond(Bilinear(1500.0, 900.0), 1e-3 * np.arange(count), np.zeros(count))),
    "frequency response": (1, lambda count: frequency_response(half_car_002(), np.arange(float(count)), speed=20.0)),
    "spectral RMS": (
        1,
        lambda count: spectral_rms(half_car_002(), np.arange(float(count)), np.ones(count), speed=20.0),
    ),
    "road of waves": (3, lambda count: roads.iso8608("C", 20.0, seed=1, length=100.0 * count).phase),
    "filtered road": (4, lambda count: roads.iso8608_filtered("C", 20.0, seed=1, length=1.0 * count).samples),
}


def test_numbers_of_a_law_are_converted_by_no_program():
    laws = [
        lambda r: PiecewiseLinear([-0.1, 0.2], [r, 3, 9e2]),
        lambda r: PiecewiseLinear((0.1, 0.2, 0.3), (r, 4, 5, 6)),
    ]
    assert [in_calls(law, [1500.0]) for law in laws] == [[0], [0]]


@pytest.mark.parametrize("name", OF_A_LENGTH)
def test_of_another_length_compiles_few_programs(name):
    most, call = OF_A_LENGTH[name]
    _, other = in_calls(call, [31, 37])
    assert 0 < other <= most


STARTS: dict[str, dict[str, Any]] = {
    "alone": {},
    "on a machine": {"rig": Rig(gas_force=-50.0, force_delay=1e-3)},
    "warming up": {"rig": Rig(temperature_slope=1e-3, heating=1e-3), "freeze": ["temperature_slope"]},
}


@pytest.mark.parametrize("machine", STARTS)
def test_of_a_fit_of_other_records(machine):
    def runs(rate: float) -> BenchSet:
        dyno = bench.VirtualDyno(Bilinear(rate, 900.0), sampling_rate=200.0, force_noise=5.0, gas_force=-100.0)
        return dyno.run([SineTest(0.01, 2.0)])

    def fit(records: BenchSet) -> float:
        return identify.fit(Bilinear, records, **STARTS[machine]).parameters[0].value

    made = [runs(rate) for rate in (1500.0, 1700.0, 1900.0)]
    first, *others = in_calls(fit, made)
    assert (first > 0) == (machine == "warming up") and others == [0, 0]  # all else is C


@pytest.mark.parametrize("machine", STARTS)
def test_of_fits_of_other_dampers(machine):
    def dampers(rate: float) -> dict[str, BenchSet]:
        laws = {f"{rate + 50.0 * i:g}": Bilinear(rate + 50.0 * i, 900.0) for i in range(round(rate / 500.0))}
        dynos = {name: bench.VirtualDyno(law, sampling_rate=200.0, force_noise=5.0) for name, law in laws.items()}
        return {name: dyno.run([SineTest(0.01, 2.0)]) for name, dyno in dynos.items()}

    start, options = Bilinear(1800.0, 1200.0), STARTS[machine]
    made = [dampers(rate) for rate in (1500.0, 1700.0, 2300.0)]  # three, three and five of them
    first, *others = in_calls(lambda records: identify.fit_many(start, records, **options).values, made)
    assert first <= (machine == "warming up") and others == [0, 0]  # all else is C


BOUNCE = roads.white("C", 20.0)
TUNINGS: dict[str, Any] = {
    "minimise": lambda rate: tune.minimise(
        "rms_sprung_acceleration", quarter_car_000(Bilinear(rate, 900.0)), BOUNCE,
        limits={"rms_dynamic_tyre_load": rate}, shape=tune.slope(1.0, 9.0 * rate), max_steps=2,
    ),
    "pareto": lambda rate: tune.pareto(
        ["rms_sprung_acceleration", "rms_dynamic_tyre_load"], quarter_car_000(Linear(rate)), BOUNCE, points=3,
        limits={"working_space_rms": 1e-5 * rate},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", [pytest.param("minimise", marks=pytest.mark.slow), "pareto"])
def test_of_a_tuning_from_other_numbers(name):
    first, *others = in_calls(lambda rate: TUNINGS[name](rate).before, [1500.0, 1700.0])
    assert first > 0 and others == [0]

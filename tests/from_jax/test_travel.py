"""Everything travels: pickled or copied, a thing is equal, has the same structure, and compiles nothing anew."""

import copy
import pickle
from typing import Any

import diffrax
import equinox as eqx
import jax
import numpy as np
import pytest

from jaxdamp import Ride, bench, identify, metrics, parameters, respond, roads, simulate
from jaxdamp.dampers import Bilinear, Linear, Spring, with_fitted_range
from jaxdamp.simulation import Adaptive, Exponential
from jaxdamp.vehicles import AbstractVehicle, presets


TIME = 2e-3 * np.arange(251)
RUN = bench.BenchRun(
    name="sine",
    time=TIME,
    stroke=0.01 * (1.0 - np.cos(12.0 * TIME)),
    velocity=0.12 * np.sin(12.0 * TIME),
    force=180.0 * np.sin(12.0 * TIME) + 3.0 * np.sin(301.0 * TIME),
)
BUMP = roads.cosine_bump(0.03, start=0.0, duration=0.03)
PEAKS = ["rms_sprung_acceleration", metrics.Metric("stroke", metrics.percentile(90))]


def shipped(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


def ride() -> Ride:
    return Ride(presets.quarter_car_000(Bilinear(1500.0, 900.0)), BUMP, duration=0.05, metrics=PEAKS)


def cars() -> dict[str, Any]:
    made = {name: make for name, make in vars(presets).items() if getattr(make, "__module__", "") == presets.__name__}
    return {name: make() for name, make in made.items() if not name.startswith("_")}


ROADS = {
    "bump": BUMP,
    "delayed": roads.delayed(BUMP, positions=[0.0, 2.0], speed=20.0),
    "superposed": roads.superposed(BUMP, BUMP),
    "profile": roads.from_profile(np.arange(3.0), np.array([0.0, 0.01, 0.0]), speed=10.0),
    "random": roads.iso8608("C", speed=20.0, duration=0.5, seed=0),
    "filtered": roads.iso8608_filtered("C", speed=20.0, duration=0.5, seed=0),
    "white": roads.white("C", speed=20.0),
}
THINGS = {
    "ride": ride,
    "ride on a white road": lambda: Ride(presets.quarter_car_000(), ROADS["white"]),
    "response": lambda: simulate(presets.quarter_car_000(Linear(1500.0)), BUMP, duration=0.05),
    "metrics": lambda: ride()(),
    "engine": lambda: Exponential(1e-3, 2),
    "engine of diffrax": lambda: Adaptive(diffrax.Kvaerno5()),
    "problem": lambda: identify.prepare(Linear(1000.0) + Spring(10.0), [RUN]),
    "free parameters": lambda: parameters.free_parameters(presets.half_car_002(), bounds={"*.rate": (10.0, 1e6)}),
    "fit": lambda: identify.fit(Linear(1000.0) + Spring(10.0), [RUN]),
    "comparison": lambda: identify.compare({"linear": Linear(1000.0)}, [RUN]),
    "fits of several dampers": lambda: identify.fit_many(Linear(1000.0), [[RUN], [RUN]]),
    "record": lambda: RUN,
}


def require_same(thing: Any, again: Any, name: str) -> None:
    """One structure, the same numbers to the last bit."""
    assert type(again) is type(thing), name
    structures = jax.tree.structure(thing), jax.tree.structure(again)
    opaque = not isinstance(thing, tuple | eqx.Module)  # a leaf by itself: a result, a record
    assert opaque or (structures[0] == structures[1] and hash(structures[0]) == hash(structures[1])), name
    assert contents(thing) == contents(again), name


def contents(thing: Any) -> Any:
    """The numbers and words of a thing, results and records by their fields."""
    if isinstance(thing, jax.Array | np.ndarray):
        numbers = np.asarray(thing)
        return (str(numbers.dtype), numbers.shape, numbers.tobytes())
    if isinstance(thing, list | tuple):
        return [contents(item) for item in thing]
    if isinstance(thing, dict):
        return {key: contents(item) for key, item in thing.items()}
    if type(thing).__module__.startswith("jaxdamp") and hasattr(thing, "__dict__"):
        return contents(vars(thing))
    return type(thing) if isinstance(thing, eqx.Module) else repr(thing)


def test_every_preset_and_every_kind_of_road_travels():
    presets_of_cars = cars()
    assert len(presets_of_cars) > 5 and all(isinstance(car, AbstractVehicle) for car in presets_of_cars.values())
    for name, thing in (presets_of_cars | ROADS).items():
        for again in (shipped(thing), copy.deepcopy(thing)):
            require_same(thing, again, name)


@pytest.mark.parametrize("name", THINGS)
def test_problems_rides_engines_and_results_travel(name):
    thing = THINGS[name]()
    for again in (shipped(thing), copy.deepcopy(thing)):
        require_same(thing, again, name)


def test_statistics_and_bounds_are_the_same_object_or_equal_after_the_journey():
    for statistic in (*metrics.STATISTICS.values(), metrics.percentile(90)):
        assert shipped(statistic) == statistic and hash(shipped(statistic)) == hash(statistic)
    for domain in (parameters.real, parameters.positive, parameters.interval(1.0, 2.0), parameters.increasing):
        assert shipped(domain) is domain and copy.deepcopy(domain) is domain


def test_what_has_travelled_compiles_nothing_anew():
    compiled: list[str] = []

    def note(event: str, duration_secs: float, **kwargs: str | int) -> None:
        del duration_secs, kwargs
        compiled.extend([event] * (event == "/jax/core/compile/backend_compile_duration"))

    home, law = ride(), with_fitted_range(Linear(1000.0) + Spring(10.0), velocity=(-1.0, 1.0))
    problem = identify.prepare(law, [RUN])
    calls = {
        "ride": lambda thing: thing({"damper.rebound_rate": 1600.0}),
        "respond": lambda thing: respond(thing, TIME, RUN.stroke, RUN.velocity),
        "simulate": lambda thing: simulate(thing.vehicle, BUMP, duration=0.05).motion,
        "solve": lambda thing: identify.solve(thing).best.values,
    }
    things = {"ride": home, "respond": law, "simulate": home, "solve": problem}
    first = {name: call(things[name]) for name, call in calls.items()}
    travelled = {name: shipped(thing) for name, thing in things.items()}
    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        second = {name: call(travelled[name]) for name, call in calls.items()}
    finally:
        jax.monitoring.unregister_event_duration_listener(note)
    assert compiled == []
    assert contents(jax.tree.leaves(first)) == contents(jax.tree.leaves(second))

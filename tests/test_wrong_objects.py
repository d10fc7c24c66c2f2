"""Wrong objects in wrong places: every refusal names the argument, what came, and what to write.

The calls run in a process of their own, as users make them: without the type checker that the tests switch on.
"""

import json
import os
import subprocess
import sys

import pytest


PREPARE = """
import json, sys
import diffrax
import numpy as np
import jaxdamp
from jaxdamp import bench, dampers, export, identify, metrics, plots
from jaxdamp import respond, Ride, roads, simulate, sweep, tune, vehicles

car = vehicles.presets.quarter_car_000()
road = roads.iso8608("C", speed=20.0, seed=1)
law = dampers.Linear(1500.0)
time = np.arange(2000) / 1000
stroke = 0.02 * np.sin(12 * time)
run = bench.BenchRun.from_arrays("run", time, stroke, 1500 * 0.24 * np.cos(12 * time))
runs = bench.BenchSet([run])
answers = {}
for call in json.loads(sys.stdin.read()):
    try:
        answers[call] = "accepted: " + repr(eval(call))[:80]
    except Exception as error:
        kind = "ValueError" if isinstance(error, ValueError) else type(error).__name__
        answers[call] = f"{kind}: {error}"
print(json.dumps(answers))
"""

ANSWERS = {  # call: words that its refusal holds
    "tune.Scenarios(road)": ("`roads` must be roads by name, or a sequence", "around one road"),
    "tune.Scenarios([3.0])": ("`roads['road 1']`", "3.0"),
    "tune.Scenarios([road], [{'rate': 1.0}])": ("`conditions['condition 1']` must be a `tune.Condition",),
    "tune.Scenarios([road], tune.Condition())": ("`conditions` must be conditions by name", "around one condition"),
    "tune.minimise('rms_sprung_acceleration', car, road, limits=['rms_stroke'])": (
        "`limits` must be a mapping of metrics",
    ),
    "tune.minimise('comfort', car, road, limits={'working_space_rms': 'low'})": (
        "`limits['working_space_rms']`",
        "Write 0.1",
    ),
    "tune.minimise('working_space_rms', car, road, shape=['monotone'])": ("`shape` must be made by `tune.slope`",),
    "tune.Targets({'rms_stroke': 1.0})": ("`targets['rms_stroke']` must be a value and a positive tolerance",),
    "tune.sensitivity(3.0, car, road)": ("`metric` must be metrics by name",),
    "tune.sensitivity('working_space_rms', road, car)": ("`vehicle` must be a vehicle",),
    "tune.sensitivity('working_space_rms', car, road, quantities={'speed': 1.0})": (
        "`road` must be a function of speed",
    ),
    "simulate(road, car)": ("`vehicle` must be a vehicle", "is an Iso8608", "`simulate(vehicle, road)`"),
    "simulate(car, road, duration=1.0, engine='adaptive')": ("`engine` must be an engine", "'adaptive'", "Adaptive()`"),
    "Ride(car, road, duration=1.0, engine=jaxdamp.simulation.Exponential)": ("`engine` must be", "Exponential(...)`"),
    "respond(law, time, stroke, engine=diffrax.Tsit5())": ("`engine` must be an engine", "Tsit5", "Adaptive()`"),
    "jaxdamp.simulation.Adaptive(mode='both')": ("`mode` must be one of", "'both'"),
    "simulate(car, 'iso:C')": ("`road` must be a road", "'iso:C'", "roads.iso8608("),
    "simulate(car, road, duration='10')": ("`duration` must be a number", "the text '10'"),
    "Ride(road, car)": ("`vehicle` must be a vehicle", "`Ride(vehicle, road)`"),
    "respond(time, law, stroke)": ("`law` must be a damper law", "an array of shape (2000,)", "respond(law, time"),
    "respond(dampers.Linear, time, stroke)": ("`law` must be a damper law", "the class Linear", "`Linear(...)`"),
    "jaxdamp.testing.check_law(dampers.Linear)": ("`law` must be a damper law", "the class Linear", "`Linear(...)`"),
    "vehicles.presets.quarter_car_000(1500.0)": ("`QuarterCar.damper` must be a damper law", "dampers.Linear(1500.0)"),
    "vehicles.presets.half_car_002(car)": ("`Corner.damper` must be a damper law", "is a QuarterCar"),
    "vehicles.presets.truck_001(damper=1000.0)": ("`Corner.damper` must be a damper law", "dampers.Linear(1000.0)"),
    "vehicles.HalfCar(500.0, 800.0, 1.0, 1.0, law, law)": ("`HalfCar.front` must be a Corner", "is a Linear"),
    "vehicles.QuarterCar(300.0, 40.0, 2e4, 2e5, law, bump_stop=3)": ("`QuarterCar.bump_stop` must be a damper law",),
    "vehicles.modes(road)": ("`vehicle` must be a vehicle", "is an Iso8608"),
    "vehicles.stationary_rms(law)": ("`vehicle` must be a vehicle", "is a Linear"),
    "vehicles.static_equilibrium(law)": ("`vehicle` must be a vehicle", "`static_equilibrium(vehicle)`"),
    "roads.delayed(car, delays=[0.0, 1.0])": ("`road` must be a road", "is a QuarterCar"),
    "dampers.Linear([1.0, 2.0])": ("`Linear.rate` must be one number", "an array of shape (2,)", "jax.vmap"),
    "dampers.Linear('1500')": ("`rate` must be a number", "the text '1500'"),
    "dampers.Linear(None)": ("`rate` must be a number", "None"),
    "dampers.Linear(law)": ("`rate` must be a number", "is a Linear"),
    "dampers.Lag(0.004, law)": ("`lag_time` must be a number", "is a Linear"),
    "dampers.Lag(dampers.Linear, 0.004)": ("`Lag.law` must be a damper law", "Make one of it: `Linear(...)`"),
    "dampers.Scheduled(law, [0.0, 1.0], 0.5)": ("`Scheduled.laws` must be a tuple", "is a Linear"),
    "dampers.Polynomial(5.0)": ("`coefficients` must",),
    "dampers.Besinger(1600.0, [4200.0], 900.0, 0.13, 0.05)": (
        "`Besinger.rebound_rate` must be one number",
        "shape (1,)",
    ),
    "dampers.with_command(1.0, 2.0)": ("`law` must be a damper law", "`with_command(law, command)`"),
    "law * '2'": ("`factor` must be a number", "the text '2'"),
    "-2.0 * law": ("`factor` must not be negative", "Scaled(law, factor, allow_active=True)"),
    "identify.fit(runs, law)": ("`runs` must be a record or records", "is a Linear", "`fit(law, runs)`"),
    "identify.fit('besinger', runs)": ("`law` must be a law", "Write `dampers.Besinger`"),
    "identify.fit('bouc_wen', runs)": ("`law` must be a law", "Write `dampers.BoucWen`"),
    "identify.fit('besinger_lag', runs)": ("`law` must be a law", "default_ladder(runs, ['besinger_lag'])"),
    "identify.fit(law, 'a.csv')": ("`runs` must be a record or records", "the text 'a.csv'", "bench.read(paths)"),
    "identify.fit(law, runs, rig=['gas_force'])": ("`rig` must be one of", "'gas'", "but is 'gas_force'"),
    "identify.fit_many(law, runs[0])": ("`dampers` must be the records of each damper", "fit_many(law, {"),
    "identify.fit(law, [time])": ("`runs[0]` must be a record", "BenchRun.from_arrays"),
    "identify.fit(vehicles.QuarterCar, runs)": ("`law` must be a law", "the class QuarterCar"),
    "identify.compare(['linear'], runs)": ("`laws` must be laws by name", "default_ladder(runs, ['linear'])"),
    "identify.compare({'a': 'linear'}, runs)": ("`laws['a']` must be a law", "Write `dampers.Linear`"),
    "identify.compare(runs, {'a': law})": ("`laws` must be laws by name", "is a BenchSet", "`compare(laws, runs)`"),
    "identify.compare({'a': law}, runs, held_out='b')": ("`held_out` must be a record or records",),
    "identify.fit(law, runs, tie=['rate'])": ("`tie` must be a mapping of names to names", "tie={'front.damper.**'"),
    "identify.fit(law, runs, tie={'rate': ['rate']})": ("`tie` must be a mapping of names to names",),
    "identify.fit(law, runs, bounds=[1, 2])": ("`bounds` must be a mapping of names to limits", "[1, 2]", "Write"),
    "identify.fit(law, runs, bounds='rate')": ("`bounds` must be a mapping of names to limits", "'rate'"),
    "identify.fit(law, runs, priors=[1, 2])": ("`priors` must be a mapping of names to means", "[1, 2]", "Write"),
    "identify.fit(law, runs, priors={'rate': ('a', 'b')})": ("`priors['rate']` must be a mean", "('a', 'b')"),
    "identify.fit(law, runs, tie=3.0)": ("`tie` must be a mapping of names to names", "3.0"),
    "identify.fit(law, runs, loss=None)": ("`loss` must be one of 'squares'", "is None"),
    "identify.fit(law, runs, initial_state=time)": ("`initial_state` must be one of", "an array of shape (2000,)"),
    "identify.fit(law, runs, samples_per_cycle=1.5)": ("`samples_per_cycle` must be a whole number", "1.5"),
    "identify.fit(law, runs, max_steps=time)": ("`max_steps` must be a whole number", "an array of shape (2000,)"),
    "identify.fit_many(law, {'a': runs}, priors=law)": ("`priors` must be a mapping of names to means",),
    "identify.compare({'a': law}, runs, bounds=[1, 2])": ("`bounds` must be a mapping of names to limits",),
    "identify.compare({'a': law}, runs, priors={1: (1.0, 2.0)})": ("`priors` must be a mapping of names to means",),
    "identify.fit_vehicle(car, [], bounds=[1, 2])": ("`bounds` must be a mapping of names to limits",),
    "identify.fit_targets(dict, {'a': 1.0}, {'a': 2.0}, bounds={'a': 1.0})": ("`bounds['a']` must be two finite",),
    "identify.train(law, runs, held_out=runs, tie=['rate'])": ("`tie` must be a mapping of names to names",),
    "tune.minimise('comfort', car, road, bounds={1: (1.0, 2.0)})": ("`bounds` must be a mapping of parameters",),
    "identify.cross_validate([law], runs)": ("`laws` must be laws by name", "`cross_validate(laws, runs)`"),
    "identify.train(runs, law, held_out=runs)": ("`runs` must be a record or records", "is a Linear"),
    "identify.default_ladder(runs, ['linaer'])": ("`law` must be one of", "Did you mean 'linear'?"),
    "identify.default_ladder('a.csv')": ("`runs` must be a record or records", "bench.read(paths)"),
    "tune.minimise(car, 'rms', road)": ("`metric` must be", "is a QuarterCar", "`minimise(metric, vehicle, road)`"),
    "Ride(car, road, metrics=metrics.Metric('stroke', 'rms'))": ("`metrics` must be a list", "`metrics=[metric]`"),
    "tune.minimise('rms_sprung_acceleration', road, car)": ("`vehicle` must be a vehicle", "is an Iso8608"),
    "sweep({'damper.rate': [1.0]}, lambda point: point)": ("`function` must be a function", "`sweep(function, over)`"),
    "sweep(lambda p: {'y': p['a']}, {'a': [1.0]}, summary={'y': 3})": (
        "`summary` must say what is kept",
        "sweeps.Summary",
    ),
    "bench.VirtualDyno(1500.0)": ("`law` must be a damper law", "dampers.Linear(1500.0)"),
    "bench.VirtualDyno(law, rig=law)": ("`rig` must be a Rig", "is a Linear", "VirtualDyno(law, rig=Rig("),
    "bench.VirtualDyno(law, sensors=5.0)": ("`sensors` must be sensors", "bench.Sensors(force_noise=5.0)"),
    "bench.VirtualDyno(law).run([1.0])": ("`tests[0]` must be a test", "bench.SineTest("),
    "bench.BenchSet([law])": ("`runs[0]` must be a record", "is a Linear"),
    "export.to_json(1500.0)": ("`module` must be a law, a vehicle",),
    "export.to_csv(1500.0, 'law.csv', [0.0, 1.0])": ("`law` must be a damper law", "to_csv(law, path, velocities)"),
    "export.to_c(1500.0, 'law.c')": ("`law` must be a damper law", "to_c(law, path)"),
    "export.to_fmu(1500.0, 'law.fmu')": ("`law` must be a damper law", "to_fmu(law, path)"),
    "export.to_explorer(1500.0, 'law.html')": ("`law` must be a damper law", "to_explorer(law, path)"),
    "export.to_adams(1500.0, 'a.dpr', [0.0, 1.0])": ("`law` must be a damper law", "to_adams(law, path, velocities)"),
    "plots.ride(car)": ("`responses` must be a response", "is a QuarterCar", "jaxdamp.simulate(vehicle, road)"),
    "plots.force_velocity({'a': 1500.0})": ("`laws['a']` must be a damper law", "the number 1500.0"),
    "plots.fit_loops(law)": ("`result` must be the result of a fit", "is a Linear"),
    "plots.tuning(car)": ("`result` must be the result of a tuning", "is a QuarterCar"),
    "plots.law_card(1500.0)": ("`law` must be a damper law", "dampers.Linear(1500.0)"),
}


@pytest.fixture(scope="module")
def answers():
    environment = os.environ | {"JAX_ENABLE_X64": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PREPARE],
        input=json.dumps(list(ANSWERS)),
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("call", ANSWERS)
def test_a_wrong_object_is_refused_in_words(answers, call):
    assert answers[call].startswith("ValueError: "), answers[call]
    for words in ANSWERS[call]:
        assert words in answers[call]

"""The printed step of a vehicle with the observer of its metrics, as a ride takes it: prerequisite of rides in C."""

import ctypes
import shutil
import subprocess
from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import vehicles
from jaxdamp._vectors import MemoryLayout
from jaxdamp.codegen import C, PrintedFunction, Symbols, lower
from jaxdamp.dampers import Besinger, BoucWen, Lag, Linear, SeriesSpring
from jaxdamp.metrics import Metric
from jaxdamp.simulation.equations import Equations, RoadInput, settled
from jaxdamp.simulation.exponential import ExponentialStepper
from jaxdamp.simulation.observer import MetricObserver


pytestmark = pytest.mark.users_flags

STEP, COUNT = 1e-3, 150
VALVE = Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05)
QUARTER = vehicles.presets.quarter_car_000
CARS = {
    "quarter car, lag": lambda: QUARTER(Lag(VALVE, 0.004)),
    "quarter car, series spring": lambda: QUARTER(SeriesSpring(VALVE, 1e6, 1e8)),
    "half car, Bouc and Wen": lambda: vehicles.presets.half_car_002(BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)),
    "tracked hull": lambda: vehicles.presets.m113_003(VALVE),
    "full car": lambda: vehicles.presets.full_car_jazar(VALVE + Linear(100.0)),
}


def one_step(car):
    """A function of arrays that takes one step, and its arguments at the start but the road."""
    system = car.system()
    equations = Equations(system, MemoryLayout.SCALARS)
    stepper = ExponentialStepper(equations, jnp.asarray(STEP))
    channel = next(c.name for c in system.layout.channels if c.name.endswith("acceleration"))
    metrics = [Metric(channel, "rms", weighting="Wk"), Metric(channel, "peak")]
    observer = MetricObserver(equations, metrics, STEP, COUNT)
    wheels = len(system.layout.wheels)
    flat = RoadInput((jnp.zeros(()),) * wheels, (jnp.zeros(()),) * wheels)
    now = stepper.start(settled(system, jnp.zeros(wheels)), flat)
    held, still = eqx.partition((stepper, observer.outputs), eqx.is_inexact_array)
    carry, known = eqx.partition((now, observer.begin(now, flat)), eqx.is_inexact_array)

    def step(held, carry, h0, h1, rate):
        own, observer.outputs = eqx.combine(held, still)
        now, gathered = eqx.combine(carry, known)
        begin, end = (RoadInput((h,) * wheels, (rate,) * wheels) for h in (h0, h1))
        after = own(now, begin, end)
        return eqx.filter((after, observer.add(gathered, after, end)), eqx.is_inexact_array)

    return step, held, carry


def compiled(function, arguments, folder):
    """The function in C, of arrays to arrays."""
    place = iter(range(10**6))

    def named(array):
        names = np.array([f"x[{next(place)}]" for _ in range(array.size)], object).reshape(array.shape)
        return Symbols(names)

    program = lower(function, *jax.tree.map(named, arguments))
    outputs = [(f"y[{k}]", a) for k, a in enumerate(a for r in jax.tree.leaves(program.results) for a in r.ravel())]
    text = C().function(PrintedFunction("void f(const double *x, double *y)", ["x", "y"], program.statements, outputs))
    (folder / "f.c").write_text("\n".join(f"#include <{n}.h>" for n in ("math", "stdbool", "stdint")) + f"\n{text}")
    subprocess.run("gcc -std=c99 -O0 -fPIC -shared f.c -o f.so -lm".split(), cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "f.so"))

    def call(*trees):
        x = np.concatenate([np.ravel(np.asarray(leaf, float)) for leaf in jax.tree.leaves(trees)])
        y = np.zeros(len(outputs))
        library.f(ctypes.c_void_p(x.ctypes.data), ctypes.c_void_p(y.ctypes.data))
        return y

    return call


def check(name, folder):
    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    step, held, carry = one_step(CARS[name]())
    zero = jnp.zeros(())
    in_c = compiled(step, (held, carry, zero, zero, zero), folder)
    in_jax = jax.jit(step)
    leaves, tree = jax.tree.flatten(carry)
    largest = np.zeros(sum(leaf.size for leaf in leaves))
    heights = 0.01 * np.sin(np.arange(COUNT + 1) * 0.09) ** 2
    worst = np.zeros_like(largest)
    for h0, h1 in pairwise(heights):
        road = [jnp.asarray(number) for number in (h0, h1, (h1 - h0) / STEP)]
        ours = in_c(held, carry, *road)
        carry = in_jax(held, carry, *road)
        theirs = np.concatenate([np.ravel(np.asarray(leaf)) for leaf in jax.tree.leaves(carry)])
        largest = np.maximum(largest, np.abs(theirs))
        worst = np.maximum(worst, np.abs(ours - theirs))
    assert jax.tree.structure(carry) == tree
    assert np.all(worst <= 1e-12 * np.maximum(largest, 1e-6))


@pytest.mark.slow
@pytest.mark.parametrize("name", CARS)
@pytest.mark.exhaustive_cases("full car")
def test_printed_steps_of_vehicles_are_those_of_jax(tmp_path, name):
    check(name, tmp_path)

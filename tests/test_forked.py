"""A process that was forked while JAX was at work is told so, instead of waiting for ever."""

import functools
import os
import signal
import subprocess
import sys
import warnings

import numpy as np
import pytest

from jaxdamp import Ride, bench, identify, metrics, respond, roads, simulate, sweep, vehicles
from jaxdamp.dampers import Linear, Table


LAW, TIME = Linear(1500.0), np.linspace(0.0, 1.0, 11)
CAR, ROAD = vehicles.presets.quarter_car_000(LAW), roads.step(0.01)


@functools.cache  # made before the fork, and not while tests are collected
def ride() -> Ride:
    return Ride(CAR, ROAD, metrics=["rms_sprung_acceleration"], duration=1.0)


CALLS = {
    "respond": lambda: respond(LAW, TIME, 0.0 * TIME),
    "simulate": lambda: simulate(CAR, ROAD, duration=1.0),
    "ride": lambda: ride()(),
    "sweep": lambda: sweep(ride(), {"sprung_mass": [300.0, 400.0]}),
    "fit": lambda: identify.fit(Linear, []),
    "a law": lambda: Table([-1.0, 0.0, 1.0], [-900.0, 0.0, 1500.0]),
    "a vehicle": vehicles.presets.half_car_002,
    "a road of a formula": lambda: roads.sine(0.01, wavelength=5.0, speed=20.0),
    "a road from a profile": lambda: roads.from_profile(TIME, TIME, speed=20.0),
    "a random road": lambda: roads.iso8608("C", speed=20.0, seed=1),
    "heights": lambda: ROAD.height(TIME),
    "modes": lambda: vehicles.modes(CAR),
    "frequency response": lambda: vehicles.frequency_response(CAR, [1.0]),
    "spectral rms": lambda: vehicles.spectral_rms(CAR, [1.0, 2.0], [1.0, 1.0]),
    "metric": lambda: metrics.rms(TIME),
    "metric of a run": lambda: metrics.weighted_rms(TIME, 1e-3, "Wk"),
    "virtual dyno": lambda: bench.VirtualDyno(LAW).run([bench.SineTest(0.02, 1.0)]),
}


def _in_a_forked_process(call):
    """The exit code: 0 where it was refused with the remedy, 2 where the call went through, below 0 where it hung."""
    respond(LAW, TIME, 0.0 * TIME)
    ride()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of JAX and Python, which do not say what to do
        child = os.fork()
    if not child:
        signal.alarm(30)
        try:
            call()
        except RuntimeError as error:
            os._exit(0 if 'get_context("spawn")' in str(error) else 1)
        os._exit(2)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_computation_in_a_forked_process_is_refused(call):
    assert _in_a_forked_process(call) == 0


def test_records_are_read_in_a_forked_process(tmp_path):
    run = bench.BenchRun.from_arrays("run", np.arange(200) / 100, np.sin(np.arange(200) / 10), np.arange(200.0))
    bench.BenchSet([run]).write(tmp_path)
    assert _in_a_forked_process(lambda: bench.read(tmp_path, sign="rebound-positive")) == 2


@pytest.mark.slow
def test_a_process_forked_from_one_that_has_only_loaded_the_library_computes():
    program = """
import os
from jaxdamp import bench, control, dampers, export, identify, roads, rig, simulation, sweeps, tune, vehicles
child = os.fork()
if not child:
    print(float(rig.respond(dampers.Linear(1500.0), [0.0, 0.1, 0.2], [0.0, 0.01, 0.02])[-1]), flush=True)
    os._exit(0)
os.waitpid(child, 0)
"""
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, timeout=600)
    assert float(done.stdout) == pytest.approx(150.0, rel=1e-3), done.stderr


def test_a_fork_after_a_computation_with_jax_alone_is_refused():
    program = """
import os
import jax.numpy as jnp
from jaxdamp.dampers import Linear
from jaxdamp.rig import respond
(2.0 * jnp.ones(3)).block_until_ready()
if not os.fork():
    try:
        respond(Linear(1500.0), [0.0, 0.1, 0.2], [0.0, 0.01, 0.02])
    except RuntimeError as error:
        print(str(error)[:24], flush=True)
    os._exit(0)
os.wait()
"""
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "This process was forked", done.stderr

"""A process that was forked while JAX was at work is told so, instead of waiting for ever."""

import os
import subprocess
import sys
import warnings

import numpy as np
import pytest

from jaxdamp import Ride, identify, respond, roads, simulate, sweep, vehicles
from jaxdamp.dampers import Linear


LAW, TIME = Linear(1500.0), np.linspace(0.0, 1.0, 11)
CAR, ROAD = vehicles.presets.quarter_car_000(LAW), roads.step(0.01)
RIDE = Ride(CAR, ROAD, metrics=["rms_sprung_acceleration"], duration=1.0)
CALLS = {
    "respond": lambda: respond(LAW, TIME, 0.0 * TIME),
    "simulate": lambda: simulate(CAR, ROAD, duration=1.0),
    "ride": RIDE,
    "sweep": lambda: sweep(RIDE, {"sprung_mass": [300.0, 400.0]}),
    "fit": lambda: identify.fit(Linear, []),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_computation_in_a_forked_process_is_refused(call):
    respond(LAW, TIME, 0.0 * TIME)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of JAX and Python, which do not say what to do
        child = os.fork()
    if not child:
        try:
            call()
        except RuntimeError as error:
            os._exit(0 if 'get_context("spawn")' in str(error) else 1)
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


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

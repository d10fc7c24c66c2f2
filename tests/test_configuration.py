"""`configure` changes the settings of a process, so each question is asked in a fresh one."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from jaxdamp.configuration import _with_option


pytestmark = pytest.mark.users_flags

FUSED = "xla_cpu_small_while_loop_byte_threshold=16777216"

IMPORTING = """
import os, sys, jax
before = dict(jax.config.values), dict(os.environ), sys.getrecursionlimit()
import jaxdamp
assert (dict(jax.config.values), dict(os.environ), sys.getrecursionlimit()) == before
jaxdamp.configure(cache=False)
assert jax.config.jax_default_matmul_precision is None  # which a sweep would take for another function
jaxdamp.configure(x64=False, cache=False)
assert jax.config.jax_default_matmul_precision == "highest"  # of a GPU
jax.config.update("jax_default_matmul_precision", "tensorfloat32")
jaxdamp.configure(x64=False, cache=False)
assert jax.config.jax_default_matmul_precision == "tensorfloat32"
"""

CONFIGURING = """
import jaxdamp
import jax, jax.numpy as jnp
done = jaxdamp.configure(cpu_devices=3, cache="{folder}")
assert repr(done).startswith("jaxdamp: 64-bit floats, 3 CPU devices, loops compiled as one function"), done
road = jaxdamp.roads.cosine_bump(0.05, start=0.1, duration=0.2)
found = jaxdamp.Ride(jaxdamp.vehicles.presets.quarter_car_000(), road, duration=0.5)()["peak_sprung_acceleration"]
assert found.dtype == jnp.float64 and len(jax.devices("cpu")) == 3
assert any(path.is_file() for path in done.cache.iterdir())
assert jaxdamp.configure(cpu_devices=3, cache="{folder}") == done  # a cell that is run again
print(repr(float(found)))
try:
    jaxdamp.configure(cpu_devices=2, fused_loops=False)
except RuntimeError as error:
    print(error)
"""

PLAIN = """
import jaxdamp
done = jaxdamp.configure(x64=True, cpu_devices=1, fused_loops=False, cache=False)
assert repr(done) == "jaxdamp: 64-bit floats, 1 CPU device, loops as JAX compiles them, compiled code not kept."
road = jaxdamp.roads.cosine_bump(0.05, start=0.1, duration=0.2)
found = jaxdamp.Ride(jaxdamp.vehicles.presets.quarter_car_000(), road, duration=0.5)()["peak_sprung_acceleration"]
print(repr(float(found)))
"""


def fresh(script):
    environment = {name: value for name, value in os.environ.items() if name not in ("XLA_FLAGS", "JAX_ENABLE_X64")}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.slow
def test_processes(tmp_path):
    scripts = [IMPORTING, CONFIGURING.replace("{folder}", str(tmp_path / "cache")), PLAIN]
    with ThreadPoolExecutor() as pool:
        silent, configured, plain = pool.map(fresh, scripts)
    assert silent == []
    assert float(configured[0]) == pytest.approx(float(plain[0]), rel=1e-12)
    assert configured[1].startswith("`jaxdamp.configure` comes too late: JAX has started, and cpu_devices=2 (now 3)")
    assert "Restart Python" in configured[1]


def test_flags_of_others_stay():
    theirs = "--xla_backend_extra_options=xla_cpu_other=1 --xla_dump_to=here"
    once = _with_option(theirs, True)
    assert once.split() == [
        "--xla_dump_to=here",
        f"--xla_backend_extra_options=xla_cpu_other=1,{FUSED}",
        "--xla_cpu_prefer_vector_width=512",
    ]
    assert _with_option(once, True).split() == once.split()
    assert sorted(_with_option(once, False).split()) == sorted(theirs.split())
    assert _with_option("", False) == ""


def test_refuses_no_device():
    from jaxdamp import configure

    with pytest.raises(ValueError, match="`cpu_devices` must be one or more, but is 0"):
        configure(cpu_devices=0)

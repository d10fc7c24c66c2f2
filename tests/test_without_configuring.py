"""The README says that everything works without `jaxdamp.configure()`: in single precision, in a process of its own."""

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest


pytestmark = pytest.mark.users_flags

ENTRIES = Path(__file__).with_name("every_entry_point.py")

# Relative to the largest number of each entry, some five times what was measured; 1e-4 if it is not named.
TOLERANCE = {"minimise, parameters": 1e-3, "sweep, derivatives": 5e-4}


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_every_entry_point_works_without_configuring():
    plain = {name: value for name, value in os.environ.items() if not name.startswith("JAX_ENABLE")}
    done = subprocess.run([sys.executable, str(ENTRIES)], capture_output=True, text=True, env=plain, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    single = json.loads(done.stdout.splitlines()[-1])
    double = runpy.run_path(str(ENTRIES))["every_entry_point"]()
    assert set(single) == set(double)
    for name, expected in double.items():
        size = np.max(np.abs(expected))
        np.testing.assert_allclose(
            single[name], expected, rtol=0.0, atol=TOLERANCE.get(name, 1e-4) * size, err_msg=name
        )

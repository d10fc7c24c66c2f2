"""Laws as C and JavaScript: lines, time to print and to compile, time of a step, beside the compiled loop of XLA.

python -m benchmarks.printed
"""

import ctypes
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import configure


DONE = configure(cpu_devices=1, cache=False)

from benchmarks._timing import best, report  # noqa: E402
from jaxdamp.dampers import AbstractDamper, Besinger, BoucWen, Lag, Linear, MonoTube, SeriesSpring  # noqa: E402
from jaxdamp.export import to_c, to_fmu  # noqa: E402
from jaxdamp.rig import respond  # noqa: E402


INSTANTS, STEP = 100_000, 1e-3
VALVE = Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05)
LAWS: dict[str, AbstractDamper] = {
    "Besinger": VALVE,
    "lag": Lag(Linear(2000.0), 0.004),
    "Bouc-Wen": BoucWen(1500.0, 3000.0, 250.0, 1e-3, 0.7, 1.7),
    "series spring": SeriesSpring(VALVE, 1e6, 1e8),
    "mono-tube": MonoTube.reference(),
}
DRIVE = """
#include "law.h"
void drive(int n, const double *x, const double *v, double h, double *force) {
    law_parameters p;
    double state[LAW_STATES + 1];
    law_defaults(&p);
    law_init(&p, state);
    for (int i = 0; i < n; ++i) {
        if (i) law_advance(&p, x[i - 1], v[i - 1], x[i], v[i], h, state);
        force[i] = law_force(&p, x[i], v[i], state);
    }
}
"""


def measured(law: AbstractDamper, folder: Path) -> list[float]:
    """Lines of C, seconds to print and to compile, nanoseconds of a step in C and in XLA, difference, FMU in kB."""
    start = time.perf_counter()
    source = to_c(law, folder / "law.c")[1]
    printing = time.perf_counter() - start
    (folder / "drive.c").write_text(DRIVE, encoding="utf-8")
    start = time.perf_counter()
    words = "gcc -std=c99 -O2 -fPIC -shared law.c drive.c -o law.so -lm"
    subprocess.run(words.split(), cwd=folder, check=True)
    compiling = time.perf_counter() - start
    times = np.arange(INSTANTS) * STEP
    x, v = 0.01 * np.sin(20.0 * times), 0.2 * np.cos(20.0 * times)
    force = np.zeros(INSTANTS)
    pointers = [array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in (x, v, force)]
    library = ctypes.CDLL(str(folder / "law.so"))

    def in_c() -> None:
        library.drive(INSTANTS, *pointers[:2], ctypes.c_double(STEP), pointers[2])

    with_xla = jax.jit(lambda x, v: respond(law, times, x, v))
    arrays = jnp.asarray(x), jnp.asarray(v)
    spans = [best(function, 5) / INSTANTS * 1e9 for function in (in_c, lambda: with_xla(*arrays))]
    expected = np.asarray(with_xla(*arrays))
    difference = np.abs(force - expected).max() / np.abs(expected).max()
    size = to_fmu(law, folder / "law.fmu").stat().st_size / 1e3
    lines = len(source.read_text(encoding="utf-8").splitlines())
    return [lines, printing, compiling, *spans, difference, size]


def one(name: str) -> None:
    """In a process of its own, since a library is loaded once."""
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(measured(LAWS[name], Path(folder))))


def main() -> None:
    if shutil.which("gcc") is None:
        sys.exit("There is no gcc.")
    print(DONE)
    rows = []
    for name in LAWS:
        done = subprocess.run([sys.executable, "-m", "benchmarks.printed", name], capture_output=True, check=True)
        lines, printing, compiling, in_c, in_xla, difference, size = json.loads(done.stdout.splitlines()[-1])
        rows.append([name, int(lines), printing, compiling, in_c, in_xla, f"{difference:.0e}", size])
    columns = ["law", "lines", "print and test [s]", "gcc [s]", "C [ns]", "XLA [ns]", "difference", "FMU [kB]"]
    report("printed", f"A law as C, one core, {INSTANTS} steps", columns, rows)


if __name__ == "__main__":
    one(sys.argv[1]) if len(sys.argv) > 1 else main()

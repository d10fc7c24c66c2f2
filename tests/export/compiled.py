"""Printed laws, compiled together and driven through one random motion."""

import ctypes
import shutil
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import without_fitted_ranges
from jaxdamp.export._c_text import DERIVATIVES, law_source
from jaxdamp.export._law_program import LawProgram, law_numbers
from jaxdamp.parameters import with_values


INSTANTS, STEP = 120, 1e-3
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
CHANGES = (2e-4, 0.03, 1e-4, 0.05)  # of x0, v0, x1, v1
# The numbers are compared, not the speed: XLA compiles the laws quickly whatever XLA_FLAGS says.
QUICKLY: dict[str, int | bool] = {"xla_backend_optimization_level": 0}
if jax.__version_info__ < (0, 11):
    QUICKLY["xla_cpu_use_fusion_emitters"] = False
PREAMBLE = "#include <math.h>\n#include <stdbool.h>\n#include <stdint.h>\n"


def compiler(name="gcc"):
    """The path of a compiler; the test is skipped without it."""
    return shutil.which(name) or pytest.skip(f"no compiler {name}")


def motion():
    """A random stroke [m] about a sine of 12 mm, which reaches a bump stop, with its velocity [m/s]."""
    rng = np.random.default_rng(7)
    frequency, phase = np.append(rng.uniform(1.0, 40.0, 6), 5.0), np.append(rng.uniform(0.0, 6.28, 6), 0.0)
    omega = 2.0 * np.pi * frequency
    angle = omega * np.arange(INSTANTS)[:, None] * STEP + phase
    size = np.append(0.05 / omega[:-1], 0.012)
    return (size * np.sin(angle)).sum(1), (size * omega * np.cos(angle)).sum(1)


def drive(name, states):
    """The C function that drives a law; all its numbers change by the same share."""
    changes = ", ".join(map(repr, CHANGES))
    return f"""
void run_{name}(const double *x, const double *v, double *states, double *forces, double *dstates, double *dforces) {{
    const int n = {INSTANTS}, size = {states};
    const double d[4] = {{{changes}}}, h = {STEP!r};
    int i, k;
    {name}_parameters p, dp;
    double state[{states + 1}], dstate[{states + 1}];
    {name}_defaults(&p);
    {name}_defaults(&dp);
    {name}_init(&p, x[0], state);
    for (k = 0; k < size; ++k) states[k] = state[k];
    for (i = 1; i < n; ++i) {{
        for (k = 0; k < size; ++k) dstate[k] = 0.3 * state[k];
        {name}_advance_derivative(&p, &dp, x[i - 1], d[0], v[i - 1], d[1], x[i], d[2], v[i], d[3], h, state, dstate);
        {name}_advance(&p, x[i - 1], v[i - 1], x[i], v[i], h, state);
        forces[i - 1] = {name}_force(&p, x[i], v[i], state);
        dforces[i - 1] = {name}_force_derivative(&p, &dp, x[i], d[2], v[i], d[3], state, dstate);
        for (k = 0; k < size; ++k) states[i * size + k] = state[k];
        for (k = 0; k < size; ++k) dstates[(i - 1) * size + k] = dstate[k];
    }}
}}
"""


def compiled(laws, folder):
    """A library of the laws, by names, compiled in one run."""
    source, library = folder / "laws.c", folder / "laws.so"
    text = [PREAMBLE]
    for name, law in laws.items():
        program = LawProgram(law)
        printed = law_source(program, name, DERIVATIVES)
        text += [printed.header(), printed.definitions(), drive(name, program.states)]
    source.write_text("\n".join(text), encoding="utf-8")
    command = [compiler(), *STRICT, "-O0", "-fPIC", "-shared", str(source), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:3000]
    return ctypes.CDLL(str(library))


def in_c(library, name, states):
    """States, forces and their derivatives over the motion, from the compiled law."""
    sizes = (INSTANTS, states), (INSTANTS - 1,), (INSTANTS - 1, states), (INSTANTS - 1,)
    results = [np.zeros(size) for size in sizes]
    pointers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (*motion(), *results)]
    getattr(library, f"run_{name}")(*pointers)
    return results


def in_jax(law, states):
    """One step from each of these states: the states after it, the forces, and their derivatives."""
    law = without_fitted_ranges(law)
    numbers = law_numbers(law)
    x, v = map(jnp.asarray, motion())

    def step(values, x0, v0, x1, v1, state):
        changed = with_values(law, dict(zip([n.path for n in numbers], values, strict=True)))
        after = changed.advance(x0, v0, x1, v1, state, jnp.asarray(STEP))
        return after, changed.force(x1, v1, after)

    values = [jnp.asarray(n.value) for n in numbers]
    changes = [jnp.asarray(change) for change in CHANGES]

    def both(x0, v0, x1, v1, state):
        return jax.jvp(step, (values, x0, v0, x1, v1, state), (values, *changes, 0.3 * state))

    step_of_all = jax.jit(jax.vmap(both), compiler_options=QUICKLY)
    (after, force), (dafter, dforce) = step_of_all(x[:-1], v[:-1], x[1:], v[1:], jnp.asarray(states[:-1]))
    return [np.asarray(a) for a in (after, force, dafter, dforce)]


def worst(ours, theirs):
    """The greatest difference relative to the greatest value, of every column."""
    if not ours.size:
        return 0.0
    size = np.abs(theirs).max(axis=0)
    return float((np.abs(ours - theirs).max(axis=0) / np.where(size > 0, size, 1.0)).max())

"""A C program that compares a printed law with stored forces."""

import numpy as np

from jaxdamp.export._law_program import LawProgram
from jaxdamp.rig import respond


_INSTANTS, _STEP = 201, 1e-3  # s
_LONGEST_STROKE, _FREQUENCIES = 0.008, (6.0, 17.0)  # m, Hz


def sample_motion(program: LawProgram) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], stroke [m] and velocity [m/s] of two sines, within the strokes where the law is valid."""
    reach = _LONGEST_STROKE
    for term in program.law.side_by_side():
        low, high = (float(limit) for limit in term.stroke_limits)
        reach = min(reach, -0.4 * low, 0.4 * high)
    time = np.arange(_INSTANTS) * _STEP
    angles = [2.0 * np.pi * f * time for f in _FREQUENCIES]
    stroke = reach * (0.7 * np.sin(angles[0]) + 0.3 * np.sin(angles[1]))
    slow, fast = (2.0 * np.pi * f for f in _FREQUENCIES)
    return time, stroke, reach * (0.7 * slow * np.cos(angles[0]) + 0.3 * fast * np.cos(angles[1]))


def self_test(program: LawProgram, name: str) -> str:
    """The text of the program; it returns zero if the greatest difference is due to rounding."""
    time, stroke, velocity = sample_motion(program)
    computed = respond(program.law, time, stroke, velocity)
    force = np.asarray(computed, float)
    real = "double" if program.dtype == "float64" else "float"
    close = 1e-9 if program.dtype == computed.dtype == "float64" else 1e-3
    arrays = [_array(label, values) for label, values in (("x", stroke), ("v", velocity), ("expected", force))]
    return f"""/* Compares {name}.c with forces that jaxdamp computed:  cc {name}.c {name}_test.c -lm && ./a.out */
#include "{name}.h"

#include <math.h>
#include <stdio.h>

{"".join(arrays)}
int main(void) {{
    {name}_parameters p;
    {real} state[{name.upper()}_STATES + 1];
    double worst = 0.0, greatest = 0.0;
    int i;
    {name}_defaults(&p);
    {name}_init(&p, state);
    for (i = 0; i < {_INSTANTS}; ++i) {{
        double error;
        if (i > 0) {{
            {name}_advance(
                &p, ({real})x[i - 1], ({real})v[i - 1], ({real})x[i], ({real})v[i], ({real}){_STEP!r}, state);
        }}
        error = fabs({name}_force(&p, ({real})x[i], ({real})v[i], state) - expected[i]);
        if (!(error <= worst)) worst = error;
        if (fabs(expected[i]) > greatest) greatest = fabs(expected[i]);
    }}
    printf("{name}: greatest difference %.1e of the greatest force %g N\\n", worst / greatest, greatest);
    return worst <= {close!r} * greatest ? 0 : 1;
}}
"""


def _array(name: str, values: np.ndarray) -> str:
    rows = [", ".join(map(repr, row.tolist())) for row in np.array_split(values, len(values) // 5)]
    return f"static const double {name}[{len(values)}] = {{\n    " + ",\n    ".join(rows) + "\n};\n"

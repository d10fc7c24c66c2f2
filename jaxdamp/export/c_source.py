"""A law or a vehicle as portable C, with a test of itself."""

import os
import re
from pathlib import Path

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._c_text import DERIVATIVES, INCLUDES, array_text, law_source, vehicle_source
from jaxdamp.export._law_program import LawProgram, identifier
from jaxdamp.export._vehicle_program import VehicleProgram
from jaxdamp.rig import respond
from jaxdamp.roads import from_profile
from jaxdamp.simulation import simulate, substeps_needed
from jaxdamp.vehicles import AbstractVehicle


_INSTANTS, _STEP = 201, 1e-3  # s
_LONGEST_STROKE, _HIGHEST, _FREQUENCIES = 0.008, 0.004, (6.0, 17.0)  # m, m, Hz


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


def law_test(program: LawProgram, name: str) -> str:
    """The text of the program for a law; it returns zero if the greatest difference is due to rounding."""
    time, stroke, velocity = sample_motion(program)
    computed = respond(program.law, time, stroke, velocity, state=program.law.initial_state())
    force = np.asarray(computed, float)
    real = "double" if program.dtype == "float64" else "float"
    close = _tolerance(program.dtype, computed.dtype)
    arrays = [array_text(label, values) for label, values in (("x", stroke), ("v", velocity), ("expected", force))]
    return f"""{_begin(name, "forces")}
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


def sample_heights(program: VehicleProgram) -> np.ndarray:
    """Heights under the wheels [m], shape (instants, wheels), which begin at zero and differ from wheel to wheel."""
    phase = np.arange(program.wheels) * 0.4
    angle = 2.0 * np.pi * np.arange(_INSTANTS)[:, None] * _STEP
    return _HIGHEST * np.sum([np.sin(f * angle + phase) - np.sin(phase) for f in _FREQUENCIES], axis=0)


def vehicle_test(program: VehicleProgram, name: str) -> str:
    """The text of the program for a vehicle; it returns zero if the differences of all channels are due to rounding."""
    heights, time = sample_heights(program), np.arange(_INSTANTS) * _STEP
    count = substeps_needed(program.vehicle, _STEP)
    response = simulate(program.vehicle, from_profile(time, heights), dt=_STEP, substeps=count)
    expected = np.stack([np.asarray(response[channel.name]) for channel in program.channels])
    greatest = np.abs(expected).max(axis=1)
    real, upper = ("double" if program.dtype == "float64" else "float"), name.upper()
    close = _tolerance(program.dtype, np.asarray(response[program.channels[0].name]).dtype)
    rates = np.gradient(heights, _STEP, axis=0)
    arrays = {"heights": heights.ravel(), "rates": rates.ravel(), "expected": expected[:, -1], "greatest": greatest}
    return f"""{_begin(name, "the channels at the end of a run")}
{"".join(array_text(label, values) for label, values in arrays.items())}
int main(void) {{
    static {name}_parameters p;
    static {real} m[{upper}_MATRICES], c[{upper}_CARRY], y[{upper}_OUTPUTS];
    {real} road[4][{upper}_WHEELS]; /* heights and rates at the beginning and the end of a step */
    double worst = 0.0;
    int i, j, k;
    {name}_defaults(&p);
    {name}_prepare(&p, ({real}){_STEP / count!r}, m);
    for (i = 0; i < {_INSTANTS}; ++i) {{
        for (j = 0; j < {count}; ++j) {{
            for (k = 0; k < {upper}_WHEELS; ++k) {{
                const int now = i * {upper}_WHEELS + k, before = i ? now - {upper}_WHEELS : now;
                const double from = (double)j / {count}, to = (double)(j + 1) / {count};
                road[0][k] = ({real})(heights[before] + from * (heights[now] - heights[before]));
                road[1][k] = ({real})(rates[before] + from * (rates[now] - rates[before]));
                road[2][k] = ({real})(heights[before] + to * (heights[now] - heights[before]));
                road[3][k] = ({real})(rates[before] + to * (rates[now] - rates[before]));
            }}
            if (i) {name}_step(m, road[0], road[1], road[2], road[3], c);
        }}
        if (!i) {name}_start(m, road[2], road[3], c);
    }}
    {name}_outputs(m, c, road[2], road[3], y);
    for (k = 0; k < {upper}_OUTPUTS; ++k) {{
        const double error = fabs(y[k] - expected[k]) / (greatest[k] > 0.0 ? greatest[k] : 1.0);
        if (!(error <= worst)) worst = error;
    }}
    printf("{name}: greatest difference %.1e of the largest value of a channel\\n", worst);
    return worst <= {close!r} ? 0 : 1;
}}
"""


def _tolerance(ours: object, computed: object) -> float:
    return 1e-9 if ours == computed == "float64" else 1e-3


def _begin(name: str, what: str) -> str:
    return f"""/* Compares {name}.c with {what} that jaxdamp computed:  cc {name}.c {name}_test.c -lm && ./a.out */
#include "{name}.h"

#include <math.h>
#include <stdio.h>
"""


def to_c(
    law: AbstractDamper | AbstractVehicle,
    path: str | os.PathLike[str],
    *,
    derivatives: bool = False,
    precision: str = "float64",
) -> list[Path]:
    """Write a law or a vehicle as C source, header and a test program.

    The source is C99 that compiles as C++ too, without allocation, global state or anything but <math.h>: it runs in
    real time. A struct holds the parameters and settings, with units and allowed values as comments; `NAME_defaults`
    sets those of this law or vehicle.

    Of a law, `NAME_init` gives the states at rest, `NAME_force` the force, `NAME_advance` the states after a step, as
    the methods of the law do, and `NAME_state_rate` their rate for solvers of differential equations. The test program
    repeats a motion and compares the forces with those computed here.

    Of a vehicle, `NAME_prepare` computes what follows from the parameters and the step, `NAME_start` the static
    equilibrium on the road, `NAME_step` a step of `simulate` with the exponential engine, `NAME_outputs` the channels
    and `NAME_state_rate` the rates of the states. The test program compares the channels of a run with `simulate`.

    `cc NAME.c NAME_test.c -lm && ./a.out` runs the test.

    Arguments:
        law: any law or composition, or any vehicle with its laws.
        path: the source file `NAME.c` to write, beside which `NAME.h` and `NAME_test.c` are written, or a folder for
            files named after the class. Existing files are replaced.
        derivatives: also write functions for the change of the results for given changes of parameters, motion (of a
            vehicle: heights and rates of the road) and states.
        precision: "float64", or "float32" for processors that compute in single precision.

    Returns:
        The paths of header, source and test program.

    Raises:
        ValueError: a folder that does not exist, a name that C does not allow, another precision, a vehicle without
            static equilibrium.
        NotImplementedError: an operation of a law that cannot be printed; the message names it.
    """
    check_module("law", law, (AbstractDamper, AbstractVehicle), "to_c(law, path)")
    _checks.one_of("precision", precision, ("float64", "float32"))
    file = source_path(law, path)
    name = file.stem
    if isinstance(law, AbstractDamper):
        program = LawProgram(law, precision)
        source, test = law_source(program, name, DERIVATIVES if derivatives else ()), law_test(program, name)
    else:
        car = VehicleProgram(law, precision)
        source, test = vehicle_source(car, name, derivatives), vehicle_test(car, name)
    texts = {
        file.with_suffix(".h"): source.header(),
        file: f'#include "{name}.h"\n\n{INCLUDES}\n{source.definitions()}',
        file.with_name(f"{name}_test.c"): test,
    }
    return [write_whole(file, text) for file, text in texts.items()]


def source_path(law: AbstractDamper | AbstractVehicle, path: str | os.PathLike[str]) -> Path:
    """The source file, in a folder with the name of the class."""
    given = Path(path).expanduser()
    if given.is_dir():
        return given / f"{re.sub(r'(?<=[a-z])(?=[A-Z])', '_', type(law).__name__).lower()}.c"
    if given.suffix != ".c" or identifier(given.stem) != given.stem:
        must = "be a folder or a file NAME.c whose name is an identifier of C"
        _checks.refuse("path", must, str(given), f"Try {identifier(given.stem) + '.c'!r}.")
    return given

"""A law, a vehicle or a controller as portable C, with a test of itself."""

import math
import os
import re
from collections.abc import Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._writing import write_whole
from jaxdamp.control import Signals
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges
from jaxdamp.export._c_text import (
    DERIVATIVES,
    INCLUDES,
    LANGUAGE,
    array_text,
    controller_source,
    law_source,
    vehicle_source,
)
from jaxdamp.export._controller_program import ControllerProgram, program_of
from jaxdamp.export._law_program import LawProgram, identifier
from jaxdamp.export._vehicle_program import VehicleProgram
from jaxdamp.rig import respond
from jaxdamp.roads import from_profile
from jaxdamp.simulation import simulate
from jaxdamp.vehicles import AbstractVehicle


_INSTANTS, _STEP = 201, 1e-3  # s
_LONGEST_STROKE, _HIGHEST, _FREQUENCIES = 0.008, 0.004, (6.0, 17.0)  # m, m, Hz


def sample_motion(law: AbstractDamper, step: float = _STEP) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], stroke [m] and velocity [m/s] of two sines, within the strokes where the law is valid."""
    reach = _LONGEST_STROKE
    for term in law.side_by_side():
        low, high = (float(limit) for limit in term.stroke_limits)
        reach = min(reach, -0.4 * low, 0.4 * high)
    time = np.arange(_INSTANTS) * step
    angles = [2.0 * np.pi * f * time for f in _FREQUENCIES]
    stroke = reach * (0.7 * np.sin(angles[0]) + 0.3 * np.sin(angles[1]))
    slow, fast = (2.0 * np.pi * f for f in _FREQUENCIES)
    return time, stroke, reach * (0.7 * slow * np.cos(angles[0]) + 0.3 * fast * np.cos(angles[1]))


def law_test(program: LawProgram, name: str) -> str:
    """The text of the program for a law; it returns zero if the greatest difference is due to rounding."""
    time, stroke, velocity = sample_motion(program.law)
    law = without_fitted_ranges(program.law)  # this motion is a test, wherever it goes
    computed = respond(law, time, stroke, velocity, state=law.state_at_rest(stroke[0]))
    arrays = {"x": stroke, "v": velocity, "expected": np.asarray(computed, float)}
    real, close = LANGUAGE.types[program.dtype], _tolerance(program.dtype, computed.dtype)
    return f"""{_begin(name, "forces", arrays)}
int main(void) {{
    {name}_parameters p;
    {real} state[{name.upper()}_STATES + 1];
    double worst = 0.0, greatest = 0.0;
    int i;
    {name}_defaults(&p);
    {name}_init(&p, ({real})x[0], state);
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


def vehicle_test(program: VehicleProgram, name: str) -> str:
    """The text of the program for a vehicle; it returns zero if the differences of all channels are due to rounding."""
    step = program.longest_step
    time = np.arange(_INSTANTS) * step
    # heights under the wheels [m], shape (time, wheels), which begin at zero and differ from wheel to wheel
    angle, phase = 2.0 * np.pi * time[:, None], 0.4 * np.arange(program.wheels)
    heights = _HIGHEST * np.sum([np.sin(f * angle + phase) - np.sin(phase) for f in _FREQUENCIES], axis=0)
    response = simulate(without_fitted_ranges(program.vehicle), from_profile(time, heights), dt=step, substeps=1)
    expected = np.stack([np.asarray(response[channel.name]) for channel in program.channels])
    greatest = np.abs(expected).max(axis=1)
    real, upper = LANGUAGE.types[program.dtype], name.upper()
    close = _tolerance(program.dtype, np.asarray(response[program.channels[0].name]).dtype)
    rates = np.gradient(heights, step, axis=0)
    arrays = {"heights": heights.ravel(), "rates": rates.ravel(), "expected": expected[:, -1], "greatest": greatest}
    return f"""{_begin(name, "the channels at the end of a run", arrays)}
int main(void) {{
    static {name}_parameters p;
    static {real} m[{upper}_MATRICES], c[{upper}_CARRY], y[{upper}_OUTPUTS];
    {real} road[4][{upper}_WHEELS]; /* heights and rates at the beginning and the end of a step */
    double worst = 0.0;
    int i, k;
    {name}_defaults(&p);
    {name}_prepare(&p, ({real}){step!r}, m);
    for (i = 0; i < {_INSTANTS}; ++i) {{
        for (k = 0; k < {upper}_WHEELS; ++k) {{
            const int now = i * {upper}_WHEELS + k, before = i ? now - {upper}_WHEELS : now;
            road[0][k] = ({real})heights[before];
            road[1][k] = ({real})rates[before];
            road[2][k] = ({real})heights[now];
            road[3][k] = ({real})rates[now];
        }}
        if (i) {name}_step(m, road[0], road[1], road[2], road[3], c);
        else {name}_start(m, road[2], road[3], c);
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


def sample_signals(program: ControllerProgram, step: float) -> np.ndarray:
    """What the sensors of a controller measure, shape (instants, inputs): sines that differ from damper to damper."""
    signals = {}
    laws = dict(zip(program.vehicle.layout.ports, program.vehicle.elements(), strict=True))
    for k, damper in enumerate(program.dampers):
        time, stroke, velocity = sample_motion(laws[damper], step)
        speed, phase = 2.0 * np.pi * _FREQUENCIES[0] / 4.0, 0.9 * k
        body, acceleration = 0.3 * np.sin(speed * time + phase), 0.3 * speed * np.cos(speed * time + phase)
        values = (body, body - velocity, acceleration, stroke, velocity, 0.4 * body, 0.3 * body, 0.02 * body)
        shown = zip(Signals._fields, values, strict=True)
        signals |= {f"{damper}_{field}": values for field, values in shown}
    return np.stack([signals[line.name] for line in program.inputs], axis=1)


def controller_test(program: ControllerProgram, name: str) -> str:
    """The text of the program for a controller; it returns zero if commands and demands differ by rounding."""
    period = program.vehicle.period
    step = period / math.ceil(period / program.longest_step * (1.0 - 1e-9))
    given = sample_signals(program, step)
    computed = program.run(jnp.asarray(given), step)
    expected = np.asarray(computed, float)
    real, upper, close = LANGUAGE.types[program.dtype], name.upper(), _tolerance(program.dtype, computed.dtype)
    arrays = {"given": given.ravel(), "expected": expected.ravel(), "greatest": np.abs(expected).max(axis=0)}
    return f"""{_begin(name, "commands and demands", arrays)}
int main(void) {{
    {name}_parameters p;
    {real} m[{upper}_MATRICES], u[{upper}_INPUTS], c[{upper}_CARRY], y[{upper}_OUTPUTS];
    double worst = 0.0;
    int i, k;
    {name}_defaults(&p);
    {name}_prepare(&p, ({real}){step!r}, m);
    for (i = 0; i < {_INSTANTS}; ++i) {{
        for (k = 0; k < {upper}_INPUTS; ++k) u[k] = ({real})given[i * {upper}_INPUTS + k];
        if (i) {name}_step(m, u, c);
        else {name}_start(m, u, c);
        {name}_outputs(c, y);
        for (k = 0; k < {upper}_OUTPUTS; ++k) {{
            const double size = greatest[k] > 0.0 ? greatest[k] : 1.0;
            const double error = fabs(y[k] - expected[i * {upper}_OUTPUTS + k]) / size;
            if (!(error <= worst)) worst = error;
        }}
    }}
    printf("{name}: greatest difference %.1e of the largest command or demand\\n", worst);
    return worst <= {close!r} ? 0 : 1;
}}
"""


def _tolerance(ours: object, computed: object) -> float:
    return 1e-9 if ours == computed == "float64" else 1e-3


def _begin(name: str, what: str, arrays: Mapping[str, np.ndarray]) -> str:
    return f"""/* Compares {name}.c with {what} that jaxdamp computed:  cc {name}.c {name}_test.c -lm && ./a.out */
#include "{name}.h"

#include <math.h>
#include <stdio.h>

{"".join(array_text(label, values) for label, values in arrays.items())}"""


def to_c(
    law: AbstractDamper | AbstractVehicle,
    path: str | os.PathLike[str],
    *,
    part: str = "whole",
    derivatives: bool = False,
    precision: str = "float64",
) -> list[Path]:
    """Write a law, a vehicle or a controller as C source, header and a test program.

    The source is C99 that compiles as C++ too, without allocation, global state or anything but <math.h>: it runs in
    real time. A struct holds the parameters and settings, with units and allowed values as comments; `NAME_defaults`
    sets those of this law or vehicle.

    Of a law, `NAME_init` gives the states at rest at a stroke, `NAME_force` the force, `NAME_advance` the states after
    a step, as the methods of the law do, and `NAME_state_rate` their rate for solvers of differential equations. The
    test program repeats a motion and compares the forces with those computed here.

    Of a vehicle, `NAME_prepare` computes what follows from the parameters and the step, `NAME_start` the static
    equilibrium on the road, `NAME_step` a step of `simulate` with the exponential engine, `NAME_outputs` the channels
    and `NAME_state_rate` the rates of the states. The test program compares the channels of a run with `simulate`.

    A controlled vehicle (`control.Controlled`) is such a vehicle, whose steps are instants of its controller; it has no
    `NAME_state_rate`. With `part="controller"` its controller is written alone, as a control unit runs it: `NAME_start`
    takes the first sample of the measured signals, `NAME_step` the next instant, a period or a whole part of it later,
    and `NAME_outputs` gives command and demanded force of each damper. The filter of the sensors is inside. The delay
    and the actuator belong to the vehicle; but where laws have states, as with hysteresis, the controller has copies of
    them, whose states follow the measured motion under the commands as delay and actuator let them act.

    `cc NAME.c NAME_test.c -lm && ./a.out` runs the test.

    Arguments:
        law: any law or composition, or any vehicle with its laws.
        path: the source file `NAME.c` to write, beside which `NAME.h` and `NAME_test.c` are written, or a folder for
            files named after the class. Existing files are replaced.
        part: "whole", or "controller" for the controller of a controlled vehicle alone.
        derivatives: also write functions for the change of the results for given changes of parameters, motion (of a
            vehicle: heights and rates of the road) and states; not of a controlled vehicle, which jumps at its samples.
        precision: "float64", or "float32" for processors that compute in single precision.

    Returns:
        The paths of header, source and test program.

    Raises:
        ValueError: a folder that does not exist, a name that C does not allow, another precision, a vehicle without
            static equilibrium, a controller of a law or a vehicle that has none, derivatives of a controlled vehicle.
        NotImplementedError: an operation of a law that cannot be printed; the message names it.
    """
    check_module("law", law, (AbstractDamper, AbstractVehicle), "to_c(law, path)")
    _checks.one_of("precision", precision, ("float64", "float32"))
    program = program_of(law, part, precision)
    file = source_path(part if part == "controller" else type(law).__name__, path)
    name = file.stem
    if derivatives and program.sampled:
        remedy = "Export `vehicle.passive`, with its dampers at fixed commands."
        _checks.refuse("derivatives", "be left out for a controller, which jumps at its samples", True, remedy)
    if isinstance(program, LawProgram):
        source, test = law_source(program, name, DERIVATIVES if derivatives else ()), law_test(program, name)
    elif isinstance(program, ControllerProgram):
        source, test = controller_source(program, name), controller_test(program, name)
    else:
        source, test = vehicle_source(program, name, derivatives), vehicle_test(program, name)
    tests, begin = file.with_name(f"{name}_test.c"), test.partition(name)[0]  # as all test programs begin
    if tests.exists() and not tests.read_text(encoding="utf-8", errors="replace").startswith(begin):
        remedy = "Move that file, or take another name."
        _checks.refuse("path", f"leave room for its test program, {tests.name}", f"{file.name}, beside it", remedy)
    texts = {
        file.with_suffix(".h"): source.header(),
        file: f'#include "{name}.h"\n\n{INCLUDES}\n{source.definitions()}',
        tests: test,
    }
    return [write_whole(file, text) for file, text in texts.items()]


def source_path(kind: str, path: str | os.PathLike[str]) -> Path:
    """The source file, in a folder with the name of the class."""
    given = Path(path).expanduser()
    if given.is_dir():
        return given / f"{re.sub(r'(?<=[a-z])(?=[A-Z])', '_', kind).lower()}.c"
    if given.suffix != ".c" or identifier(given.stem) != given.stem:
        must = "be a folder or a file NAME.c whose name is an identifier of C"
        _checks.refuse("path", must, str(given), f"Try {identifier(given.stem) + '.c'!r}.")
    return given

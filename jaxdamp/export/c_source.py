"""A law or a vehicle as portable C."""

import os
import re
from pathlib import Path

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._c_text import INCLUDES
from jaxdamp.export._law_program import LawProgram, identifier
from jaxdamp.export._law_source import DERIVATIVES, law_source
from jaxdamp.export._self_test import law_test, vehicle_test
from jaxdamp.export._vehicle_program import VehicleProgram
from jaxdamp.export._vehicle_source import vehicle_source
from jaxdamp.vehicles import AbstractVehicle


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

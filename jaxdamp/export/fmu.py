"""A law, a vehicle or a controller as functional mock-up unit (FMI 2.0)."""

import hashlib
import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._unit_registry import unit_registry
from jaxdamp._warned import warn
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._c_text import controller_source, law_source, vehicle_source
from jaxdamp.export._controlled_program import ControlledProgram
from jaxdamp.export._controller_program import ControllerProgram, Line, program_of
from jaxdamp.export._fmu_limits import GREATEST, in_fmi, limits, margins, tables
from jaxdamp.export._law_program import LawProgram, identifier
from jaxdamp.export._vehicle_program import LONGEST_STEP, PreparedProgram, VehicleProgram
from jaxdamp.vehicles import AbstractVehicle, Channel


_NAMES, _SYMBOLS = "kilogram meter second ampere kelvin mole radian", "kg m s A K mol rad"
_BASE_UNITS = dict(zip(_NAMES.split(), _SYMBOLS.split(), strict=True))
_SIGNAL = {"variability": "continuous"}
_INPUT = {"causality": "input"} | _SIGNAL
_OUTPUT = {"causality": "output", "initial": "calculated"} | _SIGNAL
_LOCAL = {"causality": "local", "initial": "calculated"} | _SIGNAL
_FIXED = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
_SHORTEST = 1e-9  # s, of longest_step


AnyProgram: TypeAlias = LawProgram | VehicleProgram | ControllerProgram


class Variable(NamedTuple):
    """A variable of the model description; its value reference is its place in the list."""

    name: str
    unit: str
    about: dict[str, str]
    start: float | None = None
    limits: tuple[float, float] = (-np.inf, np.inf)
    derivative_of: int | None = None


def variables(program: AnyProgram, longest_step: float) -> list[Variable]:
    """All variables, in the order of unit.c: values and rates of the inputs, outputs, numbers, states, their rates."""
    inputs, outputs = _signals(program)
    listed = [Variable(line.name, line.unit, _INPUT | {"description": line.description}, 0.0) for line in inputs]
    listed += [Variable(line.name, line.unit, _OUTPUT | {"description": line.description}) for line in outputs]
    words = (
        "longest step of the model, right for its numbers as exported; shorten it for steeper laws or lighter wheels"
    )
    said = {"description": f"{words}. Longer communication steps are divided"}
    listed.append(Variable("longest_step", "s", _FIXED | said, longest_step, (_SHORTEST, np.inf)))
    listed += _of_numbers(program)
    if not program.numbers:
        listed.append(Variable("none", "", _FIXED, 0.0))
    listed += _of_states(program, len(listed))
    names = [variable.name for variable in listed]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        _checks.refuse("law", "have a different name for each parameter, channel and input", f"two of {double!r}")
    return listed


def _signals(program: AnyProgram) -> tuple[Sequence[Line | Channel], Sequence[Line | Channel]]:
    """Inputs and outputs."""
    if isinstance(program, ControllerProgram):
        return program.inputs, program.outputs
    if isinstance(program, LawProgram):
        motion = [Line("x", "m", "stroke, positive in extension"), Line("v", "m/s", "velocity, positive in extension")]
        return motion, [Line("F", "N", "force, positive when it resists extension")]
    said = "rate of {}; in co-simulation it follows from the heights as long as it is zero"
    rates = [Line(f"{height.name}_rate", "m/s", said.format(height.name)) for height in program.heights]
    return [*program.heights, *rates], program.channels


def _of_states(program: AnyProgram, first: int) -> list[Variable]:
    """The states, of which the first has this place, and their rates, if an importing tool may integrate them."""
    if isinstance(program, ControllerProgram) or program.sampled:
        return []
    if isinstance(program, LawProgram):
        states = [(f"state[{k}]", "") for k in range(program.states)]
    else:
        states = [(f"state.{name}", unit) for name, unit in program.states]
    listed = [Variable(name, unit, _LOCAL) for name, unit in states]
    rates = {"m": "m/s", "m/s": "m/s^2", "rad": "rad/s", "rad/s": "rad/s^2"}
    return listed + [
        Variable(f"der({name})", rates.get(unit, ""), _LOCAL, derivative_of=first + k)
        for k, (name, unit) in enumerate(states)
    ]


def _of_numbers(program: AnyProgram) -> Iterator[Variable]:
    """One variable for each number; `terms.0.knots` becomes `terms[0].knots[1]`."""
    causes = {"parameter": _FIXED | {"variability": "tunable"}, "setting": _FIXED, "command": _INPUT}
    for number in program.numbers:
        about = causes[number.kind] | {"description": number.meaning}
        for index in np.ndindex(*number.value.shape):
            place = f"[{','.join(map(str, index))}]" if index else ""
            ends = limits(number.domain, index[-1] if index else 0)
            yield Variable(in_fmi(number.path) + place, number.unit, about, float(number.value[index]), ends)


def description(program: AnyProgram, members: list[Variable], name: str, guid: str) -> str:
    """The model description as XML; what is sampled is for co-simulation only."""
    model = program.law if isinstance(program, LawProgram) else program.vehicle
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=type(model).__name__,
        guid=f"{{{guid}}}",
        description=repr(model),
        generationTool=f"jaxdamp {importlib.metadata.version('jaxdamp')}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    can = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true", "canNotUseMemoryManagementFunctions": "true"}
    steps = {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true"}
    kinds = {"ModelExchange": {"providesDirectionalDerivative": "true"}, "CoSimulation": steps}
    for kind, more in list(kinds.items())[program.sampled :]:
        files = ET.SubElement(ET.SubElement(root, kind, {"modelIdentifier": name} | can | more), "SourceFiles")
        ET.SubElement(files, "File", {"name": f"{name}.c"})
    step = program.vehicle.period if isinstance(program, ControllerProgram) else LONGEST_STEP
    _units(ET.SubElement(root, "UnitDefinitions"), {variable.unit for variable in members} - {""})
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    listed = ET.SubElement(root, "ModelVariables")
    for place, variable in enumerate(members):
        attributes = {"name": variable.name, "valueReference": str(place)} | variable.about
        scalar = ET.SubElement(listed, "ScalarVariable", attributes)
        real = ET.SubElement(scalar, "Real", {"unit": variable.unit} if variable.unit else {})
        ends = zip(("min", "max"), variable.limits, strict=True)
        numbers = {key: end for key, end in ends if abs(end) < GREATEST} | {"start": variable.start}
        numbers |= {"derivative": None if variable.derivative_of is None else variable.derivative_of + 1}
        real.attrib |= {key: repr(value) for key, value in numbers.items() if value is not None}
    _structure(ET.SubElement(root, "ModelStructure"), members)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _structure(structure: ET.Element, members: list[Variable]) -> None:
    """Outputs, derivatives and what is computed at the start, by places counted from one."""
    about = [variable.about for variable in members]
    lists = {
        "Outputs": [k for k, a in enumerate(about) if a["causality"] == "output"],
        "Derivatives": [k for k, variable in enumerate(members) if variable.derivative_of is not None],
        "InitialUnknowns": [k for k, a in enumerate(about) if a.get("initial") == "calculated"],
    }
    for name, places in lists.items():
        if places:
            group = ET.SubElement(structure, name)
            for place in places:
                ET.SubElement(group, "Unknown", index=str(place + 1))


def _units(definitions: ET.Element, units: set[str]) -> None:
    """Units with their powers of SI base units."""
    registry: Any = unit_registry()
    for unit in sorted(units):
        base = registry.Quantity(1.0, unit).to_base_units()
        entry = ET.SubElement(definitions, "Unit", {"name": unit})
        powers = dict(base.unit_items())
        if all(float(power).is_integer() and key in _BASE_UNITS for key, power in powers.items()):
            attributes = {_BASE_UNITS[key]: str(int(power)) for key, power in powers.items()}
            ET.SubElement(entry, "BaseUnit", attributes | {"factor": repr(float(base.magnitude))})


_PLATFORMS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}
_TEXTS = Path(__file__).parent / "fmi2"
_WHEN = (2000, 1, 1, 0, 0, 0)  # of all files in the archive: the same model gives the same file


def to_fmu(
    law: AbstractDamper | AbstractVehicle,
    path: str | os.PathLike[str],
    *,
    part: str = "whole",
    compiler: str | None = "cc",
) -> Path:
    """Write a law, a whole vehicle or a controller as FMU of FMI 2.0, for co-simulation and for model exchange.

    Inputs of a law are the stroke `x` and the velocity `v`, positive in extension; the output is the force `F`,
    positive when it resists extension. Inputs of a vehicle are the heights of the road under its wheels and their
    rates, such as `z_road` and `z_road_rate`; outputs are its channels. Commands of laws, such as a coil current, are
    inputs too. Parameters are tunable parameters with units, settings are fixed ones. Numbers that the law does not
    allow, alone or together, and results that are not finite are errors, which are logged.

    In co-simulation a law makes its own steps (`advance`) and a vehicle those of `simulate` (the exponential engine),
    at most `longest_step` long (shorten it for steeper laws or lighter wheels than those exported), without the delay
    of a communication step that inputs held over a step would bring. A vehicle begins at rest in its static equilibrium
    on the first heights. Rates of the road that are not given follow from the heights. In model exchange the importing
    tool integrates the states, with exact directional derivatives of outputs and rates by inputs, states and
    parameters, as implicit solvers and linearisations want them. The file has C sources, and a binary for this platform
    if there is a compiler.

    A controlled vehicle and, with `part="controller"`, its controller alone are for co-simulation only, since they jump
    at their samples. Communication steps may be of any length, also different ones, that can be divided so that
    samples lie between two steps; others are an error, which is logged. Inputs of a controller are what its sensors
    measure, such as `damper_body_velocity`; outputs are commands and demands, which belong to the inputs of the same
    instant once these are set; right after a step they belong to inputs that are held.

    Arguments:
        law: any law or composition, or any vehicle with its laws.
        path: the file to write, NAME.fmu; an existing one is replaced, and never left incomplete.
        part: "whole", or "controller" for the controller of a controlled vehicle alone.
        compiler: the command of a C compiler with the options of gcc; None for an FMU of sources only, which the
            importing tool compiles.

    Returns:
        The path of the file.

    Raises:
        ValueError: a folder that does not exist, a name that is no identifier of C, a vehicle whose laws are too steep
            for steps of 1/64 ms, a controller of a law or a vehicle that has none.
        NotImplementedError: an operation of a law that cannot be printed; the message names it.
        RuntimeError: a compiler that fails.
    """
    check_module("law", law, (AbstractDamper, AbstractVehicle), "to_fmu(law, path)")
    file = Path(path).expanduser()
    name = file.stem
    if file.suffix != ".fmu" or identifier(name) != name:
        must = "be a file NAME.fmu whose name is an identifier of C"
        _checks.refuse("path", must, str(file), f"Try {identifier(name) + '.fmu'!r}.")
    program = program_of(law, part)
    longest = program.longest_step if isinstance(program, PreparedProgram) else LONGEST_STEP
    listed = variables(program, longest)
    code, text = _printed(program, listed)
    files = ("checks.c", code, "unit.c", "services.c")
    texts = [text, *((_TEXTS / file).read_text(encoding="utf-8") for file in files)]
    guid = hashlib.sha256(repr((texts, listed)).encode()).hexdigest()[:32]
    defines = {"GUID": f'"{{{guid}}}"', "DEFAULT_STEP": repr(longest), "SHORTEST": repr(_SHORTEST)}
    if isinstance(program, ControlledProgram | ControllerProgram):
        defines |= {"PERIOD": repr(program.vehicle.period), "DELAY": repr(program.delay)}
    source = "\n".join([*(f"#define {key} {value}" for key, value in defines.items()), "", *texts])
    contents = {"modelDescription.xml": description(program, listed, name, guid).encode()}
    contents |= {f"sources/{h.name}": h.read_bytes() for h in sorted(_TEXTS.glob("*.h"))}
    contents[f"sources/{name}.c"] = source.encode()
    if compiler is not None:
        contents |= _binary(contents, name, compiler)
    return write_whole(file, _archive(contents))


def _printed(program: AnyProgram, members: list[Variable]) -> tuple[str, str]:
    """The file of this kind of model, and the functions and tables that it uses."""
    if isinstance(program, LawProgram):
        code, source = "law.c", law_source(program, "model", ("force", "state_rate"))
    elif isinstance(program, ControllerProgram):
        code, source = "controller.c", controller_source(program, "model")
    else:
        code, source = "vehicle.c", vehicle_source(program, "model", not program.sampled)
    functions = source._replace(functions=[*source.functions, *margins(program)]).static()
    outputs = [variable.name for variable in members if variable.about["causality"] == "output"]
    return code, functions + tables(program, [variable.name for variable in _of_numbers(program)], outputs)


def _binary(contents: dict[str, bytes], name: str, compiler: str) -> dict[str, bytes]:
    """The shared library for this platform; nothing, and a warning, without the compiler."""
    command = shutil.which(compiler)
    if command is None:
        said = f"There is no compiler {compiler!r}: {name}.fmu has C sources and no binary."
        warn(f"{said} Pass `compiler=...`, or None to leave the binary out.")
        return {}
    system, ending = _PLATFORMS[sys.platform]
    with tempfile.TemporaryDirectory() as folder:
        for file in (file for file in contents if file.startswith("sources/")):
            (Path(folder) / Path(file).name).write_bytes(contents[file])
        options = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"{name}.c", "-o", "library", "-lm"]
        done = subprocess.run([command, *options], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"The compiler {command} has failed on {name}.c:\n{done.stderr}")
        bits = 64 if sys.maxsize > 2**32 else 32
        return {f"binaries/{system}{bits}/{name}.{ending}": (Path(folder) / "library").read_bytes()}


def _archive(contents: dict[str, bytes]) -> bytes:
    """The files as ZIP archive."""
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in contents.items():
                entry = zipfile.ZipInfo(name, _WHEN)
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
        file.seek(0)
        return file.read()

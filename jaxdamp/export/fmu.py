"""A law as functional mock-up unit (FMI 2.0)."""

import hashlib
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._law_program import LawNumber, LawProgram, identifier
from jaxdamp.export._write import write_whole
from jaxdamp.export.c_source import INCLUDES, functions, header


_PLATFORMS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}
_TEXTS = Path(__file__).parent / "fmi2"
_NAMES, _SYMBOLS = "kilogram meter second ampere kelvin mole radian", "kg m s A K mol rad"
_BASE_UNITS = dict(zip(_NAMES.split(), _SYMBOLS.split(), strict=True))
_WHEN = (2000, 1, 1, 0, 0, 0)  # of all files in the archive: the same law gives the same file


class Variable(NamedTuple):
    """A variable of the model description; its value reference is its place in the list."""

    name: str
    unit: str
    about: dict[str, str]
    start: float | None = None
    limits: tuple[float, float] = (-np.inf, np.inf)
    derivative_of: int | None = None


def to_fmu(law: AbstractDamper, path: str | os.PathLike[str], *, compiler: str | None = "cc") -> Path:
    """Write a law as FMU of FMI 2.0, for co-simulation and for model exchange.

    Inputs are the stroke `x` and the velocity `v`, positive in extension, and commands of the law such as a coil
    current; the output is the force `F`, positive when it resists extension. Parameters of the law are tunable
    parameters with units, settings are fixed ones. In co-simulation the law makes its own steps (`advance`), at most
    `longest_step` long, without the delay of a communication step that inputs held over a step would bring. In model
    exchange the importing tool integrates the states (`state_rate`), with exact directional derivatives of forces and
    rates by inputs, states and parameters, as implicit solvers and linearisations want them. The file has C sources,
    and a binary for this platform if there is a compiler.

    Arguments:
        law: any law or composition.
        path: the file to write, NAME.fmu; an existing one is replaced, and never left incomplete.
        compiler: the command of a C compiler with the options of gcc; None for an FMU of sources only, which the
            importing tool compiles.

    Returns:
        The path of the file.

    Raises:
        ValueError: a folder that does not exist, a name that is no identifier of C.
        NotImplementedError: an operation of the law that cannot be printed; the message names it.
        RuntimeError: a compiler that fails.
    """
    check_module("law", law, (AbstractDamper,), "to_fmu(law, path)")
    file = Path(path).expanduser()
    name = file.stem
    if file.suffix != ".fmu" or identifier(name) != name:
        must = "be a file NAME.fmu whose name is an identifier of C"
        _checks.refuse("path", must, str(file), f"Try {identifier(name) + '.fmu'!r}.")
    program = LawProgram(law)
    source = _law_text(program)
    known = [*_variables(program)]
    guid = hashlib.sha256((source + repr(known)).encode()).hexdigest()[:32]
    source = f'#define GUID "{{{guid}}}"\n\n{source}\n{(_TEXTS / "damper.c").read_text(encoding="utf-8")}'
    contents = {"modelDescription.xml": _description(program, known, name, guid).encode()}
    contents |= {f"sources/{h.name}": h.read_bytes() for h in sorted(_TEXTS.glob("*.h"))}
    contents[f"sources/{name}.c"] = source.encode()
    if compiler is not None:
        contents |= _binary(contents, name, compiler)
    return write_whole(file, _archive(contents))


def _law_text(program: LawProgram) -> str:
    """The functions of the law, visible in their file only."""
    derivatives = ("force", "state_rate")  # what model exchange asks for
    declared = header(program, "law", derivatives)
    declared = re.sub(r"(?m)^(void|double) (?=\w+\()", r"static \1 ", declared)
    return f"{declared}\n{INCLUDES}\n{functions(program, 'law', derivatives, static=True)}"


def _variables(program: LawProgram) -> Iterator[Variable]:
    """All variables, in the order that the C source gives them."""
    signal = {"variability": "continuous"}
    held = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
    on = {"description": "stroke, positive in extension"}
    yield Variable("x", "m", {"causality": "input", **signal, **on}, 0.0)
    on = {"description": "velocity, positive in extension"}
    yield Variable("v", "m/s", {"causality": "input", **signal, **on}, 0.0)
    on = {"description": "force, positive when it resists extension"}
    yield Variable("F", "N", {"causality": "output", **signal, "initial": "calculated", **on})
    on = {"description": "longest step of the law; longer communication steps are divided"}
    yield Variable("longest_step", "s", {**held, **on}, 1e-3, (1e-9, np.inf))
    for number in program.numbers:
        yield from _of_number(number)
    if not program.numbers:
        yield Variable("none", "", held, 0.0)
    first = sum(max(n.value.size, 1) for n in program.numbers) + 4 + (not program.numbers)
    local = {"causality": "local", **signal, "initial": "calculated"}
    for k in range(program.states):
        yield Variable(f"state[{k}]", "", local)
    for k in range(program.states):
        yield Variable(f"der(state[{k}])", "", local, derivative_of=first + k)


def _of_number(number: LawNumber) -> Iterator[Variable]:
    """One variable for each number; `terms.0.knots` becomes `terms[0].knots[1]`."""
    name = re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", number.path)
    causes = {
        "parameter": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
        "setting": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
        "command": {"causality": "input", "variability": "continuous"},
    }
    about = causes[number.kind] | {"description": number.meaning}
    for index in np.ndindex(*number.value.shape):
        place = f"[{','.join(map(str, index))}]" if index else ""
        yield Variable(
            name + place, number.unit, about, float(number.value[index]), (number.domain.lower, number.domain.upper)
        )


def _description(program: LawProgram, known: list[Variable], name: str, guid: str) -> str:
    """The model description as XML."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=type(program.law).__name__,
        guid=f"{{{guid}}}",
        description=repr(program.law),
        generationTool=f"jaxdamp {importlib.metadata.version('jaxdamp')}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    can = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true", "canNotUseMemoryManagementFunctions": "true"}
    steps = {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true"}
    for kind, more in (("ModelExchange", {"providesDirectionalDerivative": "true"}), ("CoSimulation", steps)):
        files = ET.SubElement(ET.SubElement(root, kind, {"modelIdentifier": name} | can | more), "SourceFiles")
        ET.SubElement(files, "File", {"name": f"{name}.c"})
    _units(ET.SubElement(root, "UnitDefinitions"), {variable.unit for variable in known} - {""})
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    listed = ET.SubElement(root, "ModelVariables")
    for place, variable in enumerate(known):
        attributes = {"name": variable.name, "valueReference": str(place)} | variable.about
        scalar = ET.SubElement(listed, "ScalarVariable", attributes)
        real = ET.SubElement(scalar, "Real", {"unit": variable.unit} if variable.unit else {})
        limits = zip(("min", "max"), variable.limits, strict=True)
        numbers = {key: limit for key, limit in limits if np.isfinite(limit)} | {"start": variable.start}
        numbers |= {"derivative": None if variable.derivative_of is None else variable.derivative_of + 1}
        real.attrib |= {key: repr(value) for key, value in numbers.items() if value is not None}
    _structure(ET.SubElement(root, "ModelStructure"), known)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _structure(structure: ET.Element, known: list[Variable]) -> None:
    """Outputs, derivatives and what is computed at the start, by places counted from one."""
    about = [variable.about for variable in known]
    lists = {
        "Outputs": [k for k, a in enumerate(about) if a["causality"] == "output"],
        "Derivatives": [k for k, variable in enumerate(known) if variable.derivative_of is not None],
        "InitialUnknowns": [k for k, a in enumerate(about) if a.get("initial") == "calculated"],
    }
    for name, places in lists.items():
        if places:
            group = ET.SubElement(structure, name)
            for place in places:
                ET.SubElement(group, "Unknown", index=str(place + 1))


def _units(definitions: ET.Element, units: set[str]) -> None:
    """Units with their powers of SI base units."""
    import pint

    registry: Any = pint.UnitRegistry()
    for unit in sorted(units):
        base = registry.Quantity(1.0, unit).to_base_units()
        entry = ET.SubElement(definitions, "Unit", {"name": unit})
        powers = dict(base.unit_items())
        if all(float(power).is_integer() and key in _BASE_UNITS for key, power in powers.items()):
            attributes = {_BASE_UNITS[key]: str(int(power)) for key, power in powers.items()}
            ET.SubElement(entry, "BaseUnit", attributes | {"factor": repr(float(base.magnitude))})


def _binary(contents: dict[str, bytes], name: str, compiler: str) -> dict[str, bytes]:
    """The shared library for this platform; nothing, and a warning, without the compiler."""
    command = shutil.which(compiler)
    if command is None:
        said = f"There is no compiler {compiler!r}: {name}.fmu has C sources and no binary."
        warnings.warn(f"{said} Pass `compiler=...`, or None to leave the binary out.", stacklevel=3)
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

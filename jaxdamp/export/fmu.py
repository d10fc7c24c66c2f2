"""A law or a vehicle as functional mock-up unit (FMI 2.0)."""

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
import zipfile
from pathlib import Path

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._law_program import LawProgram, identifier
from jaxdamp.export._law_source import law_source
from jaxdamp.export._model_description import description, variables
from jaxdamp.export._vehicle_program import VehicleProgram
from jaxdamp.export._vehicle_source import vehicle_source
from jaxdamp.simulation import substeps_needed
from jaxdamp.vehicles import AbstractVehicle


_PLATFORMS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}
_TEXTS = Path(__file__).parent / "fmi2"
_LONGEST_STEP = 1e-3  # s
_WHEN = (2000, 1, 1, 0, 0, 0)  # of all files in the archive: the same model gives the same file


def to_fmu(law: AbstractDamper | AbstractVehicle, path: str | os.PathLike[str], *, compiler: str | None = "cc") -> Path:
    """Write a law or a whole vehicle as FMU of FMI 2.0, for co-simulation and for model exchange.

    Inputs of a law are the stroke `x` and the velocity `v`, positive in extension; the output is the force `F`,
    positive when it resists extension. Inputs of a vehicle are the heights of the road under its wheels and their
    rates, such as `z_road` and `z_road_rate`; outputs are its channels. Commands of laws, such as a coil current, are
    inputs too. Parameters are tunable parameters with units, settings are fixed ones.

    In co-simulation a law makes its own steps (`advance`) and a vehicle those of `simulate` (the exponential engine),
    at most `longest_step` long, without the delay of a communication step that inputs held over a step would bring. A
    vehicle begins at rest in its static equilibrium on the first heights. Rates of the road that are not given follow
    from the heights. In model exchange the importing tool integrates the states, with exact directional derivatives of
    outputs and rates by inputs, states and parameters, as implicit solvers and linearisations want them. The file has
    C sources, and a binary for this platform if there is a compiler.

    Arguments:
        law: any law or composition, or any vehicle with its laws.
        path: the file to write, NAME.fmu; an existing one is replaced, and never left incomplete.
        compiler: the command of a C compiler with the options of gcc; None for an FMU of sources only, which the
            importing tool compiles.

    Returns:
        The path of the file.

    Raises:
        ValueError: a folder that does not exist, a name that is no identifier of C, a vehicle whose laws are too steep
            for steps of 1/64 ms.
        NotImplementedError: an operation of a law that cannot be printed; the message names it.
        RuntimeError: a compiler that fails.
    """
    check_module("law", law, (AbstractDamper, AbstractVehicle), "to_fmu(law, path)")
    file = Path(path).expanduser()
    name = file.stem
    if file.suffix != ".fmu" or identifier(name) != name:
        must = "be a file NAME.fmu whose name is an identifier of C"
        _checks.refuse("path", must, str(file), f"Try {identifier(name) + '.fmu'!r}.")
    if isinstance(law, AbstractDamper):
        program, longest, code = LawProgram(law), _LONGEST_STEP, "law.c"
        model, printed = program.law, law_source(program, "model", ("force", "state_rate"))
    else:
        program, longest, code = VehicleProgram(law), _LONGEST_STEP / substeps_needed(law, _LONGEST_STEP), "vehicle.c"
        model, printed = program.vehicle, vehicle_source(program, "model", derivatives=True)
    listed = variables(program, longest)
    texts = [
        printed.static(),
        *((_TEXTS / file).read_text(encoding="utf-8") for file in (code, "unit.c", "services.c")),
    ]
    guid = hashlib.sha256(repr((texts, listed)).encode()).hexdigest()[:32]
    source = "\n".join([f'#define GUID "{{{guid}}}"', f"#define DEFAULT_STEP {longest!r}\n", *texts])
    contents = {"modelDescription.xml": description(model, listed, name, guid).encode()}
    contents |= {f"sources/{h.name}": h.read_bytes() for h in sorted(_TEXTS.glob("*.h"))}
    contents[f"sources/{name}.c"] = source.encode()
    if compiler is not None:
        contents |= _binary(contents, name, compiler)
    return write_whole(file, _archive(contents))


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

"""Printed loops as machine code: by the C compiler of the system, and by NVRTC for GPUs."""

import atexit
import ctypes
import ctypes.util
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import uuid
from importlib import resources, util
from pathlib import Path
from typing import NamedTuple

import jax


class Build(NamedTuple):
    """How a C text is compiled: the first that the compiler takes, of several sets of options."""

    options: tuple[tuple[str, ...], ...]
    with_xla: bool = False  # whether it needs the headers of XLA


_COMMON = "-std=gnu11 -march=native -fPIC -shared -w -fopenmp-simd -fno-math-errno -fno-trapping-math -fno-signed-zeros"
# Of a fit: little time to compile, derivatives in vectors of the processor.
FIT = Build((tuple(f"{_COMMON} -O2 -ftree-vectorize -ffp-contract=fast -lm".split()),))
# Multiplications and additions are fused as XLA fuses them; sums stay in their order, what is not finite stays so.
_LOOP = tuple(f"{_COMMON} -O3 -freciprocal-math -ffp-contract=fast -lm".split())
_OF_GCC = (  # for x86; without the last one, loops that read a thousand places are not made vectors of
    *("-mprefer-vector-width=512", "-mrecip", "-fno-tree-pre", "-lmvec", "-ldl"),
    "--param=loop-max-datarefs-for-datadeps=1000000",
)
LOOP = Build(((*_LOOP, *_OF_GCC), _LOOP), with_xla=True)


def compiler() -> str | None:
    """The C compiler: the environment variable `CC`, or gcc, clang, cc on the path; None without one."""
    chosen = os.environ.get("CC", "").split()
    return next(filter(None, map(shutil.which, [*chosen[:1], "gcc", "clang", "cc"])), None)


def compiled_by() -> str:
    """The path of the C compiler.

    Raises:
        NotImplementedError: there is none.
    """
    tool = compiler()
    if tool is None:
        raise NotImplementedError("No C compiler is at hand. Install gcc or clang, or name one in the variable CC.")
    return tool


@functools.cache
def library(text: str, build: Build = FIT) -> ctypes.CDLL:
    """A C text compiled and loaded; kept for other processes beside the compiled programs of JAX, where these are kept.

    The file is named by its text, compiler and processor, and by what it holds, so that another one is never loaded
    for it; the folder must be this user's and closed to others, or else the file is only that of this process.

    Arguments:
        text: C.
        build: how it is compiled.

    Raises:
        NotImplementedError: no C compiler, or one that refuses the text; no room for temporary files, or none from
            which programs may run. The message holds what was said.
    """
    tool, problem = compiled_by(), None
    headers = [f"-I{jax.ffi.include_dir()}", f"-I{resources.files('jaxdamp.codegen')}"] if build.with_xla else []
    for place in (_lasting_folder, _folder):
        try:
            folder = place()
            if folder is not None:
                return _loaded(folder, text, [tool, *headers], build)
        except OSError as error:  # such as a folder from which no program may run
            problem = error
    remedy = "Name another folder for temporary files, from which programs may run, in the variable TMPDIR."
    raise NotImplementedError(f"Printed functions cannot be compiled or loaded here ({problem}). {remedy}") from problem


def _loaded(folder: Path, text: str, command: list[str], build: Build) -> ctypes.CDLL:
    """From a folder where it may be already."""
    digest = hashlib.sha256("\n".join([text, *command, str(build), _processor()]).encode()).hexdigest()[:24]
    for path in folder.glob(f"c_{digest}_*.so"):
        if path.stem.endswith(hashlib.sha256(path.read_bytes()).hexdigest()[:24]):
            return ctypes.CDLL(str(path))
    draft = folder / f"{digest}-{uuid.uuid4().hex}"
    source, target = draft.with_suffix(".c"), draft.with_suffix(".tmp")
    source.write_text(text, encoding="utf-8")
    said = _compiled([*command, str(source), "-o", str(target)], build)
    source.unlink()
    if said is not None:
        raise NotImplementedError(f"{command[0]} does not compile the printed functions: {said}")
    path = folder / f"c_{digest}_{hashlib.sha256(target.read_bytes()).hexdigest()[:24]}.so"
    target.replace(path)
    return ctypes.CDLL(str(path))


def _compiled(command: list[str], build: Build) -> str | None:
    """What the compiler said if it refused a text; None if it did not."""
    said = None
    for options in build.options:
        done = subprocess.run([*command, *options], capture_output=True, text=True)
        if done.returncode == 0:
            return None
        said = done.stderr.strip()[-2000:]
    return said


def _lasting_folder() -> Path | None:
    """Beside the compiled programs of JAX, if these are kept, in a folder that only this user can write."""
    cache = getattr(jax.config, "jax_compilation_cache_dir", None)
    if not cache or "://" in cache or not hasattr(os, "getuid"):
        return None
    folder = Path(cache) / "printed"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
    except OSError:
        return None
    return folder if state.st_uid == os.getuid() and not state.st_mode & 0o022 and os.access(folder, os.W_OK) else None


@functools.cache
def _processor() -> str:
    """What the compiler's `-march=native` means: another processor needs another file."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return " ".join(platform.uname())
    kinds = {line for line in lines if line.startswith(("flags", "model name", "Features"))}
    return platform.machine() + " ".join(sorted(kinds))


@functools.cache
def _folder() -> Path:
    """Of this process, removed at its end."""
    folder = Path(tempfile.mkdtemp(prefix="jaxdamp-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def registered(text: str, *functions: tuple[str, str]) -> str:
    """The name under which XLA calls functions of a C text, compiled once in a process.

    Functions are given with their platform of XLA, "cpu" or "CUDA"; without any it is `loop` on "cpu".
    """
    name, loops = f"jaxdamp_loop_{hashlib.sha256(text.encode()).hexdigest()[:20]}", library(text, LOOP)
    for where, function in functions or (("cpu", "loop"),):
        jax.ffi.register_ffi_target(name, jax.ffi.pycapsule(getattr(loops, function)), platform=where)
    return name


INSTALL = "Install `nvidia-cuda-nvrtc-cu12`, or `nvidia-cuda-nvrtc` for CUDA 13."
VERBOSE = b"--ptxas-options=-v"  # says registers and spills


class Compiler(NamedTuple):
    """An NVRTC that is installed."""

    library: ctypes.CDLL
    version: tuple[int, int]
    architectures: frozenset[int]  # such as 90

    @classmethod
    def at(cls, path: str) -> "Compiler":
        """That of a file."""
        library, major, minor, count = ctypes.CDLL(path), ctypes.c_int(), ctypes.c_int(), ctypes.c_int()
        library.nvrtcVersion(ctypes.byref(major), ctypes.byref(minor))
        library.nvrtcGetNumSupportedArchs(ctypes.byref(count))
        numbers = (ctypes.c_int * count.value)()
        library.nvrtcGetSupportedArchs(numbers)
        return cls(library, (major.value, minor.value), frozenset(numbers))


class Kernel(NamedTuple):
    """A compiled kernel."""

    image: bytes  # CUBIN
    report: str  # of the assembler: registers, stack and spills


@functools.cache
def compilers() -> tuple[Compiler, ...]:
    """The run-time compilers of CUDA that are installed: those of JAX and of the system."""
    spec = util.find_spec("nvidia")
    folders = [Path(place) for place in (spec.submodule_search_locations or ())] if spec else []
    paths = [str(path) for folder in folders for path in sorted(folder.glob("*/lib/libnvrtc.so.*"))]
    return tuple(Compiler.at(path) for path in [*paths, *filter(None, [ctypes.util.find_library("nvrtc")])])


def driver_version() -> tuple[int, int] | None:
    """The newest CUDA that the driver of this machine knows, such as (12, 4); None without a driver."""
    try:
        driver, number = ctypes.CDLL("libcuda.so.1"), ctypes.c_int()
    except OSError:
        return None
    return divmod(number.value // 10, 100) if not driver.cuDriverGetVersion(ctypes.byref(number)) else None


def compiler_for(architecture: int) -> Compiler:
    """The newest compiler for an architecture whose kernels the driver loads: of its major version, or an older one.

    Raises:
        NotImplementedError: there is none; the message says what is installed.
    """
    installed_compilers, driver = compilers(), driver_version()
    suiting = [
        c for c in installed_compilers if architecture in c.architectures and (not driver or c.version[0] <= driver[0])
    ]
    if not suiting:
        installed = ", ".join(
            f"{c.version[0]}.{c.version[1]} (up to sm_{max(c.architectures)})" for c in installed_compilers
        )
        here = f"installed: {installed}" if installed else "none is installed"
        for_driver = f" and a driver of CUDA {driver[0]}.{driver[1]}" if driver else ""
        raise NotImplementedError(
            f"No NVRTC, the compiler of CUDA, for sm_{architecture}{for_driver}: {here}. {INSTALL}"
        ) from FileNotFoundError("libnvrtc.so")
    return max(suiting, key=lambda c: c.version)


@functools.cache
def kernel(text: str, architecture: int) -> Kernel:
    """A text compiled for the GPUs of one architecture.

    Raises:
        NotImplementedError: no NVRTC, or it refuses the text; the message holds what it says.
    """
    nvrtc, program = compiler_for(architecture).library, ctypes.c_void_p()
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), text.encode(), b"kernel.cu", 0, None, None)
    options = (ctypes.c_char_p * 2)(f"--gpu-architecture=sm_{architecture}".encode(), VERBOSE)

    def read(what: str) -> bytes:
        size = ctypes.c_size_t()
        getattr(nvrtc, f"nvrtcGet{what}Size")(program, ctypes.byref(size))
        result = ctypes.create_string_buffer(size.value)
        getattr(nvrtc, f"nvrtcGet{what}")(program, result)
        return result.raw

    refused = nvrtc.nvrtcCompileProgram(program, 2, options)
    report = read("ProgramLog").rstrip(b"\0").decode(errors="replace")
    image = b"" if refused else read("CUBIN")
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    if refused:
        raise NotImplementedError(f"NVRTC does not compile the printed loop: {report[-2000:]}")
    return Kernel(image, report)


def launcher(images: list[bytes]) -> str:
    """The C text of the function that launches a kernel, of which there is an image for each architecture."""
    template = resources.files("jaxdamp.codegen").joinpath("launch.c").read_text(encoding="utf-8")
    kind = "__attribute__((aligned(16))) static const unsigned char"
    rows = [f"{kind} image{i}[] = {{{','.join(map(str, image))}}};" for i, image in enumerate(images)]
    names = ", ".join(f"image{i}" for i in range(len(images)))
    return template.replace("@images@", "\n".join(rows)).replace("@names@", names)


def on_gpu() -> bool:
    """Whether what is traced runs on a GPU: on the default device, or else that of JAX."""
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    if isinstance(device, jax.Device):
        return device.platform == "gpu"
    return (device or jax.default_backend()) in ("gpu", "cuda")


def registered_on_gpu(text: str) -> str:
    """The name under which XLA calls a kernel on the GPUs of this process; on its processors it is an error."""
    devices = [device for device in jax.local_devices() if device.platform == "gpu"]
    architectures = sorted({int(device.compute_capability.replace(".", "")) for device in devices})  # such as "9.0"
    images = [kernel(text, architecture).image for architecture in architectures]
    return registered(launcher(images), ("CUDA", "loop"), ("cpu", "elsewhere"))

"""Printed loops as CUDA kernels: compiled by NVRTC for the GPU at hand, launched by a small library in C.

Compiled for several architectures and compared through the same text compiled as C; not yet run on a GPU.
"""

import ctypes
import ctypes.util
import functools
from importlib import resources, util
from pathlib import Path
from typing import NamedTuple

import jax

from jaxdamp.codegen._native import registered


INSTALL = "Install `nvidia-cuda-nvrtc-cu12`."
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
        known = (ctypes.c_int * count.value)()
        library.nvrtcGetSupportedArchs(known)
        return cls(library, (major.value, minor.value), frozenset(known))


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
    found, driver = compilers(), driver_version()
    suiting = [c for c in found if architecture in c.architectures and (not driver or c.version[0] <= driver[0])]
    if not suiting:
        installed = ", ".join(f"{c.version[0]}.{c.version[1]} (up to sm_{max(c.architectures)})" for c in found)
        here = f"installed: {installed}" if installed else "none is installed"
        for_driver = f" and a driver of CUDA {driver[0]}.{driver[1]}" if driver else ""
        raise NotImplementedError(
            f"No NVRTC, the compiler of CUDA, for sm_{architecture}{for_driver}: {here}. {INSTALL}"
        )
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

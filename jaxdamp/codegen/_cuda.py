"""Printed loops as CUDA kernels: compiled to PTX by NVRTC, launched from a small library of this machine's C compiler.

Compiled to PTX and compared through the same text compiled as C; not yet run on a GPU.
"""

import ctypes
import ctypes.util
import functools
from importlib import resources, util
from pathlib import Path

import jax

from jaxdamp.codegen._native import registered


@functools.cache
def _nvrtc() -> ctypes.CDLL:
    """The run-time compiler of CUDA, which comes with `jax[cuda12]` and `jax[cuda13]`.

    Raises:
        NotImplementedError: it is not installed.
    """
    spec = util.find_spec("nvidia")
    folders = [Path(place) for place in (spec.submodule_search_locations or ())] if spec else []
    libraries = [str(path) for folder in folders for path in sorted(folder.glob("*/lib/libnvrtc.so.*"))]
    name = next(iter(libraries), None) or ctypes.util.find_library("nvrtc")
    if name is None:
        raise NotImplementedError("NVRTC, the compiler of CUDA, is not installed. Install `nvidia-cuda-nvrtc-cu12`.")
    return ctypes.CDLL(name)


@functools.cache
def ptx(text: str, architecture: str) -> bytes:
    """The PTX of a kernel.

    Arguments:
        text: of the kernel.
        architecture: such as "compute_90".

    Raises:
        NotImplementedError: no NVRTC, or it refuses the text; the message holds what it says.
    """
    nvrtc, program = _nvrtc(), ctypes.c_void_p()
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), text.encode(), b"kernel.cu", 0, None, None)
    options = (ctypes.c_char_p * 1)(f"--gpu-architecture={architecture}".encode())
    refused = nvrtc.nvrtcCompileProgram(program, 1, options)
    what = "ProgramLog" if refused else "PTX"
    size = ctypes.c_size_t()
    getattr(nvrtc, f"nvrtcGet{what}Size")(program, ctypes.byref(size))
    result = ctypes.create_string_buffer(size.value)
    getattr(nvrtc, f"nvrtcGet{what}")(program, result)
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    if refused:
        message = result.value.decode(errors="replace")[-2000:]
        raise NotImplementedError(f"NVRTC does not compile the printed loop: {message}")
    return result.value


def launcher(text: str, architecture: str) -> str:
    """The C text of the function that launches a kernel."""
    template = resources.files("jaxdamp.codegen").joinpath("launch.c").read_text(encoding="utf-8")
    return template.replace("@ptx@", ",".join(map(str, ptx(text, architecture))))


def register_on_gpu(text: str, name: str) -> None:
    """Let XLA call a kernel on the GPUs of this process, under the name of the same loop on its processors."""
    capability = jax.devices()[0].compute_capability  # such as "9.0"
    registered(launcher(text, f"compute_{capability.replace('.', '')}"), "CUDA", name)

"""Sweeps in a process of its own: `python elsewhere.py devices folder` writes their results."""

import sys
import warnings
from pathlib import Path

import jax
import numpy as np
from cases import AXES, decay, failing

import jaxdamp


def main(folder: Path) -> None:
    warnings.simplefilter("error")
    one = [jax.local_devices()[-1]]  # another one than before
    for name, devices, chunk in (("all", None, 1), ("all", None, 7), ("all", None, 4096), ("one", one, None)):
        data = jaxdamp.sweep(decay(), AXES, chunk=chunk, devices=devices, gradients=True)
        data.to_netcdf(folder / f"decay-{name}-{chunk}.nc", engine="scipy")
    for _ in range(2):  # the second time all is done
        data = jaxdamp.sweep(decay(), AXES, chunk=2, gradients=True, file=folder / "shared.nc")
        data.to_netcdf(folder / "decay-shared-2.nc", engine="scipy")
    try:
        jaxdamp.sweep(decay(), {**AXES, "a": [0.0]}, gradients=True, file=folder / "shared.nc")
    except ValueError as error:
        (folder / "refusal.txt").write_text(str(error), encoding="utf-8")
    warnings.simplefilter("ignore", UserWarning)
    data = jaxdamp.sweep(failing, {"a": np.linspace(0.0, 3.0, 7), "b": AXES["b"]}, chunk=4)
    data.to_netcdf(folder / "failing.nc", engine="scipy")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_num_cpu_devices", int(sys.argv[1]))
    main(Path(sys.argv[2]))

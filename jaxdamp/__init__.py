"""From a dyno file to a better damper, differentiable from end to end.

dyno file → damper law with hysteresis → vehicle on a road → ride metric → better damper → table for the simulator
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from jaxdamp import dampers, metrics, roads, vehicles
from jaxdamp.configuration import Configuration, configure
from jaxdamp.rig import respond
from jaxdamp.simulation import Response, Ride, simulate


if TYPE_CHECKING:
    from jaxdamp import bench, export, identify, plots, sweeps, tune
    from jaxdamp.sweeps import sweep


__all__ = [
    "Configuration",
    "Response",
    "Ride",
    "bench",
    "configure",
    "dampers",
    "export",
    "identify",
    "metrics",
    "plots",
    "respond",
    "roads",
    "simulate",
    "sweep",
    "sweeps",
    "tune",
    "vehicles",
]


def __getattr__(name: str) -> Any:
    """Subpackages that need more than JAX are imported when they are first used."""
    if name == "sweep":
        return import_module("jaxdamp.sweeps").sweep
    if name in __all__:
        return import_module(f"jaxdamp.{name}")
    raise AttributeError(f"module 'jaxdamp' has no attribute {name!r}")

"""From a dyno file to a better damper, differentiable from end to end.

dyno file → damper law with hysteresis → vehicle on a road → ride metric → better damper → table for the simulator
"""

from importlib import import_module
from typing import TYPE_CHECKING


if TYPE_CHECKING:
    from jaxdamp import (
        bench,
        control,
        dampers,
        export,
        identify,
        metrics,
        parameters,
        plots,
        report,
        rig,
        roads,
        simulation,
        sweeps,
        testing,
        tune,
        vehicles,
    )
    from jaxdamp.configuration import Configuration as Configuration, configure
    from jaxdamp.rig import respond
    from jaxdamp.simulation import Response, Ride, simulate
    from jaxdamp.sweeps import sweep

    __version__: str


__all__ = [
    "Response",
    "Ride",
    "__version__",
    "bench",
    "configure",
    "control",
    "dampers",
    "export",
    "identify",
    "metrics",
    "parameters",
    "plots",
    "report",
    "respond",
    "rig",
    "roads",
    "simulate",
    "simulation",
    "sweep",
    "sweeps",
    "testing",
    "tune",
    "vehicles",
]

_HOMES = {
    "Configuration": "configuration",
    "Response": "simulation",
    "Ride": "simulation",
    "configure": "configuration",
    "respond": "rig",
    "simulate": "simulation",
    "sweep": "sweeps",
}


def __getattr__(name: str) -> object:
    """Everything is imported when it is first used, so that the command line answers at once."""
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            value = version("jaxdamp")
        except PackageNotFoundError:  # a source tree on the path, not installed
            value = "0+unknown"
    elif name in _HOMES:
        value = getattr(import_module(f"jaxdamp.{_HOMES[name]}"), name)
    elif name in __all__:
        value = import_module(f"jaxdamp.{name}")
    else:
        from jaxdamp._guesses import answer

        answer(__name__, name, __all__)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """All that is public, loaded or not."""
    return sorted(__all__)

"""One `fit` for laws and vehicles."""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, Protocol, cast, overload, runtime_checkable

from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.vehicle_fitting import fit_vehicle
from jaxdamp.identify.vehicle_result import VehicleFit
from jaxdamp.vehicles import AbstractVehicle


P = ParamSpec("P")


@runtime_checkable
class Fit(Protocol[P]):
    """`fit` of a law, which is also `fit_vehicle` of a vehicle."""

    @overload
    def __call__(self, law: AbstractVehicle, runs: Any, **options: Any) -> VehicleFit: ...
    @overload
    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> FitResult: ...


def also_of_vehicles(fit: Callable[P, FitResult]) -> Fit[P]:
    """The same function, which gives a vehicle with its records to `fit_vehicle`."""

    @functools.wraps(fit)
    def either(*args: Any, **kwargs: Any) -> Any:
        given = args[0] if args else kwargs.get("law", kwargs.get("vehicle"))
        return (fit_vehicle if isinstance(given, AbstractVehicle) else fit)(*args, **kwargs)

    return cast(Fit[P], either)

"""The work of the peers done with jaxdamp: the same cars, the same road, the same number."""

import numpy as np

from benchmarks.peers import problem
from jaxdamp import Ride, roads
from jaxdamp.parameters import parameters
from jaxdamp.simulation import Exponential


METRIC = "rms_sprung_acceleration"


def ride(case: str, road: problem.Heights, dt: float = 1e-3, *, printed: bool | None = None) -> Ride:
    """The car of a case, with the law of the first row that is drawn, on a road given at instants."""
    profile = roads.from_profile(np.arange(road.shape[0]) * dt, road)
    car = problem.vehicle(problem.law(case, problem.draw(case, 1)[0]), case)
    engine = Exponential(dt=dt, printed=printed)
    return Ride(car, profile, metrics=[METRIC], duration=(road.shape[0] - 1) * dt, engine=engine)


def paths(case: str) -> list[str]:
    """Where the columns of the table of parameters are in the car."""
    known = [p.path for p in parameters(problem.vehicle(problem.law(case, problem.draw(case, 1)[0]), case))]

    def path(name: str) -> str:
        axle, _, rest = name.partition("_") if case == "half_car" else ("", "", name)
        ends = [p for p in known if p.startswith(f"{axle}.damper" if axle else "damper") and p.endswith(f".{rest}")]
        if len(ends) > 1:  # a stiffness of the car is not one of the law
            ends = [min(ends, key=len)]
        return ends[0]

    return [path(name) for name in problem.names(case)]


def point(case: str, table: problem.Parameters) -> dict[str, np.ndarray]:
    """Parameters of many cars by path."""
    return dict(zip(paths(case), table.T, strict=True))

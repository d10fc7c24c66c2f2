"""Scenarios: the roads of a tuning and the conditions of the vehicle on them, such as payload, wear and tolerance."""

import copy
import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._random import sobol_points
from jaxdamp._traced import equal, of_known_numbers
from jaxdamp._types import Point, Value
from jaxdamp.metrics import Metric
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import AbstractEngine
from jaxdamp.tune.risk import RISKS, Risk, risk_of
from jaxdamp.tune.scenario_ride import ScenarioRide, scenario_ride
from jaxdamp.tune.settings import Run
from jaxdamp.vehicles import AbstractVehicle


Road = AbstractRoad | WhiteRoad
T = TypeVar("T")


class Condition(NamedTuple):
    """A condition of the vehicle: other values of parameters or settings, or factors on them.

    Attributes:
        values: by path, last part or pattern, in SI units: `{"sprung_mass": 1500.0}` is a payload,
            `{"damper.temperature": 350.0}` a hot damper.
        factors: on the values of the vehicle, whatever these are: `{"damper.**_rate": 0.85}` is a worn damper. What is
            tuned can have factors, but no values.
        weight: relative to the other conditions.
    """

    values: Mapping[str, Value] = {}
    factors: Mapping[str, Value] = {}
    weight: float = 1.0


class Scenario(NamedTuple):
    """One road under one condition of the vehicle."""

    name: str  # of the scenario
    road: Road  # what is driven over
    condition: Condition  # values of the vehicle that differ
    weight: float  # in a mean over scenarios [-]


@final
@dataclasses.dataclass(frozen=True, init=False, repr=False)
class Scenarios:
    """Roads and conditions, each with each: takes the place of the road in `minimise`, `sensitivity` and `robust`.

    Few scenarios are driven one after the other, many side by side. A metric is then one number for all of them, by
    `risk`; a limit applies in each of them.

    Arguments:
        roads: by name, or a sequence: several classes, seeds and speeds. All of them are driven for the same time; or
            all are white.
        conditions: of the vehicle, by name or as a sequence; only as it is, if left out. `tolerances` and `samples`
            make them.
        weights: of the roads, relative to each other, in their order or by name; all equal if left out.
        risk: `"mean"`; `"worst"`, the largest value; or `CVaR(share)`, the mean of the worst share.

    Raises:
        ValueError: no road; driven and white roads together; weights that are negative, or not one for each road.

    >>> from jaxdamp import roads, vehicles
    >>> ways = {"C, 20 m/s": roads.white("C", 20.0), "D, 10 m/s": roads.white("D", 10.0)}
    >>> loads = {"empty": Condition(), "laden": Condition({"sprung_mass": 1500.0}, weight=0.5)}
    >>> scenarios = Scenarios(ways, loads)
    >>> scenarios
    Scenarios: 4 (2 roads, 2 conditions), mean
    >>> ride = scenarios.ride(vehicles.presets.quarter_car_000(), metrics=["rms_sprung_acceleration"])
    >>> {name: round(float(value), 3) for name, value in ride({"damper.rate": 3000.0}).items()}
    {'rms_sprung_acceleration': 1.023}
    """

    scenarios: tuple[Scenario, ...]
    risk: Risk
    _counts: tuple[int, int]

    def __init__(
        self,
        roads: Mapping[str, Road] | Sequence[Road],
        conditions: Mapping[str, Condition] | Sequence[Condition] = (),
        *,
        weights: Mapping[str, float] | Sequence[float] | None = None,
        risk: str | Risk = "mean",
    ) -> None:
        on = _named("roads", roads, "road")
        under = _named("conditions", conditions, "condition") or {"": Condition()}
        if not on:
            _checks.refuse("roads", "hold one or more", "empty", "Write `[roads.iso8608('C', 20.0, seed=1)]`.")
        for name, road in on.items():
            check_module(f"roads[{name!r}]", road, (AbstractRoad, WhiteRoad), "Scenarios(roads)")
        if len({isinstance(road, WhiteRoad) for road in on.values()}) > 1:
            remedy = "Drive over all of them, or take `roads.white` for all of them."
            _checks.refuse("roads", "be all white or all driven over", "a mixture", remedy)
        for name, condition in under.items():
            must = "be a `tune.Condition(values, factors)`"
            remedy = "Write `tune.Condition({'sprung_mass': 1500.0})`."
            _checks.instance(f"conditions[{name!r}]", condition, Condition, must, remedy)
            _checks.nonnegative(f"conditions[{name!r}].weight", condition.weight)
        of_roads = _weights(on, weights)
        pairs = list(itertools.product(on.items(), under.items()))
        shares = np.array([of_roads[road] * condition.weight for (road, _), (_, condition) in pairs])
        if not np.all(np.isfinite(shares)) or np.any(shares < 0) or not np.any(shares > 0):
            _checks.refuse(
                "weights", "be 0 or more, some of them positive", shares.tolist(), "Leave them out for equal ones."
            )
        object.__setattr__(self, "risk", risk_of(risk))
        object.__setattr__(self, "_counts", (len(on), len(under)))
        scenarios = (
            Scenario(", ".join(filter(None, (road_name, name))), road, condition, float(share))
            for ((road_name, road), (name, condition)), share in zip(pairs, shares / shares.sum(), strict=True)
        )
        object.__setattr__(self, "scenarios", tuple(scenarios))

    def __len__(self) -> int:
        return len(self.scenarios)

    def __repr__(self) -> str:
        names = (f"{n} {word}{'s' * (n > 1)}" for n, word in zip(self._counts, ("road", "condition"), strict=True))
        risk = getattr(self.risk, "__name__", self.risk)
        return f"Scenarios: {len(self)} ({', '.join(names)}), {risk}"

    @property
    def white(self) -> bool:
        """Whether the roads are white."""
        return isinstance(self.scenarios[0].road, WhiteRoad)

    @property
    def in_words(self) -> str:
        """Where a metric holds that is one number for all, as "in the worst of 4 scenarios"; empty of one scenario."""
        kind = next((f"in the {name} of" for name, risk in RISKS.items() if risk is self.risk), "over")
        return f"{kind} {len(self)} scenarios" if len(self) > 1 else ""

    def on_other_roads(self, seed: int) -> "Scenarios | None":
        """The same scenarios on other realisations of their random roads; `None` if no road is random."""
        originals = {id(s.road): s.road for s in self.scenarios if isinstance(s.road, AbstractRoad)}
        others = {key: road.reseeded(seed) for key, road in originals.items()}
        if all(other is None for other in others.values()):
            return None
        return self._with("scenarios", tuple(s._replace(road=others.get(id(s.road)) or s.road) for s in self.scenarios))

    def with_risk(self, risk: str | Risk) -> "Scenarios":
        """The same scenarios with another risk."""
        return self._with("risk", risk_of(risk))

    def _with(self, name: str, value: object) -> "Scenarios":
        other = copy.copy(self)
        object.__setattr__(other, name, value)
        return other

    def ride(
        self,
        vehicle: AbstractVehicle,
        *,
        metrics: Sequence[str | Metric] | None = None,
        duration: float | None = None,
        dt: float | None = None,
        engine: AbstractEngine | None = None,
    ) -> ScenarioRide:
        """The metrics of a vehicle over all scenarios, called as a `Ride`; the arguments are those of a `Ride`.

        Raises:
            ValueError: what `Ride` refuses on one of the roads, and paths that the vehicle does not have.
        """
        run = Run(duration=duration, dt=dt, engine=engine)
        return scenario_ride(vehicle, self.scenarios, self.risk, metrics, run)


@of_known_numbers
def tolerances(scatter: Mapping[str, float], count: int, *, seed: int = 0) -> dict[str, Condition]:
    """Conditions of `count` dampers or vehicles from one production, whose parameters scatter independently.

    Arguments:
        scatter: standard deviation of each parameter relative to its value, such as `{"damper.**_rate": 0.05}`; all
            that a pattern names have one factor in each sample. Factors are normally distributed, within ±3 standard
            deviations.
        count: number of samples.
        seed: the same seed draws the same samples.

    Raises:
        ValueError: no parameter, a scatter that is not above 0 and below 1/3, a count below one.

    >>> list(tolerances({"damper.rate": 0.1}, 2)["sample 1"].factors)
    ['damper.rate']
    """
    from scipy.stats import truncnorm

    check_scatter(scatter)
    _checks.counts(count=count)
    unit = sobol_points(seed, len(scatter), 0, count)
    factors = 1.0 + truncnorm.ppf(unit, -3.0, 3.0) * np.array(list(scatter.values()))
    return {
        f"sample {i + 1}": Condition(factors=dict(zip(scatter, map(float, row), strict=True)))
        for i, row in enumerate(factors)
    }


def check_scatter(scatter: object) -> None:
    """Refuse what is no mapping of parameters to standard deviations relative to their values, below a third."""
    remedy = "Write `{'damper.**_rate': 0.05}`: 0.05 is a standard deviation of 5 %."
    if not isinstance(scatter, Mapping) or not scatter:
        _checks.refuse("scatter", "be a mapping of one or more parameters", _checks.described(scatter), remedy)
    for name, deviation in scatter.items():
        _checks.positive(f"scatter[{name!r}]", deviation, remedy)
        if not deviation < 1.0 / 3.0:
            _checks.refuse(f"scatter[{name!r}]", "be above 0 and below 1/3", deviation, remedy)


def check_roads(roads: Sequence[object], call: str, others: tuple[type, ...] = ()) -> None:
    """Refuse what is neither a road nor of another kind that may stand for one, and what is there twice."""
    for i, road in enumerate(roads):
        if not isinstance(road, others):
            check_module(f"roads[{i}]", road, (AbstractRoad,), call)
        again = next((j for j in range(i) if equal(roads[j], road)), None)
        if again is not None:
            remedy = "Take several seeds: a road that counts twice makes the error of the mean too small."
            _checks.refuse(f"roads[{i}]", "be another road than the others", f"roads[{again}] again", remedy)


@of_known_numbers
def samples(values: Point) -> dict[str, Condition]:
    """Conditions of given values, one for each sample: those of a fitted law from its posterior, for instance.

    Arguments:
        values: for each parameter its value in each sample, equally many for all; of a vector, shape (samples, size).

    Raises:
        ValueError: no value, or different numbers of samples.

    >>> samples({"damper.rate": [2400.0, 2600.0]})["sample 2"].values
    {'damper.rate': 2600.0}
    """
    columns = {name: np.asarray(column, float) for name, column in values.items()}
    counts = {name: np.shape(column)[0] if np.ndim(column) else 0 for name, column in columns.items()}
    if not counts or len(set(counts.values())) != 1 or 0 in counts.values():
        _checks.refuse("values", "have equally many samples of each parameter, one or more", counts)
    rows = range(next(iter(counts.values())))
    return {
        f"sample {i + 1}": Condition({name: c[i] if c.ndim > 1 else float(c[i]) for name, c in columns.items()})
        for i in rows
    }


def _named(argument: str, given: Mapping[str, T] | Sequence[T], word: str) -> dict[str, T]:
    """Roads or conditions by name: those of a sequence are numbered."""
    if isinstance(given, Mapping):
        return {str(name): one for name, one in given.items()}
    if not isinstance(given, Sequence) or isinstance(given, str | Condition):
        must = f"be {word}s by name, or a sequence"
        _checks.refuse(argument, must, _checks.described(given), f"Write `[...]` around one {word}.")
    return {f"{word} {i + 1}": one for i, one in enumerate(given)}


def _weights(roads: Mapping[str, Road], weights: Mapping[str, float] | Sequence[float] | None) -> dict[str, float]:
    """The weight of each road."""
    if weights is None:
        return dict.fromkeys(roads, 1.0)
    by_name = dict(weights) if isinstance(weights, Mapping) else dict(zip(roads, weights, strict=False))
    if len(weights) != len(roads) or set(by_name) != set(roads):
        _checks.refuse("weights", f"be one for each road ({', '.join(roads)})", weights, "Leave it out for equal ones.")
    return by_name

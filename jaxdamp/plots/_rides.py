"""What a ride sheet shows: vehicles before and after on a road, their numbers, velocities and spectra."""

import dataclasses
import functools
import warnings
from collections.abc import Mapping, Sequence
from statistics import NormalDist

import equinox as eqx
import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import percent_change
from jaxdamp.control import laws_at_levels
from jaxdamp.dampers import AbstractDamper, Linear, takes_command, without_fitted_ranges
from jaxdamp.parameters import get
from jaxdamp.plots import _style
from jaxdamp.rig import quasi_static
from jaxdamp.roads import AbstractRoad, WhiteRoad, from_profile
from jaxdamp.simulation import Response, Ride, simulate
from jaxdamp.tune import Limits, Rescore, Run, TuneResult, change_in_percent, damper_paths, limit_spans
from jaxdamp.vehicles import AbstractVehicle, CriticalDamping, critical_damping, equivalent_dampers, modes


GOALS = {"comfort": "body acceleration", "travel": "suspension travel", "grip": "tyre load variation"}
FACTORS = np.geomspace(0.3, 3.0, 13)  # of the damping, along the curve of constant damping
_MOST_DAMPERS = 2
_NORMAL = np.array([NormalDist().inv_cdf((i + 0.5) / 2000) for i in range(2000)])
_EVENT = 0.35  # share of the run within which the road is moved: less is a bump


@dataclasses.dataclass(frozen=True)
class Rides:
    """Vehicles before and after, with their numbers; equal ones for a single ride."""

    names: tuple[str, str]
    cars: tuple[AbstractVehicle, AbstractVehicle]
    responses: tuple[Response, Response] | None  # None on a white road
    road: AbstractRoad | WhiteRoad | None
    run: Run
    values: tuple[Mapping[str, float], Mapping[str, float]]
    units: Mapping[str, str]
    limits: Mapping[str, tuple[float, float]]
    fresh: Rescore | None
    tuning: TuneResult | None

    @classmethod
    def of_tuning(cls, result: TuneResult) -> "Rides":
        """A tuning, driven again on its road, as long as that is known."""
        drive, cars = result.drive, (result.start, result.vehicle)
        road, run = (None, Run()) if drive is None else (drive.road, drive.run)
        responses = None
        if road is not None and not isinstance(road, WhiteRoad):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the notes of the tuning say it
                first, second = (simulate(car, road, **run) for car in cars)
                responses = (first, second)
        limits = limit_spans(result.limits, list(result.before))
        sides = (result.before, result.after)
        return cls(("before", "after"), cars, responses, road, run, sides, result.units, limits, result.fresh, result)

    @classmethod
    def of_responses(cls, rides: Mapping[str, Response], limits: Limits | None) -> "Rides":
        """Rides on one road, which is not level, the first against the last."""
        first, last = next(iter(rides)), list(rides)[-1]
        pair = (rides[first], rides[last])
        if level := [name for name in (first, last) if not np.any(np.asarray(rides[name].road_rate))]:
            remedy = "`plots.ride` draws a motion without a road."
            _checks.refuse(
                "rides", "be driven over a road that is not level all the time", level[0] or "a ride", remedy
            )
        sides = tuple({name: float(v) for name, v in each.metrics().items()} for each in pair)
        time = np.asarray(pair[0].time)
        dt = float(f"{(time[-1] - time[0]) / (len(time) - 1):.6g}")  # single precision has no more digits
        road = from_profile(dt * np.arange(len(time)), np.asarray(pair[0].road))
        run = Run(duration=dt * (len(time) - 1), dt=dt)
        units = pair[0].metric_units()
        spans = limit_spans(limits, list(sides[0]))
        cars = (pair[0].vehicle, pair[1].vehicle)
        return cls((first, last), cars, pair, road, run, (sides[0], sides[1]), units, spans, None, None)

    @property
    def single(self) -> bool:
        return self.names[0] == self.names[1]

    @property
    def speed(self) -> float | None:
        """Of the vehicle [m/s], where it is known."""
        speed = getattr(self.road, "speed", None)
        if speed is None and self.responses is not None:
            speed = self.responses[0].axle_timing.speed
        return None if speed is None else float(speed)

    @property
    def white(self) -> bool:
        return isinstance(self.road, WhiteRoad)

    def goal(self, goal: str) -> list[str]:
        """The metrics of a goal that are known of both."""
        try:
            names = self.cars[0].goal_metrics(goal, white=self.white)
        except ValueError:
            return []
        return [name for name in names if name in self.values[0]]

    @functools.cached_property
    def is_event(self) -> bool:
        """Whether the road is one bump or hole, after and before which it is level."""
        if self.responses is None:
            return False
        rate = np.abs(np.asarray(self.responses[0].road_rate)[:, 0])
        return float(np.mean(rate > 1e-3 * rate.max())) < _EVENT if rate.max() > 0.0 else True

    def change(self, name: str, after: float) -> float | None:
        """The change of a metric [%]; none where the tables have none: from zero, and of one that may be negative."""
        before, metrics = self.values[0][name], self.cars[0].ride_metrics
        if self.tuning is not None:
            return change_in_percent(self.tuning, name, before, after)
        return None if any(m.name == name and m.statistic.signed for m in metrics) else percent_change(before, after)

    @property
    def passive(self) -> tuple[AbstractVehicle, AbstractVehicle]:
        """The vehicles without their controllers."""
        return self.cars[0].passive, self.cars[1].passive

    @functools.cached_property
    def frequencies(self) -> np.ndarray:
        """Undamped, of the last vehicle at its equilibrium [Hz]."""
        return np.asarray(modes(self.passive[1]).undamped_frequency, float)

    def styles(self) -> list[tuple[str, _style.Look, int]]:
        """Label, look and number of what is drawn: one ride, or before and after."""
        if self.single:
            return [("", dict(_style.AFTER), 1)]
        words = [_style.in_words(name) for name in self.names]
        return [(words[0], dict(_style.BEFORE), 0), (words[1], dict(_style.AFTER), 1)]

    def laws(self, path: str, number: int) -> list[AbstractDamper]:
        """The law of a vehicle at a path; where a controller commands it, at all levels of its command."""
        car, law = self.cars[number], get(self.passive[number], path)
        return [law] if car.passive is car or not takes_command(law) else laws_at_levels(law)

    def dampers(self) -> list[str]:
        """The paths of the first laws that differ, or of the first ones whose motion is known."""
        (first, last), paths = self.passive, damper_paths(self.passive[0])
        differ = [p for p in paths if repr(get(first, p)) != repr(get(last, p))]
        moving = [p for p in paths if damper_velocity(self, p, 1) is not None]
        return (differ or moving or paths)[:_MOST_DAMPERS]


def without_answer(tuned: TuneResult) -> str:
    """The sentence of the verdict without the answer, which stands above it."""
    lead, _, explanation = tuned.verdict.sentence.partition(": ")
    said = tuned.verdict.outcome.value.startswith(lead) and explanation
    return _style.first_upper(_style.said(explanation)) if said else _style.said(tuned.verdict.sentence)


def constant_damping(shown: Rides, comfort: Sequence[str], grip: Sequence[str]) -> tuple[np.ndarray, np.ndarray] | str:
    """The mean metrics of comfort and grip with linear dampers from soft to firm; or why they cannot be driven."""
    assert shown.road is not None
    car = without_fitted_ranges(shown.passive[0])
    paths = damper_paths(car)
    rates = {path: _slope(get(car, path)) for path in paths}
    try:
        linear = eqx.tree_at(lambda c: [get(c, path) for path in paths], car, [Linear(rates[path]) for path in paths])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ride = Ride(linear, shown.road, metrics=[*comfort, *grip], **(Run() if shown.white else shown.run))
            # One after the other: all side by side take four times as long to compile.
            driven = [ride({f"{path}.rate": f * rate for path, rate in rates.items()}) for f in FACTORS]
    except ValueError as error:
        return str(error)
    x, y = (np.mean([[values[name] for name in names] for values in driven], axis=1) for names in (comfort, grip))
    return x, y


def _slope(law: AbstractDamper) -> float:
    """The damping of a law between ± 0.2 m/s [N s/m]."""
    force = np.asarray(quasi_static(law, np.array([-0.2, 0.2])).force)
    return max(float(force[1] - force[0]) / 0.4, 50.0)


def element(shown: Rides, path: str, number: int) -> str | None:
    """The name of a damper by the path of its law, of several with this law the first on its axle; None without one."""
    car, frame = shown.passive[number], shown.passive[number].frame()
    law, names = get(car, path), [name for name in frame.element_names if not name.endswith("lift_off")]
    with_it = [name for name in names if frame.element(name).law is law]
    return next((n for n in with_it if n.startswith(path.partition(".")[0])), next(iter(with_it), None))


def damper_velocity(shown: Rides, path: str, number: int) -> np.ndarray | None:
    """The velocity of a damper over time [m/s]; None where it is not known.

    On a white road it is normally distributed: values of equal probability.
    """
    name = element(shown, path, number)
    if isinstance(shown.road, WhiteRoad):
        motion = equivalent_dampers(shown.cars[number], shown.road.velocity_psd, speed=shown.road.speed)
        size = float(motion[name].velocity_rms) if name in motion else np.inf
        return size * _NORMAL if np.isfinite(size) else None
    response = None if shown.responses is None else shown.responses[number]
    return None if response is None or name not in response.dampers else np.asarray(response[f"{name}_velocity"])


def critical(shown: Rides, path: str, number: int) -> CriticalDamping | None:
    """Critical damping of body and wheel at a damper; None if it is not alone between the two."""
    name = element(shown, path, number)
    return None if name is None else critical_damping(shown.passive[number]).get(name)


def quadrants(velocity: np.ndarray | None) -> str:
    """Shares of time at low and high speed on both sides, with the border at the RMS velocity."""
    if velocity is None:
        return ""
    border = float(np.sqrt(np.mean(velocity**2)))
    if not border:
        return "The damper does not move"
    low, high = np.abs(velocity) <= border, np.abs(velocity) > border
    shares = [100.0 * np.mean(side & speed) for side in (velocity > 0, velocity < 0) for speed in (low, high)]
    rebound, compression = (f"{a:.0f} % slow, {b:.0f} % fast" for a, b in (shares[:2], shares[2:]))
    return f"Rebound {rebound} (> {_style.quantity(1e3 * border, 'mm/s')})\ncompression {compression}"


def dips(shown: Rides) -> str:
    """Where the axles of a car with two cancel each other, in words."""
    delays = None if shown.responses is None else shown.responses[0].axle_timing.delays
    if delays is None or len(delays) != 2 or not float(delays[1]):
        return ""
    return f"dips at {', '.join(_style.short((0.5 + i) / float(delays[1])) for i in range(3))} Hz: axle after axle"

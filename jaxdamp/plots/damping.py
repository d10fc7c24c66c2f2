"""The damping ratio that a damper gives body and wheel, over its velocity."""

import functools
from collections.abc import Mapping

import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Axes, Figure, VectorLike
from jaxdamp.dampers import AbstractDamper, extrapolated
from jaxdamp.plots import _style, fitted_range
from jaxdamp.rig import quasi_static
from jaxdamp.vehicles import AbstractVehicle, CriticalDamping, critical_damping


AT_REST = 0.02  # share of the largest velocity below which friction has no damping ratio that is worth an axis
_SAME = 0.01  # relative difference of two ratios that one axis can show


@of_known_numbers
def damping_ratio(
    vehicles: AbstractVehicle | Mapping[str, AbstractVehicle],
    velocities: VectorLike | None = None,
    *,
    damper: str | None = None,
) -> Figure:
    """The damping ratio of body and wheel over the velocity of a damper: its secant rate over critical damping.

    ζ(v) = (F(v) − F(0))/v divided by 2 √(k m) of the body, or of the wheel on the right axis, as in
    `vehicles.critical_damping`; F is the settled force at constant velocity. Of the coupled motions about rest see
    `vehicles.modes`.

    Arguments:
        vehicles: a vehicle, or vehicles by name, of which the first of several is black and dashed.
        velocities: where to draw [m/s]; −1 to 1 m/s if left out.
        damper: its name, such as "front_damper"; all between body and wheel if left out, one beside the other.

    Raises:
        ValueError: no vehicle, an unknown damper, a vehicle without dampers between body and wheels.

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> axes = damping_ratio(quarter_car_000()).axes[0]
    >>> round(float(axes.get_lines()[0].get_ydata()[0]), 3)  # 2500 N s/m over 2 √(60e3 · 1200)
    0.147
    """
    remedy = "Take a vehicle, or several by name: {'before': ..., 'after': ...}."
    cars = _style.by_name("vehicles", vehicles, AbstractVehicle, "a vehicle", remedy)
    critical = {name: critical_damping(car) for name, car in cars.items()}
    shown = _dampers(critical, damper)
    points = np.linspace(-1.0, 1.0, 401) if velocities is None else np.asarray(velocities, dtype=float)
    figure = _style.new_figure(max(4.2 * len(shown), 6.0), 4.2)
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    styles = _style.ride_styles(list(cars))
    heights = []
    for axes, name in zip(panels, shown, strict=True):
        laws = {key: car.frame().element(name).law for key, car in cars.items()}
        for key, law in laws.items():
            force, label = np.asarray(quasi_static(law, points).force), _style.in_words(key) or "law"
            heights.append(ratios(axes, law, critical[key][name], points, force, label=label, **styles[key]))
        fitted_range.shade(axes, laws.values(), points)
        y = "damping ratio of the body [–]" if axes is panels[0] else ""
        _style.dress(axes, _style.VELOCITY, y, _style.first_upper(_style.in_words(name)))
        wheel_axis(axes, [each[name] for each in critical.values()])
        axes.set_xlim(float(points.min()), float(points.max()))
    panels[0].set_ylim(0.0, max(heights))
    if len(cars) > 1:
        panels[0].legend(frameon=False)
    return figure


def _dampers(critical: Mapping[str, Mapping[str, CriticalDamping]], damper: str | None) -> list[str]:
    """The dampers to draw, checked: that one, or all that every vehicle has."""
    names = [name for name in next(iter(critical.values())) if all(name in each for each in critical.values())]
    if not names:
        _checks.refuse("vehicles", "have a damper between a body and a wheel of its own", "vehicles without one")
    if damper is not None:
        _checks.one_of("damper", damper, names)
    return names if damper is None else [damper]


def ratios(
    axes: Axes, law: AbstractDamper, critical: CriticalDamping, points: np.ndarray, force: np.ndarray, **style: object
) -> float:
    """Draw the damping ratio of the body over velocities [m/s], with a gap at rest; the height that it needs.

    `force` is settled at the velocities `points` [m/s], which increase.
    """
    slow = np.abs(points) < AT_REST * np.abs(points).max()
    secant = (force - np.interp(0.0, points, force)) / np.where(slow, np.nan, points)
    ratio = secant / max(float(critical.body), 1e-9)
    fitted_range.curve(axes, law, points, ratio, **style)
    inside = ratio[~extrapolated(law, points) & np.isfinite(ratio)]
    return 1.15 * float(inside.max(initial=0.1))


def wheel_axis(axes: Axes, critical: list[CriticalDamping]) -> None:
    """An axis on the right with the damping ratio of the wheel, where one can show it for all."""
    shares = np.array([float(each.body) / float(each.wheel) for each in critical])
    if np.ptp(shares) <= _SAME * shares[-1]:
        share = float(shares[-1])
        to_wheel, back = functools.partial(np.multiply, share), functools.partial(np.multiply, 1.0 / share)
        wheel = axes.secondary_yaxis("right", functions=(to_wheel, back))
        wheel.set_ylabel("wheel [–]")

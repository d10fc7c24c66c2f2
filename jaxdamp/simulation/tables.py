"""What responses say in numbers: ride metrics and comfort as tables, several responses side by side."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from jaxdamp._tables import Compared, Table, comparison_table, percent_change
from jaxdamp._traced import of_known_numbers


if TYPE_CHECKING:
    from jaxdamp.simulation.response import Response


@of_known_numbers
def metrics_table(responses: "Mapping[str, Response]") -> Table:
    """The ride metrics of responses by name, of one kind of vehicle, and the change from the first to the last.

    A metric that may be negative, such as a mean, has no change in percent.

    Arguments:
        responses: by name, of one kind of vehicle.
    """
    first = next(iter(responses.values()))
    values = [response.metrics() for response in responses.values()]
    signed = {m.name for m in first.vehicle.ride_metrics if m.statistic.signed}
    rows = []
    for name, unit in first.metric_units().items():
        numbers = [float(of[name]) for of in values]
        change = None if name in signed else percent_change(numbers[0], numbers[-1])
        rows.append(Compared(name, unit, numbers, change))
    return comparison_table("Ride metrics", "metric", tuple(responses), rows)


@of_known_numbers
def comfort_table(responses: "Mapping[str, Response]") -> Table:
    """Comfort by ISO 2631-1 of every acceleration, of responses by name, and the change from the first to the last.

    Arguments:
        responses: by name, of one kind of vehicle.
    """
    first = next(iter(responses.values()))
    comforts = [response.comfort() for response in responses.values()]
    rows = []
    for channel in comforts[0]:
        for name, unit in comfort_units(first.units[channel]).items():
            numbers = [float(getattr(of[channel], name)) for of in comforts]
            words = f"{channel} {name.replace('_', ' ')}"
            rows.append(Compared(words, unit, numbers, percent_change(numbers[0], numbers[-1])))
    return comparison_table("Comfort by ISO 2631-1 (Wk, angles We)", "what", tuple(responses), rows)


def comfort_units(unit: str) -> dict[str, str]:
    """Units of the numbers of comfort, from that of the acceleration."""
    dose = f"{unit.removesuffix('s^2')}s^1.75"
    return {"weighted_rms": unit, "max_transient_value": unit, "vibration_dose_value": dose}

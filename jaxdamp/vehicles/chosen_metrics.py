"""Which metrics of a vehicle are meant: by names, by short names such as "comfort", or of any channel."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

from jaxdamp import _checks
from jaxdamp.metrics import Metric, current_names
from jaxdamp.vehicles.channels import LIFT_OFF_FRACTIONS, Channel, ChannelKind
from jaxdamp.vehicles.system import Layout


# The short names of what a rider and a designer want: kind of the channel, statistic, whether it is weighted.
GOALS = {
    "comfort": (ChannelKind.ACCELERATION, "rms", True),
    "travel": (ChannelKind.STROKE, "peak_to_peak", False),
    "grip": (ChannelKind.TYRE_LOAD, "rms", False),
}


def is_stationary(metric: Metric, channels: Mapping[str, Channel]) -> bool:
    """Whether a metric follows from the RMS of its channel on a white road.

    Absolute heights have no finite RMS there, since they follow the road.

    Arguments:
        metric: the metric.
        channels: of the vehicle, by name.
    """
    unbounded = metric.from_rest and channels[metric.channel].kind is ChannelKind.HEIGHT
    return metric.statistic.of_rms is not None and not (unbounded or metric.by or metric.window)


def metrics_of_goal(layout: Layout, goal: str, *, white: bool = False) -> list[str]:
    """The names of the ride metrics that a short name means, as `goal_metrics` says."""
    channels, (kind, statistic, weighted) = layout.by_name, GOALS[goal]
    statistic = "standard_deviation" if white and kind is ChannelKind.STROKE else statistic
    names = [
        m.name
        for m in layout.metrics
        if channels[m.channel].kind is kind and m.statistic.name == statistic and (m.weighting is not None) == weighted
    ]
    return names[:1] if goal == "comfort" else names


def chosen_metrics(
    layout: Layout, wanted: Sequence[str | Metric] | None, argument: str, *, white: bool = False
) -> list[Metric]:
    """The requested metrics, checked and with their weightings.

    Arguments:
        layout: of the vehicle.
        wanted: names of ride metrics, or metrics of any channel; "comfort", "travel" and "grip" mean those of
            `goal_metrics`; None for all ride metrics.
        argument: name of this argument in error messages.
        white: for stationary rides on a white road.

    Raises:
        ValueError: an empty list; an unknown name or channel, with the nearest known one; a weighting of a channel that
            is not an acceleration; two metrics of one name.
    """
    by_name = {m.name: m for m in layout.metrics}
    if wanted is None:
        return list(layout.metrics)
    if isinstance(wanted, Metric):
        _checks.refuse(argument, "be a list", "one Metric", f"Write `{argument}=[metric]`.")
    if not len(wanted):
        some = ", ".join(map(repr, list(by_name)[:3]))
        _checks.refuse(argument, "name one or more", "empty", f"Write [{some}], or leave it out for all.")
    if not isinstance(wanted, str):
        spelled = {goal: metrics_of_goal(layout, goal, white=white) for goal in GOALS}
        lists = [(isinstance(one, str) and spelled.get(one)) or [one] for one in wanted]
        wanted = list(itertools.chain.from_iterable(lists))
    names = [m for m in wanted if not isinstance(m, Metric)] if not isinstance(wanted, str) else wanted
    current = iter(current_names(argument, names, by_name))
    chosen = [of_channel(m, layout, argument) if isinstance(m, Metric) else by_name[next(current)] for m in wanted]
    return _of_different_names(chosen, argument)


def _of_different_names(metrics: Sequence[Metric], argument: str) -> list[Metric]:
    """The metrics, each once; two of one name are refused."""
    by_name: dict[str, Metric] = {}
    for metric in metrics:
        if by_name.setdefault(metric.name, metric) != metric:
            remedy = "Give one of them another: `Metric(..., name=...)`."
            _checks.refuse(argument, "have one metric of each name", f"two of {metric.name!r}", remedy)
    return list(by_name.values())


def of_channel(metric: Metric, layout: Layout, argument: str) -> Metric:
    """The metric after a check of its channels, with the weighting of its channel instead of "default".

    Lift-off is counted as in the ride metrics, by whether the wheel can lift off.
    """
    channels = layout.by_name
    for name in (metric.channel, metric.by) if metric.by else (metric.channel,):
        _checks.one_of(f"channel of {argument}", name, channels)
    weighting = channels[metric.channel].kind.weighting
    if metric.weighting is not None and weighting is None:
        remedy = f"Leave its `weighting` out; {metric.channel} is {channels[metric.channel].kind.meaning}."
        _checks.refuse(argument, "weight an acceleration, as ISO 2631-1 does", repr(metric.channel), remedy)
    counts = {m.channel: m.statistic for m in layout.metrics if m.statistic in LIFT_OFF_FRACTIONS}
    if metric.statistic in LIFT_OFF_FRACTIONS and metric.channel in counts:
        return dataclasses.replace(metric, statistic=counts[metric.channel])
    return metric.weighted_by(weighting) if metric.weighting == "default" else metric

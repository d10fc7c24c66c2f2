"""Targets: wanted values of metrics with tolerances, as an objective."""

from collections.abc import Mapping
from typing import Any, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric


@final
class Targets:
    """The mean square distance of metrics from their targets, in tolerances: an objective for `minimise`.

    It is at most 1 if all targets are met within their tolerances on average, and 0 if all are met exactly.

    Arguments:
        targets: `{metric: (value, tolerance)}` in the unit of the metric.

    Raises:
        ValueError: no target, or one that is no pair of finite numbers with a positive tolerance.

    >>> import jax.numpy as jnp
    >>> targets = Targets({"rms_sprung_acceleration": (0.9, 0.05), "rms_dynamic_tyre_load": (1450.0, 100.0)})
    >>> values = {"rms_sprung_acceleration": jnp.asarray(1.0), "rms_dynamic_tyre_load": jnp.asarray(1450.0)}
    >>> round(float(targets(values)), 6)
    2.0
    """

    __name__ = "targets"

    def __init__(self, targets: Mapping[str | Metric, tuple[float, float]]) -> None:
        if not isinstance(targets, Mapping) or not targets:
            must = "be a mapping of one or more metrics to a value and a tolerance"
            remedy = "Write `{'rms_sprung_acceleration': (0.9, 0.05)}`."
            _checks.refuse("targets", must, _checks.described(targets), remedy)
        self.metrics = [metric for metric in targets if isinstance(metric, Metric)]
        self.values = {m.name if isinstance(m, Metric) else m: _pair(m, pair) for m, pair in targets.items()}

    def __repr__(self) -> str:
        return f"Targets({', '.join(f'{name} {v:g} ± {tol:g}' for name, (v, tol) in self.values.items())})"

    def __call__(self, metrics: Mapping[str, Scalar]) -> Scalar:
        """The mean square distance from the targets, in tolerances."""
        squares = [((metrics[name] - value) / tolerance) ** 2 for name, (value, tolerance) in self.values.items()]
        return sum(squares[1:], squares[0]) / len(squares)

    def note(self, name: str, value: float) -> str:
        """Whether a metric meets its target, in words; empty for one that has none."""
        if name not in self.values:
            return ""
        target, tolerance = self.values[name]
        off = (value - target) / tolerance
        met = "met" if abs(off) <= 1.0 else f"missed by {abs(off):.1f} tolerances"
        return f"target {target:.4g} ± {tolerance:.2g}, {met}"


def _pair(metric: str | Metric, pair: Any) -> tuple[float, float]:
    label = f"targets[{metric.name if isinstance(metric, Metric) else metric!r}]"
    numbers = np.shape(pair) == (2,) and np.asarray(pair).dtype.kind in "iuf"
    if not numbers or not np.all(np.isfinite(pair)) or not pair[1] > 0:
        _checks.refuse(label, "be a value and a positive tolerance", pair, "Write (1.2, 0.05).")
    return float(pair[0]), float(pair[1])

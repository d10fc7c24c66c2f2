"""The result of `sensitivity`: tables, sentences on the flatness of an optimum, and a picture."""

import dataclasses
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table, plain, typeset_unit


FORCE_STEP = 100.0  # N, for which effects of the curve are stated
COST = 0.01  # of the metric, for which flat directions are stated


class CurveSensitivity(NamedTuple):
    """Derivatives by the force at each velocity of one damper curve."""

    velocity: Float[np.ndarray, " points"]  # where the hats are [m/s], shape (points,)
    force: Float[np.ndarray, " points"]  # of the curve there [N], with settled states
    gradient: dict[str, Float[np.ndarray, " points"]]  # of each metric by the height of each hat [its unit per N]


@final
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(AbstractResult):
    """Derivatives of ride metrics.

    Attributes:
        values: the metrics.
        units: unit of each metric.
        parameters: name of each number.
        parameter_units: unit of each number.
        point: the numbers where the derivatives are taken.
        gradient: for each metric its derivative by each number, in their units.
        curves: derivatives by the force at each velocity, for each damper by its path.
        hessian: for each metric its second derivatives by the numbers; None without `second_order`.
    """

    values: dict[str, float]
    units: dict[str, str]
    parameters: tuple[str, ...]
    parameter_units: tuple[str, ...]
    point: Float[np.ndarray, " numbers"]
    gradient: dict[str, Float[np.ndarray, " numbers"]]
    curves: dict[str, CurveSensitivity]
    hessian: dict[str, Float[np.ndarray, "numbers numbers"]] | None = None

    def elasticities(self, metric: str) -> dict[str, float]:
        """Change of a metric in percent of its size for each percent of a number; NaN where one of both is zero."""
        _checks.one_of("metric", metric, self.values)
        scaled = self.gradient[metric] * self.point / (abs(self.values[metric]) or np.nan)
        return dict(zip(self.parameters, np.where(self.point == 0.0, np.nan, scaled).tolist(), strict=True))

    @property
    def summary(self) -> str:
        """The number that changes each metric most, in a sentence."""
        most = []
        for metric in self.values:
            slopes = {name: slope for name, slope in self.elasticities(metric).items() if np.isfinite(slope)}
            if slopes:
                name = max(slopes, key=lambda name: abs(slopes[name]))
                most.append(f"1 % more {name} changes {metric} by {slopes[name]:+.3g} %.")
        return " ".join(most) or "No parameter differs from zero, so there is no relative change."

    @property
    def warnings(self) -> tuple[str, ...]:
        """Metrics that no number changes, or that have no derivative."""
        lost = [name for name, slopes in self.gradient.items() if slopes.size and not np.any(slopes)]
        odd = [name for name, slopes in self.gradient.items() if not np.all(np.isfinite(slopes))]
        texts = [f"{name} does not depend on any of these numbers here." for name in lost]
        return (*texts, *(f"The derivative of {name} is not finite." for name in odd))

    def table(self) -> Table:
        """A row for each number, the most effective for the first metric first: percent for each percent."""
        by_metric = {name: self.elasticities(name) for name in self.values}
        first = by_metric[next(iter(self.values))]
        order = sorted(range(len(self.parameters)), key=lambda i: -abs(np.nan_to_num(first[self.parameters[i]])))
        columns = (Column("parameter"), Column("value"), Column("unit"), *(Column(n, "%/%", "+.3f") for n in by_metric))
        rows = []
        for i in order:
            name = self.parameters[i]
            cells = (None if np.isnan(slopes[name]) else slopes[name] for slopes in by_metric.values())
            rows.append((name, float(self.point[i]), typeset_unit(self.parameter_units[i], "–"), *cells))
        return Table("Change of the metrics for 1 % of each parameter", columns, tuple(rows))

    def curve_table(self, damper: str | None = None) -> Table:
        """A row for each velocity of the curve of a damper: percent for 100 N in a hat around it.

        Arguments:
            damper: path of the damper; the first if left out.

        Raises:
            ValueError: no curves, an unknown damper.
        """
        if not self.curves:
            _checks.refuse("result", "have curves", "one of none", "Drive over a road that is not white.")
        damper = next(iter(self.curves)) if damper is None else damper
        _checks.one_of("damper", damper, self.curves)
        curve, effects = self.curves[damper], self.curve_effects(damper)
        columns = (Column("velocity", "m/s"), Column("force", "N", ".0f"), *(Column(n, "%", "+.3f") for n in effects))
        rows = zip(curve.velocity.tolist(), curve.force.tolist(), *(e.tolist() for e in effects.values()), strict=True)
        return Table(f"Change of the metrics for {FORCE_STEP:g} N at each velocity of {damper}", columns, tuple(rows))

    def curve_effects(self, damper: str) -> dict[str, Float[np.ndarray, " points"]]:
        """Change of each metric in percent of its size for 100 N at each velocity of a damper."""
        gradients = self.curves[damper].gradient
        return {name: 100.0 * FORCE_STEP * g / (abs(self.values[name]) or np.nan) for name, g in gradients.items()}

    def flatness(self, metric: str) -> tuple[str, ...]:
        """How far each principal direction of the parameters can go for 1 % of the metric, in sentences.

        The directions are the eigenvectors of the second derivatives by relative changes. Along a direction of negative
        curvature the point is no minimum. A slope that remains is stated first.

        Raises:
            ValueError: no second derivatives, an unknown metric.
        """
        if self.hessian is None:
            _checks.refuse("result", "have second derivatives", "one of none", "Pass `second_order=True`.")
        _checks.one_of("metric", metric, self.hessian)
        chosen = np.flatnonzero(self.point != 0.0)
        scale = self.point[chosen]
        relative = self.hessian[metric][np.ix_(chosen, chosen)] * np.outer(scale, scale) / abs(self.values[metric])
        slope = self.gradient[metric][chosen] * scale / abs(self.values[metric])
        curvature, directions = np.linalg.eigh(relative)
        sentences = []
        if np.linalg.norm(slope) > COST:
            steepest = self.parameters[chosen[int(np.argmax(np.abs(slope)))]]
            sentences.append(
                f"{metric} has a slope here, {np.linalg.norm(slope):.2g} % for 1 %, most along {steepest}: no optimum."
            )
        for value, direction in zip(curvature, directions.T, strict=True):
            direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
            words = " ".join(
                f"{share:+.2f} {self.parameters[i]}"
                for i, share in zip(chosen, direction, strict=True)
                if abs(share) > 0.1
            )
            if value <= 0.0:
                sentences.append(f"{metric} is curved downwards along {words}.")
            else:
                far = 100.0 * np.sqrt(2.0 * COST / value)
                sentences.append(f"{metric} rises by {100 * COST:g} % at ±{far:.3g} % along {words}.")
        return tuple(sentences)

    plot = drawn_by("sensitivity", "Damper curves coloured by their effect on each metric; effects of the parameters.")

    def content(self) -> Contents:
        """All derivatives as plain data, ready for JSON; numbers that are not finite are None."""
        elasticities = {name: plain(self.elasticities(name)) for name in self.values}
        return self._data(*(field.name for field in dataclasses.fields(self))) | {"elasticities": elasticities}

    def __repr__(self) -> str:
        flat = [] if self.hessian is None else [s for name in self.values for s in self.flatness(name)]
        return "\n".join([self.table().to_text(), *flat, *(f"warning: {text}" for text in self.warnings)])

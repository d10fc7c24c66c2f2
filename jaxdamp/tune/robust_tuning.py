"""`robust`: a tuning over scenarios, and what the scatter of its parameters costs."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Generic, Unpack, final

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._results import AbstractResult
from jaxdamp._status import Status
from jaxdamp._tables import Table, plain
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import Metric
from jaxdamp.tune.minimising import minimise
from jaxdamp.tune.objective import Function
from jaxdamp.tune.result import TuneResult, V
from jaxdamp.tune.risk import Risk
from jaxdamp.tune.scenarios import Scenarios
from jaxdamp.tune.settings import RUN, Settings
from jaxdamp.tune.tolerance import ToleranceEffect, check_scatter, tolerance_effects, tolerance_table
from jaxdamp.vehicles import AbstractVehicle


if TYPE_CHECKING:
    from matplotlib.figure import Figure


@final
@dataclasses.dataclass(frozen=True, repr=False)
class RobustResult(AbstractResult, Generic[V]):
    """A tuning over scenarios with the effects of tolerances.

    Attributes:
        tuning: the result of `minimise` over the scenarios.
        tolerances: the effect of the scatter of each parameter on the metric, at the tuned vehicle.
    """

    tuning: TuneResult[V]
    tolerances: tuple[ToleranceEffect, ...]

    @property
    def vehicle(self) -> V:
        """The tuned vehicle."""
        return self.tuning.vehicle

    @property
    def status(self) -> Status:
        """How the search of the tuning ended."""
        return self.tuning.status

    @property
    def warnings(self) -> tuple[str, ...]:
        """The doubts about the tuning."""
        return self.tuning.warnings

    @property
    def sentences(self) -> tuple[str, ...]:
        """The effects of the tolerances in words, the largest first."""
        return tuple(effect.sentence(self.tuning.metric) for effect in self.tolerances)

    @property
    def summary(self) -> str:
        """The improvement, and the scenario in which the metric is largest, in a sentence."""
        each = self.tuning.scenarios
        assert each is not None
        values = each.after[self.tuning.metric]
        worst = f"Largest in {each.names[int(values.argmax())]!r}, {values.max():.4g}; smallest {values.min():.4g}."
        return f"{self.tuning.summary} {worst}"

    def table(self) -> Table:
        """Metrics in every scenario, before and after."""
        return self.tuning.scenario_table()

    def tolerance_table(self) -> Table:
        """The effects of the tolerances."""
        return tolerance_table(self.tolerances, self.tuning.metric)

    def tables(self) -> dict[str, Table]:
        """Metrics in every scenario, parameters, tolerances."""
        tolerances = {"tolerances": self.tolerance_table()} if self.tolerances else {}
        return {"scenarios": self.table(), "parameters": self.tuning.parameter_table()} | tolerances

    def plot(self, **options: Any) -> "Figure":
        """The tuning, as of `minimise`."""
        return self.tuning.plot(**options)

    def content(self) -> dict[str, Any]:
        """The tuning and the tolerances as plain data, ready for JSON."""
        return self.tuning.content() | {"tolerances": [plain(effect._asdict()) for effect in self.tolerances]}

    def __repr__(self) -> str:
        return "\n".join([self.summary, repr(self.tuning), *self.sentences])


@of_known_numbers
def robust(
    metric: str | Metric | Function,
    vehicle: V,
    scenarios: Scenarios,
    *,
    risk: str | Risk | None = None,
    scatter: Mapping[str, float] | None = None,
    progress: Callable[[int, float], None] | None = None,
    **settings: Unpack[Settings],
) -> RobustResult[V]:
    """Minimise a metric over scenarios by its mean, its worst case or the mean of its worst share.

    Arguments:
        metric: as in `minimise`.
        vehicle: to start from.
        scenarios: roads and conditions; `tolerances(...)` makes conditions of a production scatter.
        risk: `"mean"`, `"worst"` or `CVaR(share)`, in place of that of the scenarios.
        scatter: standard deviations, relative to the values, of parameters whose cost is stated at the result, such as
            `{"damper.**_rate": 0.1}`; none if left out.
        progress: as in `minimise`.
        settings: keywords of `minimise`: `over`, `limits`, `duration`, `starts` and the others.

    Raises:
        ValueError: what `minimise` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> from jaxdamp.tune import Condition
    >>> loads = {"empty": Condition(), "laden": Condition({"sprung_mass": 1500.0})}
    >>> scenarios = Scenarios([roads.white("C", 20.0)], loads)
    >>> result = robust("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), scenarios, risk="worst")
    >>> result.tuning.converged
    True
    """
    call = "robust(metric, vehicle, scenarios)"
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    remedy = "Write `tune.Scenarios([road, ...], conditions)`; on one road call `minimise`."
    _checks.instance("scenarios", scenarios, Scenarios, "be made by `tune.Scenarios`", remedy)
    scenarios = scenarios if risk is None else scenarios.with_risk(risk)
    if scatter is not None:
        check_scatter(scatter)
    tuning = minimise(metric, vehicle, scenarios, progress=progress, **settings)
    effects: tuple[ToleranceEffect, ...] = ()
    if scatter:
        run: dict[str, Any] = {name: value for name, value in settings.items() if name in RUN}
        effects = tolerance_effects(metric, tuning.vehicle, scenarios, scatter, **run)
    return RobustResult(tuning, effects)

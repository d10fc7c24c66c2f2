import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

from jaxdamp import bench, identify, plots, roads, simulate, tune, vehicles
from jaxdamp._status import Status
from jaxdamp.bench import BenchSet, SineTest
from jaxdamp.dampers import Bilinear, BoucWen, Lag
from jaxdamp.identify import Comparison, CrossValidation
from jaxdamp.identify.cross_validation import Fold
from jaxdamp.parameters import free_parameters
from jaxdamp.simulation import Response
from jaxdamp.tune import ParetoFront, TuneResult
from jaxdamp.tune.front import FrontParameter
from jaxdamp.tune.measuring import Measurement


PRESENT = {"damper.rate": 1800.0, "spring_rate": 21e3, "weighted_rms_sprung_acceleration": 0.76}
PRESENT |= {"rms_dynamic_tyre_load": 502.0}
COMFORT, GRIP = "weighted_rms_sprung_acceleration", "rms_dynamic_tyre_load"


@pytest.fixture(scope="session")
def runs() -> BenchSet:
    """Eight records, of which the peak velocities are 0.06, 0.13 ... 0.50 m/s."""
    dyno = bench.VirtualDyno(Lag(Bilinear(2600.0, 1200.0), 0.004), sampling_rate=500.0, force_noise=5.0)
    return dyno.run([SineTest(0.01, float(i), cycles=4) for i in range(1, 9)])


@pytest.fixture(scope="session")
def comparison(runs: BenchSet) -> Comparison:
    starts = identify.default_ladder(tuple(runs), ["linear", "bilinear"])
    return identify.compare(starts, tuple(runs[:7]), held_out=tuple(runs[7:]))


@pytest.fixture(scope="session")
def responses() -> dict[str, Response]:
    road = roads.band_limited(0.5, 20.0, rms=0.003, duration=12.0, dt=0.01, seed=3)
    laws = {"soft": Bilinear(1500.0, 1500.0), "firm": Bilinear(4000.0, 3000.0)}
    return {name: simulate(vehicles.presets.quarter_car_000(law), road, dt=0.005) for name, law in laws.items()}


@pytest.fixture(scope="session")
def tuned() -> TuneResult:
    car = vehicles.presets.quarter_car_000()
    road = roads.cosine_bump(0.05, start=0.2, duration=0.3)
    travel = float(simulate(car, road, duration=2.0, dt=0.005).metrics()["working_space_peak_to_peak"])
    return tune.minimise(
        "rms_sprung_acceleration",
        car,
        road,
        bounds={"damper.rate": (1000.0, 4000.0)},
        limits={"working_space_peak_to_peak": 1.2 * travel},
        duration=2.0,
        dt=0.005,
    )


@pytest.fixture(scope="session")
def validation() -> CrossValidation:
    """Of stored numbers."""
    scores = {"linear": (61.0, 70.0, 74.0), "besinger_lag": (93.0, 97.0, 96.0)}
    return CrossValidation(
        tuple(
            Fold(law, "fast" if number else "slow", f"{number}Hz", percent, 100.0 - percent, None)
            for law, percents in scores.items()
            for number, percent in enumerate(percents)
        )
    )


@pytest.fixture(scope="session")
def swept() -> xarray.Dataset:
    """A map of stored numbers, with its least value within."""
    rate, spring = np.linspace(500.0, 3000.0, 11), np.linspace(10e3, 30e3, 9)
    comfort = 0.7 + 1e-7 * (rate[:, None] - 1300.0) ** 2 + 2e-9 * (spring - 16e3) ** 2
    grip = 400.0 + 2e-4 * (rate[:, None] - 2100.0) ** 2 + 0.004 * spring
    axes = ("damper.rate", "spring_rate")
    data = {COMFORT: (axes, comfort, {"units": "m/s^2"}), GRIP: (axes, grip, {"units": "N"})}
    coordinates = {axes[0]: (axes[0], rate, {"units": "N s/m"}), axes[1]: (axes[1], spring, {"units": "N/m"})}
    return xarray.Dataset(data, coordinates | {"failed": (axes, np.zeros(comfort.shape, bool))})


@pytest.fixture(scope="session")
def front() -> ParetoFront:
    """Of stored numbers: more damping, less tyre load, less comfort."""
    car = vehicles.presets.quarter_car_000(Bilinear(1500.0, 1500.0))
    share = np.linspace(0.0, 1.0, 9)
    values = {COMFORT: 0.8 + 0.5 * share**2, GRIP: 700.0 - 250.0 * share**0.5}
    rates = np.stack([1000.0 + 3000.0 * share, 800.0 + 1500.0 * share], axis=1)
    over = ["damper.rebound_rate", "damper.compression_rate"]
    return ParetoFront(
        start=car, names=(COMFORT, GRIP), values=values, before={COMFORT: 1.15, GRIP: 640.0},
        units={COMFORT: "m/s^2", GRIP: "N"},
        parameters=tuple(FrontParameter(name, "N s/m", 1500.0, 100.0, 5000.0) for name in over),
        designs=rates, limits={GRIP: 650.0}, reference={COMFORT: 1.4, GRIP: 800.0}, warnings=(),
        status=Status.CONVERGED, evaluations=9, interpolated=0, dropped=0,
        free=free_parameters(car, over=over), measured=object.__new__(Measurement), fresh={},
    )  # fmt: skip


@pytest.fixture(scope="session")
def figures(
    runs: BenchSet,
    comparison: Comparison,
    responses: dict[str, Response],
    tuned: TuneResult,
    validation: CrossValidation,
    swept: xarray.Dataset,
    front: ParetoFront,
) -> dict[str, Figure]:
    """The pictures by which people judge: what the house style and the golden pictures are tested with."""
    evaluation, best = bench.evaluate(runs), comparison.best.result
    return {
        "damper sheet": comparison.plot("sheet", evaluation=evaluation),
        "bench sheet": evaluation.plot("sheet"),
        "ride sheet": plots.ride_sheet(responses),
        "tuning sheet": tuned.plot("sheet"),
        "one ride": responses["soft"].plot("sheet"),
        "ladder": comparison.plot(),
        "errors of held-out records": validation.plot(),
        "loops": best.plot(),
        "loops by law": comparison.plot("loops"),
        "cycles": evaluation.plot(),
        "ride": plots.ride(responses, weighting="Wk"),
        "damper use": plots.damper_use(responses),
        "tuning": tuned.plot(),
        "curves": plots.force_velocity(
            {"besinger_lag": best.law, "bilinear": Bilinear(2000.0, 1500.0)}, runs=list(runs), baseline="bilinear"
        ),
        "law card": plots.law_card(BoucWen(800.0, 2000.0, 300.0, 2e-3), frequencies=(1.0, 4.0)),
        "sweep map": plots.sweep(swept, COMFORT, limits={GRIP: 640.0}, present=PRESENT),
        "plane": plots.sweep(swept, COMFORT, against=GRIP, limits={GRIP: 640.0}, present=PRESENT),
        "damping ratio": plots.damping_ratio({name: one.vehicle for name, one in responses.items()}),
        "front": plots.pareto(front),
    }

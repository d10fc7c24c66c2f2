import pytest

from jaxdamp import bench, identify, roads, simulate, tune, vehicles
from jaxdamp.bench import BenchSet, SineTest
from jaxdamp.dampers import Bilinear, Lag
from jaxdamp.identify import Comparison
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


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

"""How often the law that `compare` recommends is right: virtual dampers, judged on fresh motion.

Each damper has a law drawn at random, in two thirds of the cases one of the candidates, else one that no candidate can
follow exactly, and is measured in one to eight sines with noise of 1 to 5 % of the force. The recommended law and all
others are then scored on six fresh sines, no faster than the measured ones. Counted are the dampers where its error is
within 10 % of the smallest, and those where it has no number that is not identifiable. The smallest error on the fitted
records, which was recommended before, stands beside it.

    python -m benchmarks.recommendation [--dampers 60] [--seed 0] [--law linear,bilinear,...]
"""

import argparse
import warnings
from collections.abc import Callable

import numpy as np

from jaxdamp import configure


configure()

from jaxdamp import identify  # noqa: E402
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno  # noqa: E402
from jaxdamp.dampers import (  # noqa: E402
    AbstractDamper,
    Besinger,
    Bilinear,
    CoulombFriction,
    Dahl,
    HyperbolicTangent,
    Lag,
    Linear,
    PiecewiseLinear,
    Saturating,
    SeriesSpring,
)
from jaxdamp.identify import Rung  # noqa: E402
from jaxdamp.rig import Rig, quasi_static  # noqa: E402


SAMPLING_RATE = 400.0  # Hz
FRESH = 6  # records to judge on
WITHIN = 1.1  # times the smallest error


def _besinger(draw: Callable[..., float]) -> Besinger:
    return Besinger(draw(800, 2500), draw(2000, 5000), draw(500, 1500), draw(0.08, 0.2), draw(0.03, 0.08))


def _curve(draw: Callable[..., float]) -> PiecewiseLinear:
    return PiecewiseLinear([-0.3, -0.08, 0.08, 0.3], [draw(500, 5000) for _ in range(5)])


INSIDE: dict[str, Callable[[Callable[..., float]], AbstractDamper]] = {
    "linear": lambda draw: Linear(draw(800, 4000)),
    "bilinear": lambda draw: Bilinear(draw(1500, 4000), draw(500, 1500)),
    "friction": lambda draw: Linear(draw(800, 3000)) + CoulombFriction(draw(30, 150), draw(0.01, 0.03)),
    "curve": _curve,
    "besinger": _besinger,
    "besinger with lag": lambda draw: Lag(_besinger(draw), draw(0.002, 0.008)),
    "besinger on a spring": lambda draw: SeriesSpring(_besinger(draw), draw(2e5, 8e5)),
    "friction with lag": lambda draw: Lag(
        Linear(draw(800, 3000)) + CoulombFriction(draw(30, 150), draw(0.01, 0.03)), draw(0.002, 0.008)
    ),
}
OUTSIDE: dict[str, Callable[[Callable[..., float]], AbstractDamper]] = {
    "curve on a spring": lambda draw: SeriesSpring(_curve(draw), draw(2e5, 8e5)),
    "bilinear and Dahl": lambda draw: Bilinear(draw(1500, 4000), draw(500, 1500)) + Dahl(draw(1e5, 4e5), draw(30, 120)),
    "saturating with lag": lambda draw: Lag(Saturating.guess(*_saturated(draw)), draw(0.002, 0.008)),
    "hyperbolic tangent": lambda draw: HyperbolicTangent.guess(*_saturated(draw)),
}


def _saturated(draw: Callable[..., float]) -> tuple[np.ndarray, np.ndarray]:
    """Velocities [m/s] and forces [N] of a digressive curve."""
    velocity = np.linspace(-0.6, 0.6, 121)
    return velocity, draw(400, 1200) * np.tanh(velocity / draw(0.1, 0.3)) + draw(300, 1000) * velocity


def measured(rng: np.random.Generator) -> tuple[str, list[BenchRun], list[BenchRun]]:
    """The name of a law drawn at random, its records and fresh ones."""

    def draw(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def sines(count: int, fastest: float) -> list[SineTest]:
        frequencies = [draw(0.5, 8.0) for _ in range(count)]
        sizes = [min(draw(0.003, 0.04), fastest / (2 * np.pi * f)) for f in frequencies]
        cycles = [4 if f < 2 else 8 for f in frequencies]
        rows = enumerate(zip(sizes, frequencies, cycles, strict=True))
        return [SineTest(a, f, cycles=c, name=f"{k + 1}") for k, (a, f, c) in rows]

    laws = INSIDE if rng.uniform() < 2 / 3 else OUTSIDE
    name = str(rng.choice(list(laws)))
    law, count = laws[name](draw), int(rng.integers(1, 9))
    tests = sines(count, 0.8)
    fastest = max(2 * np.pi * test.frequency * test.amplitude for test in tests)
    size = float(np.sqrt(np.mean(quasi_static(law, np.linspace(-fastest, fastest, 21)).force ** 2)))
    noise, rig = float(rng.uniform(0.01, 0.05)) * size, Rig(force_offset=float(rng.normal(0.0, 0.02)) * size)
    dynos = [
        VirtualDyno(law, rig=rig, sampling_rate=SAMPLING_RATE, force_noise=noise, seed=int(rng.integers(2**31)))
        for _ in range(2)
    ]
    return name, list(dynos[0].run(tests)), list(dynos[1].run(sines(FRESH, fastest)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dampers", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--law", default=",".join(identify.LAWS))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of laws outside the range that they were fitted to
    rng, names = np.random.default_rng(arguments.seed), arguments.law.split(",")
    print(
        f"{'truth':<22}{'records':>8}  {'recommended':<24}{'of best':>8}  {'smallest fitted error':<24}{'of best':>8}"
    )
    counts = np.zeros((2, 2), int)
    for _ in range(arguments.dampers):
        truth, runs, fresh = measured(rng)
        comparison = identify.compare(identify.default_ladder(runs, names), runs)
        errors = {rung.name: rung.result.score(fresh)[1] for rung in comparison.rungs}
        least, line = min(errors.values()), f"{truth:<22}{len(runs):>8}"
        for k, rung in enumerate((comparison.best, comparison.best_fit)):
            ratio = errors[rung.name] / least
            counts[k] += ratio <= WITHIN, not _unidentifiable(rung)
            line += f"  {rung.name + ' *' * _unidentifiable(rung):<24}{ratio:>8.2f}"
        print(line, flush=True)
    print(f"\n{'':<26}{'recommended':>14}{'smallest fitted error':>24}")
    for text, row in zip(("error within 10 %", "all numbers identifiable"), counts.T, strict=True):
        print(f"{text:<26}{100 * row[0] / arguments.dampers:>12.0f} %{100 * row[1] / arguments.dampers:>22.0f} %")


def _unidentifiable(rung: Rung) -> bool:
    return any(estimate.note == "not identifiable" for estimate in rung.result.parameters)


if __name__ == "__main__":
    main()

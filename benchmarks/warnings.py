"""Whether the warnings of a fit name the true cause, and whether their advice helps: `python -m benchmarks.warnings`.

Virtual records of dampers with random numbers, on a noisy bench with one artefact of random size, fitted by the law
without it. Right: the first cause that the fit names is the true one, or "the law". Then the advice is followed, where
it is another fit, and the coverage of the 95 % intervals of the law's numbers is compared.

    python -m benchmarks.warnings [--seeds 30] [--only delay,hum] [--law bilinear|besinger] [--show]
"""

import argparse
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

import jaxdamp
from jaxdamp import bench, dampers, identify
from jaxdamp._tables import Column, Table


LAWS = {
    "bilinear": (dampers.Bilinear, (2600.0, 1200.0)),
    "besinger": (dampers.Besinger, (1600.0, 4200.0, 900.0, 0.13, 0.05)),
}
TESTS = [bench.SineTest(a, f, cycles=int(8 * f), name=f"{f:g} Hz") for a, f in ((0.02, 1.0), (0.02, 3.0), (0.01, 8.0))]
RATE, NOISE = 500.0, 5.0  # Hz, N
SAMPLED = 1e-3  # of a number: what sampling at this rate costs; so near is covered
# What the fit says of each cause; the law is always a right answer.
CAUSES = {
    "zero error": "a constant force",
    "gas spring": "a spring of",
    "moving mass": "a moving mass",
    "friction": "friction of",
    "delay": "a delay of the force",
    "low-pass filter": "a low-pass filter",
    "drift of damping": "damping that falls",
    "drift of zero": "zero that drifts",
    "clearance": "a clearance",
    "jitter": "a clock that jitters",
    "hum": "the mains",
    "gain of a record": "a gain of",
    "clipping": "clipped",
    "reversed sign": "drives the motion",
    "the law": "the law misses",
}
ADVICE = re.compile(r'add ("[^.;,]*?) to the machine')


class Case(NamedTuple):
    """Records with one artefact."""

    runs: list[bench.BenchRun]
    truth: dampers.AbstractDamper


Make = Callable[[dampers.AbstractDamper, np.random.Generator, int], list[bench.BenchRun]]


def _measured(law: dampers.AbstractDamper, seed: int, **settings: Any) -> list[bench.BenchRun]:
    settings = {"force_noise": NOISE, "stroke_noise": 1e-5} | settings
    return list(bench.VirtualDyno(law, sampling_rate=RATE, seed=seed, **settings).run(TESTS))


def _rig(**ranges: tuple[float, float]) -> Make:
    """Faults of machine and channels, of sizes between two ends."""

    def make(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
        return _measured(law, seed, **{name: float(rng.uniform(*ends)) for name, ends in ranges.items()})

    return make


def _clearance(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    """A rod that moves by 0.2 to 1 mm after each reversal before the piston follows."""
    gap, runs = rng.uniform(2e-4, 1e-3), []
    for run, test in zip(_measured(law, seed), TESTS, strict=True):
        stroke, velocity = test.stroke(run.time), test.velocity(run.time)
        piston, moved = 0.0, np.zeros(len(run))
        for k, x in enumerate(stroke):
            new = min(max(piston, x - 0.5 * gap), x + 0.5 * gap)
            moved[k], piston = float(new != piston), new
        lost = np.asarray(jax.vmap(law.force_velocity)(velocity)) * (1.0 - moved)  # type: ignore[attr-defined]
        runs.append(replace(run, force=run.force - lost))
    return runs


def _drift_of_zero(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    """A load cell whose zero drifts over each record."""
    runs, size = _measured(law, seed), float(rng.choice([-1, 1]) * rng.uniform(10.0, 50.0))
    return [replace(run, force=run.force + size * run.time / run.time[-1]) for run in runs]


def _gain(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    """One record whose force is 3 to 8 % too large or too small."""
    runs, which = _measured(law, seed), int(rng.integers(len(TESTS)))
    factor = 1.0 + float(rng.choice([-1, 1]) * rng.uniform(0.03, 0.08))
    return [replace(run, force=factor * run.force) if i == which else run for i, run in enumerate(runs)]


def _clipped(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    """A force channel that ends at 60 to 95 % of the largest force."""
    largest = max(float(np.abs(run.force).max()) for run in _measured(law, seed))
    return _measured(law, seed, force_limit=float(rng.uniform(0.6, 0.95)) * largest)


def _reversed(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    del rng
    return _measured(law, seed, reversed_force=True)


def _series(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    return _measured(dampers.SeriesSpring(law, rng.uniform(2e5, 6e5)), seed)


def _dahl(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    friction = dampers.Dahl(rng.uniform(1e5, 5e5), rng.uniform(30.0, 90.0))
    return _measured(dampers.SeriesSpring(law, rng.uniform(2e5, 6e5)) + friction, seed)


def _curved(law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    """A valve that opens: above its velocity the law has a part of its rate only."""
    knee, rates = rng.uniform(0.1, 0.3), [float(np.asarray(p.value)) for p in jaxdamp.parameters.parameters(law)[:2]]
    return _measured(
        dampers.PiecewiseLinear([-knee, 0.0, knee], [0.5 * rates[1], rates[1], rates[0], 0.4 * rates[0]]), seed
    )


ARTEFACTS: dict[str, tuple[str, Make]] = {
    "none": ("", _rig()),
    "zero error": ("zero error", _rig(force_offset=(10.0, 60.0))),
    "gas spring": ("gas spring", _rig(gas_stiffness=(1000.0, 5000.0))),
    "moving mass": ("moving mass", _rig(moving_mass=(1.0, 4.0))),
    "friction": ("friction", _rig(friction=(15.0, 50.0))),
    "delay": ("delay", _rig(force_delay=(5e-4, 4e-3))),
    "low-pass filter": ("low-pass filter", _rig(force_lag=(1e-3, 5e-3))),
    "drift of damping": ("drift of damping", _rig(temperature_slope=(5e-4, 4e-3), heating=(0.002, 0.004))),
    "drift of zero": ("drift of zero", _drift_of_zero),
    "clearance": ("clearance", _clearance),
    "jitter": ("jitter", _rig(clock_jitter=(3e-4, 2e-3))),
    "hum": ("hum", _rig(mains_ripple=(5.0, 30.0))),
    "gain of a record": ("gain of a record", _gain),
    "clipping": ("clipping", _clipped),
    "reversed sign": ("reversed sign", _reversed),
    "series spring": ("the law", _series),
    "another curve": ("the law", _curved),
    "spring and Dahl": ("the law", _dahl),
}


class Outcome(NamedTuple):
    """What a fit said of one artefact."""

    named: tuple[str, ...]  # causes, in order
    before: float  # share of the numbers of the law within their intervals
    after: float  # the same after the advice was followed
    texts: tuple[str, ...]


def causes_in(warnings: Sequence[str]) -> tuple[str, ...]:
    """The causes that warnings name, in their order."""
    return tuple(
        cause
        for warning in warnings
        for cause, words in CAUSES.items()
        if words in warning and (cause == "the law" or CAUSES["the law"] not in warning)
    )


def outcome(artefact: str, seed: int, law: str = "bilinear", *, follow: bool = True) -> Outcome:
    """Records with one artefact, fitted, and fitted again as the first warning advises."""
    rng = np.random.default_rng([seed, sum(map(ord, artefact))])
    kind, middle = LAWS[law]
    truth = kind(*(np.array(middle) * rng.uniform(0.75, 1.3, len(middle))))
    runs = ARTEFACTS[artefact][1](truth, rng, seed)
    try:
        result = identify.fit(kind, runs, starts=1)
    except ValueError as error:
        return Outcome(causes_in([str(error)]), np.nan, np.nan, (str(error),))
    before, after = _covered(result, truth), np.nan
    texts = [text for text in result.main_warnings if causes_in([text])]
    advice = ADVICE.search(texts[0]) if texts else None
    if advice and follow:
        name = re.findall(r'"(\w+)"', advice[1])
        again = identify.fit(kind, runs, starts=1, rig=name[-1])
        after = _covered(again, truth)
    return Outcome(causes_in(texts), before, after, result.main_warnings)


def _covered(result: identify.FitResult, truth: dampers.AbstractDamper) -> float:
    """Share of the numbers of the law within their intervals."""
    true = {f"law.{p.path}": float(p.value) for p in jaxdamp.parameters.parameters(truth)}
    true |= {p.path: float(p.value) for p in jaxdamp.parameters.parameters(truth)}
    ends = [(true[e.name], *e.interval) for e in result.parameters if e.name in true]
    return float(np.mean([low - SAMPLED * value <= value <= high + SAMPLED * value for value, low, high in ends]))


def matrix(artefacts: Sequence[str], seeds: int, law: str = "bilinear", show: bool = False) -> Table:
    """One row for each artefact: the shares of seeds named right and wrong, and coverage before and after the advice.

    Arguments:
        artefacts: names of `ARTEFACTS`.
        seeds: of each.
        law: of the dampers, a name of `LAWS`.
        show: whether to print all warnings of the seeds that are not named right.
    """
    rows = []
    for artefact in artefacts:
        cause, outcomes = ARTEFACTS[artefact][0], [outcome(artefact, seed, law) for seed in range(seeds)]
        right = [bool(o.named) and o.named[0] in (cause, "the law") if cause else not o.named for o in outcomes]
        wrong = Counter(o.named[0] for o, is_right in zip(outcomes, right, strict=True) if o.named and not is_right)
        for seed, (o, is_right) in enumerate(zip(outcomes, right, strict=True)):
            if show and not is_right:
                print(artefact, seed, *o.texts, sep="\n    ", file=sys.stderr)
        law_named = sum(bool(o.named) and o.named[0] == "the law" for o in outcomes)
        names = ", ".join(f"{name} {count}" for name, count in wrong.most_common())
        fitted = [(o.before, o.after) for o in outcomes if np.isfinite(o.before)]
        both = [(b, a) for b, a in fitted if np.isfinite(a)]
        before = 100.0 * np.mean([b for b, _ in fitted]) if fitted else None
        followed = [100.0 * float(np.mean(values)) for values in zip(*both, strict=True)] if both else [None, None]
        shares = (100.0 * float(np.mean(right)), 100.0 * law_named / seeds, 100.0 * wrong.total() / seeds)
        rows.append((artefact, *shares, names, before, len(both), *followed))
    columns = [Column("artefact"), *(Column(name, "%", ".0f") for name in ("right", "by the law", "wrong"))]
    columns += [Column("named instead"), Column("coverage", "%", ".0f"), Column("followed", spec="d")]
    columns += [Column("of these before", "%", ".0f"), Column("after", "%", ".0f")]
    return Table(f"Causes that a fit of {law} names, {seeds} seeds each", tuple(columns), tuple(rows))


def main() -> None:
    """Print the matrix."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--only", default=",".join(ARTEFACTS))
    parser.add_argument("--law", choices=LAWS, default="bilinear")
    parser.add_argument("--show", action="store_true", help="Print the warnings of seeds that are not named right.")
    arguments = parser.parse_args()
    jaxdamp.configure()
    print(matrix(arguments.only.split(","), arguments.seeds, arguments.law, arguments.show).to_text())


if __name__ == "__main__":
    main()

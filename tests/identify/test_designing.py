"""Designs of experiments: brute force, closed forms, limits, and fits to the records of a designed programme."""

import dataclasses
import itertools

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import CommandStep, MultiSineTest, RandomTest, SineTest, TriangleTest, VirtualDyno, programmes
from jaxdamp.dampers import AbstractDamper, Besinger, Bilinear, Linear, Scheduled, Spring, Table
from jaxdamp.identify import MachineLimits, design_experiment
from jaxdamp.identify.design_goal import information
from jaxdamp.rig import Rig


BESINGER = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
PUBLISHED = Besinger(14_400.0, 15_600.0, 3_600.0, limit_velocity=0.125, transition_velocity=0.7)
CANDIDATES = [
    SineTest(a, f, name=f"{i}") for i, (a, f) in enumerate([(0.02, 0.5), (0.01, 2.0), (0.02, 3.0), (0.01, 9.0)])
]


def errors_of(tests: list[SineTest], law: AbstractDamper = BESINGER, noise: float = 20.0):
    """Standard errors that a programme would give, from a design that may only take all of it."""
    design = design_experiment(law, runs=1, tests=tests, force_noise=noise, sampling_rate=500.0, programme=tests)
    assert design.programme_covariance is not None
    return np.sqrt(np.diag(design.programme_covariance))


@pytest.mark.parametrize("criterion", ["D", "A"])
def test_no_other_three_runs_are_better(criterion):
    design = design_experiment(
        BESINGER, runs=3, tests=CANDIDATES, force_noise=20.0, sampling_rate=500.0, criterion=criterion
    )
    values = np.asarray(design.free.values)

    def worth(relative):
        return np.linalg.slogdet(relative)[1] if criterion == "D" else np.trace(relative)

    matrices = information(
        BESINGER, CANDIDATES, rig=None, freeze=(), tie=None, sampling_rate=500.0, force_noise=20.0
    ).matrices * np.outer(values, values)
    sets = itertools.combinations_with_replacement(range(len(CANDIDATES)), 3)
    best = min(worth(np.linalg.inv(matrices[list(runs)].sum(axis=0) + 1e-6 * np.eye(5))) for runs in sets)
    assert worth(design.covariance / np.outer(values, values)) == pytest.approx(best, rel=1e-3)
    assert len({test.name for test in design.tests}) == 3


@pytest.mark.slow
def test_expected_errors_are_those_of_a_fit():
    """The machine's offset is determined too; the records come from the tests of the design as they are."""
    rig = Rig(force_offset=20.0)
    limits = MachineLimits(0.02, 0.6, frequencies=(0.5, 12.0))
    design = design_experiment(
        BESINGER, limits, runs=3, force_noise=10.0, sampling_rate=500.0, duration=1.0, rig=rig, programme=CANDIDATES
    )
    runs = VirtualDyno(BESINGER, rig=rig, sampling_rate=500.0, force_noise=10.0, seed=3).run(design.tests)
    result = identify.fit(BESINGER, runs, rig=rig, starts=1)
    for estimate in result.parameters:
        assert estimate.standard_error == pytest.approx(design.standard_errors[estimate.name], rel=0.15)
    assert design.runs_to_match is not None and design.runs_saved == 4 - design.runs_to_match
    assert f"{design.runs_to_match} such runs are as good as the 4 of the programme" in repr(design)
    assert len(design.table().rows) == 6 and len(design.runs_table().rows) == 3
    assert len(design.plot().axes) == 2


def test_paper_001_becomes_identifiable():
    """The one test that the law was fitted to leaves C_b and α open; four runs of the same machine do not."""
    limits = MachineLimits(0.020, 0.314, frequencies=(0.5, 2.5))
    (one,) = programmes.sines([0.010], [2.0], cycles=1)
    design = design_experiment(
        PUBLISHED,
        limits,
        runs=4,
        force_noise=20.0,
        waveforms=["sine", "triangle"],
        programme=[one],
        strokes=3,
        frequencies=3,
    )
    records = {row["parameter"]: row for row in design.table().records()}
    for name in ("blow_off_rate", "transition_velocity"):
        value = float(str(records[name]["value"]))
        error = float(str(records[name]["standard error, 1 runs of the programme"]))
        assert error > 2.0 * value and design.standard_errors[name] < 0.45 * value


def test_the_criterion_c_takes_what_the_function_needs():
    """Only compression matters to a force in compression: the fastest run, again and again."""
    design = design_experiment(
        Bilinear(2600.0, 1200.0),
        runs=2,
        tests=CANDIDATES,
        force_noise=20.0,
        sampling_rate=500.0,
        criterion="c",
        function=lambda law: law.force_velocity(-0.5),
        programme=CANDIDATES,
    )
    fastest = max(CANDIDATES, key=lambda t: t.peak_velocity * np.sqrt(t.duration))
    assert [test.name for test in design.tests] == [fastest.name, f"{fastest.name}_2"]
    mine, theirs = design.function_errors
    assert mine == pytest.approx(0.5 * design.standard_errors["compression_rate"])
    assert theirs == pytest.approx(0.5 * errors_of(CANDIDATES, Bilinear(2600.0, 1200.0))[1], rel=1e-6)


def test_priors_count_and_limits_hold():
    known = design_experiment(
        Linear(2000.0), runs=1, tests=CANDIDATES, force_noise=1e6, sampling_rate=500.0, prior={"rate": 5.0}
    )
    assert known.standard_errors["rate"] == pytest.approx(5.0, rel=1e-3)
    limits = MachineLimits(0.02, 0.6, force=600.0, power=60.0, frequencies=(0.5, 12.0))
    bounded = design_experiment(Linear(2000.0), limits, runs=1, force_noise=10.0, waveforms=["sine"], duration=1.0)
    peak = identify.extent(bounded.tests[0])[1]
    assert 0.8 * np.sqrt(60.0 * 2 / 2000.0) < peak <= np.sqrt(60.0 * 2 / 2000.0)  # the heat of c v²/2 is met first


@pytest.mark.parametrize("test", [TriangleTest(0.02, 1.5), MultiSineTest(0.02, 0.3, (1.0, 2.3, 5.3), duration=3.0)])
def test_velocities_are_derivatives_and_limits_are_touched(test):
    time = np.linspace(-test.warm_up, test.duration, 40_001)
    np.testing.assert_allclose(np.gradient(test.stroke(time), time)[1:-1], test.velocity(time)[1:-1], atol=2e-5)
    assert np.max(np.abs(test.velocity(time))) == pytest.approx(test.peak_velocity, rel=1e-3)
    assert np.max(np.abs(test.stroke(time))) <= 0.02 * 1.001
    assert abs(test.stroke(time)[0]) < 1e-12


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({}, "`limits` must be given, or `tests`"),
        ({"tests": CANDIDATES, "runs": 0}, "`runs` must be 1 or more"),
        ({"tests": CANDIDATES, "criterion": "c"}, "`function` must be given with the criterion 'c'"),
        ({"tests": CANDIDATES, "criterion": "E"}, "criterion"),
        ({"limits": MachineLimits(0.02, 0.5), "waveforms": ["sines"]}, "waveforms"),
        ({"limits": MachineLimits(0.02, 0.5, power=1e-3), "waveforms": ["sine"]}, "no candidate"),
        ({"tests": CANDIDATES, "prior": {"rat": 1.0}}, "No parameter is named 'rat'"),
        ({"tests": CANDIDATES, "law": Linear}, "`law` must be a law with its numbers, but is the class Linear"),
        (
            {"tests": CANDIDATES, "law": lambda velocity, force: Linear(1.0)},
            "write the law with the numbers you expect",
        ),
        ({"tests": CANDIDATES, "rig": ["gas"]}, "`rig` must be a `Rig` with its numbers, but is a list of 1"),
        ({"tests": CANDIDATES, "rig": Rig()}, r"Write those that the runs shall determine, `rig=Rig\(gas_force"),
        ({"tests": []}, "`tests` must hold at least one test"),
        (
            {"tests": CANDIDATES, "limits": MachineLimits(0.005, 0.01)},
            r"no candidate within them: 0 \(20 mm, 0.06283 m/s",
        ),
        ({"limits": MachineLimits(0.02, 0.5), "duration": -1.0}, "`duration` must be positive"),
        ({"limits": MachineLimits(0.02, 0.5), "strokes": 0}, "`strokes` must be 1 or more"),
        (
            {"tests": CANDIDATES, "criterion": "c", "function": lambda law: law.rate * np.ones(2)},
            r"`function` must return one number, but is one that returns an array of shape \(2,\)",
        ),
        ({"tests": CANDIDATES, "criterion": "c", "function": lambda law: {"rate": law.rate}}, "returns a dict of 1"),
    ],
)
def test_refusals(settings, match):
    with pytest.raises(ValueError, match=match):
        common = {"law": Linear(2000.0), "force_noise": 20.0, "sampling_rate": 500.0, "strokes": 2, "frequencies": 2}
        design_experiment(**common | settings)


def test_limits_refuse():
    with pytest.raises(ValueError, match="frequencies"):
        MachineLimits(0.02, 0.5, frequencies=(2.0, 1.0))
    assert dataclasses.replace(MachineLimits(0.02, 0.5), force=10.0).force == 10.0


def test_tests_beyond_the_machine_are_left_out_and_named():
    limits = MachineLimits(0.02, 0.3, force=400.0, frequencies=(0.5, 8.0))
    tests = [
        *CANDIDATES[:2],
        SineTest(0.1, 5.0, name="long"),
        TriangleTest(0.002, 6.0, name="sharp"),  # its turns are as sharp as those of a sine of 13.8 Hz
        RandomTest(0.01, 0.1, duration=4.0, band=(0.5, 9.0), name="wide"),
        CommandStep(SineTest(0.02, 0.2), (0.0, 1.0), name="slow"),
        SineTest(0.015, 3.0, name="strong"),
    ]
    design = design_experiment(
        Linear(2000.0), limits, runs=2, tests=tests, force_noise=10.0, sampling_rate=500.0, programme=tests[1:3]
    )
    assert {test.name.rstrip("_2") for test in design.tests} <= {"0", "1", "sharp"}
    left_out, programme = design.warnings
    assert left_out == (
        "Left out of the candidates as beyond `limits`: long (100 mm, 3.142 m/s), wide (9 Hz), slow (0.2 Hz), "
        "strong (565.5 N)."
    )
    assert programme.startswith("The machine cannot run 1 of the 2 tests of the programme: long (100 mm, 3.142 m/s, 6")
    assert f"warning: {left_out}" in repr(design)


def test_a_zero_is_judged_by_its_vector_its_prior_or_its_force():
    def design(law, **settings):
        return design_experiment(law, runs=1, tests=CANDIDATES, force_noise=20.0, sampling_rate=500.0, **settings)

    table = design(Table([-0.3, -0.1, 0.0, 0.1, 0.3], [-500.0, -200.0, 0.0, 300.0, 700.0]), criterion="A")
    assert table.warnings == ()  # known to 2 N beside 700 N
    assert "not identifiable" not in repr(table)
    gas = Linear(2000.0) + Spring(5000.0, 0.0)
    assert design(gas).warnings == ()  # to 1 N beside forces of 500 N
    (said,) = design(gas, prior={"preload": 0.1}).warnings
    assert said == "The runs will not determine terms.1.preload."


def test_a_command_that_is_held_is_said_and_one_that_varies_counts():
    law = Scheduled((Linear(900.0), Linear(4900.0)), levels=[0.0, 2.0], command=0.5)
    sine = SineTest(0.02, 1.0, name="held")

    def design(*tests):
        return design_experiment(law, runs=1, tests=tests, force_noise=20.0, sampling_rate=500.0)

    weak, held = design(sine).warnings
    assert weak == "The runs will not determine laws.0.rate, laws.1.rate."
    assert held.startswith("All runs are at command 0.5 of 0 to 2, and say little or nothing of numbers that act at ")
    best = design(sine, CommandStep(sine, (0.0, 2.0), name="steps"))
    assert [test.name for test in best.tests] == ["steps"] and best.warnings == ()
    assert max(best.standard_errors.values()) < 20.0

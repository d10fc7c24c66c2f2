"""Many dampers in one call: the optimum of single fits, shared parameters, dampers that stand out."""

import dataclasses
import json
from typing import Any

import numpy as np
import optimistix as optx
import pytest

from jaxdamp import identify
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import AbstractDamper, Bilinear, Lag, Linear, Scheduled, with_command
from jaxdamp.identify import Status, control_charts, fit, fit_many
from jaxdamp.identify.rows import Row
from jaxdamp.identify.traces import _grouped
from jaxdamp.parameters import free_parameters, get
from jaxdamp.rig import Rig


TESTS = [SineTest(0.02, 1.0), SineTest(0.01, 4.0)]
CLICKS = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)


def records(law: AbstractDamper, seed: int = 0, rig: Rig | None = None) -> list[BenchRun]:
    return list(VirtualDyno(law, rig=rig or Rig(), force_noise=4.0, sampling_rate=200.0, seed=seed).run(TESTS))


@pytest.fixture(scope="module")
def clicks() -> dict[str, list[BenchRun]]:
    """Rebound by clicks, compression and gas force common to all."""
    laws = {f"{c:g}": Bilinear(2000.0 + 100.0 * c - 4.0 * c**2, 1200.0) for c in CLICKS}
    return {name: records(law, i, Rig(gas_force=-80.0)) for i, (name, law) in enumerate(laws.items())}


@pytest.mark.parametrize(
    ("start", "options"),
    [
        (Bilinear, {"rig": "gas"}),
        (Lag(Bilinear(1500.0, 1500.0), 2e-3), {"rig": "gas", "bounds": {"lag_time": (1e-4, 1e-2)}}),
        (Bilinear(2400.0, 1200.0), {"rig": "gas", "over": ["rebound_rate"]}),
    ],
    ids=["memoryless", "with a state", "one of its numbers"],
)
@pytest.mark.exhaustive_cases("memoryless")
def test_the_optimum_is_that_of_single_fits(clicks, start, options):
    many = fit_many(start, clicks, **options)
    assert many.converged and many.names == tuple(clicks) and len(many) == 6
    for i in (0, 5):
        single = fit(start, clicks[many.names[i]], starts=1, **options)
        assert many.parameters == tuple(e.name for e in single.parameters)
        values, errors = (
            np.array([getattr(e, name) for e in single.parameters]) for name in ("value", "standard_error")
        )
        np.testing.assert_allclose(many.values[i], values, atol=1e-2 * errors.min(), rtol=1e-3)
        np.testing.assert_allclose(many.standard_errors[i], errors, rtol=1e-2)
        assert many.rmse[i] == pytest.approx(single.rmse, rel=0.02)
        ranges: list[Any] = [many.laws[i].fitted_to, single.law.fitted_to]
        for one, other in zip(*(covered.known() for covered in ranges), strict=True):
            assert one.name == other.name and one.limits == pytest.approx(other.limits, rel=1e-4)
        assert float(get(many.rigs[i], "gas_force")) == pytest.approx(-80.0, abs=2.0)


@pytest.mark.slow
def test_records_cut_out_of_a_long_motion_start_in_the_periodic_solution():
    laws = [Lag(Linear(2000.0), 0.5), Lag(Linear(2300.0), 0.4)]
    made = [VirtualDyno(law, sampling_rate=200.0).run(SineTest(0.02, 2.0, cycles=12)) for law in laws]
    cut = [run.process(between=(4.8, 5.9)) for runs in made for run in runs]
    start = Lag(Linear(2600.0), 0.65)
    many = fit_many(start, cut, initial_state="periodic")
    for law, fitted in zip(laws, many.laws, strict=True):
        np.testing.assert_allclose(*(free_parameters(each).values for each in (fitted, law)), rtol=5e-3)
    assert not any(many.remarks) and np.all(many.drift < 1e-6)
    assert np.all(np.abs(fit_many(start, cut).values[:, 1] / [0.5, 0.4] - 1.0) > 0.1)
    drifting = dataclasses.replace(many, drift=np.array([0.0, 0.01]))
    assert drifting.remarks[1] == "its states are not periodic: over a cycle they still change by 0.01"


@pytest.mark.parametrize("options", [{}, {"force_noise": 4.0}, {"shared": ["*_rate", "lag_time"]}], ids=str)
def test_standard_errors_where_records_weigh_alike_are_those_of_single_fits(options):
    tests = [SineTest(0.02, 0.2, cycles=2), SineTest(0.02, 2.0)]  # the force of one is ten times that of the other
    law, shared = Lag(Bilinear(2400.0, 1200.0), 4e-3), "shared" in options
    dynos = [VirtualDyno(law, force_noise=4.0, sampling_rate=200.0, seed=seed) for seed in range(2)]
    dampers = {str(i): list(dyno.run(tests)) for i, dyno in enumerate(dynos)}
    many = fit_many(LAGGING, dampers, weighting="runs", **options)
    every = [run for runs in dampers.values() for run in runs] if shared else dampers["0"]
    alike: dict[str, Any] = {"bad_records": "keep"} if shared else options
    single = fit(LAGGING, every, weighting="runs", starts=1, **alike)
    errors = [e.standard_error for e in single.parameters]
    np.testing.assert_allclose(many.standard_errors[0], errors, rtol=0.05)


def test_each_damper_beside_a_shared_number_has_its_own_noise():
    dynos = [VirtualDyno(Bilinear(2400.0, 1200.0), force_noise=noise, sampling_rate=200.0) for noise in (2.0, 20.0)]
    dampers = [list(dyno.run(TESTS)) for dyno in dynos]
    errors = [fit_many(Bilinear, dampers, shared=shared).standard_errors[:, 0] for shared in ((), ["compression_rate"])]
    np.testing.assert_allclose(*errors, rtol=0.05)


@pytest.mark.parametrize("start", [Bilinear, Lag(Bilinear(1500.0, 1500.0), 2e-3)], ids=["memoryless", "with a state"])
def test_errors_are_those_of_the_samples_where_their_means_are_fitted(start):
    dyno = VirtualDyno(Bilinear(2400.0, 1200.0), force_noise=20.0, sampling_rate=4000.0)
    slow = list(dyno.run([SineTest(0.02, 0.5, cycles=2), SineTest(0.02, 1.0, cycles=2)]))
    many, single = fit_many(start, {"a": slow}), fit(start, slow, starts=1)
    assert many.rmse[0] == pytest.approx(20.0, rel=0.05) and many.rmse[0] == pytest.approx(single.rmse, rel=1e-6)
    np.testing.assert_allclose(many.record_rmse[0], [score.rmse for score in single.scores], rtol=1e-6)
    assert many.fit_percent[0] == pytest.approx(single.fit_percent, rel=1e-6)


def test_records_of_three_lengths_are_computed_in_two_loops():
    rows = [Row(1e-3, [], np.ones(size), 0, 0, 1, 1) for size in (2000, 700, 200) for _ in range(10)]
    assert sorted(len(group) for group in _grouped(rows)) == [10, 20]


LAGGING = Lag(Bilinear(1500.0, 1500.0), 2e-3)
PRINTED = [
    {"rig": ["gas", "delay"]},
    {"loss": "huber", "priors": {"lag_time": (5e-3, 1e-4)}},
    {"shared": ["rebound_rate"], "priors": {"rebound_rate": (2400.0, 20.0)}},
    {"weighting": "runs", "freeze": ["compression_rate"], "starts": 2},
    {"initial_state": "rest", "samples_per_cycle": 60, "tie": {"compression_rate": "rebound_rate"}},
]


@pytest.mark.parametrize("options", PRINTED, ids=["machine", "loss and priors", "shared", "starts", "tie"])
@pytest.mark.exhaustive_cases("machine", "shared", "starts", "tie")
def test_dampers_with_different_records_are_fitted_alike_by_c_and_by_xla(options, monkeypatch):
    tests = [SineTest(0.02, 1.0, cycles=2), SineTest(0.01, 4.0), SineTest(0.015, 2.0, cycles=2)]
    dampers = {}
    for i in range(3):
        law = Lag(Bilinear(2000.0 + 100.0 * i, 1200.0), 5e-3)
        dyno = VirtualDyno(law, force_noise=4.0, sampling_rate=200.0, seed=i)
        dampers[str(i)] = list(dyno.run(tests[: i + 1]))
    by_c = fit_many(LAGGING, dampers, **options)
    if "shared" not in options:  # what a damper gets does not depend on the others
        alone = fit_many(LAGGING, {"1": dampers["1"]}, **options)
        np.testing.assert_allclose(by_c.values[1], alone.values[0], rtol=1e-9)
    monkeypatch.setattr("jaxdamp.identify.search.evaluator", lambda *_: None)
    by_xla = fit_many(LAGGING, dampers, **options)
    assert by_xla.status == by_c.status and by_xla.remarks == by_c.remarks
    assert np.all(np.abs(by_xla.values - by_c.values) <= 1e-6 * by_c.standard_errors)
    for name in ("standard_errors", "fit_percent", "rmse"):
        np.testing.assert_allclose(getattr(by_xla, name), getattr(by_c, name), rtol=1e-6)


def test_shared_parameters_follow_the_setting(clicks):
    some = {name: runs for name, runs in clicks.items() if name != "4"}
    settings = [float(name) for name in some]
    shared = {"rebound_rate": 2, "compression_rate": 0, "gas_force": 0}
    many = fit_many(Bilinear, some, rig="gas", shared=shared, settings=settings)
    assert many.converged
    assert np.ptp(many.values[:, 1]) == 0.0 and many.values[0, 1] == pytest.approx(1200.0, abs=5.0)
    between = many.law_at(4.0)  # never measured
    assert float(get(between, "rebound_rate")) == pytest.approx(2336.0, abs=8.0)
    apart = fit_many(Bilinear, some, rig="gas", settings=settings)
    assert np.all(many.standard_errors[:, 1] < 0.6 * apart.standard_errors[:, 1])
    assert float(get(apart.law_at(4.0), "rebound_rate")) == pytest.approx(np.mean(apart.values[[1, 2], 0]))
    blended = apart.law_at(3.0, blend="force")  # between the dampers of 2 and 6 clicks
    ends = [float(law.force(0.0, 0.2, law.initial_state())) for law in (apart.laws[1], apart.laws[2])]
    assert float(blended.force(0.0, 0.2, blended.initial_state())) == pytest.approx(0.75 * ends[0] + 0.25 * ends[1])
    unsure = dataclasses.replace(apart, standard_errors=apart.values * 0.6)
    assert isinstance(unsure.law_at(3.0), Scheduled) and isinstance(unsure.law_at(2.0), Bilinear)
    with pytest.raises(ValueError, match="`setting` must be from 0 to 10"):
        many.law_at(11.0)


def test_a_polynomial_gives_no_law_beyond_its_limits():
    """Through 800, 300 and 200 N s/m at 4, 8 and 16 clicks the fourth degree gives -458 N s/m at 13."""
    settings, rates = [0, 2, 4, 8, 16], [5000.0, 2000.0, 800.0, 300.0, 200.0]
    test = SineTest(0.02, 1.0)
    runs = [VirtualDyno(Bilinear(r, 900.0), force_noise=1.0, seed=i).run([test])[0] for i, r in enumerate(rates)]
    shared = {"rebound_rate": 4, "compression_rate": 0}
    for bounds, least in (({}, "0"), ({"rebound_rate": (150.0, 6000.0)}, "150")):
        many = fit_many(Bilinear, runs, shared=shared, settings=settings, bounds=bounds)
        assert float(get(many.law_at(8.0), "rebound_rate")) == pytest.approx(300.0, abs=2.0)
        with pytest.raises(ValueError, match=rf"within {least} to .* is 13, where its poly.* -4.*lower degree"):
            many.law_at(13.0)
    with pytest.raises(ValueError, match="a number of each damper's own"):
        control_charts(fit_many(Bilinear, runs, shared=["rebound_rate", "compression_rate"]), 8)


def test_a_bad_run_stands_out(clicks):
    bad = [BenchRun(r.name, r.time, r.stroke, r.velocity, 1.5 * r.force) for r in clicks["4"]]
    many = fit_many(Bilinear, clicks | {"4": bad}, rig="gas", settings=CLICKS)
    assert many.unusual == ("4",)
    assert "rebound_rate = " in many.remarks[2] and "where the others suggest" in many.remarks[2]
    assert many.remarks[2] in repr(many)
    assert not any(fit_many(Bilinear, clicks, rig="gas", settings=CLICKS).remarks)
    row = many.table().records()[2]
    assert row["damper"] == "4" and row["setting"] == 4.0 and row["remark"] == many.remarks[2]
    data = json.loads(json.dumps(many.to_dict(), allow_nan=False))
    assert data["units"]["law.rebound_rate"] == "N s/m" and data["dampers"]["4"]["status"] == "converged"


def test_several_starts_side_by_side(clicks):
    start = Lag(Bilinear(1500.0, 1500.0), 0.3)  # a lag so long that its neighbourhood is flat
    few = fit_many(start, [clicks["0"]], rig="gas", max_steps=3)
    assert few.status == (Status.STEP_LIMIT,) and few.remarks[0].startswith("The search stopped")
    assert fit_many(start, [clicks["0"]], rig="gas", max_steps=3, starts=4).rmse[0] <= few.rmse[0]


def test_names_may_be_numbers_and_texts(clicks):
    mixed: dict[Any, list[BenchRun]] = {1: clicks["0"], "reference": clicks["2"]}
    assert fit_many(Bilinear, mixed).names == ("1", "reference")


def test_dampers_with_commands():
    law = Scheduled((Linear(1000.0), Linear(3000.0)), [0.0, 2.0], 0.0)
    dampers = [
        [BenchRun(r.name, r.time, r.stroke, r.velocity, r.force, command=u) for r in records(with_command(law, u))]
        for u in (0.5, 1.5)
    ]
    together = [run for runs in dampers for run in runs]
    many = fit_many(law, [together, together])
    np.testing.assert_allclose(many.values, [[1000.0, 3000.0]] * 2, rtol=0.01)


def test_what_is_refused(clicks):
    refusals: tuple[tuple[dict[str, Any], str], ...] = (
        ({"shared": {"rebound_rate": 1}}, "`settings` must be given"),
        ({"shared": {"rebound_rate": 6}, "settings": CLICKS}, "degrees below the number of settings, 6"),
        ({"shared": ["rebound"]}, "No parameter is named 'rebound'"),
        ({"settings": CLICKS[:3]}, "one number for each of 6 dampers"),
        ({"starts": 0}, "`starts` must be 1 or more"),
    )
    for options, message in refusals:
        with pytest.raises(ValueError, match=message):
            fit_many(Bilinear, clicks, **options)
    with pytest.raises(ValueError, match="`dampers` must hold at least one damper"):
        fit_many(Bilinear, {})
    for names in ({1: clicks["0"], "1": clicks["2"]}, {"": clicks["0"]}):
        with pytest.raises(ValueError, match="`dampers` must have names that are different as texts and not empty"):
            fit_many(Bilinear, names)
    assert identify.ManyFits is type(fit_many(Bilinear, [clicks["0"]]))


def spiked(runs: list[BenchRun], seed: int) -> list[BenchRun]:
    """The same with spikes of either sign at 1 to 6 % of the samples."""
    rng = np.random.default_rng(seed)
    spikes = [rng.choice([-2e3, 2e3], len(r)) * (rng.random(len(r)) < 0.01 * (1 + seed)) for r in runs]
    return [dataclasses.replace(r, force=r.force + spike) for r, spike in zip(runs, spikes, strict=True)]


@pytest.mark.parametrize(
    "options",
    [
        {"loss": "student_t"},
        {"priors": {"rebound_rate": (3000.0, 4.0), "gas_force": (-90.0, 1.0)}},
        {"loss": "huber", "priors": {"compression_rate": (1210.0, 4.0)}},
    ],
    ids=["loss", "priors", "both"],
)
@pytest.mark.exhaustive_cases("loss", "priors")
def test_losses_and_priors_are_those_of_single_fits(clicks, options):
    wild = {name: spiked(runs, i) for i, (name, runs) in enumerate(clicks.items())} if "loss" in options else clicks
    many = fit_many(Bilinear, wild, rig="gas", **options)
    for i in (0, 4):
        single = fit(Bilinear, wild[many.names[i]], rig="gas", starts=1, **options)
        values, errors = (
            np.array([getattr(e, name) for e in single.parameters]) for name in ("value", "standard_error")
        )
        np.testing.assert_allclose(many.values[i], values, atol=0.02 * errors.min(), rtol=0.0)
        np.testing.assert_allclose(many.standard_errors[i], errors, rtol=0.01)
    if options.get("loss") == "student_t":
        assert many.share_left_out[5] > many.share_left_out[0] + 0.02 > 0.02
        assert many.unusual == ("10",) and "of its samples have less than half weight" in many.remarks[5]


@pytest.mark.parametrize(
    "options",
    [
        {"force_noise": 8.0},
        {"input_noise": (2e-5, 2e-2)},
        {"per_record": ["rebound_rate"]},
        {"solver": optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)},
    ],
    ids=lambda options: next(iter(options)),
)
def test_every_option_of_a_single_fit_is_one_of_many(clicks, options):
    some = {name: clicks[name] for name in ("0", "10")}
    many = fit_many(Bilinear, some, rig="gas", **options)
    single = fit(Bilinear, clicks["10"], rig="gas", starts=1, **options)
    paths = many.parameters
    assert paths == ("law.rebound_rate", "law.compression_rate", "rig.gas_force")
    for j, path in enumerate(paths):
        own = [i for i, e in enumerate(single.parameters) if e.name.partition("[")[0] == path]
        error = np.sqrt(np.mean(single.covariance[np.ix_(own, own)]))
        assert many.values[1, j] == pytest.approx(np.mean([single.parameters[i].value for i in own]), abs=0.02 * error)
        assert many.standard_errors[1, j] == pytest.approx(error, rel=0.01)
        assert float(get(many.models[1], path)) == pytest.approx(float(get(single.model, path)), abs=0.02 * error)
    if many.bias is not None:
        np.testing.assert_allclose(many.bias[1], [e.bias for e in single.parameters], rtol=0.02)
        assert "noise of stroke and velocity biases law.rebound_rate by about -" in many.remarks[1]
        assert [column.name for column in many.table().columns].count("bias") == 3
        assert many.to_dict()["dampers"]["10"]["bias"]["law.rebound_rate"] == pytest.approx(many.bias[1, 0])
    assert (many.bias is None) == ("input_noise" not in options)
    if "force_noise" in options:
        shared = fit_many(Bilinear, some, rig="gas", shared=["*_rate", "gas_force"], **options)
        together = fit(Bilinear, [*clicks["0"], *clicks["10"]], rig="gas", bad_records="keep", starts=1, **options)
        errors = [e.standard_error for e in together.parameters]
        np.testing.assert_allclose(shared.standard_errors[0], errors, rtol=0.1)
    else:
        with pytest.raises(ValueError, match=f"`shared` must be left out with `{next(iter(options))}`"):
            fit_many(Bilinear, some, rig="gas", shared=["gas_force"], **options)


def test_a_bad_record_of_a_damper_is_named(clicks):
    bad = [dataclasses.replace(run, force=run.force * (1.3 if i else 1.0)) for i, run in enumerate(clicks["6"])]
    many = fit_many(Bilinear, clicks | {"6": bad}, rig="gas")
    assert many.unusual == ("6",) and f"mostly of {bad[1].name!r}" in many.remarks[3]


@pytest.mark.parametrize(
    "options",
    [{"loss": "student_t"}, {"priors": {"rebound_rate": (2400.0, 2.0)}}, {"starts": 2}],
    ids=["loss", "priors", "starts"],
)
def test_everything_shared_is_the_fit_of_all_records_together(options):
    dampers = {name: records(Bilinear(2400.0, 1200.0), seed) for seed, name in enumerate("ABC")}
    if "loss" in options:
        dampers = {name: spiked(runs, 1) for name, runs in dampers.items()}
    every = [run for runs in dampers.values() for run in runs]
    single = fit(Bilinear, every, **options)
    many = fit_many(Bilinear, dampers, shared=["*_rate"], **options)
    assert many.converged
    for j, e in enumerate(single.parameters):
        np.testing.assert_allclose(many.values[:, j], e.value, atol=0.2 * e.standard_error)
        assert many.standard_errors[0, j] == pytest.approx(e.standard_error, rel=0.1)


def test_states_at_the_beginning_are_estimated_damper_by_damper():
    law = Lag(Bilinear(2000.0, 1200.0), 5e-3)
    dampers = {name: records(law, seed)[:1] for seed, name in enumerate("AB")}
    begun = Lag(Bilinear(1500.0, 1500.0), 2e-3)
    many = fit_many(begun, dampers, initial_state="estimated")
    single = fit(begun, dampers["B"], initial_state="estimated", starts=1)
    np.testing.assert_allclose(many.values[1], [single[name].value for name in many.parameters], rtol=1e-9)
    with pytest.raises(ValueError, match="`shared` must be left out with `initial_state`"):
        fit_many(begun, dampers, initial_state="estimated", shared=["lag_time"])


def test_one_damper_of_many_has_everything_that_a_single_fit_has(clicks):
    many = fit_many(Bilinear, clicks, rig="gas")
    single = many.fit("10", input_noise=(1e-5, 1e-3))
    np.testing.assert_allclose(many.values[5], [e.value for e in single.parameters], rtol=1e-3)
    assert single["rebound_rate"].bias is not None
    assert single.profile("rebound_rate").interval[0] < single["rebound_rate"].value

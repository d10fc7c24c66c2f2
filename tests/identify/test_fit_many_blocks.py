"""Fits of many dampers in blocks into a store: those of one call in memory, whatever interrupts, fails or is added."""

import dataclasses
import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import xarray

from jaxdamp._types import Number
from jaxdamp.bench import BenchRun, DamperRecords, SineTest, VirtualDyno
from jaxdamp.dampers import AbstractDamper, AbstractMemoryless, Bilinear
from jaxdamp.identify import Status, control_charts, fit_many, many, many_blocks
from jaxdamp.identify.many_blocks import DamperFits
from jaxdamp.parameters import parameter, positive


START = Bilinear(1500.0, 1500.0)
TEST = SineTest(0.02, 1.0)
TORN = 5


def made(i: int) -> tuple[BenchRun, ...]:
    """Records of a damper of a line; those of one are torn."""
    if i == TORN:
        raise ValueError(f"damper{i}.csv, line 3: no number")
    law = Bilinear(2000.0 + 10.0 * (i % 7), 1200.0)
    return tuple(VirtualDyno(law, force_noise=4.0, sampling_rate=100.0, seed=i).run(TEST))


def changed(runs: tuple[BenchRun, ...], **fields: Any) -> tuple[BenchRun, ...]:
    """Records with other fields."""
    return tuple(dataclasses.replace(run, **fields) for run in runs)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(many_blocks, "BLOCK", 8)


@pytest.fixture
def read(monkeypatch):
    """The numbers of the dampers whose blocks are computed."""
    names, compute = [], DamperFits.compute

    def counted(work, indices):
        names.extend(work._names[row] for row in indices if row in work._names)
        return compute(work, indices)

    monkeypatch.setattr(DamperFits, "compute", counted)
    return names


def test_fits_in_a_store_are_those_in_memory_and_a_torn_file_is_named(tmp_path, read):
    dampers = DamperRecords(made, range(20), [f"No. {i}" for i in range(20)])
    with pytest.warns(UserWarning, match=r"1 of 20 dampers were left out: No\. 5\."):
        line = fit_many(START, dampers, file=tmp_path / "line.zarr")
    others = {name: dampers[name] for name in dampers if name != "No. 5"}
    expected = fit_many(START, others)
    fitted = np.array([name in others for name in line.names])
    for name in ("values", "standard_errors", "fit_percent", "rmse", "steps", "drift", "share_left_out"):
        np.testing.assert_allclose(getattr(line, name)[fitted], getattr(expected, name), rtol=1e-8, atol=1e-12)
    assert line.status[5] is Status.LEFT_OUT and not line.converged
    assert line.remarks[5] == "it was left out: damper5.csv, line 3: no number" and line.unusual == ("No. 5",)
    assert repr(line["No. 6"]) == repr(Bilinear(*line.values[6])) and line["No. 6"].fitted_to is not None
    assert line.table().rows[5][1:-1] == (None,) * 6 and line.to_dict()["dampers"]["No. 5"]["fit"]["value"] is None
    assert [len(errors) for errors in line.record_rmse] == [1] * 5 + [0] + [1] * 14
    with pytest.raises(ValueError, match="name a damper that was fitted"):
        _ = line["No. 5"]
    lazy = xarray.open_zarr(tmp_path / "line.zarr", consolidated=False)
    np.testing.assert_array_equal(lazy["values"][:20], line.values)
    assert len(pickle.loads(pickle.dumps(line)).records[6]) == 1
    assert len(line.fit("No. 6").minima) == len(expected.fit("No. 6").minima)
    read.clear()
    with pytest.warns(UserWarning, match="left out"):
        again = fit_many(START, dampers, file=tmp_path / "line.zarr")
    np.testing.assert_array_equal(again.values, line.values)
    assert not read


def test_only_new_and_changed_dampers_are_fitted(tmp_path, read):
    file, records = tmp_path / "line.zarr", {str(i): made(i) for i in range(5)}
    first = fit_many(Bilinear, records, file=file)
    assert read == list("01234")
    read.clear()
    changed = {**records, "3": made(4), "9": made(9)}
    del changed["1"]  # the others stay what they are
    line = fit_many(Bilinear, changed, file=file)
    assert read == ["3", "9"] and line.names == ("0", "2", "3", "4", "9")
    np.testing.assert_array_equal(line.values[:2], first.values[[0, 2]])
    np.testing.assert_allclose(line.values[2], first.values[4], rtol=1e-6)
    assert np.array_equal(fit_many(Bilinear, records, file=file).values, first.values)


def test_what_a_record_states_beside_its_channels_changes_it(tmp_path, read):
    file, runs = tmp_path / "line.zarr", made(0)
    moving = {"command_channel": np.linspace(0.0, 1.0, len(runs[0])), "command_unit": "A"}
    ways: list[dict[str, Any]] = [
        {},
        {"settings": {"clicks": 3}},
        {"stroke_is_integrated": True},
        moving,
        {**moving, "command_unit": "V"},
    ]
    for way in ways:
        read.clear()
        fit_many(START, {"0": runs, "1": changed(made(1), **way)}, file=file)
        assert read == (["0", "1"] if not way else ["1"])


def test_a_damper_that_states_what_the_first_does_not_is_left_out_as_memory_refuses_it(tmp_path):
    stated = changed(made(0), settings={"compression_rate": "1200 N s/m"})
    for first, other in ((stated, made(1)), (made(1), stated)):
        dampers = {"a": first, "b": other, "c": first}
        with pytest.raises(ValueError, match="must all state their compression_rate"):
            fit_many(START, dampers)
        with pytest.warns(UserWarning, match="1 of 3 dampers were left out: b"):
            line = fit_many(START, dampers, file=tmp_path / f"{len(first[0].settings)}.zarr")
        lacking = ", but is without one: " + ("20mm_1Hz. Fit" if first is stated else "20mm_1Hz of 'a', with which")
        assert "`runs` must all state their compression_rate" in line.reasons[1] and lacking in line.reasons[1]


def test_another_damper_may_be_the_first_where_the_start_is_a_law(tmp_path, read):
    file, how = tmp_path / "line.zarr", dict[str, Any](rig="offset")
    lines = [{str(i): changed(made(i), settings={"compression_rate": f"{1200 + i} N s/m"}) for i in (1, 2)}]
    lines.append({"0": changed(made(0), settings={"compression_rate": "1190 N s/m"})} | lines[0])
    for line in lines:
        fit_many(START, line, file=file, **how)
    assert read == ["1", "2", "0"]
    with pytest.raises(ValueError, match="start is Bilinear"):
        fit_many(Bilinear(1500.0, 1600.0), {"a": made(0)}, file=tmp_path / "line.zarr", **how)


def test_the_row_of_other_records_is_not_filled_by_those_of_the_call(tmp_path, monkeypatch):
    file, old = tmp_path / "line.zarr", {str(i): made(i) for i in range(8, 20)}
    stopping = _Interrupting(17, many_blocks.fitted_records)
    monkeypatch.setattr(many_blocks, "fitted_records", stopping)
    with pytest.raises(KeyboardInterrupt):
        fit_many(START, old, file=file)
    stopping.at = -1
    new = fit_many(START, {**old, "18": made(20)}, file=file)
    again, expected = fit_many(START, old, file=file), fit_many(START, old)
    np.testing.assert_allclose(again.values, expected.values, rtol=1e-8)
    assert abs(new.values[10, 0] - again.values[10, 0]) > 10.0
    assert not any(again.reasons) and not any(new.reasons)


def test_what_a_file_system_says_is_tried_again(tmp_path):
    away = {"2"}

    def read(i: int) -> tuple[BenchRun, ...]:
        if str(i) in away:
            raise PermissionError("the share is away")
        return made(i)

    dampers = DamperRecords(read, range(4))
    with pytest.warns(UserWarning, match="1 of 4 dampers were left out: 2"):
        line = fit_many(START, dampers, file=tmp_path / "line.zarr")
    assert line.reasons[2] == "the share is away The next call tries it again."
    for _ in range(3):
        with pytest.warns(UserWarning, match="1 of 4 dampers were left out: 2"):
            fit_many(START, dampers, file=tmp_path / "line.zarr")
    assert xarray.open_zarr(tmp_path / "line.zarr", consolidated=False).sizes["damper"] == 16  # a block for another try
    away.clear()
    assert fit_many(START, dampers, file=tmp_path / "line.zarr").converged


def own_law(factor: float) -> AbstractDamper:
    """A law of one's own whose code is edited between two calls."""

    class Mine(AbstractMemoryless):
        rate: Number = parameter("N s/m", "damping coefficient", positive)

        def force_velocity(self, v):
            return factor * self.rate * v

    return Mine(1500.0)


def test_another_code_of_a_law_of_ones_own_is_other_work(tmp_path):
    dampers = DamperRecords(made, range(3))
    first = fit_many(own_law(1.0), dampers, file=tmp_path / "line.zarr")
    np.testing.assert_array_equal(fit_many(own_law(1.0), dampers, file=tmp_path / "line.zarr").values, first.values)
    with pytest.raises(ValueError, match=r"other work: code is \w+ there, \w+ now"):
        fit_many(own_law(2.0), dampers, file=tmp_path / "line.zarr")


def test_records_left_out_are_said_and_are_those_of_no_fit(tmp_path):
    tests = [TEST, SineTest(0.01, 2.0)]
    law = Bilinear(2000.0, 1200.0)
    good, bad = (list(VirtualDyno(law, force_noise=4.0, force_limit=f).run(tests)) for f in (None, 120.0))
    dampers = {"a": [bad[0], good[1]], "b": good}
    memory = fit_many(START, dampers, bad_records="leave_out")
    for _ in range(2):  # the second is read from the store
        line = fit_many(START, dampers, file=tmp_path / "line.zarr", bad_records="leave_out")
        assert line.remarks == memory.remarks and line.converged
        assert line.remarks == (f"it was fitted without {bad[0].name!r}: records with an error", "")
        assert [len(errors) for errors in line.record_rmse] == [1, 2]
        assert [run.name for run in line.records[0]] == [good[1].name]
        assert line.fit("a").rmse == pytest.approx(line.rmse[0], rel=0.05)


def test_a_store_without_a_fit_is_described(tmp_path):
    line = fit_many(START, DamperRecords(made, range(3)), file=tmp_path / "line.zarr", cluster="2/2")
    words = "Bilinear: none of 3 dampers was fitted: its block is not done yet"
    assert line.summary == words and repr(line).startswith(words)
    assert json.loads(json.dumps(line.to_dict(), allow_nan=False))["dampers"]["0"]["status"] == "left_out"
    settled = dataclasses.replace(line, settings=(0.0, 1.0, 2.0))
    with pytest.raises(
        ValueError, match=r"`setting` must lie between dampers that were fitted, and none was, .*its block"
    ):
        settled.law_at(0.5)
    assert settled.unusual == ("0", "1", "2") and len(settled.table().rows) == 3
    with pytest.raises(ValueError, match=r"`dampers` must hold a number .*, but is Bilinear: none of 3 dampers"):
        control_charts(line, 3)


def test_an_interrupted_fit_goes_on_and_parts_share_a_store(tmp_path, read, monkeypatch):
    file, dampers = tmp_path / "line.zarr", DamperRecords(made, range(8, 28))
    stopping = _Interrupting(17, many_blocks.fitted_records)
    monkeypatch.setattr(many_blocks, "fitted_records", stopping)
    with pytest.raises(KeyboardInterrupt):
        fit_many(START, dampers, file=file)
    stopping.at = -1
    read.clear()
    line = fit_many(START, dampers, file=file, cluster="2/3")
    assert read == [str(i) for i in range(16, 24)]
    assert line.reasons[-1] == "its block is not done yet" and line.status[-1] is Status.LEFT_OUT
    told = []
    with ThreadPoolExecutor(2) as pool:
        line = fit_many(START, dampers, file=file, cluster=pool, progress=lambda *done: told.append(done))
    assert line.converged and told == [(24, 24)]
    np.testing.assert_array_equal(line.values, fit_many(START, dampers, file=tmp_path / "other.zarr").values)


class _Interrupting:
    """Stops where the records of a damper are looked at."""

    def __init__(self, at, function):
        self.at, self.function = at, function

    def __call__(self, name, runs, options):
        if name == str(self.at):
            raise KeyboardInterrupt
        return self.function(name, runs, options)


def test_a_damper_whose_fit_raises_is_left_out_alone(tmp_path, monkeypatch):
    together = many.fitted_together

    def raising(begin, dampers, options):
        if "2" in dampers:
            raise FloatingPointError("not finite")
        return together(begin, dampers, options)

    monkeypatch.setattr(many, "fitted_together", raising)
    with pytest.warns(UserWarning, match="1 of 5 dampers were left out: 2"):
        result = fit_many(START, DamperRecords(made, range(5)), file=tmp_path / "line.zarr")
    assert result.reasons == ("", "", "FloatingPointError: not finite", "", "")
    assert np.all(np.isfinite(result.values).sum(axis=1) == [2, 2, 0, 2, 2])


def test_what_a_store_does_not_suit_is_refused(tmp_path):
    file, dampers = tmp_path / "line.zarr", DamperRecords(made, range(3))
    fit_many(START, dampers, file=file)
    cases: list[tuple[Bilinear, dict[str, Any], str]] = [
        (Bilinear(1600.0, 1500.0), {}, r"other work: start is Bilinear \(\w+\) there"),
        (START, {"loss": "soft_l1"}, "loss is squares there, soft_l1 now"),
        (START, {"rig": "gas"}, "parameters is rebound_rate, compression_rate there"),
        (START, {"shared": ["rebound_rate"]}, "`shared` must be left out with `file`"),
        (START, {"settings": [1.0]}, "one number for each of 3 dampers"),
    ]
    for law, options, message in cases:
        with pytest.raises(ValueError, match=message):
            fit_many(law, dampers, file=file, **options)
    with pytest.raises(ValueError, match=r"`file` must end in '\.zarr'"):
        fit_many(START, dampers, cluster="1/2")
    with pytest.raises(ValueError, match=r"lie in a folder that exists"):
        fit_many(START, dampers, file=tmp_path / "none" / "line.zarr")
    with pytest.raises(ValueError, match=r"one whose records can be read, but is 1 dampers without .*line 3"):
        fit_many(START, DamperRecords(made, [TORN]), file=tmp_path / "torn.zarr")

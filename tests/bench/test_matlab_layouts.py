"""How MATLAB users store channels: with units, scales and names beside them, in arrays and cells of structures."""

import numpy as np
import pytest
import scipy.io

from jaxdamp.bench import read


T = np.arange(300) / 300
X = np.round(20 * np.sin(6 * np.pi * T), 3)
F = np.round(800 * np.cos(6 * np.pi * T) + 5.0, 3)
CHANNELS = {"t": (T, "s"), "x": (X, "mm"), "F": (F, "N")}


def saved(tmp_path, **variables):
    scipy.io.savemat(tmp_path / "a.mat", variables)
    return tmp_path / "a.mat"


def structures(**fields):
    """An array of structures."""
    array = np.zeros(len(next(iter(fields.values()))), dtype=[(name, "O") for name in fields])
    for name, values in fields.items():
        for index, value in enumerate(values):
            array[index][name] = value
    return array


def cells(*values):
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


def assert_is_the_record(run):
    np.testing.assert_allclose(run.time, T, atol=1e-12)
    np.testing.assert_allclose(run.stroke, 1e-3 * X, atol=1e-9)
    np.testing.assert_allclose(run.force, F, atol=1e-6)


def with_counts(values, **fields):
    channels = {name: {"data": samples, "unit": unit} for name, (samples, unit) in CHANNELS.items()}
    channels["F"] = {"data": values, "unit": "N", **fields}
    return {"rec": channels}


@pytest.mark.parametrize("scale", ["scale", "factor", "Gain", "slope"])
def test_counts_are_scaled_and_a_note_says_so(tmp_path, scale):
    counts = np.round((F - 5.0) / 0.05).astype(np.int16)
    run = read(saved(tmp_path, **with_counts(counts, **{scale: 0.05, "offset": 5.0})))[0]
    np.testing.assert_allclose(run.force, 0.05 * counts + 5.0)
    assert f"channel 'F' is its counts · 0.05 +5, by {scale}, offset beside them" in run.notes


def test_a_scale_beside_decimals_is_not_applied_and_several_are_refused(tmp_path):
    run = read(saved(tmp_path, **with_counts(F, scale=0.05)))[0]
    assert_is_the_record(run)
    assert any("channel 'F' as it stands: scale not applied" in note for note in run.notes)
    with pytest.raises(ValueError, match=r"a\.mat, channel 'F': which of scale, gain scales it is not clear"):
        read(saved(tmp_path, **with_counts(F.astype(np.int16), scale=0.05, gain=2.0)))
    with pytest.raises(ValueError, match=r"which of scale \(2 numbers\) scales it is not clear"):
        read(saved(tmp_path, **with_counts(F.astype(np.int16), scale=[0.05, 1.0])))


@pytest.mark.parametrize("key", ["units", "Units"])
def test_units_stand_around_the_runs_and_may_be_empty(tmp_path, key):
    units = {name: unit for name, (_, unit) in CHANNELS.items()} | {"counter": ""}
    fields = {name: values for name, (values, _) in CHANNELS.items()} | {"counter": np.arange(300)}
    runs = read(saved(tmp_path, **{key: units, "cold": fields, "warm": fields}))
    assert runs.names == ("a/cold", "a/warm")
    assert_is_the_record(runs[1])


@pytest.mark.parametrize("form", ["array", "cell"])
def test_an_array_of_channels(tmp_path, form):
    values, units = [v for v, _ in CHANNELS.values()], [u for _, u in CHANNELS.values()]
    channels = structures(name=[*CHANNELS], unit=units, data=values)
    if form == "cell":
        channels = cells(*({"name": n, "Unit": u, "data": v} for n, u, v in zip(CHANNELS, units, values, strict=True)))
    assert_is_the_record(read(saved(tmp_path, ch=channels))[0])


def test_what_simulink_writes(tmp_path):
    signals = structures(values=[X[:, None], F[:, None]], dimensions=[1, 1], label=["x [mm]", "F [N]"])
    path = saved(tmp_path, S={"time": T, "signals": signals, "blockName": "model/Scope"})
    assert_is_the_record(read(path, units={"time": "s"})[0])
    both = {"values": np.stack([X, F], axis=1), "dimensions": 2, "label": ""}
    path = saved(tmp_path, S={"time": T, "signals": both, "blockName": ""})
    where = {"stroke": "signals[0]", "force": "signals[1]"}
    assert_is_the_record(read(path, columns=where, units={"time": "s", "stroke": "mm", "force": "N"})[0])


@pytest.mark.parametrize("names", ["names", "Labels"])
def test_a_matrix_with_names_and_units_beside_it(tmp_path, names):
    data = np.stack([v for v, _ in CHANNELS.values()], axis=1)
    fields = {"data": data, names: cells(*CHANNELS), "units": cells(*(u for _, u in CHANNELS.values()))}
    run = read(saved(tmp_path, **fields))[0]
    assert_is_the_record(run)
    assert "left out" not in run.describe()
    assert_is_the_record(read(saved(tmp_path, rec=fields))[0])

"""Files of each format, written by its own library and read back equal."""

import datetime
import sys

import numpy as np
import pytest

from jaxdamp.bench import READERS, RawColumn, RawTable, read


T = np.round(np.arange(300) / 300, 9)  # a workbook stores 16 digits
X = np.round(20 * np.sin(6 * np.pi * T), 9)
F = np.round(800 * np.cos(6 * np.pi * T) + 5.0, 9)


def same(run, time=T):
    np.testing.assert_array_equal(run.time, time)
    np.testing.assert_array_equal(run.stroke, X * 1e-3)
    np.testing.assert_array_equal(run.force, F)


def workbook(path, **sheets):
    import openpyxl

    book = openpyxl.Workbook()
    for index, (name, lines) in enumerate(sheets.items()):
        sheet = book.create_sheet(name, index)
        for row in lines:
            sheet.append(row)
    del book["Sheet"]
    book.save(path)
    return path


def rows(header=("t [s]", "x [mm]", "F [N]"), time=None):
    return [header, *zip(T.tolist() if time is None else time, X.tolist(), F.tolist(), strict=True)]


def test_xlsx(tmp_path):
    info = [("Operator", "A. B."), ("Date", datetime.date(2026, 3, 1))]
    below = [(), ("mean", None, 5.0)]
    cold = [("Bench 7", None, 12), (), *rows(), *below]
    warm = [("time", "stroke", "force"), ("s", "mm", "N"), *rows()[1:]]
    runs = read(workbook(tmp_path / "set.xlsx", info=info, cold=cold, warm=warm))
    assert runs.names == ("set/cold", "set/warm")
    same(runs[0])
    same(runs[1])
    assert runs[1].source == str(tmp_path / "set.xlsx")
    assert any("1 row of another form behind the numbers left out" in note for note in runs[0].notes)
    start = datetime.datetime(2026, 3, 1, 9, 30)
    stamps = [start + datetime.timedelta(milliseconds=5 * i) for i in range(300)]
    run = read(workbook(tmp_path / "stamped.xlsx", only=rows(("when", "x [mm]", "F [N]"), stamps)))[0]
    assert run.name == "stamped"
    np.testing.assert_allclose(run.time, np.arange(300) * 0.005, atol=1e-9)


def test_faults_in_a_workbook_name_sheet_row_and_column(tmp_path):
    faulty = rows()
    faulty[20] = (T[19], "off", 1.0)
    path = workbook(tmp_path / "a.xlsx", cold=rows(), warm=faulty)
    with pytest.raises(ValueError, match=r"a\.xlsx, record 'warm', line 21, column 'x \[mm\]': 'off' is not a number"):
        read(path)
    with pytest.raises(ValueError, match=r"no record"):
        read(workbook(tmp_path / "b.xlsx", info=[("a", "b")]))


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_mat(tmp_path, version):
    fields = {"x": X, "F": F, "t": T, "operator": "A. B.", "rate": 300.0}
    path = tmp_path / "a.mat"
    if version == "5":
        import scipy.io

        scipy.io.savemat(path, {"rec": {**fields, "units": {"x": "mm", "F": "N", "t": "s"}}})
    else:
        import h5py

        with h5py.File(path, "w", userblock_size=512) as file:
            group = file.create_group("rec")
            for name in ("x", "F", "t"):
                inner = group.create_group(name)
                inner["data"] = fields[name][None]
                unit = inner.create_dataset(
                    "unit", data=np.frombuffer({"x": b"mm", "F": b"N", "t": b"s"}[name], "u1").astype("u2")[:, None]
                )
                unit.attrs["MATLAB_class"] = np.bytes_("char")
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    same(read(path)[0])


def test_objects_of_matlab_are_refused_by_name(tmp_path):
    import h5py

    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as content:
        for name in ("force", "stroke"):
            held = content.create_dataset(name, data=np.array([[3707764736, 2, 1, 1, 1, 1]], np.uint32))
            held.attrs["MATLAB_class"] = np.bytes_("timeseries")
    with path.open("rb+") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    with pytest.raises(ValueError, match=r"force \(timeseries\), stroke \(timeseries\): .* `t = ts.Time"):
        read(path)


def test_records_of_mat_7_3_come_by_name(tmp_path, monkeypatch):
    """The library lists the fields of HDF5 in another order in each process."""
    import pymatreader

    record = {"t_s": T, "x_mm": X, "F_N": F}
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    monkeypatch.setattr("jaxdamp.bench.matlab._refuse_objects", lambda _: None)
    monkeypatch.setattr(pymatreader, "read_mat", lambda _: {"warm": record, "cold": record, "hot": record})
    assert read(path).names == ("a/cold", "a/hot", "a/warm")


def test_arrays_of_structures_and_matrices_in_mat(tmp_path):
    import scipy.io

    element = np.zeros(2, dtype=[("t_s", "O"), ("x_mm", "O"), ("F_N", "O")])
    for index in range(2):
        element[index] = (T, X, F)
    scipy.io.savemat(tmp_path / "a.mat", {"runs": element, "note": "ok"})
    runs = read(tmp_path / "a.mat")
    assert runs.names == ("a/runs[0]", "a/runs[1]")
    same(runs[1])
    scipy.io.savemat(tmp_path / "b.mat", {"data": np.stack([T, X, F], axis=1)})
    where = {"time": "data[0]", "stroke": "data[1]", "force": "data[2]"}
    with pytest.raises(ValueError, match=r'no names: pass .*columns=\{"time": 0, "stroke": 1, "force": 2\}, units='):
        read(tmp_path / "b.mat")
    same(read(tmp_path / "b.mat", columns=where, units={"time": "s", "stroke": "mm", "force": "N"})[0])


def test_tdms(tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    def channel(group, name, values, **properties):
        return ChannelObject(group, name, values, properties=properties)

    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [
                channel("stamped", "t", T, unit_string="s"),
                channel("stamped", "x", X, unit_string="mm"),
                channel("stamped", "F", F, unit_string="N"),
                channel("stamped", "events", np.arange(3.0)),
                channel("waves", "x", X, unit_string="mm", wf_increment=1 / 300, wf_start_offset=0.0),
                channel("waves", "F", F, unit_string="N", wf_increment=1 / 300, wf_start_offset=0.0),
            ]
        )
    runs = read(tmp_path / "a.tdms")
    assert runs.names == ("a/stamped", "a/waves")
    same(runs[0])
    np.testing.assert_allclose(runs[1].time, T, atol=1e-12)
    np.testing.assert_array_equal(runs[1].force, F)
    assert any("do not have the 300 samples or the clock of the others: events (3)" in note for note in runs[0].notes)


def test_mf4(tmp_path):
    from asammdf import MDF, Signal

    with MDF() as file:
        file.append([Signal(X, T, unit="mm", name="x")], comment="motion")
        file.append([Signal(F, T, unit="N", name="F")], comment="load")
        file.append([Signal(T[::10] + 40, T[::10], unit="degC", name="oil temperature")], comment="slow")
        file.save(tmp_path / "a.mf4")
    run = read(tmp_path / "a.mf4")[0]
    same(run)
    assert any("'slow' of the file left out: neither stroke nor force" in note for note in run.notes)


def test_mf4_groups_on_different_clocks(tmp_path):
    from asammdf import MDF, Signal

    def written(**groups):
        with MDF() as file:
            for name, signal in groups.items():
                file.append([signal], comment=name)
            file.save(tmp_path / "a.mf4", overwrite=True)
        return tmp_path / "a.mf4"

    slow, fast = np.arange(200) / 100, 0.1 + np.arange(600) / 400
    stroke = Signal(20 * np.sin(9 * slow), slow, unit="mm", name="x")
    force = Signal(540 * np.cos(9 * fast), fast, unit="N", name="F")
    (run,) = read(written(motion=stroke, load=force))
    np.testing.assert_allclose(run.time, fast)
    np.testing.assert_array_equal(run.force, 540 * np.cos(9 * fast))
    np.testing.assert_allclose(run.stroke, 0.02 * np.sin(9 * fast), atol=1e-6)
    assert any("the stroke in 'motion' and the force in 'load', on different clocks" in note for note in run.notes)
    with pytest.raises(ValueError, match=r"is not clear: the stroke in 'motion', 'two'"):
        read(written(motion=stroke, two=Signal(stroke.samples, slow + 0.001, unit="mm", name="x"), load=force))
    late = Signal(force.samples, fast + 5.0, unit="N", name="F")
    with pytest.raises(ValueError, match=r"hardly overlap\. Export the channels of a record on one clock"):
        read(written(motion=stroke, load=late))
    gap = Signal(np.delete(force.samples, slice(100, 120)), np.delete(fast, slice(100, 120)), unit="N", name="F")
    with pytest.raises(ValueError, match="'load': the clock has gaps"):
        read(written(motion=stroke, load=gap))


def test_parquet(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    when = np.datetime64("2026-03-01T09:30:00") + (np.arange(300) * 5000).astype("timedelta64[us]")
    field = pa.field("F", pa.float64(), metadata={"unit": "N"})
    schema = pa.schema([("time", pa.timestamp("us")), ("x_mm", pa.float64()), field, ("state", pa.string())])
    pq.write_table(pa.table([when, X, F, ["ok"] * 300], schema=schema), tmp_path / "a.parquet")
    same(read(tmp_path / "a.parquet")[0], np.arange(300) * 5 / 1000)


def test_parquet_decimals_are_numbers_and_samples_count_from_one(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    force = pa.array(F).cast(pa.decimal128(20, 9))
    pq.write_table(pa.table({"t_s": T, "x_mm": X, "F_N": force}), tmp_path / "a.parquet")
    np.testing.assert_allclose(read(tmp_path / "a.parquet")[0].force, F)
    pq.write_table(pa.table({"t_s": T, "x_mm": X, "F_N": np.where(T == T[0], np.nan, F)}), tmp_path / "a.parquet")
    with pytest.raises(ValueError, match=r"a\.parquet, sample 1: the force"):
        read(tmp_path / "a.parquet")


@pytest.mark.parametrize("suffix", [".xlsx", ".mat", ".tdms", ".mf4", ".parquet"])
def test_damaged_files_are_named(tmp_path, suffix):
    path = tmp_path / f"run{suffix}"
    path.write_bytes(b"MATLAB nothing of this is a record \0\1\2" * 20)
    with pytest.raises(ValueError, match=rf"run\{suffix} cannot be read as \{suffix} .*export it again, or as CSV"):
        read(path)
    path.write_bytes(b"")
    with pytest.raises(ValueError, match="is empty"):
        read(path)
    with pytest.raises(
        ValueError, match=r"is not a text file; it looks like a MATLAB file \(\.mat\): give it that ending"
    ):
        (tmp_path / "run.csv").write_bytes(b"MATLAB 5.0 \0\1")
        read(tmp_path / "run.csv")


@pytest.mark.parametrize(
    ("suffix", "library"),
    [(".xlsx", "openpyxl"), (".mat", "pymatreader"), (".tdms", "nptdms"), (".mf4", "asammdf"), (".parquet", "pyarrow")],
)
def test_a_missing_library_names_the_extra(tmp_path, monkeypatch, suffix, library):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / f"run{suffix}").write_bytes(b"something")
    with pytest.raises(ImportError, match=rf"need the library '{library}'.*pip install 'jaxdamp\[io\]'"):
        read(tmp_path / f"run{suffix}")


def test_a_folder_of_mixed_files(tmp_path, write):
    write("a.csv")
    workbook(tmp_path / "a.xlsx", only=rows())
    workbook(tmp_path / "b.xlsx", only=rows())
    assert read(tmp_path).names == ("a (csv)", "a (xlsx)", "b")


def test_a_reader_of_ones_own(tmp_path):
    def read_raw(file):
        data = np.fromfile(file).reshape(-1, 3)
        names = (("t", "s"), ("x", "mm"), ("F", "N"))
        return [RawTable(file, tuple(RawColumn(n, c, u) for (n, u), c in zip(names, data.T, strict=True)))]

    np.stack([T, X, F], axis=1).tofile(tmp_path / "a.RAW")
    same(read(tmp_path, readers={".raw": read_raw})[0])
    (tmp_path / "a.RAW").rename(tmp_path / "a.dat")
    same(read(tmp_path, readers={".dat": read_raw})[0])
    assert ".raw" not in READERS
    with pytest.raises(ValueError, match="in lower case"):
        read(tmp_path, readers={"raw": read_raw})
    with pytest.raises(ValueError, match=r"same number of samples.*'t': 2"):
        RawTable(tmp_path, (RawColumn("t", [1, 2]), RawColumn("x", [1])))
    with pytest.raises(ValueError, match="one number a sample"):
        RawColumn("x", np.zeros((2, 2)))

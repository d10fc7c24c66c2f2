import numpy as np
import pytest

from jaxdamp.bench import BenchRun, read
from jaxdamp.bench.settings import settings_by_name


MANIFEST = """
test = "QC/T 545"
sign = "compression-positive"
command = "current"
files = ["*A.csv"]

[columns]
stroke = "hub"
velocity = false

[units]
stroke = "mm"

[gains]
force = "1 N/V"

[settings."*_{current}A"]
[settings."hot_*"]
temperature = 80
oil = "B"
"""


@pytest.fixture
def folder(write, tmp_path):
    for name in ("hot_0.5A.csv", "cold_1A.csv", "other.csv"):
        write(name, header="t_s,hub,F_V,v_mm_s", extra=[np.ones(600)])
    return tmp_path


def test_a_manifest_says_how_to_read_a_folder(folder):
    (folder / "jaxdamp.toml").write_text(MANIFEST)
    runs = read(folder)
    assert runs.names == ("cold_1A", "hot_0.5A")
    assert [run.command for run in runs] == [1.0, 0.5]
    assert runs["hot_0.5A"].settings == {"test": "QC/T 545", "current": 0.5, "temperature": 80, "oil": "B"}
    assert "positive stroke is compression, as given" in " ".join(runs[0].notes)
    assert runs[0].notes[-1] == f"read as the manifest {folder / 'jaxdamp.toml'} says"
    assert "temperature  80" in runs["hot_0.5A"].describe()
    with pytest.raises(ValueError, match="names no unit"):
        read(folder, manifest=False)


def test_a_named_manifest_and_what_wins(folder):
    (folder / "bench.toml").write_text(MANIFEST)
    turned = read(folder, manifest="bench.toml")
    plain = read(folder, manifest=folder / "bench.toml", sign="rebound-positive", gains={"force": "2 N/V"}, command=7.0)
    np.testing.assert_array_equal(plain[0].stroke, -turned[0].stroke)
    np.testing.assert_array_equal(plain[0].force, -2 * turned[0].force)
    assert plain[0].command == 7.0
    one = read(folder / "cold_1A.csv", manifest=folder / "bench.toml", settings="*_{amperes}A", command="amperes")
    assert one[0].settings == {"test": "QC/T 545", "amperes": 1.0}
    with pytest.raises(FileNotFoundError, match=r"no manifest 'none.toml', nor in"):
        read(folder, manifest="none.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sing = 'rebound-positive'", "unknown key 'sing'.*Did you mean 'sign'"),
        ("sign = 3", "sign must be a text, but is the number 3"),
        ("columns = 'x'", "columns must be a table, but is the text 'x'"),
        ("[columns", "is no valid TOML"),
        ("[units]\nstrok = 'mm'", "Did you mean 'stroke'"),
        ("command = 'current'", r"a setting that is a number.*'current'.*Its settings: none"),
        ("[settings.'*']\nTemprature = '80 degC'", "spelt right, but is 'Temprature'. Did you mean 'temperature'"),
        ("[settings.'*mm']", r"fit the records, but is '\*mm'\. It does not fit"),
    ],
)
def test_wrong_manifests(folder, text, message):
    (folder / "jaxdamp.toml").write_text(f"{text}\n")
    with pytest.raises(ValueError, match=message):
        read(
            folder,
            **(
                {}
                if "unit" in text
                else {
                    "units": {"stroke": "mm"},
                    "gains": {"force": "1 N/V"},
                    "columns": {"stroke": "hub", "velocity": None},
                }
            ),
        )


def test_settings_from_names():
    names = ["5mm_3.0Hz_0.5A", "25mm_0.25Hz_1A"]
    found = settings_by_name(names, "{amplitude}mm_{frequency}Hz_{current}A")
    assert found[names[1]] == {"amplitude": 25.0, "frequency": 0.25, "current": 1.0}
    assert settings_by_name(["front_3"], "{axle}_{clicks}")["front_3"] == {"axle": "front", "clicks": 3.0}
    with pytest.raises(ValueError, match=r"one value, as current of '5mm_3.0Hz_0.5A', but is 0.5 and 2"):
        settings_by_name(names, {"*_{current}A": {}, "5mm*": {"current": 2}})
    assert settings_by_name(names, {"5mm*": {"oil_temperature": 3.0, "temper": 1.0}})[names[0]]["temper"] == 1.0
    with pytest.raises(ValueError, match="It does not fit 25mm"):
        settings_by_name(names, "5mm_*_{current}A")
    with pytest.raises(ValueError, match="a word of its own"):
        settings_by_name(names, "{a}_{a}")


def test_settings_are_written_and_read_back(tmp_path):
    time = np.arange(600) / 300
    wave = np.sin(6 * np.pi * time)
    run = BenchRun.from_arrays("a", time, 0.01 * wave, 100 * np.cos(6 * np.pi * time), command=2.0)
    from dataclasses import replace

    run = replace(run, settings={"clicks": 12, "oil": "B"})
    assert read(run.to_csv(tmp_path / "a.csv"))[0].settings == {"clicks": 12, "oil": "B"}


def test_measured_damper_by_current(data):
    runs = read(data / "mr_damper", settings="*_{current}A", command="current")
    assert [run.command for run in runs] == [float(run.name.split("_")[-1][:-1]) for run in runs]

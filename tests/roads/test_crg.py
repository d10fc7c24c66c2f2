import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from jaxdamp.roads import assess_roughness, read_crg


pytest.importorskip("pyopencrg", reason="OpenCRG files need pyopencrg: pip install 'jaxdamp[io]'")

U, V = 100.0 + 0.25 * np.arange(41), np.array([-1.5, -0.5, 0.5, 1.5])
INCH = 0.0254


def surface():
    return 0.01 * np.sin(0.7 * (U[:, None] - 100.0)) + 0.02 * V[None, :] ** 3


def write(path: Path, z: np.ndarray, channels: dict[str, np.ndarray] | None = None, modifiers: str = "") -> Path:
    """An OpenCRG file in the format KRBI, written without the package that reads it."""
    channels = channels or {}
    head = [
        "$ROAD_CRG",
        f"reference_line_start_u = {U[0]}",
        f"reference_line_end_u = {U[-1]}",
        f"reference_line_increment = {U[1] - U[0]}",
        f"long_section_v_right = {V[0]}",
        f"long_section_v_left = {V[-1]}",
        f"long_section_v_increment = {V[1] - V[0]}",
        *(["reference_line_start_phi = 0.3", "reference_line_end_phi = 0.3"] if "phi" in channels else []),
        "$",
        *(["$ROAD_CRG_MODS", modifiers, "$"] if modifiers else []),
        "$KD_DEFINITION",
        "#:KRBI",
        f"U:reference line u,m,{U[0]:.3f},{U[1] - U[0]:.3f}",
        *(f"D:reference line {name},{'rad' if name == 'phi' else 'm/m'}" for name in channels),
        *(f"D:long section {k + 1},m" for k in range(V.size)),
        "$",
        "$" * 72,
    ]
    rows = np.column_stack([*channels.values(), z]).astype(">f4").tobytes()
    path.write_bytes(("\n".join(head) + "\n").encode("ascii") + rows + b"\xff" * (-len(rows) % 80))
    return path


def test_lines_between_the_points_of_the_grid(tmp_path):
    path = write(tmp_path / "road.crg", surface())
    lateral = [1.5, 0.2, -0.5, -1.1]
    road = read_crg(path, speed=5.0, lateral=lateral)
    expected = np.array([np.interp(lateral, V, row) for row in surface()])
    np.testing.assert_allclose(road.samples, expected, atol=1e-8)  # single precision in the file
    assert road.wheels == 4 and road.grid == pytest.approx(0.05) and road.duration == pytest.approx(2.0)
    assert read_crg(path, speed=5.0).samples.shape == (41, 1)


@pytest.mark.parametrize("form", ["KDBI", "LRFI", "LDFI"])
def test_other_formats_of_the_standard(tmp_path, form):
    pyopencrg = pytest.importorskip("pyopencrg")
    pyopencrg.read(str(write(tmp_path / "road.crg", surface()))).save(str(tmp_path / "other.crg"), fmt=form)
    assert form.encode() in (tmp_path / "other.crg").read_bytes()
    road = read_crg(tmp_path / "other.crg", speed=5.0, lateral=[1.5, -0.5])
    np.testing.assert_allclose(road.samples, surface()[:, [3, 1]], atol=1e-7)  # LRFI writes ten characters


def test_part_of_the_road(tmp_path):
    path = write(tmp_path / "road.crg", surface())
    part = read_crg(path, speed=5.0, lateral=0.5, start=102.5, stop=105.0)
    np.testing.assert_allclose(part.samples[:, 0], surface()[10:21, 2], atol=1e-8)
    assert part.duration == pytest.approx(0.5)


def test_slope_banking_and_scales_count(tmp_path):
    # the first increment of a file has no slope or heading of its own
    slope, bank = np.full(41, 0.02), np.full(41, -0.03)
    path = write(tmp_path / "road.crg", surface(), {"slope": slope, "banking": bank}, "scale_z_grid = 2.0")
    samples = np.asarray(read_crg(path, speed=5.0, lateral=[0.5, -0.5]).samples)
    rise = samples[1:] - samples[:1]
    expected = 2.0 * (surface() - surface()[0])[1:, [2, 1]] + 0.02 * (U - U[0])[1:, None]
    np.testing.assert_allclose(rise, expected, atol=1e-7)
    across = samples[:, 0] - samples[:, 1]
    np.testing.assert_allclose(across, 2.0 * (surface()[:, 2] - surface()[:, 1]) - 0.03 * 1.0, atol=1e-8)


def test_a_curved_reference_line_changes_no_heights(tmp_path):
    heading = 0.3 + 0.02 * np.arange(41)
    path = write(tmp_path / "road.crg", surface(), {"phi": heading})
    path.write_bytes(path.read_bytes().replace(b"end_phi = 0.3", b"end_phi = 1.1"))
    np.testing.assert_allclose(read_crg(path, speed=5.0, lateral=-0.5).samples[:, 0], surface()[:, 1], atol=1e-8)


def test_gaps_are_not_filled(tmp_path):
    z = surface()
    z[5, 0] = z[7, 3] = np.nan
    path = write(tmp_path / "road.crg", z)
    np.testing.assert_allclose(read_crg(path, 5.0, lateral=0.5).samples[:, 0], z[:, 2], atol=1e-8)
    with pytest.raises(
        ValueError, match=r"`lateral` must run where.*v = -1 m in a gap.*u = 101.25 m on.*-0.5 and 0.5 m"
    ):
        read_crg(path, 5.0, lateral=[0.0, -1.0])
    assert read_crg(path, 5.0, lateral=-1.0, start=102.0).samples.shape == (33, 1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lateral": 2.0}, r"`lateral` must lie on the surface, from -1.5 to 1.5 m, but is \[2.0\].*left"),
        ({"lateral": []}, r"`lateral` must hold one number for each track"),
        ({"start": 50.0}, r"`start` must lie between 100 and 110 m, but is 50.0 m.*u of the file"),
        ({"start": 105.0, "stop": 103.0}, r"`stop` must lie behind `start`, but is 103.0 m, and start 105.0"),
        ({"speed": 0.0}, r"`speed` must be positive"),
    ],
)
def test_errors(tmp_path, options, message):
    path = write(tmp_path / "road.crg", surface())
    with pytest.raises(ValueError, match=message):
        read_crg(path, **{"speed": 5.0, **options})


def test_damaged_and_missing_files(tmp_path):
    path = write(tmp_path / "road.crg", surface())
    whole = path.read_bytes()
    path.write_bytes(whole[:-400])
    with pytest.warns(UserWarning, match="41 cross sections but the file has 20"):
        assert read_crg(path, speed=5.0).samples.shape == (20, 1)
    path.write_bytes(whole[:300])
    with pytest.raises(ValueError, match=r"`path` must name an OpenCRG file without errors"):
        read_crg(path, speed=5.0)
    with pytest.raises(FileNotFoundError, match=r"no file .*none\.crg"):
        read_crg(tmp_path / "none.crg", speed=5.0)


def test_without_the_package_the_remedy_is_told(tmp_path, monkeypatch):
    path = write(tmp_path / "road.crg", surface())
    monkeypatch.setitem(sys.modules, "pyopencrg", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'jaxdamp\[io\]'"):
        read_crg(path, speed=5.0)


# ---- measured roads


@pytest.mark.parametrize(("name", "stated", "found"), [("1in", 0.96944, 0.9573), ("3in", 2.3164, 2.3154)])
def test_ride_courses_have_the_stated_rms(data, name, stated, found):
    """The headers state the detrended RMS of the rough part; that of the 1 in course is 1.25 % less in the file."""
    path = data / "roads" / f"detrended_rms_course_{name}.crg"
    road = read_crg(path, speed=10.0, lateral=[0.9, -0.9], start=100.0, stop=404.8)
    z = np.asarray(road.samples)
    np.testing.assert_allclose(z[:, 0], z[:, 1], atol=1e-16)
    rms = np.std(signal.detrend(z[:, 0])) / INCH
    assert rms == pytest.approx(found, abs=1e-4)
    assert rms == pytest.approx(stated, rel=0.015)
    whole = np.asarray(read_crg(path, speed=10.0).samples[:, 0])
    rough = np.flatnonzero(np.abs(whole) > 1e-9) * 0.05
    assert whole.size == 10_096 and rough[0] == pytest.approx(100.0) and rough[-1] == pytest.approx(404.75)


def test_belgian_block_equals_the_bytes_of_the_file_and_is_plausible(data):
    path = data / "roads" / "belgian_block.crg"
    content = path.read_bytes()
    rows = np.frombuffer(content[content.rindex(b"$" * 72) + 73 :], ">f4", 1001 * 342).reshape(1001, 342)
    lateral = np.array([1.0, 0.5, 0.0, -0.5, -1.0])
    road = read_crg(path, speed=5.0, lateral=lateral)
    columns = 1 + np.rint((lateral + 1.7) / 0.01).astype(int)
    np.testing.assert_allclose(road.samples, rows[:, columns], atol=2e-7)  # v of the file is exact to 1e-16 m
    for column in range(lateral.size):
        z = np.asarray(road.samples[:, column])
        blocks = assess_roughness(z, 0.01)
        assert 0.012 < blocks.rms < 0.032  # 10 m, with a long swell of a few centimetres
        short = z - np.convolve(np.pad(z, 50, mode="edge"), np.ones(101) / 101, mode="valid")
        assert 0.008 < np.std(short) < 0.016  # stones
        assert 1.0 < np.max(np.abs(np.diff(z))) / 0.01 < 2.5  # steep edges between them
        assert set(blocks.band_classes) <= set("DEFGH")
    with pytest.raises(ValueError, match=r"`lateral` must run where the surface was measured.*gap of the scan"):
        read_crg(path, speed=5.0, lateral=-1.65)

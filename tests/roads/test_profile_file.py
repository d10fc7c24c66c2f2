import numpy as np
import pytest

from jaxdamp.roads import from_profile, read_profile


PLACE = 0.1 * np.arange(30)
HEIGHT = 0.01 * np.sin(PLACE)


def text(separator=",", head="", factor=1.0):
    rows = [separator.join(f"{value:.12g}" for value in (x, factor * z)) for x, z in zip(PLACE, HEIGHT, strict=True)]
    return head + "\n".join(rows) + "\n"


@pytest.mark.parametrize("separator", [",", ";", "\t", "  ", ", "])
@pytest.mark.parametrize("names", [True, False])
def test_separators_names_and_remarks(tmp_path, separator, names):
    head = "# measured on Monday\n% left lane\n\n" + (separator.join(["x", "z"]) + "\n" if names else "")
    (tmp_path / "road.txt").write_text(text(separator, head))
    road = read_profile(tmp_path / "road.txt", speed=5.0)
    np.testing.assert_allclose(road.samples, from_profile(PLACE, HEIGHT, speed=5.0).samples, atol=1e-14)
    assert road.grid == pytest.approx(0.02)


def test_units_and_columns_by_name(tmp_path):
    rows = np.column_stack([1e6 * HEIGHT, PLACE / 0.3048, 1e3 * HEIGHT])
    lines = ["right, station, left", *(", ".join(map(str, row)) for row in rows)]
    (tmp_path / "road.csv").write_text("\ufeff" + "\n".join(lines), encoding="utf-8")
    road = read_profile(
        tmp_path / "road.csv", 5.0, position="station", height=["left", 0], position_unit="ft", height_unit="mm"
    )
    np.testing.assert_allclose(road.samples, np.column_stack([HEIGHT, 1e3 * HEIGHT]), atol=1e-12)
    assert road.grid == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("head", "units"),
    [
        ("position [ft], height [in]", {}),
        ("position (feet),height (inch)", {"height_unit": "in"}),  # of the library's units and of others
        ("position[ft] height [in]", {}),
        ("station_ft;z_in", {"position_unit": "ft"}),
    ],
)
def test_the_header_names_the_units(tmp_path, head, units):
    separator = next((mark for mark in ";," if mark in head), " ")
    rows = [f"{x / 0.3048:.15g}{separator}{z / 0.0254:.15g}" for x, z in zip(PLACE, HEIGHT, strict=True)]
    (tmp_path / "road.csv").write_text("\n".join([head, *rows]))
    road = read_profile(tmp_path / "road.csv", 5.0, **units)
    np.testing.assert_allclose(road.samples[:, 0], HEIGHT, atol=1e-14)
    assert road.grid == pytest.approx(0.02)


def test_without_a_speed_positions_are_times(tmp_path):
    (tmp_path / "road.csv").write_text(text())
    assert read_profile(tmp_path / "road.csv").grid == pytest.approx(0.1)
    assert read_profile(tmp_path / "road.csv", position_unit="ms").grid == pytest.approx(1e-4)
    with pytest.raises(ValueError, match=r"`position_unit` must be one of 's', 'ms', but is 'm'"):
        read_profile(tmp_path / "road.csv", position_unit="m")
    (tmp_path / "road.csv").write_text(text(head="x [ms],z [m]\n"))
    assert read_profile(tmp_path / "road.csv").grid == pytest.approx(1e-4)
    with pytest.raises(
        ValueError, match=r"a unit of length in the header of its positions.*'x \[ms\]'.*in time are without it"
    ):
        read_profile(tmp_path / "road.csv", 5.0)
    (tmp_path / "road.csv").write_text(text(head="x [m],z [m]\n"))
    with pytest.raises(ValueError, match=r"a unit of time in the header.*'x \[m\]'.*along the road need `speed`"):
        read_profile(tmp_path / "road.csv")


@pytest.mark.parametrize(
    ("head", "speed", "message"),
    [
        ("t_s,h_mm", 5.0, r"a unit of length in the header of its positions.*'t_s'.*in time are without it"),
        ("t_ms,h_m", 5.0, r"a unit of length in the header of its positions.*'t_ms'"),
        ("x_m,h_m", None, r"a unit of time in the header of its positions.*'x_m'.*along the road need `speed`"),
        ("x,h_s", 5.0, r"a unit of length in the header of its heights.*'h_s'"),
    ],
)
def test_units_of_the_wrong_quantity_behind_an_underscore_are_refused(tmp_path, head, speed, message):
    (tmp_path / "road.csv").write_text(text(head=head + "\n"))
    with pytest.raises(ValueError, match=message):
        read_profile(tmp_path / "road.csv", speed)


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        ("# nothing\n", {}, r"`path` must name a file with numbers.*empty"),
        ("x,z\n", {}, r"`path` must name a file with numbers, but is .*road.csv, which has only 'x,z'"),
        ("0,1\n1,2,3\n", {}, r"`path` must name a file with 2 numbers in each line.*'1,2,3'"),
        ("x;z\n0;1\n1;2,5\n", {}, r"`path` must name a file with 2 numbers.*'1;2,5'.*decimals have a point"),
        ("x,z\n0,1\n1,2\n", {"height": "zz"}, r"`height` must be one of 'x', 'z', but is 'zz'. Did you mean 'z'"),
        ("x,z\n0,1\n1,2\n", {"height": 2}, r"`height` must be a column from 0 to 1, but is 2.*csv has \['x', 'z'\]"),
        ("hello\n", {}, r"`path` must name a file with numbers, but is .*road.csv, which has only 'hello'"),
        ("0,1\n1,2\n", {"height_unit": "inch"}, r"`height_unit` must be one of 'm', 'km'"),
        ("x,z [mm]\n0,1\n1,2\n", {"height_unit": "m"}, r"`height_unit` must be the unit of the column 'z \[mm\]' of"),
        ("x,z [N]\n0,1\n1,2\n", {}, r"a unit of length in the header of its heights, but is .*road.csv .*'z \[N\]'"),
        ("x,z (left)\n0,1\n1,2\n", {}, r"column 'z \(left\)'. Usual units are m, km"),
        ("0,1\n1,nan\n", {}, r"`height` must be finite.*first at sample 1"),
    ],
)
def test_errors(tmp_path, content, options, message):
    (tmp_path / "road.csv").write_text(content)
    with pytest.raises(ValueError, match=message):
        read_profile(tmp_path / "road.csv", 5.0, **options)


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_profile(tmp_path / "none.csv")

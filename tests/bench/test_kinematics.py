"""Motion ratios from tables of kinematics programs: columns, units, signs, and what no linkage has."""

import numpy as np
import pytest

from jaxdamp import bench
from jaxdamp.dampers import Linear, Linkage


X = np.arange(-80.0, 61.0, 10.0)  # mm, in rebound


def length(x):
    return 500.0 + 0.8 * x - 1e-3 * x**2


def slope(x):
    return 0.8 - 2e-3 * x


def written(folder, header, rows, name="front.csv", separator=","):
    lines = [header, *(separator.join(f"{cell:.10g}" for cell in row) for row in rows)]
    (folder / name).write_text("\n".join(lines), encoding="utf-8")
    return folder / name


@pytest.mark.parametrize(
    ("header", "wheel", "damper", "options"),
    [
        ("rebound travel [mm],damper length [mm]", X, length(X), {}),
        ("bump travel [mm],damper length [mm]", -X, length(X), {}),
        ("wheel travel [mm],damper compression [mm]", -X, 500.0 - length(X), {"sign": "compression-positive"}),
        ("wheel travel [in],shock travel [mm]", X / 25.4, length(X), {"sign": "rebound-positive"}),
        ("Jounce,Shock", -X, length(X), {"units": {"stroke": "mm"}}),
        ("jounce_m,motion ratio", -1e-3 * X, slope(X), {}),
        ("jounce [mm],MR [-],camber [deg],wheel rate [N/mm]", -X, slope(X), {}),
        ("a [mm],b [mm]", -X, length(X), {"columns": {"wheel": "a [mm]", "damper": 1}, "sign": "compression-positive"}),
        ("bump [mm],damper length [mm],motion ratio", -X, length(X), {}),
        ("bump [mm],damper length [mm],motion ratio", -X, 9.0 * X, {"columns": {"ratio": "motion ratio"}}),
    ],
)
def test_every_way_to_write_a_linkage_gives_the_same_ratios(tmp_path, header, wheel, damper, options):
    columns = [wheel, damper, slope(X), 5.0 * X]
    rows = np.transpose(columns[: header.count(",") + 1])[::-1]
    found = bench.read_kinematics(written(tmp_path, header, rows), **options)
    np.testing.assert_allclose(found.travel, 1e-3 * X, atol=1e-12)
    np.testing.assert_allclose(found.ratio, slope(X), rtol=1e-7)
    assert found.name == "front" and any("wheel from" in note for note in found.notes)
    law = found.linkage(Linear(1500.0))
    assert isinstance(law, Linkage)
    # 5 mm from the next point the travel is that of the parabola, whose slope is a straight line
    np.testing.assert_allclose(1e3 * law.lever(0.035)[0], length(35.0) - 500.0, rtol=1e-7)


def test_a_table_beside_zero_is_noted(tmp_path):
    found = bench.read_kinematics(written(tmp_path, "rebound [mm],damper [mm]", [(10, 8), (20, 15)]))
    np.testing.assert_allclose(found.ratio, [0.7, 0.7])
    assert any("zero wheel travel" in note for note in found.notes)


@pytest.mark.parametrize(
    ("header", "rows", "options", "words"),
    [
        ("wheel [mm],damper [mm]", [(0, 0), (10, 7)], {}, 'sign="compression-positive"'),
        ("bump [mm],damper", [(0, 0), (10, 7)], {}, r'units=\{"stroke": "mm"\}'),
        ("bump [mm],damper [N]", [(0, 0), (10, 7)], {}, r"no column for the travel of the damper.*columns="),
        ("bump [mm],damper [mm]", [(0, 0), (10, 7), (20, 6)], {}, "turns between -20 and -10 mm"),
        ("bump [mm],damper [mm]", [(0, 5), (10, 5)], {}, "must rise or fall all the way"),
        ("bump [mm],ratio", [(0, 0.7), (10, -0.7)], {}, "must be positive, but one is -0.7 at -10 mm"),
        ("bump [mm],ratio [deg/mm]", [(0, 0.7), (10, 0.7)], {}, "without the unit 'deg/mm'"),
        ("bump [mm],ratio", [(0, 0.7), (0, 0.8)], {}, "wheel travel -?0 mm twice"),
        ("bump [mm],ratio,front ratio", [(0, 0.7, 1), (1, 0.8, 1)], {}, r'could both be the ratio.*"ratio": 2'),
        ("bump [mm],damper [mm]", [(0, 0), (10, 7)], {"columns": {"wheel": "bumps"}}, r"columns=.*Did you mean 'bump'"),
        ("bump [mm],damper [mm]", [(0, 0), (10, 7)], {"columns": {"stroke": 1}}, "`columns`"),
        ("bump [mm],damper [mm]", [(0, 0), (10, 7)], {"sign": "up"}, "`sign`"),
    ],
)
def test_refusals(tmp_path, header, rows, options, words):
    with pytest.raises(ValueError, match=words):
        bench.read_kinematics(written(tmp_path, header, rows), **options)


def test_text_in_a_column_is_named(tmp_path):
    file = written(tmp_path, "bump [mm],ratio", [(0, 0.7), (10, 0.8), (20, 0.9)])
    file.write_text(file.read_text().replace("0.8", "high"))
    with pytest.raises(ValueError, match="high"):
        bench.read_kinematics(file)

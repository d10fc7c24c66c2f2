"""Limits in magnitudes, where the library counts compression and gas forces negative."""

import pytest

from jaxdamp.bench import Evaluation, Limit, SineTest, VirtualDyno, evaluate
from jaxdamp.dampers import Bilinear


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    dyno = VirtualDyno(Bilinear(2000.0, 1000.0), gas_force=-200.0)
    return evaluate(dyno.run([SineTest(0.02, f) for f in (0.5, 1.0, 3.0)]))


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (Limit("compression force", maximum=300.0, velocity=0.131), "maximum 300 N for -331 N.*write minimum -300 N"),
        (Limit("rebound force", minimum=-300.0, velocity=0.131), "minimum -300 N for 62 N.*write maximum 300 N"),
        (Limit("compression velocity", maximum=0.1, record="*3*"), "maximum 0.1 m/s .*write minimum -0.1 m/s"),
        (
            Limit("mid-stroke compression force", maximum=9.0, record="*"),
            "maximum 9 N .*mid-stroke.* write minimum -9 N",
        ),
    ],
)
def test_limits_that_no_value_can_exceed_are_refused(evaluation: Evaluation, limit: Limit, said: str) -> None:
    with pytest.raises(ValueError, match=f"`limits` must have the sign of what is measured, but is {said}"):
        evaluation.check([limit])


@pytest.mark.parametrize(
    ("limit", "passed"),
    [
        (Limit("compression force", maximum=0.0, velocity=0.131), True),
        (Limit("compression force", -400.0, 300.0, velocity=0.131), True),
        (Limit("compression force", minimum=-300.0, velocity=0.131), False),
        (Limit("rebound force", maximum=10.0, record="20mm_0.5Hz"), True),  # gas outweighs damping: -74 N
        (Limit("gas force", minimum=-250.0, maximum=-150.0), True),
        (Limit("hysteresis width", minimum=-50.0, record="*3*"), True),  # of either sign
    ],
)
def test_limits_that_say_something_stay(evaluation: Evaluation, limit: Limit, passed: bool) -> None:
    check = evaluation.check([limit])
    assert check.passed == passed and not any("another sign" in text for text in check.warnings)


def test_a_limit_that_fails_for_its_sign_says_so(evaluation: Evaluation) -> None:
    check = evaluation.check([Limit("compression force", 250.0, 300.0, velocity=0.131)])
    assert not check.passed and check.warnings == (
        "compression force at 0.131 m/s: FAILED; the limit has another sign than the measured -331 N. "
        "A compression force counts negative: write minimum -300 N and maximum -250 N.",
    )


def test_a_gas_force_in_magnitudes_passes_with_a_warning(evaluation: Evaluation) -> None:
    check = evaluation.check([Limit("gas force", maximum=150.0), Limit("friction", maximum=1.0)])
    assert check.passed and check.summary == "2 of 2 limits are kept."
    (warning,) = check.warnings
    assert "passed; the limit has another sign than the measured -200 N" in warning
    assert warning.endswith("write minimum -150 N, or give both bounds.")

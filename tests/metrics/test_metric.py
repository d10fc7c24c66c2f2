import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import STATISTICS, Metric, Reduction, Statistic, Term, percentile


def test_a_metric_is_named_after_its_parts():
    assert Metric("stroke", "rms").name == "rms_stroke"
    assert Metric("stroke", "rms", by="damper_force", window=(0.5, 2.0)).name == "rms_stroke_by_damper_force_0.5_to_2_s"
    assert Metric("a", "rms", "default").name == "weighted_rms_a" and Metric("a", "rms", "Wd").name == "Wd_rms_a"
    assert Metric("a", percentile(95)).name == "percentile_95_a"
    assert Metric("a", "rms", "Wk", name="felt").weighted_by("Wd") == Metric("a", "rms", "Wd", name="felt")
    assert Metric("a", "rms") == Metric("a", STATISTICS["rms"]) and hash(Metric("a", percentile(5))) is not None


def test_units_follow_from_those_of_the_channels():
    units = {"a": "m/s^2", "f": "N", "v": "m/s", "d": "m", "moment": "N m", "rate": "rad/s", "share": ""}
    doses = {"a": "m/s^1.75", "f": "N s^0.25", "v": "m/s^0.75", "moment": "N m s^0.25", "share": "s^0.25"}
    assert {name: Metric(name, "vibration_dose_value").unit(units) for name in doses} == doses
    for channel, by in (("f", "v"), ("v", "f"), ("moment", "rate")):
        assert Metric(channel, "dissipated_power", by=by).unit(units) == "W"
    assert Metric("d", "dissipated_power").unit(units) == "m"
    assert Metric("f", "mean", by="v").unit(units) == "N m/s"


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"statistic": "rsm"}, "`statistic` must be one of .* Did you mean 'rms'"),
        ({"weighting": "wk"}, "`weighting` must be one of .* Did you mean 'Wk'"),
        ({"window": (2.0, 1.0)}, "`window` must begin at 0 s or later and end after that"),
        ({"weighting": "Wk", "from_rest": True}, "`from_rest` must not be used with a weighting"),
    ],
)
def test_what_makes_no_metric_is_refused(more, words):
    with pytest.raises(ValueError, match=words):
        Metric("a", **({"statistic": "rms"} | more))


def test_windows_are_numbers_of_samples():
    assert Metric("a", "rms").samples(11, 0.1) == (0, 10)
    assert Metric("a", "rms", window=(0.2, 0.5)).samples(11, 0.1) == (2, 5)
    assert Metric("a", "rms", window=(0.2, 0.5)).samples(5, 0.1, begin=0.1) == (1, 4)
    for begin in (0.0, 0.3):
        with pytest.raises(ValueError, match=r"window of 'rms_a_0\.2_to_0\.5_s'` must lie in"):
            Metric("a", "rms", window=(0.2, 0.5)).samples(5, 0.1, begin=begin)


def test_a_statistic_of_terms_is_one_of_the_record(rng):
    record = jnp.asarray(rng.normal(size=50) + 3.0)
    skew = Statistic(
        "third_moment",
        (Term(Reduction.FIRST), Term(Reduction.SUM, lambda y, first: (y - first) ** 3)),
        lambda terms, count, dt: terms[1] / count,
    )
    gathered = skew.begin(record[0])
    for y in record[1:]:
        gathered = skew.add(gathered, y)
    expected = np.mean((np.asarray(record) - float(record[0])) ** 3)
    assert float(skew.end(gathered, 50, 0.1)) == pytest.approx(expected)
    assert float(skew.of(record, 0.1)) == pytest.approx(expected)


def test_only_a_statistic_that_saves_the_first_sample_has_it():
    """Otherwise a run would take its first term for it, and differ from the whole record in silence."""
    drift = Statistic("drift", (Term(Reduction.SUM, lambda y, first: y - first),), lambda terms, count, dt: terms[0])
    for use in (lambda: drift.of(jnp.arange(3.0), 0.1), lambda: drift.begin(jnp.zeros(()))):
        with pytest.raises(ValueError, match=r"begin with `Term\(Reduction.FIRST\)`"):
            use()


def test_a_statistic_has_terms_or_a_function_of_the_record():
    terms = (Term(Reduction.SUM),)
    for wrong in (
        lambda: Statistic("none"),
        lambda: Statistic("none", terms),
        lambda: Statistic("none", of_terms=lambda terms, count, dt: terms[0]),
        lambda: Statistic("none", terms, lambda terms, count, dt: terms[0], lambda record, dt: record[0]),
    ):
        with pytest.raises(ValueError, match="have terms and a function of them, or one of the record"):
            wrong()
    with pytest.raises(ValueError, match="`share` must be 0 to 100 percent"):
        percentile(101)
    assert percentile(95) is percentile(95)  # one program for all

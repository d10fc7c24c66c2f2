"""Names that people guess are answered with the right ones."""

from importlib import import_module

import pytest

from jaxdamp import Response, _guesses, dampers, identify


@pytest.mark.parametrize(
    ("module", "name", "meant"),
    [
        ("jaxdamp", "load", "jaxdamp.export.from_json"),
        ("jaxdamp", "simulat", "jaxdamp.simulate"),
        ("jaxdamp.tune", "minimize", "jaxdamp.tune.minimise"),
        ("jaxdamp.roads", "iso", "jaxdamp.roads.iso8608"),
        ("jaxdamp.dampers", "PiecwiseLinear", "jaxdamp.dampers.PiecewiseLinear"),
    ],
)
def test_a_wrong_guess_is_answered(module: str, name: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=f"has no attribute {name!r}; did you mean `{meant}"):
        getattr(import_module(module), name)


def test_what_is_answered_is_there_and_what_is_asked_is_not() -> None:
    for guess, meant in _guesses.GUESSES.items():
        module, _, name = guess.rpartition(".")
        assert not hasattr(import_module(module), name)
        for right in (part.partition("(")[0] for part in meant.split("`")[1::2] if part.startswith("jaxdamp.")):
            package, _, public = right.rpartition(".")
            assert public in import_module(package).__all__


def test_what_a_class_does_not_have() -> None:
    with pytest.raises(AttributeError, match=r"did you mean `jaxdamp.bench.read_table\(path\).law\(\)`"):
        _ = dampers.Table.from_csv
    with pytest.raises(AttributeError, match=r"velocity_histogram\(response"):
        _ = Response.histogram
    with pytest.raises(AttributeError, match=r"rig.quasi_static\(law, velocities\).force"):
        _ = dampers.Sum.force_velocity
    for name in ("estimate", "propagate", "profile", "posterior", "band"):
        with pytest.raises(AttributeError, match=rf"{name}'; did you mean that of `identify.fit\(training.law, tr"):
            getattr(identify.Training, name)
    assert not hasattr(dampers.Table([-1.0, 1.0], [-1.0, 1.0]), "from_csv")

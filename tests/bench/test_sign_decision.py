import numpy as np
import pytest

from jaxdamp.bench.sign import decide, loss_fraction


TIME = np.arange(2000) / 1000
STROKE = 0.02 * np.sin(2 * np.pi * 2.3 * TIME)
VELOCITY = np.gradient(STROKE, TIME)
FORCE = 2000.0 * VELOCITY


def test_loss_fraction_of_damper_spring_and_wrong_sign():
    work, loss = loss_fraction(TIME, STROKE, FORCE)
    assert work == pytest.approx(np.pi * 2000 * 2 * np.pi * 2.3 * 0.02**2, rel=1e-3)
    assert loss == pytest.approx(1.0, rel=5e-3)
    assert loss_fraction(TIME, STROKE, -FORCE)[1] == pytest.approx(-1.0, rel=5e-3)
    assert loss_fraction(TIME, STROKE, 1e4 * STROKE)[1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("sign", [None, "rebound-positive", "compression-positive"])
@pytest.mark.parametrize("force_sign", [None, "same"])
def test_consistent_signs(sign, force_sign):
    decision = decide(TIME, STROKE, FORCE, sign, force_sign, "run")
    turn = -1.0 if sign == "compression-positive" else 1.0
    assert (decision.motion, decision.force) == (turn, turn)
    assert "agree in sign (work per cycle +" in decision.notes[0]
    assert ("taken as rebound" in decision.notes[1]) == (sign is None)


@pytest.mark.parametrize("sign", [None, "rebound-positive", "compression-positive"])
def test_opposite_force_is_turned_when_found_or_given(sign):
    decision = decide(TIME, STROKE, -FORCE, sign, "opposite" if sign else None, "run")
    turn = -1.0 if sign == "compression-positive" else 1.0
    assert (decision.motion, decision.force) == (turn, -turn)
    assert "force turned" in decision.notes[0]


@pytest.mark.parametrize("sign", ["rebound-positive", "compression-positive"])
def test_given_sign_that_contradicts_the_work(sign):
    with pytest.raises(ValueError, match=r"contradicts the data.*force_sign=\"opposite\""):
        decide(TIME, STROKE, -FORCE, sign, None, "run")


@pytest.mark.parametrize(("turn", "word", "other"), [(-1, "same", "opposite"), (1, "opposite", "same")])
def test_given_force_sign_that_contradicts_the_work(turn, word, other):
    with pytest.raises(ValueError, match=rf"force_sign=\"{word}\" contradicts.*force_sign=\"{other}\""):
        decide(TIME, STROKE, turn * FORCE, None, word, "run")


def test_a_spring_cannot_decide():
    with pytest.raises(ValueError, match=r"cannot be established.*sign=\"rebound-positive\" or"):
        decide(TIME, STROKE, 1e4 * STROKE, None, None, "run")
    decision = decide(TIME, STROKE, 1e4 * STROKE, "rebound-positive", None, "run")
    assert "too small to tell" in decision.notes[0]


def test_unknown_words():
    with pytest.raises(ValueError, match=r"`sign`.*Did you mean 'rebound-positive'"):
        decide(TIME, STROKE, FORCE, "rebound", None, "run")
    with pytest.raises(ValueError, match=r"`force_sign`"):
        decide(TIME, STROKE, FORCE, None, "reversed", "run")


def test_noise_and_rest_do_not_change_the_decision(rng):
    rest = np.zeros(1500)
    stroke = np.concatenate([rest, STROKE, rest]) + 1e-4 * rng.standard_normal(5000)
    force = np.concatenate([rest, -FORCE, rest]) + 100 * rng.standard_normal(5000) + 300
    assert decide(np.arange(5000) / 1000, stroke, force, None, None, "run").force == -1.0

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
    assert "taken to agree in sign: the work per cycle" in decision.notes[0]


@pytest.mark.parametrize("share", [0.5, 0.25, 0.75])
def test_a_stroke_that_does_not_come_back_cannot_decide_but_one_that_does_can(share):
    """From one end of the stroke against 800 N of gas: to the other end, to the middle, and half of the way back."""
    time = np.arange(round(500 * share)) / 1000
    stroke, velocity = -0.02 * np.cos(4 * np.pi * time), 0.02 * 4 * np.pi * np.sin(4 * np.pi * time)
    force = 2000.0 * velocity - 800.0
    if share > 0.5:
        assert decide(time, stroke, force, None, None, "run").force == 1.0
        assert decide(time, stroke, -force, None, None, "run").force == -1.0
        return
    with pytest.raises(ValueError, match=r"the stroke does not come back.*sign=\"rebound-positive\" or"):
        decide(time, stroke, force, None, None, "run")
    given = decide(time, stroke, force, "rebound-positive", None, "run")
    assert given.force == 1.0 and "taken to agree in sign: the stroke does not come back" in given.notes[0]
    assert decide(time, stroke, force, None, "opposite", "run").force == -1.0


@pytest.mark.parametrize(
    ("headers", "motion"),
    [
        (["compression travel [mm]"], -1.0),
        (["bump travel [mm]", "v [m/s]"], -1.0),
        (["x [mm]", "jounce velocity [m/s]"], -1.0),
        (["stroke (compression negative) [mm]"], 1.0),
        (["rebound travel [mm]"], 1.0),
        (["extension_mm"], 1.0),
    ],
)
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_the_header_says_which_direction_is_rebound(headers, motion, turn):
    decision = decide(TIME, STROKE, turn * FORCE, None, None, "run", headers)
    assert (decision.motion, decision.force) == (motion, turn * motion)
    way = "compression" if motion < 0 else "rebound"
    assert f"positive stroke is {way}, as the header " in decision.notes[1]
    own, other = f"{way}-positive", "rebound-positive" if motion < 0 else "compression-positive"
    assert decide(TIME, STROKE, FORCE, own, None, "run", headers).motion == motion
    with pytest.raises(ValueError, match=f'"{other}" contradicts the header .*, which says {own}. Leave it out'):
        decide(TIME, STROKE, FORCE, other, None, "run", headers)
    with pytest.raises(ValueError, match=f'cannot be established .* Pass sign="{own}".$'):
        decide(TIME, STROKE, 1e4 * STROKE, None, None, "run", headers)


def test_headers_of_opposite_directions_are_refused():
    with pytest.raises(ValueError, match=r"'bump \[mm\]' and 'rebound velocity' are .* opposite .*\"velocity\": None"):
        decide(TIME, STROKE, FORCE, None, None, "run", ["bump [mm]", "rebound velocity"])


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

"""Records whose command is a channel: made, written, read, cut, looked over, and run by the virtual dyno."""

from dataclasses import replace

import numpy as np
import pytest

from jaxdamp import bench, identify
from jaxdamp.bench import BenchRun, CommandStep, RandomTest, SineTest, VirtualDyno
from jaxdamp.dampers import Linear, Scheduled


LAW = Scheduled((Linear(500.0), Linear(2500.0)), [0.0, 1.0], 0.0)
SINE = SineTest(0.01, 2.0, cycles=4)
STEPS = CommandStep(SINE, (0.0, 1.0, 0.5), hold=0.3)


@pytest.fixture(scope="module")
def run():
    return VirtualDyno(LAW, 1000.0, command_lag=8e-3).run(STEPS)[0]


def test_steps_are_smooth_and_begin_again():
    time = np.array([-1.0, 0.0, 0.299, 0.3025, 0.305, 0.599, 0.7, 0.9, 0.906])
    expected = [0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.5, 0.0]
    np.testing.assert_allclose(STEPS.command(time), expected, atol=1e-12)
    assert (STEPS.duration, STEPS.warm_up, STEPS.highest_frequency) == (2.0, 1.0, 2.0)
    np.testing.assert_array_equal(STEPS.stroke(time), SINE.stroke(time))


def test_random_levels_are_those_of_the_seed():
    one, same, other = (CommandStep.random(SINE, 0.2, 0.8, seed=seed) for seed in (3, 3, 4))
    assert one == same and one.levels != other.levels and one.name != other.name
    assert len(one.levels) == 10 and 0.2 < min(one.levels) < max(one.levels) < 0.8


def test_the_record_holds_what_was_set_and_the_force_what_the_actuator_made_of_it(run):
    assert run.command is None and run.command_unit == "A" and "command      0 … 1 A" in run.describe()
    np.testing.assert_allclose(run.command_channel, STEPS.command(run.time), atol=1e-12)
    fine = np.arange(0.0, 2.0, 1e-5)
    acting = np.zeros_like(fine)
    for i, u in enumerate(STEPS.command(fine[:-1] + 5e-6)):
        acting[i + 1] = u + (acting[i] - u) * np.exp(-1e-5 / 8e-3)
    acting = np.interp(run.time, fine, acting)
    expected = (500.0 + 2000.0 * acting) * SINE.velocity(run.time)
    np.testing.assert_allclose(run.force, expected, atol=2e-3 * np.ptp(expected))


def test_noise_of_the_channel_and_tests_without_a_command_beside_it():
    held = replace(SINE, name="held")
    noisy, other = VirtualDyno(LAW, 1000.0, command_noise=0.01, seed=2).run([STEPS, held])
    assert np.std(noisy.command_channel - STEPS.command(noisy.time)) == pytest.approx(0.01, rel=0.1)
    assert other.command_channel is None
    np.testing.assert_allclose(other.force, 500.0 * SINE.velocity(other.time), atol=1e-2)


def test_written_and_read_to_the_last_bit(run, tmp_path):
    again = bench.read(run.to_csv(tmp_path / "run.csv"))[0]
    assert again.command is None and again.command_unit == "A"
    np.testing.assert_array_equal(again.command_channel, run.command_channel)


def write(path, header, current):
    time = np.arange(400) / 200
    columns = np.column_stack([time, 20 * np.sin(9 * time), 500 * np.cos(9 * time), current * np.ones(400)])
    np.savetxt(path, columns, delimiter=",", header=f"time [s],stroke [mm],force [N],{header}", comments="")
    return path


VARIES = 0.5 + 0.4 * np.sign(np.sin(np.arange(400) / 20))


@pytest.mark.parametrize(
    ("header", "unit", "factor"),
    [
        ("current [A]", "A", 1.0),
        ("Coil current (mA)", "A", 1e-3),
        ("strom_A", "A", 1.0),
        ("valve voltage [V]", "V", 1.0),
        ("measured current [A]", "A", 1.0),
    ],
)
def test_columns_of_a_current_or_a_voltage_are_the_command(header, unit, factor, tmp_path):
    run = bench.read(write(tmp_path / "a.csv", header, VARIES), sign="rebound-positive")[0]
    assert run.command_unit == unit
    np.testing.assert_allclose(np.asarray(run.command_channel), factor * VARIES)


@pytest.mark.parametrize("header", ["motor current [A]", "LVDT voltage [V]", "current setpoint [A]", "current"])
def test_columns_of_other_currents_set_points_and_without_unit_are_not(header, tmp_path):
    run = bench.read(write(tmp_path / "a.csv", header, VARIES), sign="rebound-positive")[0]
    assert run.command is run.command_channel is None


def test_a_column_can_be_named_or_left_out_and_a_stated_command_wins(tmp_path):
    file = write(tmp_path / "a.csv", "I_out [A]", VARIES)
    named = bench.read(file, sign="rebound-positive", columns={"command": "I_out"})[0]
    np.testing.assert_array_equal(named.command_channel, VARIES)
    file = write(tmp_path / "b.csv", "current [A]", VARIES)
    assert bench.read(file, sign="rebound-positive", columns={"command": None})[0].command_channel is None
    stated = bench.read(file, sign="rebound-positive", command=0.4)[0]
    assert stated.command == 0.4 and stated.command_channel is None
    assert stated.notes[-1] == "column of the command left out, since it is stated as 0.4"


def test_a_constant_column_is_a_command_that_is_held(tmp_path):
    run = bench.read(write(tmp_path / "a.csv", "current [mA]", 500.0), sign="rebound-positive")[0]
    assert run.command == 0.5 and run.command_channel is None
    assert "command held at 0.5 A, by its column" in run.notes


def test_it_is_cut_and_filtered_with_the_record(run):
    part = run.process(low_pass=50.0).process(between=(0.5, 1.5))
    assert len(part.command_channel) == len(part) == 1000
    inside = np.abs(part.command_channel - run.command_channel[500:1500])
    assert 0.05 < inside.max() < 0.5  # the corners of its steps
    assert len(run.last_cycles(1).command_channel) == len(run.last_cycles(1))
    with pytest.raises(ValueError, match=r"`mean_cycle` must be asked for where all cycles are alike"):
        run.process(mean_cycle=True)


def test_a_command_that_varies_is_a_setting_of_its_own_and_one_that_is_held_in_a_part_is_held_there(run):
    evaluation = bench.evaluate([run, run.held_at(0.3)])
    assert list(evaluation.settings) == ["0 to 1", "0.3"]
    assert f"The command of {run.name} varies, so that its figures are of no one setting." in evaluation.notes[0]
    part = run.process(between=(1.56, 1.78))
    assert part.command == 0.5 and part.command_channel is None
    result = identify.fit(Linear, run)
    assert "(0 to 1 A), which this law does not follow" in result.main_warnings[0]
    assert not [warning for warning in result.warnings if "warms up" in warning or "friction of" in warning]


def test_the_preflight_finds_nothing_odd_in_steps_and_names_a_command_that_is_held():
    dyno = VirtualDyno(LAW, 1000.0, force_noise=15.0, command_noise=2e-3, stroke_noise=1e-5)
    tests = [STEPS, CommandStep(RandomTest(0.02, 0.3, duration=4.0), (0.0, 1.0), rise=2e-3)]
    runs = dyno.run(tests)
    assert not bench.preflight(runs).findings
    level = 0.5 + 2e-3 * np.random.default_rng(0).standard_normal(len(runs[0]))
    (found,) = bench.preflight(replace(runs[0], command_channel=level)).of("warning")
    assert found.name == "command held" and "0.5 ± 0.002 A" in found.message and "run.held_at(0.5)" in found.remedy
    assert runs[0].held_at(0.5).command == 0.5 and runs[0].held_at(0.5).command_channel is None


def test_refusals(run):
    with pytest.raises(ValueError, match="`command` must be left out beside a `command_channel`"):
        replace(run, command=0.5)
    with pytest.raises(ValueError, match="`command_unit` must be one of"):
        replace(run, command_unit="clicks")
    with pytest.raises(ValueError, match=r"command_channel.*not a finite number|command_channel.*nan"):
        replace(run, command_channel=np.where(run.time > 1.0, np.nan, 0.0))
    with pytest.raises(ValueError, match="`command` must be a column of as many samples as the time"):
        BenchRun.from_arrays("a", run.time, run.stroke, run.force, command=run.command_channel[1:], command_unit="A")
    made = BenchRun.from_arrays("a", run.time, run.stroke, run.force, command=run.command_channel, command_unit="A")
    np.testing.assert_array_equal(made.commands, run.command_channel)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"levels": (1.0,)}, "`levels` must be two or more"),
        ({"levels": (0.0, np.inf)}, "`levels` must be finite"),
        ({"rise": 0.0}, "`rise` must be positive"),
        ({"rise": 1.0}, "`rise` must be at most the hold"),
        ({"unit": "mA"}, "`unit` must be one of"),
    ],
)
def test_steps_that_cannot_be_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(STEPS, **change)


def test_the_virtual_dyno_refuses_what_law_or_record_cannot_follow():
    with pytest.raises(ValueError, match="must be left out beside a law that takes none"):
        VirtualDyno(Linear(500.0)).run(STEPS)
    with pytest.raises(ValueError, match="must stay between the levels 0 and 1 of the law, but is from 0 to 2"):
        VirtualDyno(LAW).run(replace(STEPS, levels=(0.0, 2.0)))
    with pytest.raises(ValueError, match=r"`rise` must be at least two samples of '10mm_2Hz_steps', 0.01 s"):
        VirtualDyno(LAW, 200.0).run(STEPS)

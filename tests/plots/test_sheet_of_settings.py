"""The sheet of a damper with several settings, each with its own gas force, and what its numbers leave out."""

import dataclasses

import numpy as np
import pytest

from jaxdamp import bench, plots
from jaxdamp._display import Display, shown_in
from jaxdamp.bench import BenchSet, Evaluation, SineTest, VirtualDyno
from jaxdamp.dampers import Linear
from jaxdamp.identify import Comparison
from jaxdamp.plots import _style
from jaxdamp.plots.damper_sheet import _Damper, _force_title
from jaxdamp.plots.evaluation import gas_and_friction_words
from jaxdamp.rig import Rig


GAS, SPEED = {"1": -100.0, "2": -500.0}, 0.1
SHOP = Display("imperial", "compression-positive")


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    runs: list[bench.BenchRun] = []
    for name, gas in GAS.items():
        dyno = VirtualDyno(Linear(2000.0), sampling_rate=500.0, gas_force=gas)
        own = dyno.run([SineTest(0.02, f, name=f"{name}: {f:g}Hz") for f in (0.1, 1.0, 2.0)])
        runs += [dataclasses.replace(run, settings={"clicks": name}) for run in own]
    return bench.evaluate(runs, velocities=[SPEED], by=lambda run: str(run.settings["clicks"]))


def test_limits_stand_about_the_forces_of_their_own_setting(evaluation: Evaluation) -> None:
    forces = {name: evaluation.get("rebound force", setting=name, velocity=SPEED).value for name in GAS}
    limits = [
        bench.Limit("rebound force", force - 100.0, force + 100.0, velocity=SPEED, setting=name)
        for name, force in forces.items()
    ]
    axes = plots.damper_sheet(evaluation, limits=evaluation.check(limits)).axes[1]
    bars = [line for line in axes.get_lines() if line.get_linewidth() == 6.0]
    assert [bar.get_solid_capstyle() for bar in bars] == ["butt"] * 2
    for bar, (name, force) in zip(bars, forces.items(), strict=True):
        static = evaluation.gas_and_friction[name].gas_force
        np.testing.assert_allclose(np.asarray(bar.get_ydata(), float), [force - static - 100.0, force - static + 100.0])
        assert static == pytest.approx(GAS[name], rel=0.05)


def test_the_static_force_that_was_taken_off_has_the_sign_of_the_sheet(evaluation: Evaluation, runs: BenchSet) -> None:
    with shown_in(SHOP):
        title = _force_title(_Damper.of(evaluation, None))
        (note,) = [plots.force_velocity(Linear(2000.0), runs=list(runs), static_force=-150.0).get_supxlabel()]
        slow = gas_and_friction_words(evaluation.gas_and_friction["1"])
    assert slow.startswith("Static 22.481 ± 0 lbf, ") and slow.endswith(" lbf")
    low, high = (_style.short(-evaluation.gas_and_friction[name].gas_force / 4.4482216) for name in GAS)
    assert title.endswith(f"static force of {low} to {high} lbf") and "static force of 33.7 lbf" in note


def test_a_preflight_is_drawn_in_the_unit_and_the_sign_of_its_table(evaluation: Evaluation) -> None:
    found = bench.preflight(evaluation.runs)
    with shown_in(SHOP):
        texts = {text.get_text() for text in found.plot().axes[0].texts}
    gas = [finding.size or 0.0 for finding in found.named("gas force")]
    assert len(gas) == 6 and {f"i  {_style.short(-size / 4.4482216)} lbf" for size in gas} <= texts


def test_the_friction_of_the_machine_in_the_measured_points_is_named(comparison: Comparison, runs: BenchSet) -> None:
    fit = dataclasses.replace(comparison.best.result, rig=Rig(friction=44.4822))
    damper = _Damper.of(fit, bench.evaluate(runs))
    with shown_in(SHOP):
        assert "measured with the machine's friction of 10 lbf" in _force_title(damper)


def test_numbers_at_bars_have_the_unit_of_their_axis(comparison: Comparison) -> None:
    with shown_in(SHOP):
        (axes,) = plots.ladder(comparison).axes
    bars = [bar for bars in axes.containers for bar in bars]
    said = [text.get_text() for text in axes.texts]
    assert said == [_style.short(bar.get_width() / 4.4482216) for bar in bars] and len(said) == 4
    best = _style.short(comparison.best.error / 4.4482216)
    assert axes.get_title(loc="left").split(": ")[1].startswith(f"{best} lbf = ")


def test_legends_have_three_figures_of_what_is_shown(runs: BenchSet) -> None:
    with shown_in(SHOP):
        figures = plots.records(list(runs)), bench.evaluate(runs).plot()
    for figure in figures:
        said = {text.get_text() for text in figure.legends[0].get_texts()}
        assert {f"{run.name} ({_style.short(run.peak_velocity / 0.0254)} in/s)" for run in runs} <= said

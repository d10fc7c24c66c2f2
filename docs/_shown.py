"""The pictures of README.md and of the home page, from results of the library: `python docs/_shown.py` draws them anew.

`tests/test_shown.py` says when they are no longer what the library gives.
"""

import sys
from pathlib import Path

import jaxdamp


jaxdamp.configure()

import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from jaxdamp import Ride, bench, identify, roads, simulate, tune, vehicles  # noqa: E402
from jaxdamp.dampers import Besinger, Lag, Linear  # noqa: E402
from jaxdamp.plots import _style as style  # noqa: E402


HERE = Path(__file__).parent / "shown"
COMFORT, GRIP = "weighted_rms_sprung_acceleration", "rms_dynamic_tyre_load"


def draw_all(folder: Path) -> None:
    """Write every picture."""
    folder.mkdir(exist_ok=True)
    truth = Lag(Besinger(700.0, 1800.0, 450.0, limit_velocity=0.13, transition_velocity=0.05), 3e-3)
    dyno = bench.VirtualDyno(truth, force_noise=8.0, stroke_noise=1e-5)
    runs = dyno.run([bench.SineTest(0.025, f) for f in (0.5, 1.5, 4.0, 6.5)])
    ladder = identify.compare(identify.default_ladder(runs, ["linear", "besinger", "besinger_lag"]), runs)
    best = ladder.best.result
    _save(ladder.plot("sheet"), folder / "damper_sheet.png")
    _save(chain(best, runs), folder / "chain.png")


def chain(best: identify.FitResult, runs: bench.BenchSet) -> Figure:
    """From records to a better damper, in four panels."""
    figure = style.new_figure(13.0, 3.5)
    loops, curve, spectrum, plane = figure.subplots(1, 4)
    _loops(loops, best, runs)
    car = vehicles.presets.quarter_car_000(best.law)
    road = roads.iso8608("C", speed=20.0, seed=1, duration=60.0)
    tuned = tune.minimise(COMFORT, car, road, limits={GRIP: "+10%"}, duration=20.0).vehicle
    _laws(curve, car, tuned, runs)
    _spectra(spectrum, car, tuned, road)
    _plane(plane, car, tuned, road)
    return figure


def _loops(axes, best, runs) -> None:
    for run in runs:
        last = run.time > run.time[-1] - 1.0 / run.frequency
        axes.plot(1e3 * run.stroke[last], run.force[last], **style.MEASURED, linewidth=3.0, alpha=0.5)
        axes.plot(1e3 * run.stroke[last], np.asarray(best.respond(run))[last], **style.AFTER)
    style.dress(axes, "stroke [mm]", "force [N]", f"Bench records\nlaw explains {best.fit_percent:.1f} %")


def _laws(axes, before, after, runs) -> None:
    reach = 1.1 * max(run.peak_velocity for run in runs)
    points = np.linspace(-reach, reach, 201)
    for car, look, name in ((before, style.BEFORE, "fitted"), (after, style.AFTER, "tuned")):
        axes.plot(points, [float(car.damper.law.force_velocity(v)) for v in points], **look, label=name)
    style.cross(axes)
    axes.legend(frameon=False, loc="upper left")
    style.dress(axes, "velocity [m/s]", "force [N]", "Damper law\nbefore and after tuning")


def _spectra(axes, before, after, road) -> None:
    from scipy.signal import welch

    for car, look in ((before, style.BEFORE), (after, style.AFTER)):
        response = simulate(car, road, duration=60.0)
        frequency, density = welch(np.asarray(response["sprung_acceleration"]), 1e3, nperseg=4000)
        shown = (frequency >= 0.5) & (frequency <= 25.0)
        axes.loglog(frequency[shown], density[shown], **look)
    style.plain_log_axis(axes.xaxis)
    style.dress(axes, "frequency [Hz]", "body acceleration [(m/s²)²/Hz]", "Ride\nISO class C at 20 m/s")


def _plane(axes, before, after, road) -> None:
    linear = Ride(vehicles.presets.quarter_car_000(Linear(2000.0)), road, metrics=[COMFORT, GRIP], duration=60.0)
    rates = np.geomspace(600.0, 6000.0, 25)
    data = jaxdamp.sweep(linear, {"damper.rate": rates})
    axes.plot(data[COMFORT], data[GRIP], **style.REFERENCE, label="linear dampers")
    rides = []
    for car, look, marker, name in ((before, style.BEFORE, "o", "fitted"), (after, style.AFTER, "D", "tuned")):
        rides.append(values := Ride(car, road, metrics=[COMFORT, GRIP], duration=60.0)())
        axes.plot(values[COMFORT], values[GRIP], marker, color=look["color"], markersize=8, label=name)
    axes.legend(frameon=False)
    gained, paid = (style.percent(100.0 * float(rides[1][name] / rides[0][name] - 1.0)) for name in (COMFORT, GRIP))
    title = f"Better damper\nbody {gained}, tyre load {paid}"
    style.dress(axes, "weighted body acceleration [m/s²]", "tyre load variation [N]", title)


def _save(figure: Figure, path: Path) -> None:
    from io import BytesIO

    from PIL import Image

    raw = BytesIO()
    figure.savefig(raw, dpi=110)
    few = Image.open(raw).convert("RGB").quantize(64, Image.Quantize.MAXCOVERAGE, 1, dither=Image.Dither.NONE)
    few.save(path, optimize=True)  # a rare colour stays what it is


if __name__ == "__main__":
    draw_all(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)

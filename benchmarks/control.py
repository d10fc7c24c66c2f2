"""Semi-active policies on one corner: what they gain, what they cost, and what any could gain at best.

    python -m benchmarks.control                    the table, and a picture with --picture FILE
    python -m benchmarks.control --quick            short roads and searches
    python -m benchmarks.control --speed            one car and many under linear skyhook, beside hand-written C

After Poussot-Vassal, Spelta, Sename, Savaresi and Dugard, Survey and performance evaluation on some automotive
semi-active suspension control methods, Annual Reviews in Control 36 (2012) 148-160: a single corner, comfort by the
acceleration of the body and road holding by the load of the tyre, per band of frequency and in all. Its text was not at
hand: the corner is that of Savaresi and Spelta (2007), 400 and 50 kg, 20 and 250 kN/m, 300 to 3900 N s/m, the bands are
0 to 5 and 5 to 20 Hz, the roads those of ISO 8608. Every policy is sampled each 5 ms, with an actuator of 50 Hz and
again with a delay of 10 ms and a lag of 10 ms.

The last rows are bounds. The best history of commands is the best that was found for commands that know the road from
end to end, for the body or for the tyre. The active car has the forces of the LQR without limits. The tuned policy and
the network were made on other roads, for each actuator anew.
"""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import jaxdamp
from benchmarks import semi_active
from benchmarks.semi_active import FAST, SLOW, TYRE, Record
from jaxdamp import roads
from jaxdamp.control import Controlled


BUMP = 4.0  # s of the run over the bump that count
RATES = (300.0, 400.0, 500.0, 600.0, 700.0, 800.0, 900.0, 1100.0, 1300.0, 1500.0, 2000.0, 2500.0, 3200.0, 3900.0)
Row = dict[str, dict[str, float]]  # RMS by road, then by channel and band


def judged(run: Callable[[roads.AbstractRoad], Record], surfaces: Mapping[str, list[roads.AbstractRoad]]) -> Row:
    """The mean over the roads of a kind of the RMS in each band; on the bump of the first seconds."""
    row: Row = {}
    for kind, tracks in surfaces.items():
        records = [run(road) for road in tracks]
        if kind == "bump":
            records = [Record(*(signal[: round(BUMP / semi_active.STEP)] for signal in one)) for one in records]
        bands = [
            {f"{channel}, {band}": rms for channel in Record._fields for band, rms in _bands(one, channel).items()}
            for one in records
        ]
        row[kind] = {name: float(np.mean([one[name] for one in bands])) for name in bands[0]}
    return row


def _bands(record: Record, channel: str) -> dict[str, float]:
    return semi_active.in_bands(getattr(record, channel))


def table(duration: float, count: int, steps: int) -> dict[str, Row]:
    """All rows: passive dampers, policies with both actuators, bounds."""
    surfaces = semi_active.surfaces(duration, count)

    def of(vehicle: Any) -> Row:
        return judged(lambda road: semi_active.driven(vehicle, road, duration), surfaces)

    def best(name: str, road: roads.AbstractRoad) -> Record:
        shares, _ = semi_active.best_history(road, duration, name, steps=steps)
        return semi_active.driven(semi_active.prescribed(shares), road, duration)

    rows = {f"passive, {rate:g} N s/m": of(semi_active.passive(rate)) for rate in RATES}
    print("passive dampers: done", flush=True)
    training = semi_active.training(0.5 * duration)
    for words, actuator in (("", FAST), (SUFFIX, SLOW)):
        made = semi_active.policies()
        made["skyhook, tuned"] = semi_active.tuned(training, 0.5 * duration, **actuator)
        made["network, trained"] = semi_active.learnt(training, 0.5 * duration, steps, **actuator)
        print(f"tuned{words}: {made['skyhook, tuned']}", flush=True)
        rows |= {
            name + words: of(Controlled(semi_active.corner(), policy, **actuator)) for name, policy in made.items()
        }
    print("policies: done", flush=True)
    rows["active LQR"] = judged(lambda road: semi_active.active(road, duration), surfaces)
    bounded = {kind: surfaces[kind] for kind in (MAIN, "bump")}  # the classes differ little but by a factor
    rows["best history for the body"] = judged(lambda road: best(semi_active.BODY, road), bounded)
    rows["best history for the tyre"] = judged(lambda road: best(TYRE, road), bounded)
    return rows


SUFFIX = ", 10 + 10 ms"
MAIN = "class C, 20 m/s"


def printed(rows: Mapping[str, Row]) -> str:
    """The rows as a table in Markdown, in bands on class C; of passive dampers the best and the ends."""
    passive = {name: row for name, row in rows.items() if name.startswith("passive")}
    softest, *_, hardest = passive
    body, tyre = (
        min(passive, key=lambda name, c=channel: passive[name][MAIN][f"{c}, all"]) for channel in Record._fields
    )
    shown = dict.fromkeys([softest, body, tyre, hardest, *(name for name in rows if name not in passive)])
    bands = [f"{channel}, {band}" for channel in Record._fields for band in semi_active.EDGES]
    others = [kind for kind in rows[body] if kind != MAIN]
    columns = [(MAIN, name) for name in bands] + [(k, f"{c}, all") for k in others for c in Record._fields]
    first, second = ["", *(f"{kind}: {name}" for kind, name in columns)], ["---"] * (len(columns) + 1)
    lines = [f"| {' | '.join(first)} |", f"|{'|'.join(second)}|"]
    for name in shown:
        mark = {body: " (best for the body)", tyre: " (best for the tyre)"}.get(name, "")
        numbers = [(c, rows[name][kind][c] if kind in rows[name] else None) for kind, c in columns]
        cells = ["" if x is None else f"{x:.0f}" if c.startswith("tyre") else f"{x:.3f}" for c, x in numbers]
        lines.append(f"| {name}{mark} | {' | '.join(cells)} |")
    return "\n".join(lines)


def draw(rows: Mapping[str, Row], path: Path) -> None:
    """Body against tyre on class C, in all and in both bands: passive curve, policies with both actuators, bounds."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(16.0, 6.5), constrained_layout=True)
    for axis, band in zip(axes, ("all", "0 to 5 Hz", "5 to 20 Hz"), strict=True):
        at = {name: [row[MAIN][f"{c}, {band}"] for c in Record._fields] for name, row in rows.items()}
        axis.plot(*zip(*(at[name] for name in at if name.startswith("passive")), strict=True), "k--", label="passive")
        policies = [name for name in at if name + SUFFIX in at]
        for number, name in enumerate(policies):
            colour = f"C{number % 10}"
            axis.plot(*at[name], "D" if number >= 10 else "o", color=colour, label=name)
            axis.annotate(
                "", at[name + SUFFIX], at[name], arrowprops={"arrowstyle": "->", "color": colour, "alpha": 0.6}
            )
        marks = {"active LQR": "s", "best history for the body": "*", "best history for the tyre": "P"}
        for name, mark in marks.items():
            axis.plot(*at[name], mark, color="k", markersize=9, label=name)
        axis.set_xlabel("acceleration of the body [m/s²], RMS")
        axis.set_title({"all": "all frequencies"}.get(band, band))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("load of the tyre beside that at rest [N], RMS")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    figure.suptitle(f"ISO {MAIN}: policies with an actuator of 50 Hz (dots) and with 10 ms of delay and lag (arrows)")
    figure.savefig(path, dpi=90)


def main() -> None:
    """The table and the picture, or the speed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=20.0, help="of each road [s]")
    parser.add_argument("--roads", type=int, default=4, help="random roads of each class")
    parser.add_argument("--steps", type=int, default=120, help="gradients for the bounds and the network")
    parser.add_argument("--quick", action="store_true", help="5 s, one road of each class, 40 gradients")
    parser.add_argument("--picture", type=Path, help="file to draw to")
    parser.add_argument("--speed", action="store_true", help="only times, beside hand-written C")
    options = parser.parse_args()
    jaxdamp.configure()
    if options.speed:
        from benchmarks import control_speed

        control_speed.main()
        return
    size = (5.0, 1, 40) if options.quick else (options.duration, options.roads, options.steps)
    rows = table(*size)
    print(f"{size[1]} roads of {size[0]:g} s of each class, RMS; body [m/s2], tyre [N]")
    print(printed(rows))
    if options.picture is not None:
        draw(rows, options.picture)


if __name__ == "__main__":
    main()

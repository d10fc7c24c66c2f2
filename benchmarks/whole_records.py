"""How well laws predict measured records that they were not fitted to: `python -m benchmarks.whole_records`.

The magnetorheological records in `JAXDAMP_DATA`, at each current: the last four cycles of the motion, and whole records
with rest before and after it, these also with states estimated at the beginning (`docs/fitting.md` says what of a
record that is held out may then be used, and is not scored). With `--nested` the law of each record is chosen without
it. With `--between` each law is one law of all currents, and predicts 0.5 A without any record of that current.
"""

import argparse
import os
from pathlib import Path
from typing import Any

import jaxdamp


jaxdamp.configure()

import numpy as np  # noqa: E402

from jaxdamp import bench, dampers, identify  # noqa: E402
from jaxdamp._tables import Column, Table  # noqa: E402


CURRENTS = {"*_0A": 0.0, "*_0.5A": 0.5, "*_1.0A": 1.0}
SEARCH = {"samples_per_cycle": 100, "max_steps": 30, "starts": 1}
PARTS = ("moving", "whole", "estimated")
CREEPING = "creeping_visco_plastic_spring"
LAWS = ["lugre_spring", "visco_plastic_spring", "thinned_visco_plastic", CREEPING]


def creeping(velocity: np.ndarray, force: np.ndarray, stroke: np.ndarray) -> dampers.AbstractDamper:
    """The start of the law that creeps at rest."""
    return dampers.CreepingViscoPlastic.guess(velocity, force) + dampers.Spring.guess(velocity, force, stroke)


def read(part: str) -> bench.BenchSet:
    """The records of all currents."""
    folder = Path(os.environ["JAXDAMP_DATA"]) / "mr_damper"
    records = bench.read(folder / "*.csv", sign="rebound-positive", command=CURRENTS)
    return bench.BenchSet(run.last_cycles(4) for run in records) if part == "moving" else records


def begun(laws: list[str]) -> dict[str, Any]:
    """The start of each law."""
    return {law: creeping if law == CREEPING else identify.ladder_starts([law])[law] for law in laws}


def score(part: str, laws: list[str], nested: bool) -> identify.CrossValidation:
    """Every record predicted by laws fitted to the others of the same current."""
    how = {"by": lambda run: f"{run.command} A", "weighting": "runs", "nested": nested, **SEARCH}
    initial_state = "estimated" if part == "estimated" else "warm_up"
    return identify.cross_validate(begun(laws), read(part), initial_state=initial_state, **how)


def print_between(part: str, laws: list[str]) -> None:
    """Each law as one law of all currents, with its parameters interpolated and with its forces blended."""
    for name, start in begun(laws).items():
        for blend in ("parameters", "force"):
            fit = identify.fit_scheduled(start, read(part), rig=None, weighting="runs", blend=blend, **SEARCH)
            print(
                f"\n{part}, {name}\n{fit.table().to_text()}", *(left.sentence(name) for left in fit.between), sep="\n"
            )


def main() -> None:
    """Print the scores."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parts", nargs="+", default=PARTS, choices=PARTS)
    parser.add_argument("--laws", nargs="+", default=LAWS)
    parser.add_argument("--nested", action="store_true")
    parser.add_argument("--between", action="store_true")
    options = parser.parse_args()
    rows = []
    if options.between:
        for part in options.parts:
            print_between(part, options.laws)
        return
    for part in options.parts:
        scores = score(part, options.laws, options.nested)
        print(f"\n{part}\n{scores.record_table().to_text()}", *scores.verdict, sep="\n", flush=True)
        groups = [scores.fit_percent(scores.best, group) for group in scores.groups]
        rows.append((part, scores.best, *groups, scores.fit_percent(scores.best)))
        if options.nested:
            by_group = [[fold.fit_percent for fold in scores.choices if fold.group == group] for group in scores.groups]
            rows.append((part, "chosen", *(float(np.mean(fits)) for fits in by_group), scores.chosen_fit_percent))
            print(*(f"{fold.held_out}: {fold.law}" for fold in scores.choices), sep="\n")
    columns = [Column(name, "%", ".1f") for name in ("0 A", "0.5 A", "1 A", "all")]
    print(Table("Fit of held-out records", (Column("records"), Column("law"), *columns), tuple(rows)).to_text())


if __name__ == "__main__":
    main()

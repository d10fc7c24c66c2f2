"""`jaxdamp sweep --block 17/200`: blocks of a sweep, computed into a store that other processes fill too."""

import json
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jaxdamp import Ride, sweep
from jaxdamp._checks import ArgumentError, part_of
from jaxdamp._types import Dataset
from jaxdamp.blocks import command_of, note_command, stored_blocks
from jaxdamp.cli import interrupt, resuming
from jaxdamp.cli.console import Screen
from jaxdamp.cli.options import Call


def sweep_part(screen: Screen, ride: Ride, axes: Mapping[str, np.ndarray], how: Call, store: Path, part: str) -> None:
    """Compute the blocks of one part, and say how many points the store has."""
    told = f"Blocks that are done are in {str(store)!r}, and the same command goes on from there."
    with interrupt.closing(lambda: told):
        data, remarks = swept(screen, ride, axes, how, store, part)
    screen.points(remarks, style="yellow")
    done, count = data.attrs["points_done"], data["failed"].size
    blocks, (number, _) = stored_blocks(store), part_of("block", part)
    idle = f"part {part} has no block: the sweep has {blocks}." if number > blocks else f"part {part} is done."
    rest = "The same command without --block writes the results." if done == count else ""
    screen.answer(idle, f"{done} of {count} points are in {store}.", rest)


def swept(
    screen: Screen,
    ride: Ride,
    axes: Mapping[str, np.ndarray],
    how: Call,
    file: Path | None,
    part: str | None = None,
) -> tuple[Dataset, list[str]]:
    """The results of a sweep with what it warns of.

    Raises:
        ValueError: a store of another sweep, with the options that differ.
    """
    stored = file if file is not None and file.suffix == ".zarr" else None
    now = resuming.given_now()
    with screen.stage("Driving") as advance, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")

        def tell(done: int, total: int) -> None:
            if stored is not None:
                note_command(stored, json.dumps(now, ensure_ascii=False))
            advance(f"{done} of {total} points", done)

        try:
            data = sweep(ride, axes, **how.arguments(file=file, cluster=part, progress=tell))
        except ArgumentError as error:
            if stored is None or error.argument != "file":
                raise
            differences = resuming.differences_between(json.loads(command_of(stored) or "{}"), now) if now else []
            if not differences:
                raise
            again = "Give what was given then, name another folder with --out, or delete the store to begin anew."
            raise ValueError(f"{str(stored)!r} holds another sweep: {'; '.join(differences)}. {again}") from error
    return data, [str(warning.message) for warning in caught]

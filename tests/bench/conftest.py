from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest


Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a sine record of a viscous damper (20 mm, 1.5 Hz, 3000 N s/m) as a text file, with chosen faults."""

    def make(
        name: str = "run.csv",
        header: str | None = "t_s,x_mm,F_N",
        delimiter: str = ",",
        decimal: str = ".",
        scale: Sequence[float] = (1.0, 1e3, 1.0),
        preamble: Sequence[str] = (),
        replace: Mapping[int, str] | None = None,
        drop: Sequence[int] = (),
        count: int = 600,
        extra: Sequence[np.ndarray] = (),
    ) -> Path:
        t = np.arange(count) / 300
        omega = 2 * np.pi * 1.5
        x, v = 0.02 * np.sin(omega * t), 0.02 * omega * np.cos(omega * t)
        columns = [a * factor for a, factor in zip((t, x, 3000 * v), scale, strict=True) if factor] + list(extra)
        rows = [
            delimiter.join(f"{value:.9g}" for value in row).replace(".", decimal) for row in zip(*columns, strict=True)
        ]
        for number, text in (replace or {}).items():
            rows[number] = text
        rows = [row for number, row in enumerate(rows) if number not in drop]
        lines = [*preamble, *([] if header is None else [header]), *rows]
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return make

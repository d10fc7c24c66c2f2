"""The laws of the reference: their formulas and examples are those of the notebook `gallery`, their loops are drawn."""

import ast
import json
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxdamp.dampers import AbstractDamper
from jaxdamp.plots import _style as style
from jaxdamp.rig import march


NOTEBOOK = Path(__file__).parents[1] / "notebooks" / "gallery.ipynb"
AMPLITUDE, FREQUENCIES = 0.02, (0.5, 1.0, 2.0, 4.0)  # m, Hz; those of `plots.law_card`
CYCLES, SAMPLES = 3, 200


class Card(NamedTuple):
    """A law of the gallery.

    Arguments:
        name: of its class.
        group: heading in the notebook under which it stands.
        formula: in TeX.
        code: the expression that gives the law.
    """

    name: str
    group: str
    formula: str
    code: str


class Loops(NamedTuple):
    """Last cycles at all frequencies, arrays of shape (frequencies, samples)."""

    stroke: np.ndarray
    velocity: np.ndarray
    force: np.ndarray


def cards() -> tuple[str, dict[str, Card]]:
    """What the notebook imports, and the first law of each class by the name of the class."""
    found: dict[str, Card] = {}
    start = group = formula = ""
    for cell in json.loads(NOTEBOOK.read_text())["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            group = source.splitlines()[0][3:] if source.startswith("## ") else group
            formula = source.split("$$")[1] if "$$" in source else formula
            continue
        code = "\n".join(line for line in source.splitlines() if not line.startswith("%"))
        (last,) = ast.parse(code).body[-1:]
        if not (isinstance(last, ast.Expr) and isinstance(last.value, ast.Call) and "law_card" in code):
            start = start or code
            continue
        law = last.value.args[0]
        name = ast.unparse(law).split("(")[0].split(".")[1]  # dampers.MonoTube.reference()
        found.setdefault(name, Card(name, group, formula, ast.unparse(law)))
    return start, found


def draw_all(folder: Path) -> dict[str, str]:
    """Draw the loops of every law, where they are not there yet; whether each has hysteresis, in words."""
    folder.mkdir(exist_ok=True, parents=True)
    start, known = cards()
    kept = folder / "hysteresis.json"
    sources = [Path(__file__), NOTEBOOK, *Path(str(style.__file__)).parents[1].glob("dampers/*.py")]
    if kept.exists() and kept.stat().st_mtime > max(path.stat().st_mtime for path in sources):
        return json.loads(kept.read_text())
    jax.config.update("jax_enable_x64", True)
    names: dict[str, Any] = {}
    needed = [node for node in ast.parse(start).body if isinstance(node, ast.Import | ast.ImportFrom | ast.Assign)]
    exec(ast.unparse(needed), names)
    words = {}
    for name, card in known.items():
        law = eval(card.code, names)
        loops = _loops(law)
        words[name] = _hysteresis(law, loops)
        _save(_thumbnail(loops), folder / f"{name}_small.png")
        _save(_picture(loops), folder / f"{name}.png")
    kept.write_text(json.dumps(words))
    return words


def _loops(law: AbstractDamper) -> Loops:
    phase = 2 * np.pi * np.arange(CYCLES * SAMPLES + 1) / SAMPLES
    rows = []
    for frequency in FREQUENCIES:
        stroke, velocity = AMPLITUDE * np.sin(phase), 2 * np.pi * frequency * AMPLITUDE * np.cos(phase)
        force = march(law, *(jnp.asarray(a) for a in (1.0 / (frequency * SAMPLES), stroke, velocity)), 1)
        rows.append([np.asarray(a)[-SAMPLES - 1 :] for a in (stroke, velocity, force)])
    return Loops(*(np.stack(column) for column in zip(*rows, strict=True)))


def _hysteresis(law: AbstractDamper, loops: Loops) -> str:
    """Whether forces at equal velocities differ by more than 1 % of the peak, and what remembers."""
    force = loops.force[:, :SAMPLES]
    mirrored = np.concatenate([force[:, :1], force[:, :0:-1]], axis=1)  # the same velocity on the way back
    width = np.max(np.abs(force - mirrored), axis=1) / np.max(np.abs(force), axis=1)
    if np.max(width) < 0.01:
        return "no"
    return "yes" if law.initial_state().size else "by the stroke"


def _thumbnail(loops: Loops) -> Figure:
    figure = style.new_figure(1.7, 1.3)
    axes = figure.subplots()
    _draw(axes, loops.velocity, loops.force)
    axes.axis("off")
    return figure


def _picture(loops: Loops) -> Figure:
    figure = style.new_figure(7.0, 2.8)
    over_velocity, over_stroke = figure.subplots(1, 2, sharey=True)
    lines = _draw(over_velocity, loops.velocity, loops.force)
    _draw(over_stroke, 1e3 * loops.stroke, loops.force)
    style.dress(over_velocity, style.VELOCITY, style.FORCE)
    style.dress(over_stroke, style.STROKE, "")
    style.legend_beside(figure, lines, f"±{1e3 * AMPLITUDE:g} mm at")
    return figure


def _draw(axes: Axes, x: np.ndarray, force: np.ndarray) -> list[Any]:
    style.cross(axes)
    looks = [{"color": style.graded(i, len(x)), "linewidth": 1.6} for i in range(len(x))]
    drawn = [axes.plot(*pair, **look) for *pair, look in zip(x, force, looks, strict=True)]
    for (line,), frequency in zip(drawn, FREQUENCIES, strict=True):
        line.set_label(f"{frequency:g} Hz")
    return [line for (line,) in drawn]


def _save(figure: Figure, path: Path) -> None:
    from io import BytesIO

    from PIL import Image

    raw = BytesIO()
    figure.savefig(raw, dpi=120)
    Image.open(raw).convert("RGB").quantize(32).save(path, optimize=True)

"""Results for people: tables that know their units, and a report as one HTML file that needs nothing beside it."""

import base64
import csv
import html
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple


if TYPE_CHECKING:
    import matplotlib.figure


Cell = str | float | int | None


class Shown(float):
    """A number with the text that a reader is shown; files keep all its digits.

    >>> number = Shown(14361.2734, "14361")
    >>> f"{number:.4g}", str(number)
    ('14361', '14361.2734')
    """

    text: str

    def __new__(cls, value: float, text: str) -> "Shown":
        """The number, and its text."""
        self = super().__new__(cls, value)
        self.text = text
        return self

    def __format__(self, spec: str) -> str:
        return self.text


class Column(NamedTuple):
    """A column: its name, its unit, and how a number in it is written for reading."""

    name: str
    unit: str = ""
    spec: str = ".4g"

    @property
    def heading(self) -> str:
        """Name with unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def text(self, cell: Cell) -> str:
        """A cell for reading; nothing where there is no value."""
        if cell is None:
            return ""
        return cell if isinstance(cell, str) else format(cell, self.spec)


@dataclass(frozen=True)
class Table:
    """A table with a title, columns with units, and rows of words and numbers.

    >>> table = Table("Laws", (Column("law"), Column("RMSE", "N", ".1f")), (("linear", 88.93), ("besinger", 45.02)))
    >>> table.texts()
    [('linear', '88.9'), ('besinger', '45.0')]
    >>> print(table.to_csv().splitlines())
    ['law,RMSE [N]', 'linear,88.93', 'besinger,45.02']
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def texts(self) -> list[tuple[str, ...]]:
        """The rows for reading."""
        return [tuple(c.text(cell) for c, cell in zip(self.columns, row, strict=True)) for row in self.rows]

    def is_number(self, column: int) -> bool:
        """Whether a column holds numbers, to be set to the right."""
        return any(isinstance(row[column], float | int) for row in self.rows)

    def to_csv(self) -> str:
        """All digits, with headings that carry the units."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(column.heading for column in self.columns)
        writer.writerows(["" if cell is None else cell for cell in row] for row in self.rows)
        return out.getvalue()

    def to_html(self) -> str:
        """The rows for reading, as HTML."""
        sides = [' class="number"' if self.is_number(i) else "" for i in range(len(self.columns))]
        head = "".join(f"<th{s}>{html.escape(c.heading)}</th>" for c, s in zip(self.columns, sides, strict=True))
        lines = [
            "<tr>" + "".join(f"<td{s}>{html.escape(text)}</td>" for text, s in zip(row, sides, strict=True)) + "</tr>"
            for row in self.texts()
        ]
        caption = f"<caption>{html.escape(self.title)}</caption>"
        return "\n".join([f"<table>{caption}", f"<tr>{head}</tr>", *lines, "</table>"])


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 72em; margin: 2em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }}
caption {{ text-align: left; font-weight: 600; padding-bottom: 0.3em; }}
th, td {{ text-align: left; padding: 0.15em 0.8em; border-bottom: 1px solid #ddd; }}
.number {{ text-align: right; }}
img {{ max-width: 100%; }}
figure {{ margin: 1.5em 0; }}
figcaption {{ color: #555; }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


class Report:
    """Headings, sentences, tables and pictures in order, written as one HTML file."""

    def __init__(self, title: str) -> None:
        self.title = title
        self._blocks = [f"<h1>{html.escape(title)}</h1>"]

    def heading(self, text: str) -> None:
        """A section begins."""
        self._blocks.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, *sentences: str) -> None:
        """A paragraph."""
        self._blocks.append(f"<p>{html.escape(' '.join(sentences))}</p>")

    def points(self, items: Sequence[str]) -> None:
        """A list of remarks; nothing if it is empty."""
        if items:
            self._blocks.append("<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>")

    def table(self, table: Table) -> None:
        """A table."""
        self._blocks.append(table.to_html())

    def picture(self, figure: "matplotlib.figure.Figure", caption: str, path: str | os.PathLike[str]) -> None:
        """A figure, written to a PNG file and set into the report as well."""
        figure.savefig(path, dpi=150)
        data = base64.b64encode(Path(path).read_bytes()).decode("ascii")
        said = html.escape(caption)
        image = f'<img alt="{said}" src="data:image/png;base64,{data}">'
        self._blocks.append(f"<figure>{image}<figcaption>{said}</figcaption></figure>")

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the report."""
        path = Path(path)
        path.write_text(_PAGE.format(title=html.escape(self.title), body="\n".join(self._blocks)), encoding="utf-8")
        return path

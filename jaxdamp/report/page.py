"""A page of results: one self-contained HTML file, whose parts may fail by themselves."""

import base64
import datetime
import html
import io
import os
import platform
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np

from jaxdamp._display import display
from jaxdamp._second_process import elsewhere
from jaxdamp._tables import Table
from jaxdamp._types import Figure
from jaxdamp._warned import warn
from jaxdamp._words import first_upper, said, said_as_html


class Attempts:
    """Parts of the work that do not depend on one another.

    Arguments:
        check: called before each part; what it raises is raised, such as an interruption.
        message: what an error says, in words.

    Attributes:
        troubles: the parts that failed, completely or partly, and why, in words.
    """

    def __init__(self, check: Callable[[], object] = bool, message: Callable[[Exception], str] = str) -> None:
        self.troubles: list[str] = []
        self._check, self._message = check, message

    @contextmanager
    def part(self, what: str) -> Iterator[None]:
        """One part: any error in it is noted and not raised, so that the other parts are not lost."""
        self._check()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            try:
                yield
            except Exception as error:
                self.troubles.append(f"{what} could not be made: {self._message(error) or type(error).__name__}")
        told = [str(warning.message) for warning in caught if warning.category is UserWarning]
        self.troubles += [text for text in dict.fromkeys(told) if text not in self.troubles]


_FRAME = Path(__file__).with_name("page.html")  # its styles for screens, phones and paper, and links that open parts
COLOURS = 40  # of a picture: nobody sees the difference, and the file has a quarter of the size
DOTS = 130  # of a picture in an inch
PIXELS = 86  # of a page for an inch of a picture: the widest ones fill the page


class _Block(NamedTuple):
    """A part of a page with a picture that is still being drawn."""

    what: str  # of the page it is, for the case that it fails
    text: Callable[[], str]  # waits for it


class Page(TypedDict, total=False):
    """Keywords of all reports.

    Arguments:
        title: of the page; that of its kind if left out.
        folder: folder for the pictures as separate PNG files; without it they are only in the page.
        attempts: collects parts that fail, such as a picture, which are listed at the end; a new one if left out.
    """

    title: str
    folder: Path | None
    attempts: Attempts | None


PAGE: Page = {"title": "", "folder": None, "attempts": None}


class Report:
    """Headings, sentences, tables and pictures in order, written as one HTML file.

    Arguments:
        title: of the page.
        folder: as in `Page`, or a dictionary that takes the contents of the pictures by name.
        attempts: as in `Page`.
    """

    def __init__(
        self, title: str, folder: Path | dict[str, bytes] | None = None, attempts: Attempts | None = None
    ) -> None:
        self.title = said(title)
        self.attempts = Attempts() if attempts is None else attempts
        self._folder = folder
        self._headings: list[str] = []
        self._sheets: list[str | _Block] = []
        self._blocks: list[str | _Block] = []
        self._sections: list[list[str | _Block]] = []

    def heading(self, text: str) -> None:
        """Start a section; the page begins with links to all of them. Below a sheet sections are folded."""
        self._headings.append(said(display().words(text)))
        self._sections.append([])

    def sheet(self, figure: Callable[[], Figure], finding: str, name: str) -> None:
        """A sheet of one A4 page, which the page begins with; as PNG and PDF too if the report has a folder.

        Arguments:
            figure: draws it.
            finding: what it says, for those who cannot see it.
            name: of its files, such as "damper_sheet".
        """
        what, pdf = f"The sheet {name}.png", "" if self._folder is None else f"{name}.pdf"
        with self.part(what):
            image = self._image(figure(), finding, f"{name}.png", pdf)
            also = f'<figcaption>To print or to send: <a href="{pdf}">{pdf}</a></figcaption>' if pdf else ""
            self._sheets.append(_Block(what, lambda: f'<figure class="sheet">{image()}{also}</figure>'))

    def include(self, part: "Report") -> None:
        """Sheets and sections of another page, with its files and what failed there, at the end of this one's.

        Arguments:
            part: with a dictionary as its folder if this page has a folder.
        """
        part._settle()
        for name, content in part._folder.items() if isinstance(part._folder, dict) else ():
            self._write(name, content)
        self._sheets += part._sheets
        self._headings += part._headings
        self._sections += part._sections
        if part.attempts is not self.attempts:
            self.attempts.troubles += part.attempts.troubles

    def _write(self, name: str, content: bytes) -> None:
        if isinstance(self._folder, dict):
            self._folder[name] = content
        elif self._folder is not None:
            (self._folder / name).write_bytes(content)

    def __getstate__(self) -> dict[str, object]:
        """All of it with its pictures drawn, for another process."""
        self._settle()
        return vars(self)

    def _settle(self) -> None:
        for blocks in (self._sheets, self._blocks, *self._sections):
            blocks[:] = map(self._settled, blocks)

    def _add(self, block: "str | _Block") -> None:
        (self._sections[-1] if self._sections else self._blocks).append(block)

    def verdict(self, *sentences: str, more: Sequence[str] = ()) -> None:
        """The result in words, each sentence on a line, in a box; nothing if there are no words.

        Arguments:
            sentences: what the page says.
            more: what else is known of it, folded.
        """
        lines, folded = (
            "".join(f"<p>{first_upper(self._escaped(sentence, said))}</p>" for sentence in part if sentence)
            for part in (sentences, more)
        )
        lines += f"<details><summary>more</summary>{folded}</details>" if folded else ""
        if lines:
            self._add(f'<div class="verdict">{lines}</div>')

    def text(self, *sentences: str) -> None:
        """A paragraph; nothing if there are no words."""
        if any(sentences):
            self._add(f"<p>{self._escaped(' '.join(sentences))}</p>")

    def points(self, items: Sequence[str]) -> None:
        """A list of remarks; nothing if it is empty."""
        if items:
            self._add(_points([display().words(item) for item in items]))

    def _escaped(self, sentence: str, worded: Callable[[str], str] = str) -> str:
        return html.escape(worded(display().words(sentence)))

    def table(self, table: Table) -> None:
        """A table."""
        self._add(f'<div class="table">{table.to_html(words=True)}</div>')

    def part(self, what: str) -> AbstractContextManager[None]:
        """A part that may fail; the page then reports that `what` could not be made."""
        return self.attempts.part(what)

    def picture(self, figure: "Figure | Callable[[], Figure]", caption: str, name: str) -> None:
        """A figure, in the page and as a PNG file if the report has a folder; a failure is only reported.

        Arguments:
            figure: a figure, or a function that draws it, so that drawing may fail too.
            caption: below the figure.
            name: of the file, such as "ride.png".
        """
        what = f"The picture {name}"
        with self.part(what):
            words = said(display().words(caption))
            image = self._image(figure() if callable(figure) else figure, words, name)
            self._add(_Block(what, lambda: f"<figure>{image()}<figcaption>{html.escape(words)}</figcaption></figure>"))

    def _image(self, figure: Figure, words: str, name: str, pdf: str = "") -> Callable[[], str]:
        """A figure that is being drawn, as an element of the page, and as files if the report has a folder."""
        for axes in figure.axes:
            _ = axes.get_xlim(), axes.get_ylim()  # what they call when they change does not go with them
        width = round(PIXELS * figure.get_figwidth())
        drawing = elsewhere(drawn, figure, bool(pdf))

        def image(picture: Drawn) -> str:
            for text in picture.warnings:
                warn(text, UserWarning)
            self._write(name, picture.png)
            if pdf:
                self._write(pdf, picture.pdf)
            source = f"data:image/png;base64,{base64.b64encode(picture.png).decode('ascii')}"
            return f'<img alt="{html.escape(picture.finding or words)}" width="{width}" src="{source}">'

        if drawing is not None:
            return lambda: image(drawing())
        text = image(drawn(figure, bool(pdf)))
        return lambda: text

    def to_html(self, command: str = "") -> str:
        """The page.

        Arguments:
            command: the command that writes this page, for its last lines, which have date and versions.
        """
        self._settle()
        links = [f'<a href="#part-{n}">{html.escape(text)}</a>' for n, text in enumerate(self._headings, 1)]
        contents = [f"<nav>{' · '.join(links)}</nav>"] * (len(links) > 1)
        troubles = [_points(list(map(display().words, self.attempts.troubles)))] if self.attempts.troubles else []
        sections = [
            self._section(n, text, blocks)
            for n, (text, blocks) in enumerate(zip(self._headings, self._sections, strict=True), 1)
        ]
        top = [f"<h1>{html.escape(self.title)}</h1>", *self._sheets, *self._blocks, *contents]
        parts = ["<main>", *top, *sections, *troubles, "</main>", _footer(command)]
        head, foot = _FRAME.read_text(encoding="utf-8").split("{{body}}")
        return head.replace("{{title}}", html.escape(self.title)) + "\n".join(map(str, parts)) + foot

    def _settled(self, block: "str | _Block") -> str:
        """A block as text, once its picture is drawn; empty where that failed."""
        if isinstance(block, str):
            return block
        with self.part(block.what):
            return block.text()
        return ""

    def _section(self, number: int, title: str, blocks: Sequence[object]) -> str:
        """A section with its heading, folded below a sheet."""
        heading, body = f'<h2 id="part-{number}">{html.escape(title)}</h2>', "\n".join(map(str, blocks))
        return f"<details><summary>{heading}</summary>{body}</details>" if self._sheets else f"{heading}\n{body}"

    def write(self, path: str | os.PathLike[str], command: str = "") -> Path:
        """Write the page.

        Arguments:
            path: of the file.
            command: as in `to_html`.
        """
        path = Path(path)
        path.write_text(self.to_html(command), encoding="utf-8")
        return path


def _points(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{said_as_html(item)}</li>" for item in items) + "</ul>"


def _footer(command: str) -> str:
    """Date, versions, and the command that makes the page again."""
    library, *libraries = (f"{name} {_version(name)}" for name in ("jaxdamp", "jax", "equinox", "numpy", "scipy"))
    system = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    made = f"Written on {datetime.date.today()} by {library} ({', '.join(libraries)}, {system})."
    again = f" To repeat it:<pre>{html.escape(command)}</pre>" if command else ""
    return f"<footer>{html.escape(made)}{again}</footer>"


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:  # a source tree on the path, not installed
        return "of unknown version"


class Drawn(NamedTuple):
    """A picture as files, what its titles say, and what matplotlib warned of."""

    png: bytes
    pdf: bytes
    finding: str
    warnings: list[str]


_NO_GLYPH = re.compile(r"Glyph \d+ .*missing from ")  # a warning of matplotlib, for each letter
_BOXES = (
    "Letters that no font of this machine has are boxes in pictures: install a font with them, such as Noto Sans CJK."
)


def drawn(figure: Figure, as_pdf: bool) -> Drawn:
    """A figure drawn, as PDF too if it is asked for."""
    pdf = io.BytesIO()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        small = png(figure)
        if as_pdf:
            figure.savefig(pdf, format="pdf")
    texts = [str(warning.message) for warning in caught if warning.category is UserWarning]
    texts = list(dict.fromkeys(_BOXES if _NO_GLYPH.match(text) else text for text in texts))
    return Drawn(small, pdf.getvalue(), finding(figure), texts)


def png(figure: Figure) -> bytes:
    """A figure as a small PNG file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    small, canvas, dots = io.BytesIO(), figure.canvas, figure.dpi
    try:  # `savefig` draws twice, once for the layout, and packs what is unpacked here
        figure.dpi = DOTS
        agg = FigureCanvasAgg(figure)
        agg.draw()
        whole = Image.fromarray(np.asarray(agg.buffer_rgba()))
    finally:
        figure.set_canvas(canvas)
        figure.dpi = dots
    # Colours chosen from a ninth of the dots, as good, in a seventh of the time.
    whole, plain = whole.convert("RGB"), Image.Dither.NONE
    colours = whole.resize([size // 3 for size in whole.size], Image.Resampling.NEAREST)
    few = whole.quantize(palette=colours.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, 1, dither=plain), dither=plain)
    few.save(small, format="png", optimize=True)
    return small.getvalue()


def finding(figure: Figure) -> str:
    """What the title of a figure says, or the titles of its panels."""
    titles = [figure.get_suptitle(), *(axes.get_title(loc="left") for axes in figure.axes)]
    return ". ".join(" ".join(title.split()) for title in titles if title)

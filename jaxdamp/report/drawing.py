"""A figure of a page as files."""

import io
import warnings
from typing import NamedTuple

import numpy as np

from jaxdamp._types import Figure


COLOURS = 40  # of a picture: nobody sees the difference, and the file has a quarter of the size
DOTS = 130  # of a picture in an inch


class Drawn(NamedTuple):
    """A picture as files, what its titles say, and what matplotlib warned of."""

    png: bytes
    pdf: bytes
    finding: str
    warnings: list[str]


def drawn(figure: Figure, as_pdf: bool) -> Drawn:
    """A figure drawn, as PDF too if it is asked for."""
    pdf = io.BytesIO()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        small = png(figure)
        if as_pdf:
            figure.savefig(pdf, format="pdf")
    texts = [str(warning.message) for warning in caught if warning.category is UserWarning]
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

"""A figure with the letters of every language that the fonts of the machine have: loaded with the first picture."""

import functools

from matplotlib import figure
from matplotlib.backend_bases import RendererBase
from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.text import Text


EAST_ASIAN = (  # fonts of Linux, Windows and macOS, for what the chosen font lacks
    "Noto Sans CJK SC", "Noto Sans CJK JP", "Noto Sans CJK KR", "Noto Sans SC", "Noto Sans JP", "Noto Sans KR",
    "Source Han Sans SC", "WenQuanYi Zen Hei", "WenQuanYi Micro Hei", "Droid Sans Fallback", "IPAexGothic",
    "TakaoPGothic", "Microsoft YaHei", "SimHei", "Yu Gothic", "Meiryo", "MS Gothic", "Malgun Gothic",
    "PingFang SC", "Heiti SC", "Hiragino Sans", "Hiragino Sans GB", "Apple SD Gothic Neo", "Arial Unicode MS",
)  # fmt: skip


class Figure(figure.Figure):
    """A figure whose texts take letters that their font lacks from others that the machine has."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw it, with the fonts chosen for what is written by now."""
        for text in self.findobj(Text):
            assert isinstance(text, Text)
            if not text.get_text().isascii() and (others := _fallbacks(EAST_ASIAN)):
                properties = text.get_fontproperties()
                if _lacks(properties, text.get_text()):
                    own = [name for name in properties.get_family() if name not in others]
                    text.set_fontfamily([*own, *others])
        super().draw(renderer)


@functools.cache
def _fallbacks(names: tuple[str, ...]) -> tuple[str, ...]:
    """The fonts among these that the machine has."""
    present = {font.name for font in fontManager.ttflist}
    return tuple(name for name in names if name in present)


def _lacks(properties: FontProperties, text: str) -> bool:
    """Whether a font lacks a letter of a text."""
    font = get_font(findfont(properties))
    return any(not font.get_char_index(ord(letter)) for letter in set(text) if letter.isprintable())

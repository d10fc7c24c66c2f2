"""Blocks of numbers, each under the same header, in the lines of a text file or the rows of a sheet."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from jaxdamp.bench.layout import Layout, number, split
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.raw_tables import apart


Cells = Callable[[int], Sequence[str]]  # the cells of the line or row of a number, from 1


class Block(NamedTuple):
    """A header and its rows of numbers, all by number from 1.

    Attributes:
        behind: last row of numbers of the block before; 0 without one.
        header: row of the header.
        first: first row of numbers.
        end: last row of numbers; of the last block the last row of all.
    """

    behind: int
    header: int
    first: int
    end: int


def blocks_of(cells: Cells, count: int, header: int, first: int, like: Sequence[int], layout: Layout) -> list[Block]:
    """The blocks of some lines or rows: one, or one under each that is like the header.

    The numbers below each header must begin again: a header inside one record is a fault of the file. The first row of
    numbers is that of the header if there is none.
    """
    depth = first - header
    ends = [_end(cells, start + depth, stop - 1, layout) for start, stop in pairwise([*like, count + 1])]
    if not depth or not _begin_again(cells, [start + depth for start in like], ends, layout):
        return [Block(0, header, first, count)]
    behind, ends[-1] = [0, *ends[:-1]], count
    return [Block(b, start, start + depth, end) for b, start, end in zip(behind, like, ends, strict=True)]


def _end(cells: Cells, first: int, last: int, layout: Layout) -> int:
    """The number of the last row of numbers among these."""
    while last >= first and not layout.is_row(cells(last)):
        last -= 1
    return last


def _begin_again(cells: Cells, firsts: Sequence[int], ends: Sequence[int], layout: Layout) -> bool:
    """Whether every block has numbers, and begins with a smaller one than that with which the block before ends."""
    if any(end < first for first, end in zip(firsts, ends, strict=True)):
        return False
    last, first = ([_first_number(cells(row), layout) for row in rows] for rows in (ends[:-1], firsts[1:]))
    return all(a is not None and b is not None and a > b for a, b in zip(last, first, strict=True))


def _first_number(cells: Sequence[str], layout: Layout) -> float | None:
    return number(cells[layout.full[0]], layout.delimiter) if layout.full[0] < len(cells) else None


def title(preamble: Sequence[str], block: Block, line: int, layout: Layout) -> str:
    """What stands above the header of a block; the number of its line where nothing does."""
    words = [cell for cell in split(preamble[-1], layout.delimiter) if cell] if preamble else []
    return " ".join(words)[:60] or (f"line {line}" if block.behind else "first")


def named_apart(tables: Sequence[RawTable], whole: str) -> list[RawTable]:
    """The tables of blocks with names of their own; a single one has that of the whole, and needs none in a file."""
    if len(tables) == 1:
        return [replace(tables[0], record=whole)]
    said = f"one of {len(tables)} blocks of the file, each under a header of its own"
    names = apart([f"{whole} {table.record}".strip() for table in tables])
    return [replace(t, record=name, notes=(*t.notes, said)) for t, name in zip(tables, names, strict=True)]

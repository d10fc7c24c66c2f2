"""The points of a grid cut into blocks."""

import dataclasses
from typing import final

import numpy as np


LARGEST = 2**15  # points of a block: a quarter car of 10 s takes some seconds for so many
FEWEST = 16  # blocks of a large sweep, so that a few workers can share them
SMALLEST = 256  # points of a block of a small sweep, as many as a processor takes side by side


def block_size(count: int) -> int:
    """Points of a block. It depends on the size of the sweep alone, so that any machine goes on with any store.

    Arguments:
        count: number of points of the sweep.

    >>> block_size(1000), block_size(131_072), block_size(10**9)
    (256, 8192, 32768)
    """
    return min(max(2 ** (-(-count // FEWEST) - 1).bit_length(), SMALLEST), LARGEST)


@final
@dataclasses.dataclass(frozen=True)
class Blocks:
    """A grid cut into boxes of equal shape; those at the ends of the axes may be smaller.

    Attributes:
        shape: number of points along each axis.
        box: of a block.

    >>> blocks = Blocks.of((3, 4), 6)
    >>> blocks.box, blocks.count, blocks.indices(1)
    ((1, 4), 3, array([4, 5, 6, 7]))
    """

    shape: tuple[int, ...]
    box: tuple[int, ...]

    @classmethod
    def of(cls, shape: tuple[int, ...], size: int) -> "Blocks":
        """Blocks of at most `size` points, which run on along the last axes."""
        box, room = list(shape), size
        for axis in reversed(range(len(shape))):
            pieces = -(-shape[axis] // room)
            box[axis] = -(-shape[axis] // pieces)
            room = max(room // box[axis], 1)
        return cls(shape, tuple(box))

    @property
    def numbers(self) -> tuple[int, ...]:
        """Blocks along each axis."""
        return tuple(-(-n // b) for n, b in zip(self.shape, self.box, strict=True))

    @property
    def count(self) -> int:
        """Number of blocks."""
        return int(np.prod(self.numbers))

    def region(self, number: int) -> tuple[slice, ...]:
        """The part of the grid that a block covers."""
        places = np.unravel_index(number, self.numbers)
        ends = zip(places, self.box, self.shape, strict=True)
        return tuple(slice(int(i) * b, min((int(i) + 1) * b, n)) for i, b, n in ends)

    def size(self, number: int) -> int:
        """How many points a block has."""
        return int(np.prod([part.stop - part.start for part in self.region(number)]))

    def indices(self, number: int) -> np.ndarray:
        """The numbers of its points in the order of the grid, where the last axis runs fastest."""
        ranges = [np.arange(part.start, part.stop) for part in self.region(number)]
        return np.ravel_multi_index(np.ix_(*ranges), self.shape).ravel()

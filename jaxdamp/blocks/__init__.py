"""Independent work in blocks: a store on disk that says what is done, and the processes that compute the rest."""

from jaxdamp.blocks.running import AbstractWork as AbstractWork, Cluster as Cluster, fill as fill
from jaxdamp.blocks.store import (
    Blocks as Blocks,
    BlockStore as BlockStore,
    Variable as Variable,
    block_size as block_size,
    stored_blocks as stored_blocks,
)


__all__: list[str] = []

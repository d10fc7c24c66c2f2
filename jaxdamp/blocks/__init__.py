"""Independent work in blocks: a store on disk that says what is done, and the processes that compute the rest."""

from jaxdamp.blocks.cutting import Blocks as Blocks, block_size as block_size
from jaxdamp.blocks.running import AbstractWork as AbstractWork, Cluster as Cluster, fill as fill
from jaxdamp.blocks.store import (
    AbstractStore as AbstractStore,
    BlockStore as BlockStore,
    Variable as Variable,
    command_of as command_of,
    import_zarr as import_zarr,
    note_command as note_command,
    stored_blocks as stored_blocks,
)


__all__: list[str] = []

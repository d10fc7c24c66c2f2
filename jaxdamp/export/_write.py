"""Writing of files, completely or not at all."""

import os
from pathlib import Path

from jaxdamp import _checks


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Write a file under a temporary name, then rename it: a reader never gets an incomplete file."""
    target = Path(path).expanduser()
    if not target.parent.is_dir():
        _checks.refuse("path", "lie in a folder that exists", target, "Make the folder first.")
    draft = target.with_name(f".{target.name}.{os.getpid()}.draft")
    try:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(draft, target)
    finally:
        draft.unlink(missing_ok=True)
    return target

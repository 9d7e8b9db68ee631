"""A configuration file to spoil."""

from pathlib import Path


def spoil(path: Path, old: str, new: str) -> Path:
    """Replace a line's text, which must be there."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path

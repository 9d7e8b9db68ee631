"""Where the files are that come with chefbotd beside modules. It imports next to nothing: the first stop needs it."""

from pathlib import Path


def find_packaged(installed: str, sources: str) -> Path:
    """A folder of chefbotd's: by its name in the installed package, else by its name in the source tree."""
    package = Path(__file__).parent
    folder = package / installed
    return folder if folder.is_dir() else package.parent / sources


def packaged_folder() -> Path:
    """The folder of configurations."""
    return find_packaged("config", "config")

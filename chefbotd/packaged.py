"""Where the configurations are that come with chefbotd. It imports next to nothing: the first stop needs it."""

from pathlib import Path


def packaged_folder() -> Path:
    """The folder of configurations: in the installed package, or in the source tree."""
    package = Path(__file__).parent
    installed = package / "config"
    return installed if installed.is_dir() else package.parent / "config"

"""How a missing extra or add-on is added to the installation that this program runs in (docs/install.md)."""

import shlex
import sys
from pathlib import Path
from typing import Final

DEBIAN_PREFIX: Final = Path("/opt/chefbotd")
"""Where the Debian package has its environment, which holds no pip (packaging/deb/build)."""

PIPX_FILE: Final = "pipx_metadata.json"
"""What pipx leaves in each environment that it makes."""

PIPX_HOMES: Final = (Path.home() / ".local/share/pipx", Path.home() / ".local/pipx")
"""Where pipx keeps a user's environments, if PIPX_HOME says nothing else."""


def how_to_add_extra(extra: str, prefix: Path | None = None) -> str:
    """The command that adds an extra to the environment at ``prefix``; None: the one that runs."""
    prefix = prefix or Path(sys.prefix)
    if prefix == DEBIAN_PREFIX:
        return f"'make deb WITH={extra}' in a checkout of chefbotd, then 'sudo apt install' what it has built"
    return f"{_pip_install(prefix)} 'chefbotd[{extra}]'"


def how_to_add_folder(folder: str, prefix: Path | None = None, *, editable: bool = False) -> str:
    """The command that adds a package from its folder, such as an add-on, to the environment at ``prefix``."""
    prefix = prefix or Path(sys.prefix)
    quoted = "--editable " * editable + shlex.quote(folder)
    if prefix == DEBIAN_PREFIX:
        return f"python3 -m venv .venv && .venv/bin/pip install . {quoted} (not into the Debian package)"
    if (pipx := _pipx(prefix)) is not None:
        return f"{pipx} inject --include-apps {prefix.name} {quoted}"
    return f"{_pip_install(prefix)} {quoted}"


def pytest_of(prefix: Path) -> str:
    """The pytest that tests a package which ``how_to_add_folder`` has added with its extra ``test``."""
    return ".venv/bin/pytest" if prefix == DEBIAN_PREFIX else shlex.quote(str(prefix / "bin" / "pytest"))


def _pipx(prefix: Path) -> str | None:
    """The pipx that knows this environment; None where pipx did not make it."""
    if not (prefix / PIPX_FILE).exists():
        return None
    home = prefix.parent.parent
    return "pipx" if home in PIPX_HOMES else f"sudo PIPX_HOME={shlex.quote(str(home))} pipx"


def _pip_install(prefix: Path) -> str:
    """The pip of an environment, by its path: it need not be activated. An environment of uv has none of its own."""
    if (pipx := _pipx(prefix)) is not None:
        return f"{pipx} runpip {prefix.name} install"
    if not (prefix / "bin" / "pip").exists():
        return f"uv pip install --python {shlex.quote(str(prefix / 'bin' / 'python'))}"
    return f"{shlex.quote(str(prefix / 'bin' / 'pip'))} install"

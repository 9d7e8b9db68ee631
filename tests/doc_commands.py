"""The commands that the documentation writes in blocks for a shell: which they are, and which of them a test can run."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from chefbotd.core.record import Record

ROOT: Final = Path(__file__).parents[1]
PAGES: Final = (
    "README.md",
    "CONTRIBUTING.md",
    *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs").rglob("*.md"))),
    *(str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("addons/*/README.md"))),
    "examples/README.md",
    "firmware/README.md",
)
FENCE: Final = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

NOT_RUN: Final = {
    r"^sudo |^scp |^nano |^apt ": "changes this computer, or another one",
    r"^(\(umask .*sudo|export CHEFBOTCTL_TOKEN_FILE)": "of the service's tokens: tests/test_token_recipe.py",
    r"^(journalctl|systemctl) |^ls -l /dev/chefbot": "of a service that runs under systemd",
    r"^make\b": "a target of the Makefile: test_every_target_is_there",
    r"^chefbotctl --connect kitchen-bot": "tests/test_certificate_recipe.py",
    r"^chefbotctl (robots|--robot )": "other computers answer: tests/chefbotd/cli/look",
    r"^chefbotctl (teleop|joystick|pid tune|new-robot|map live|shell)": "asks at a terminal: tests/chefbotd/cli",
    r"^chefbotctl (doctor.* --motors|calibrate)": "asks for somebody who watches: tests/chefbotd/components",
    r"^chefbotctl doctor": "takes a board to itself: tests/chefbotd/components/doctor",
    r"^chefbotctl (go|patrol|home|localize|where|places)": "drives on a map: tests/chefbotd/components/navigation",
    r"^chefbotctl map (?!list)": "of maps that are driven and kept: tests/chefbotd/components/maps",
    r"^chefbotctl zones": "of a map that is in use: tests/chefbotd/components/zones",
    r"^chefbotctl camera": "of a robot with a camera: tests/chefbotd/components/camera",
    r"^chefbotctl (flash|ports .*--udev)": "a board is plugged in: tests/chefbotd/components/flash, doctor",
    r"^chefbotctl record (evening|drive)( --for 60s)?$": "until Ctrl-C: tests/chefbotd/components/recording",
    r"^chefbotctl log (plot|info|export) .*((?<!\$)FILE|2026|auto_)": "a file of yours: tests/test_first_steps.py",
    r"^chefbotd replay auto_|^cd ~/.local": "a file of yours: tests/test_first_steps.py",
    r"chefbotd run .*(--port|my-robot|r1.toml|--foxglove|--record)|^chefbotd check-config my-robot\.toml": (
        "a robot of yours: tests/chefbotd/cli/programs, tests/test_first_steps.py"
    ),
    r"^chefbotd notify": "tells servers of yours: tests/chefbotd/components/notifications",
    r"^chefbotctl log export --ros2": "an add-on's: addons/chefbot-ros2/tests",
    r"^chefbotctl sweep|^dask |^chefbot-|^curl |^python addons|pip install|^python3 -m venv|^pipx|pytest chefbot-trip": (
        "installs: packaging/release.py tries every distribution, tests/chefbotd/cli/programs the plug-in"
    ),
    r"python -m (benchmarks|chefbotd\.shared_clock)": "takes minutes: tests/benchmarks, test_shared_clock.py",
    r"^python3.11 -m venv /tmp/slim|^du ": "measures an installation",
}
"""What of a page is not run by ``test_pages_commands_run``, by the beginning of its line; and who tries it."""


class Line(Record, frozen=True):
    """A command as it stands in a page, without its comment, its prompt and the path of the environment."""

    page: str
    text: str

    @property
    def reason(self) -> str:
        """Why it is not run; empty where it is."""
        return next((why for pattern, why in NOT_RUN.items() if re.search(pattern, self.text)), "")


def blocks_of(page: str) -> Iterator[list[Line]]:
    """The commands of each block for a shell; what a command prints is left out."""
    for language, text in FENCE.findall((ROOT / page).read_text(encoding="utf-8")):
        if language not in ("sh", "console"):
            continue
        lines = text.replace("\\\n", " ").splitlines()
        if language == "console":
            lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        commands = [re.sub(r"(^|\s)#.*", "", line).strip().removeprefix(".venv/bin/") for line in lines]
        yield [Line(page, re.sub(r"\s+", " ", command)) for command in commands if command]


def commands_of(page: str) -> list[Line]:
    """All of them."""
    return [line for block in blocks_of(page) for line in block]


def runnable(page: str) -> list[list[Line]]:
    """The blocks of a page with the lines that are run."""
    blocks = [[line for line in block if not line.reason] for block in blocks_of(page)]
    return [block for block in blocks if block]

"""The recipe of docs/api.md for tokens under systemd, followed as far as it goes without systemd."""

import re
import stat
import subprocess
from pathlib import Path

import pytest

from chefbotd.cli.common.credentials import _token
from chefbotd.rpc.access import load_guard
from chefbotd.settings import load
from tests.robot_files import full

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "api.md"
pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not part of an installed package"
)
TOKENS = "/etc/chefbotd/tokens"


def recipe() -> str:
    """The section of the page."""
    return PAGE.read_text(encoding="utf-8").split("\n## Who may do what\n")[1].split("\n## ")[0]


def sh(command: str) -> None:
    """Run a line of the recipe, without the privileges that the user's own folder does not need."""
    subprocess.run(["sh", "-c", command.replace("sudo ", "")], check=True)


def test_the_recipe_leads_from_the_command_that_makes_tokens_to_a_client_that_is_let_in(
    tmp_path: Path,
) -> None:
    """Each line as it stands, with another folder: systemd's copy is readable for the daemon, the original for root.

    The client's file is made of the daemon's; each of the three roles gets what it is for.
    """
    made, credentials, client = tmp_path / "tokens", tmp_path / "credentials", tmp_path / "token"
    (make,) = re.findall(r"^    1 \$ (.+)$", recipe(), re.MULTILINE)
    sh(make.replace(TOKENS, str(made)))
    assert stat.S_IMODE(made.stat().st_mode) == 0o600

    (name, source) = re.findall(r"^ +LoadCredential=([\w.]+):(\S+)$", recipe(), re.MULTILINE)[0]
    assert source == TOKENS
    credentials.mkdir()
    (credentials / name).write_bytes(made.read_bytes())  # what systemd does, for the daemon's user alone

    config = tmp_path / "chefbot.toml"
    (key,) = re.findall(r'^ +(token_credential = "[^"]+")$', recipe(), re.MULTILINE)
    config.write_text(full().read_text().replace("[api]\n", f"[api]\n{key}\n"))
    guard = load_guard(load(config).api, {"CREDENTIALS_DIRECTORY": str(credentials)})
    assert guard.keyring is not None

    (copy,) = re.findall(r"^\$ (\(umask .+\))$", recipe(), re.MULTILINE)
    sh(copy.replace(TOKENS, str(made)).replace("~/.chefbot-token", str(client)))
    for file, role in ((client, "drive"), (made, "admin")):
        with file.open(encoding="utf-8") as text:
            assert guard.keyring.role_of(_token(text)) == role


def test_the_unit_says_the_same() -> None:
    """Its line is the one of the recipe."""
    unit = (ROOT / "config" / "chefbotd.service").read_text(encoding="utf-8")
    (line,) = re.findall(r"^ +(LoadCredential=\S+)$", recipe(), re.MULTILINE)
    assert f"\n{line}\n" in unit
    assert "User=chefbotd\n" in unit

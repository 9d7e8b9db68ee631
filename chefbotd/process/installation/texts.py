"""The content of the installed files: the unit, the robot's configuration, the tokens, the user."""

import re
import secrets
from pathlib import Path

CONFIGURATION = "/etc/chefbotd/chefbot.toml"
TOKENS = "/etc/chefbotd/tokens"
CREDENTIAL = "chefbotd.tokens"
DEVICE = "/dev/chefbot"
USER = "chefbotd"
SERIAL_GROUP = "dialout"

SYSUSERS = f"""# The user that the robot's daemon runs as: sysusers.d(5).
u {USER} - "chefbotd robot daemon" /var/lib/chefbotd /usr/sbin/nologin
m {USER} {SERIAL_GROUP}
"""


def unit(packaged: str, program: Path) -> str:
    """The systemd unit that comes with chefbotd, for this program."""
    start = f"ExecStart={_quoted(program)} run --config {CONFIGURATION}"
    return re.sub(r"^ExecStart=.*$", lambda _: start, packaged, count=1, flags=re.MULTILINE)


def configuration(packaged: str, *, with_page: bool) -> str:
    """A packaged robot's configuration for a service: the board by its stable name, tokens, and the page."""
    device = f'[link]\ndevice = "{DEVICE}"'
    text, replaced = re.subn(r'^\[link\]\ndevice = "[^"]*"', device, packaged, count=1, flags=re.MULTILINE)
    own = [] if replaced else [device]
    own.append(f'[api]\ntoken_credential = "{CREDENTIAL}"  # {TOKENS}, by way of the unit')
    if with_page:
        own.append("[page]\nenabled = true")
    return "\n\n".join([text.rstrip("\n"), *own]) + "\n"


def tokens() -> str:
    """A random token for each role."""
    lines = [f"{role} {secrets.token_hex(32)}\n" for role in ("admin", "drive", "agent", "guest", "observe")]
    return f"# ROLE TOKEN: whoever shows the token has the role. docs/api.md, 'Who may do what'.\n{''.join(lines)}"


def _quoted(program: Path) -> str:
    """A path, quoted as systemd.service(5) asks."""
    text = str(program).replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{text}"' if " " in text else text

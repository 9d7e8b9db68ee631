"""Which steps install chefbotd as a service, and which remove it, planned from what is there."""

import importlib.util
import re
import secrets
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from chefbotd.process.installation.steps import (
    Host,
    InstallationStep,
    command,
    file,
    folder,
    refuse_link,
    remove,
    write,
)
from chefbotd.settings import load, packaged

CONFIGURATION = "/etc/chefbotd/chefbot.toml"
TOKENS = "/etc/chefbotd/tokens"
CREDENTIAL = "chefbotd.tokens"
DEVICE = "/dev/chefbot"
USER = "chefbotd"
SERIAL_GROUP = "dialout"

SYSUSERS_TEXT = f"""# The user that the robot's daemon runs as: sysusers.d(5).
u {USER} - "chefbotd robot daemon" /var/lib/chefbotd /usr/sbin/nologin
m {USER} {SERIAL_GROUP}
"""

SERVICE = "chefbotd.service"
UNIT = f"/etc/systemd/system/{SERVICE}"
WANTED_BY = f"/etc/systemd/system/multi-user.target.wants/{SERVICE}"
RULE = "/etc/udev/rules.d/60-chefbot.rules"
SYSUSERS = "/etc/sysusers.d/chefbotd.conf"
FOLDER, STATE, CACHE, RUNTIME = "/etc/chefbotd", "/var/lib/chefbotd", "/var/cache/chefbotd", "/run/chefbotd"
UDEV = "/run/udev/control"
TOKEN_MODE = 0o600
LINKS = 8
"""A program may be a link to a link; a ring of them ends the search."""


class InstallRequest(Struct, frozen=True):
    """What to install: ``program`` is started with the configuration of ``robot``, or a copy of the file ``config``.

    The program's path is that of the system on which the service runs, whatever folder the installation goes to.
    ``start`` is whether to start it, now and at each boot.
    """

    program: Path
    robot: str = "chefbot"
    config: Path | None = None
    start: bool = True


def install(host: Host, request: InstallRequest) -> list[InstallationStep]:
    """Every step from a computer without the service to one on which it runs.

    Raises:
        SettingsError: the configuration, that which is there already or else the wanted one, is not valid.
    """
    steps = [file(host, SYSUSERS, SYSUSERS_TEXT), _user(host)]
    steps += [folder(host, FOLDER, 0o755), folder(host, STATE, 0o750, USER)]
    steps += _configuration(host, request)
    steps.append(_tokens(host))
    templates = packaged().parent
    rule = file(host, RULE, (templates / "60-chefbot.rules").read_text(encoding="utf-8"))
    steps.append(rule)
    steps += _named(host, rule)
    unit = file(host, UNIT, unit_text((templates / SERVICE).read_text(encoding="utf-8"), request.program))
    steps += _program(host, request.program)
    return [*steps, unit, *_daemon_reload(host, unit), *(_started(host, unit) if request.start else ())]


def _named(host: Host, rule: InstallationStep) -> Iterator[InstallationStep]:
    """Reload udev's rules, and apply them to boards that are plugged in. In a container this does nothing."""
    if rule.act is None or not host.is_running:
        return
    if not host.path(UDEV).exists():
        yield InstallationStep("udev is not running here, so its rule has no effect yet")
        return
    yield command(host, "have udev read the rule", "udevadm", "control", "--reload")
    doing = "apply the rule to the boards that are plugged in"
    yield command(host, doing, "udevadm", "trigger", "--subsystem-match=tty", "--action=add")


def _user(host: Host) -> InstallationStep:
    if host.has_user(USER) and host.is_in_group(USER, SERIAL_GROUP):
        return InstallationStep(f"user {USER}, in the group {SERIAL_GROUP}: unchanged")
    doing = f"create the system user {USER}, in the group {SERIAL_GROUP}"
    return command(host, doing, "systemd-sysusers", *_root_option(host), str(host.path(SYSUSERS)))


def _root_option(host: Host) -> tuple[str, ...]:
    return () if host.is_running else (f"--root={host.root}",)


def _configuration(host: Host, request: InstallRequest) -> Iterator[InstallationStep]:
    """Keep a configuration that exists, because people edit it. Otherwise install the robot's, or the named file."""
    path, source, with_page = host.path(CONFIGURATION), request.config, True
    if source is None:
        with_page = _has_page(host, request.program)
        text = configuration_text(packaged(request.robot).read_text(encoding="utf-8"), with_page=with_page)
    else:
        load(source)
        text = source.read_text(encoding="utf-8")
    if not path.exists():
        yield file(host, CONFIGURATION, text)
        if not with_page:
            yield InstallationStep(
                f"its page is off, because {request.program} has no extra 'page' yet: [page] enabled = true turns it on"
            )
        if source is not None:
            yield from _description(host, source)
        return
    load(path)
    if path.read_text(encoding="utf-8") == text:
        yield InstallationStep(f"{CONFIGURATION}: unchanged")
    else:
        yield InstallationStep(f"{CONFIGURATION}: kept as it is (edited, or another robot's)")


def _has_page(host: Host, program: Path) -> bool:
    """Whether the page's extra is where the program is: in this environment, or in one of another system."""
    if host.is_running:
        return importlib.util.find_spec("aiohttp") is not None
    inside = host.path(str(program))
    for _ in range(LINKS):  # a link's target is a path of that system
        if not inside.is_symlink():
            break
        inside = host.path(str(Path("/") / inside.parent.relative_to(host.root) / inside.readlink()))
    return any(inside.parent.parent.glob("lib/python3*/site-packages/aiohttp"))


def _program(host: Host, program: Path) -> Iterator[InstallationStep]:
    """A word about a program that the other system does not have yet."""
    inside = host.path(str(program))
    if not host.is_running and not inside.exists() and not inside.is_symlink():
        yield InstallationStep(f"{program}: not in {host.root} yet; the unit starts it, so install it there")


def _description(host: Host, source: Path) -> Iterator[InstallationStep]:
    """The URDF beside a configuration, if that names one by a relative path."""
    named = tomllib.loads(source.read_text(encoding="utf-8")).get("robot", {}).get("description")
    if isinstance(named, str) and not Path(named).is_absolute():
        yield file(host, f"{FOLDER}/{named}", (source.parent / named).read_text(encoding="utf-8"))


def _tokens(host: Host) -> InstallationStep:
    """Create the tokens once; existing ones stay valid."""
    path = host.path(TOKENS)
    refuse_link(path)
    if not path.exists():
        doing = f"write {TOKENS} ({TOKEN_MODE:04o}, root), a token for each role"
        return InstallationStep(doing, lambda: write(host, path, tokens_text(), TOKEN_MODE))
    if stat.S_IMODE(path.stat().st_mode) != TOKEN_MODE:
        return InstallationStep(f"let nobody but root read {TOKENS}", lambda: path.chmod(TOKEN_MODE))
    return InstallationStep(f"{TOKENS}: unchanged")


def _daemon_reload(host: Host, unit: InstallationStep) -> Iterator[InstallationStep]:
    if host.has_systemd and unit.act is not None:
        yield command(host, "have systemd read the unit", "systemctl", "daemon-reload")


def _started(host: Host, unit: InstallationStep) -> Iterator[InstallationStep]:
    if host.path(WANTED_BY).is_symlink():
        yield InstallationStep(f"{SERVICE} starts at boot: unchanged")
    else:
        yield command(host, "start it at boot", "systemctl", *_root_option(host), "enable", SERVICE)
    if not host.is_running:
        return
    if not host.has_systemd:
        yield InstallationStep("systemd does not run here: nothing was started; it starts with the next boot")
    elif not host.ask("systemctl", "is-active", "--quiet", SERVICE):
        yield command(host, "start it now", "systemctl", "start", SERVICE)
    elif unit.act is not None:
        yield command(host, "restart it, with the robot stopped", "systemctl", "restart", SERVICE)
    else:
        yield InstallationStep(f"{SERVICE} runs: unchanged")


def uninstall(host: Host, *, purge: bool) -> list[InstallationStep]:
    """Every step that removes the service; ``purge`` also removes configuration, tokens, maps and the user."""
    return [*_stopped(host), *_removed(host), *(_purged(host) if purge else _kept(host))]


def _stopped(host: Host) -> Iterator[InstallationStep]:
    enabled = host.path(WANTED_BY).is_symlink()
    if host.has_systemd and host.ask("systemctl", "is-active", "--quiet", SERVICE):
        yield command(host, "stop it, which stops the motors", "systemctl", "stop", SERVICE)
    if enabled:
        yield command(
            host, "no longer start it at boot", "systemctl", *_root_option(host), "disable", SERVICE
        )


def _removed(host: Host) -> Iterator[InstallationStep]:
    steps = {name: remove(host, name) for name in (UNIT, RULE, SYSUSERS)}
    yield from steps.values()
    if host.has_systemd and steps[UNIT].act is not None:
        yield command(host, "have systemd forget the unit", "systemctl", "daemon-reload")
    if host.is_running and steps[RULE].act is not None and host.path(UDEV).exists():
        yield command(host, "have udev forget the rule", "udevadm", "control", "--reload")


def _purged(host: Host) -> Iterator[InstallationStep]:
    for name in (FOLDER, STATE, CACHE, RUNTIME):
        yield remove(host, name)
    if not host.has_user(USER):
        yield InstallationStep(f"user {USER}: not there")
    else:
        root = () if host.is_running else ("--root", str(host.root))
        yield command(host, "remove the user", "userdel", *root, USER)


def _kept(host: Host) -> Iterator[InstallationStep]:
    for name, what in ((FOLDER, "configuration and tokens"), (STATE, "maps and recordings")):
        if host.path(name).exists():
            yield InstallationStep(f"{name}: kept ({what}); --purge removes it")


def unit_text(packaged: str, program: Path) -> str:
    """The systemd unit that comes with chefbotd, for this program."""
    start = f"ExecStart={_quoted(program)} run --config {CONFIGURATION}"
    return re.sub(r"^ExecStart=.*$", lambda _: start, packaged, count=1, flags=re.MULTILINE)


def configuration_text(packaged: str, *, with_page: bool) -> str:
    """A packaged robot's configuration for a service: the board by its stable name, tokens, and the page."""
    device = f'[link]\ndevice = "{DEVICE}"'
    text, replaced = re.subn(r'^\[link\]\ndevice = "[^"]*"', device, packaged, count=1, flags=re.MULTILINE)
    own = [] if replaced else [device]
    own.append(f'[api]\ntoken_credential = "{CREDENTIAL}"  # {TOKENS}, by way of the unit')
    if with_page:
        own.append("[page]\nenabled = true")
    return "\n\n".join([text.rstrip("\n"), *own]) + "\n"


def tokens_text() -> str:
    """A random token for each role."""
    lines = [f"{role} {secrets.token_hex(32)}\n" for role in ("admin", "drive", "agent", "guest", "observe")]
    return f"# ROLE TOKEN: whoever shows the token has the role. docs/api.md, 'Who may do what'.\n{''.join(lines)}"


def _quoted(program: Path) -> str:
    """A path, quoted as systemd.service(5) asks."""
    text = str(program).replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{text}"' if " " in text else text

"""Which steps install chefbotd as a service, and which remove it, planned from what is there."""

import importlib.util
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from chefbotd.process.installation import texts
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
    steps = [file(host, SYSUSERS, texts.SYSUSERS), _user(host)]
    steps += [folder(host, FOLDER, 0o755), folder(host, STATE, 0o750, texts.USER)]
    steps += _configuration(host, request)
    steps.append(_tokens(host))
    templates = packaged().parent
    rule = file(host, RULE, (templates / "60-chefbot.rules").read_text(encoding="utf-8"))
    steps.append(rule)
    steps += _named(host, rule)
    unit = file(host, UNIT, texts.unit((templates / SERVICE).read_text(encoding="utf-8"), request.program))
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
    if host.has_user(texts.USER) and host.is_in_group(texts.USER, texts.SERIAL_GROUP):
        return InstallationStep(f"user {texts.USER}, in the group {texts.SERIAL_GROUP}: unchanged")
    doing = f"create the system user {texts.USER}, in the group {texts.SERIAL_GROUP}"
    return command(host, doing, "systemd-sysusers", *_root_option(host), str(host.path(SYSUSERS)))


def _root_option(host: Host) -> tuple[str, ...]:
    return () if host.is_running else (f"--root={host.root}",)


def _configuration(host: Host, request: InstallRequest) -> Iterator[InstallationStep]:
    """Keep a configuration that exists, because people edit it. Otherwise install the robot's, or the named file."""
    path, source, with_page = host.path(texts.CONFIGURATION), request.config, True
    if source is None:
        with_page = _has_page(host, request.program)
        text = texts.configuration(packaged(request.robot).read_text(encoding="utf-8"), with_page=with_page)
    else:
        load(source)
        text = source.read_text(encoding="utf-8")
    if not path.exists():
        yield file(host, texts.CONFIGURATION, text)
        if not with_page:
            yield InstallationStep(
                f"its page is off, because {request.program} has no extra 'page' yet: [page] enabled = true turns it on"
            )
        if source is not None:
            yield from _description(host, source)
        return
    load(path)
    if path.read_text(encoding="utf-8") == text:
        yield InstallationStep(f"{texts.CONFIGURATION}: unchanged")
    else:
        yield InstallationStep(f"{texts.CONFIGURATION}: kept as it is (edited, or another robot's)")


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
    path = host.path(texts.TOKENS)
    refuse_link(path)
    if not path.exists():
        doing = f"write {texts.TOKENS} ({TOKEN_MODE:04o}, root), a token for each role"
        return InstallationStep(doing, lambda: write(host, path, texts.tokens(), TOKEN_MODE))
    if stat.S_IMODE(path.stat().st_mode) != TOKEN_MODE:
        return InstallationStep(f"let nobody but root read {texts.TOKENS}", lambda: path.chmod(TOKEN_MODE))
    return InstallationStep(f"{texts.TOKENS}: unchanged")


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
    if not host.has_user(texts.USER):
        yield InstallationStep(f"user {texts.USER}: not there")
    else:
        root = () if host.is_running else ("--root", str(host.root))
        yield command(host, "remove the user", "userdel", *root, texts.USER)


def _kept(host: Host) -> Iterator[InstallationStep]:
    for name, what in ((FOLDER, "configuration and tokens"), (STATE, "maps and recordings")):
        if host.path(name).exists():
            yield InstallationStep(f"{name}: kept ({what}); --purge removes it")

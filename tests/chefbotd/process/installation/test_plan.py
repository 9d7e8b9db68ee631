"""The service installed into a folder, and removed from it; commands are kept instead of run."""

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from chefbotd.process.installation import plan
from chefbotd.process.installation.steps import CommandEnded, Host, InstallationStep, InstallError, carry_out
from chefbotd.rpc.access import Keyring
from chefbotd.rpc.parameters import Role
from chefbotd.settings import SettingsError, load, packaged
from tests.robot_files import full

PROGRAM = Path("/opt/chefbotd/bin/chefbotd")
ENABLE = ("systemctl", "enable")


@dataclass
class Computer:
    """A folder as a root, where commands have the effect of the real ones on files; ``fails`` names one that fails."""

    root: Path
    fails: str = "-"
    active: bool = False
    ran: list[tuple[str, ...]] = field(default_factory=list)
    owners: dict[str, str] = field(default_factory=dict)

    @property
    def host(self) -> Host:
        """This computer."""
        return Host(self.root, self.run, self.chown)

    def run(self, command: tuple[str, ...]) -> CommandEnded:
        """Keep it, and do what it does to the files."""
        self.ran.append(command)
        if command[0] == self.fails:
            return CommandEnded(3, "it is broken")
        if command[0] == "systemd-sysusers":
            etc = self.root / "etc"
            (etc / "passwd").write_text("root:x:0:0::/root:/bin/sh\nchefbotd:x:998:997::/:/bin/false\n")
            (etc / "group").write_text("root:x:0:\ndialout:x:20:ann,chefbotd\nchefbotd:x:997:\n")
        if "enable" in command:
            link = self.root / plan.WANTED_BY.removeprefix("/")
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(plan.UNIT)
        if "disable" in command:
            (self.root / plan.WANTED_BY.removeprefix("/")).unlink()
        return CommandEnded(0)

    def chown(self, path: Path, user: str, group: str) -> None:
        """Keep it."""
        assert user == group
        self.owners[f"/{path.relative_to(self.root)}"] = user

    def install(self, robot: str = "chefbot", config: Path | None = None) -> list[InstallationStep]:
        """Install, and return the steps."""
        steps = plan.install(self.host, plan.InstallRequest(PROGRAM, robot, config))
        carry_out(steps, lambda step: None)
        return steps

    def uninstall(self, *, purge: bool = False) -> list[InstallationStep]:
        """Remove, and return the steps."""
        steps = plan.uninstall(self.host, purge=purge)
        carry_out(steps, lambda step: None)
        return steps

    def text(self, name: str) -> str:
        """A file's text."""
        return (self.root / name.removeprefix("/")).read_text()

    def files(self) -> Mapping[str, tuple[int, bytes]]:
        """Every file that was installed, with its mode and content."""
        return {
            str(path): (path.stat().st_mode, path.read_bytes())
            for path in sorted(self.root.rglob("*"))
            if path.is_file() and not path.is_relative_to(self.root / "opt")
        }


@pytest.fixture
def computer(tmp_path: Path) -> Computer:
    """One that has the program, with the page's extra, and no service."""
    (tmp_path / "etc").mkdir()
    program = tmp_path / PROGRAM.relative_to("/")
    (program.parent.parent / "lib/python3.11/site-packages/aiohttp").mkdir(parents=True)
    program.parent.mkdir()
    program.touch()
    return Computer(tmp_path)


def test_everything_that_the_service_needs_is_there(computer: Computer):
    """Folders with modes and owners, tokens that only root can read, the rule, and the unit with the program's path."""
    computer.install()
    assert (
        "\nExecStart=/opt/chefbotd/bin/chefbotd run --config /etc/chefbotd/chefbot.toml\n"
        in computer.text(plan.UNIT)
    )
    assert 'SYMLINK+="chefbot"' in computer.text(plan.RULE)
    state, tokens = computer.root / "var/lib/chefbotd", computer.root / "etc/chefbotd/tokens"
    assert stat.S_IMODE(state.stat().st_mode) == 0o750
    assert stat.S_IMODE(tokens.stat().st_mode) == 0o600
    assert computer.owners["/var/lib/chefbotd"] == "chefbotd"
    assert computer.owners["/etc/chefbotd"] == "root"
    assert (computer.root / plan.WANTED_BY.removeprefix("/")).is_symlink()


def test_the_tokens_open_the_socket_one_for_each_role(computer: Computer):
    """Each is new in each installation."""
    computer.install()
    text = computer.text(plan.TOKENS)
    ring = Keyring.parse(text, "tokens")
    roles = dict(line.split() for line in text.splitlines() if not line.startswith("#"))
    assert {ring.role_of(token) for token in roles.values()} == set(Role)
    assert plan.tokens_text() != text


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_the_installed_configuration_is_the_robots_with_the_services_device_and_tokens(
    computer: Computer, robot: str
):
    """It is valid, and differs from the packaged one in these only."""
    computer.install(robot)
    mine, theirs = load(computer.root / "etc/chefbotd/chefbot.toml"), load(packaged(robot))
    assert mine.link.device == "/dev/chefbot"
    assert mine.api.token_credential == "chefbotd.tokens"
    assert mine.page.enabled
    same = {"device": theirs.link.device}
    assert mine.link.model_copy(update=same) == theirs.link
    for section in ("chassis", "pid", "limits", "safety", "encoders"):
        assert getattr(mine, section) == getattr(theirs, section)


def test_the_second_time_nothing_changes(computer: Computer):
    """Every step says so, none does anything, and no file is touched."""
    computer.install()
    before, ran = computer.files(), len(computer.ran)
    steps = computer.install()
    assert [step.told.rpartition(": ")[2] for step in steps] == ["unchanged"] * len(steps)
    assert all(step.act is None for step in steps)
    assert (computer.files(), len(computer.ran)) == (before, ran)


def test_planning_changes_nothing_and_tells_what_is_done_then(computer: Computer):
    """A dry run's list is that of the installation, line by line; it runs no command and writes no file."""
    planned = [step.told for step in plan.install(computer.host, plan.InstallRequest(PROGRAM))]
    assert not computer.ran
    assert not computer.files()
    assert [step.told for step in computer.install()] == planned
    removed = [step.told for step in plan.uninstall(computer.host, purge=True)]
    assert [step.told for step in computer.uninstall(purge=True)] == removed


def test_a_configuration_that_was_edited_is_kept(computer: Computer):
    """It stays byte for byte, also when another robot is asked for, and its step says so."""
    computer.install()
    path = computer.root / "etc/chefbotd/chefbot.toml"
    path.write_text(path.read_text().replace("track_width_m = 0.3\n", "track_width_m = 0.31\n"))
    before = path.read_bytes()
    steps = computer.install("khan")
    assert path.read_bytes() == before
    assert "/etc/chefbotd/chefbot.toml: kept as it is (edited, or another robot's)" in [s.told for s in steps]


def test_a_configuration_that_is_not_valid_is_told_before_anything_is_done(computer: Computer):
    """The service could not start with it: neither with the one that is there nor with the one that is offered."""
    own = computer.root / "own.toml"
    own.write_text(full().read_text().replace("track_width_m = 0.3\n", "track_width_m = -0.3\n"))
    with pytest.raises(SettingsError, match="track_width_m"):
        plan.install(computer.host, plan.InstallRequest(PROGRAM, config=own))
    computer.install()
    (computer.root / "etc/chefbotd/chefbot.toml").write_text("[robot")
    with pytest.raises(SettingsError, match="not valid TOML"):
        plan.install(computer.host, plan.InstallRequest(PROGRAM))


def test_a_configuration_of_ones_own_is_copied_with_its_description(computer: Computer):
    """As it stands, comments and all; the URDF beside it comes to lie beside the copy."""
    from chefbotd.settings.urdf import urdf_of

    own = computer.root / "own"
    own.mkdir()
    (own / "mine.urdf").write_text(urdf_of(load()))
    text = full().read_text().replace('# description = "my.urdf"', 'description = "mine.urdf"')
    (own / "robot.toml").write_text(text)
    computer.install(config=own / "robot.toml")
    assert computer.text(plan.CONFIGURATION) == text
    assert load(computer.root / "etc/chefbotd/chefbot.toml").robot.description is not None


def test_a_unit_of_an_older_version_is_replaced_and_tokens_that_others_can_read_are_closed(
    computer: Computer,
):
    """What is installed is brought to what it should be; the tokens themselves stay."""
    computer.install()
    tokens = computer.root / "etc/chefbotd/tokens"
    before = tokens.read_text()
    tokens.chmod(0o644)
    (computer.root / plan.UNIT.removeprefix("/")).write_text("[Service]\nExecStart=/usr/bin/other\n")
    told = [step.told for step in computer.install() if step.act is not None]
    assert told == [
        "let nobody but root read /etc/chefbotd/tokens",
        "replace /etc/systemd/system/chefbotd.service",
    ]
    assert (stat.S_IMODE(tokens.stat().st_mode), tokens.read_text()) == (0o600, before)
    assert "/opt/chefbotd/bin/chefbotd" in computer.text(plan.UNIT)


def test_a_command_that_fails_ends_the_installation_with_its_words(computer: Computer):
    """The steps after it are not done."""
    computer.fails = "systemd-sysusers"
    with pytest.raises(InstallError, match=r"systemd-sysusers .* failed with 3: it is broken"):
        computer.install()
    assert not (computer.root / "etc/chefbotd").exists()


def test_what_is_removed_and_what_stays(computer: Computer):
    """Unit, rule and link go; configuration, tokens and maps stay until they are purged; then nothing is left."""
    computer.install()
    steps = computer.uninstall()
    assert not (computer.root / plan.UNIT.removeprefix("/")).exists()
    assert not (computer.root / plan.WANTED_BY.removeprefix("/")).is_symlink()
    assert computer.text(plan.CONFIGURATION)
    assert "/etc/chefbotd: kept (configuration and tokens); --purge removes it" in [s.told for s in steps]
    computer.uninstall(purge=True)
    assert not (computer.root / "etc/chefbotd").exists()
    assert not (computer.root / "var/lib/chefbotd").exists()
    assert computer.ran[-1][0] == "userdel"
    assert all(step.act is None for step in plan.uninstall(computer.host, purge=False))


class Running(Host):
    """A folder that stands for the system that runs."""

    @property
    def is_running(self) -> bool:
        """It does."""
        return True

    def owner(self, path: Path) -> str:
        """As it should be."""
        return "chefbotd" if path.name == "chefbotd" and path.parent.name == "lib" else "root"


def test_on_the_running_system_udev_and_systemd_are_told_and_the_service_starts(tmp_path: Path):
    """Once: the second time it runs, and nothing is told to anybody."""
    (tmp_path / "etc").mkdir()
    (tmp_path / "run/udev").mkdir(parents=True)
    (tmp_path / "run/systemd/system").mkdir(parents=True)
    (tmp_path / "run/udev/control").touch()
    computer = Computer(tmp_path)

    def run(command: tuple[str, ...]) -> CommandEnded:
        if "is-active" in command:
            return CommandEnded(0 if computer.active else 3)
        computer.active = computer.active or "start" in command
        return computer.run(command)

    host = Running(tmp_path, run, computer.chown)
    carry_out(plan.install(host, plan.InstallRequest(PROGRAM)), lambda step: None)
    assert [command[:2] for command in computer.ran] == [
        ("systemd-sysusers", str(tmp_path / "etc/sysusers.d/chefbotd.conf")),
        ("udevadm", "control"),
        ("udevadm", "trigger"),
        ("systemctl", "daemon-reload"),
        ("systemctl", "enable"),
        ("systemctl", "start"),
    ]
    again = plan.install(host, plan.InstallRequest(PROGRAM))
    assert all(step.act is None for step in again)
    assert again[-1].told == "chefbotd.service runs: unchanged"
    moved = plan.install(host, plan.InstallRequest(Path("/opt/new place/chefbotd")))
    assert [step.told for step in moved if step.act is not None][-1].endswith(
        "systemctl restart chefbotd.service"
    )


def test_where_udev_does_not_run_it_is_told_nothing(tmp_path: Path):
    """In a container: the rule is there all the same, and its step says so."""
    (tmp_path / "etc").mkdir()
    computer = Computer(tmp_path)
    steps = plan.install(Running(tmp_path, computer.run, computer.chown), plan.InstallRequest(PROGRAM))
    carry_out(steps, lambda step: None)
    assert "udev is not running here, so its rule has no effect yet" in [step.told for step in steps]
    assert not any(command[0] == "udevadm" for command in computer.ran)


def test_where_systemd_does_not_run_nothing_is_said_to_be_started(tmp_path: Path):
    """In a chroot systemctl answers 0 and starts nothing: what is said is that the service begins with the next boot."""
    (tmp_path / "etc").mkdir()
    computer = Computer(tmp_path)
    host = Running(tmp_path, computer.run, computer.chown)
    for _ in range(2):
        steps = plan.install(host, plan.InstallRequest(PROGRAM))
        carry_out(steps, lambda step: None)
        assert steps[-1].told == (
            "systemd does not run here: nothing was started; it starts with the next boot"
        )
    carry_out(plan.uninstall(host, purge=False), lambda step: None)
    assert [command[:2] for command in computer.ran if command[0] == "systemctl"] == [
        ("systemctl", "enable"),
        ("systemctl", "disable"),
    ]


def test_without_a_start_nothing_is_enabled_and_what_runs_goes_on(tmp_path: Path):
    """An upgrade of a package: the unit is new and read, and whether it runs is as it was."""
    (tmp_path / "etc").mkdir()
    (tmp_path / "run/systemd/system").mkdir(parents=True)
    computer = Computer(tmp_path)
    host = Running(tmp_path, computer.run, computer.chown)
    carry_out(plan.install(host, plan.InstallRequest(PROGRAM, start=False)), lambda step: None)
    assert [command[:2] for command in computer.ran][-1] == ("systemctl", "daemon-reload")


def test_a_path_is_quoted_as_systemd_reads_it():
    """Spaces, and what systemd would take for a specifier or a variable."""
    line = plan.unit_text("ExecStart=/old run\n", Path("/opt/my robots/100% $HOME/chefbotd"))
    assert (
        line == 'ExecStart="/opt/my robots/100%% $$HOME/chefbotd" run --config /etc/chefbotd/chefbot.toml\n'
    )


@pytest.mark.parametrize("name", ["/var/lib/chefbotd", "/etc/chefbotd", "/etc/chefbotd/tokens"])
def test_what_a_link_leads_to_is_not_given_away(computer: Computer, name: str) -> None:
    """A link where a folder or the tokens belong is refused by name, and its target keeps its mode and its owner."""
    target = computer.root / "home"
    target.mkdir(mode=0o700)
    link = computer.root / name.removeprefix("/")
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(target)
    with pytest.raises(InstallError, match=f"{name} is a symbolic link to .*home"):
        computer.install()
    assert stat.S_IMODE(target.stat().st_mode) == 0o700
    assert "/home" not in computer.owners


def test_the_owner_of_a_link_is_the_links_own(computer: Computer) -> None:
    """One that is put there at the last moment: nobody gets what it leads to."""
    etc = computer.root / "etc"
    (etc / "passwd").write_text(f"root:x:0:0::/root:/bin/sh\nme:x:{os.getuid()}:{os.getgid()}::/:/bin/sh\n")
    (etc / "group").write_text(f"me:x:{os.getgid()}:\n")
    link = computer.root / "link"
    link.symlink_to(computer.root / "nowhere")
    Host(computer.root, computer.run).give(link, "me", "me")  # it would fail if it followed the link

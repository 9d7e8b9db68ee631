"""Finding the configuration that the running daemon, or the service, has."""

from pathlib import Path

from chefbotd.components.doctor.cli.host import RunningDaemon, config_of_unit, running_daemons


def process(proc: Path, pid: int, *words: str) -> None:
    """A process with this command line."""
    (proc / str(pid)).mkdir(parents=True)
    (proc / str(pid) / "cmdline").write_bytes("\0".join(words).encode() + b"\0")


def test_running_daemons(tmp_path: Path):
    """By their command lines, however they were started; other programs and commands are none."""
    process(
        tmp_path, 11, "/usr/bin/python3", "/usr/bin/chefbotd", "run", "--config", "/etc/chefbotd/robot.toml"
    )
    process(
        tmp_path,
        12,
        "python",
        "-m",
        "chefbotd.cli.programs.chefbotd",
        "run",
        "--listen",
        "127.0.0.1:7444",
        "--config=khan",
    )
    process(tmp_path, 13, "/usr/bin/chefbotd", "simulate")
    process(tmp_path, 14, "vi", "run")
    (tmp_path / "locks").touch()
    assert running_daemons(tmp_path) == [
        RunningDaemon(11, "/etc/chefbotd/robot.toml"),
        RunningDaemon(12, "khan", "127.0.0.1:7444"),
    ]


def test_the_services_configuration():
    """As systemctl shows ExecStart; without an option there is none."""
    shown = "{ path=/opt/chefbotd ; argv[]=/opt/chefbotd run --config /etc/chefbotd/robot.toml ; ignore_errors=no }"
    assert config_of_unit(shown) == "/etc/chefbotd/robot.toml"
    assert config_of_unit("argv[]=/opt/bin/chefbotd run ;") == ""

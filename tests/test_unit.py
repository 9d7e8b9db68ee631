"""The systemd unit: how little it may do, and that it never gives up."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from chefbotd.cli.common.exits import Exit

UNIT = Path(__file__).parents[1] / "config" / "chefbotd.service"
MOST_EXPOSED = 2.0


def said(key: str) -> list[str]:
    """The values of a key, in order."""
    return re.findall(rf"^{key}=(.*)$", UNIT.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_the_unit_is_sandboxed_to_an_exposure_of_two():
    """By systemd's own measure, 0 to 10; it was 9.2 before there was a sandbox."""
    measured = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", str(UNIT)],
        capture_output=True,
        text=True,
        check=True,
    )
    (exposure,) = re.findall(r"Overall exposure level for chefbotd.service: ([\d.]+)", measured.stdout)
    assert float(exposure) <= MOST_EXPOSED


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_systemd_finds_nothing_wrong_with_the_unit(tmp_path: Path):
    """No key and no value that it does not know, but for the two that are newer than Debian 12's systemd."""
    unit = tmp_path / "chefbotd.service"
    unit.write_text(re.sub(r"(?m)^ExecStart=\S+", "ExecStart=/bin/true", UNIT.read_text(encoding="utf-8")))
    verified = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True)
    newer = re.compile(r"Unknown key( name)? '(RestartSteps|RestartMaxDelaySec)'")
    found = [line for line in verified.stderr.splitlines() if unit.name in line and not newer.search(line)]
    assert found == []


def test_the_unit_never_gives_up_for_good_and_waits_longer_each_time():
    """Whatever ended the daemon, it is started again, without a limit; from 1 s to 30 s where systemd can."""
    assert said("Restart") == ["always"]
    assert said("StartLimitIntervalSec") == ["0"]
    assert (said("RestartSec"), said("RestartSteps"), said("RestartMaxDelaySec")) == (["1"], ["6"], ["30"])


def test_what_does_not_mend_itself_is_not_tried_again():
    """A configuration that is not valid, or an extra that it needs and is not installed: by the exit codes for them."""
    expected = [str(int(code)) for code in (Exit.NOT_INSTALLED, Exit.BAD_CONFIGURATION)]
    assert said("RestartPreventExitStatus") == [" ".join(expected)]


def test_the_unit_is_watched_and_reloads_by_sighup():
    """The daemon says that it is ready, that it lives, and reads its configuration again when it is told to."""
    assert (said("Type"), said("WatchdogSec")) == (["notify"], ["5"])
    assert said("ExecReload") == ["/bin/kill -HUP $MAINPID"]


def test_the_compiler_of_numba_may_run():
    """Memory that is written and then executed: SLAM in the worker is compiled as it starts (docs/service.md)."""
    assert not said("MemoryDenyWriteExecute")

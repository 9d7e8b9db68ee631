"""The recipe of docs/service.md for a certificate, followed as far as it goes without systemd."""

import http.client
import os
import re
import shutil
import signal
import ssl
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from chefbotd.rpc.access import AccessError, load_guard
from chefbotd.settings import load, packaged
from chefbotd.transport.ports import reserve_port
from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "service.md"
pytestmark = [
    pytest.mark.skipif(not PAGE.exists(), reason="the documentation is not part of an installed package"),
    pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed"),
]
FOLDER = "/etc/chefbotd"


def recipe() -> str:
    """The section of the page."""
    return PAGE.read_text(encoding="utf-8").split("\n## With a certificate\n")[1].split("\n## ")[0]


def configured(folder: Path) -> Path:
    """The robot's configuration with the page's lines, after the page's command has made the certificate."""
    (make,) = re.findall(r"^sudo (openssl (?:.+\\\n)+.+)$", recipe(), re.MULTILINE)
    subprocess.run(
        ["sh", "-c", make.replace(FOLDER, str(folder)).replace("192.168.7.31", "127.0.0.1")],
        check=True,
        capture_output=True,
    )
    (keys,) = re.findall(r"```toml\n(.*?)```", recipe(), re.DOTALL)
    (folder / "tokens").touch(0o600)
    (folder / "tokens").write_text(f"drive {'x' * 40}\n")
    keys += f'token_file = "{folder / "tokens"}"\n'
    config = folder / "chefbot.toml"
    config.write_text(f'extends = "chefbot"\n{keys.replace(FOLDER, str(folder))}')
    return config


def test_the_command_makes_a_certificate_that_the_daemon_takes(tmp_path: Path) -> None:
    """Its key is private as it is made, and the configuration's lines are valid beside a packaged robot's."""
    guard = load_guard(load(configured(tmp_path)).api, {})
    assert guard.tls is not None
    (tmp_path / "robot.key").chmod(0o644)
    with pytest.raises(AccessError, match=r"robot\.key"):
        load_guard(load(tmp_path / "chefbot.toml").api, {})
    assert load(packaged()).api.tls_certificate is None


@pytest.mark.slow
@pytest.mark.realtime
def test_a_client_with_the_certificate_and_the_token_reaches_the_robot(tmp_path: Path) -> None:
    """By --ca, as the page writes it, and in a browser by the name; without --ca the message names what is missing."""
    config, port = configured(tmp_path), reserve_port()
    (ask,) = re.findall(r"^chefbotctl (--connect .+)$", recipe(), re.MULTILINE)
    words = (
        ask.replace("kitchen-bot.local:7333", f"127.0.0.1:{port}")
        .replace("robot.pem", "{ca}")
        .replace("~/.", ".")
    )
    (tmp_path / ".chefbot-token").write_text(f"drive {'x' * 40}\n")
    program = (sys.executable, "-m", "chefbotd.cli.programs.chefbotd")
    daemon = (*program, "run", "--sim", "--config", str(config), "--listen", f"127.0.0.1:{port}")
    page_port = reserve_port()
    environment = {
        **os.environ,
        "XDG_STATE_HOME": str(tmp_path / "state"),
        "CHEFBOTD_PAGE__PORT": str(page_port),
    }

    def chefbotctl(said: str) -> subprocess.CompletedProcess[str]:
        client = (sys.executable, "-m", "chefbotd.cli.programs.chefbotctl", *said.split())
        return subprocess.run(
            client, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE_S
        )

    with subprocess.Popen(daemon, stderr=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stderr is not None
            lines = []
            while "listening" not in (line := process.stderr.readline()):
                lines.append(line)
                assert line, "".join(lines)
            told = chefbotctl(words.replace("{ca}", str(tmp_path / "robot.pem")))
            assert told.returncode == 0, told.stderr
            refused = chefbotctl(words.replace("--ca {ca} ", ""))
            assert refused.returncode != 0
            assert "--ca" in refused.stderr
            trusted = ssl.create_default_context(cafile=str(tmp_path / "robot.pem"))
            page = http.client.HTTPSConnection("127.0.0.1", page_port, timeout=PATIENCE_S, context=trusted)
            with closing(page):
                page.request("GET", "/", headers={"Host": f"kitchen-bot.local:{page_port}"})
                with page.getresponse() as answer:
                    assert (answer.status, b"<title>" in answer.read()) == (http.HTTPStatus.OK, True)
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE_S)

"""What the page shows and does when the daemon, the board or the network lets it down, and whom it lets in."""

import json
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    PROGRAM,
    RunningRobot,
    comes_to_rest,
    mode_is,
    moves,
    only_a_new_press_drives,
    open_page,
    stays_at_rest,
    sync_api,
    until,
)
from tests.waiting import PATIENCE_S

DRIVES_PERHAPS = "The robot may still be driving"

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]


def test_the_page_comes_back_with_the_daemon(page: Any, robot: RunningRobot) -> None:
    """Killed and started again, it is connected by itself, and the key that was held all the time drives nothing."""
    open_page(page, robot)
    page.keyboard.down("KeyW")
    robot.end(signal.SIGKILL)
    mode_is(page, DRIVES_PERHAPS)
    sync_api.expect(page.locator("#mode-reason")).to_contain_text("Hold it or switch its motors off")
    sync_api.expect(page.locator("#pose")).to_contain_text("speed not known")
    robot.start()
    mode_is(page, "Ready to drive")
    with robot.client() as client:
        assert only_a_new_press_drives(page, client)


def test_a_stalled_daemon_is_told_and_gets_no_old_commands(page: Any, robot: RunningRobot) -> None:
    """Frozen in mid-drive, key down: the page says so; then a fault stops the robot, and no old command moves it."""
    open_page(page, robot)
    page.keyboard.down("KeyW")
    with robot.client() as client:
        assert moves(client)
    robot.process.send_signal(signal.SIGSTOP)
    sync_api.expect(page.locator("#connection")).to_have_text("no answer")
    mode_is(page, DRIVES_PERHAPS)
    sync_api.expect(page.locator("#mode-reason")).to_contain_text("The daemon does not answer")
    robot.process.send_signal(signal.SIGCONT)
    sync_api.expect(page.locator("#connection")).to_have_text("connected")
    mode_is(page, "Stopped by a fault")
    with robot.client() as client:
        assert client.get_state().safety.fault == "loop_blocked"
        assert comes_to_rest(client)
        assert stays_at_rest(client)


def slow_tablet(port: int) -> socket.socket:
    """A client of the page's WebSocket at full view that has asked for everything, and never reads."""
    tablet = socket.socket()
    tablet.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    tablet.connect(("127.0.0.1", port))
    tablet.sendall(
        f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    assert b"101" in tablet.recv(64)
    topics = ["odometry", "wheels", "imu", "ranges", "battery", "link", "safety", "stats"]
    asked = {
        "jsonrpc": "2.0",
        "id": 1,
        "method": "subscribe",
        "params": {"topics": topics, "max_rate_hz": 100.0},
    }
    line = json.dumps(asked).encode()
    tablet.sendall(b"\x81" + bytes([0x80 | 126]) + struct.pack(">H", len(line)) + bytes(4) + line)
    return tablet


def test_twenty_tablets_that_do_not_read_cost_the_robot_nothing(page: Any, robot: RunningRobot) -> None:
    """No control step is missed, the page drives and is shown what happens, and nothing piles up in the daemon."""
    open_page(page, robot)
    program = psutil.Process(robot.process.pid)
    with robot.client() as client:
        page.keyboard.down("KeyA")
        before, memory = client.get_stats(), program.memory_info().rss
        tablets = [slow_tablet(robot.page_port) for _ in range(20)]
        time.sleep(10.0)
        after = client.get_stats()
        sync_api.expect(page.locator("#drivers")).to_have_text("this page (driving by hand)")
        mode_is(page, "Ready to drive")
        assert until(lambda: int(page.locator("#latency").inner_text().removesuffix(" ms")) < 500)
        page.keyboard.up("KeyA")
        grown = program.memory_info().rss - memory
    took_s = after.uptime_s - before.uptime_s
    assert after.control_steps - before.control_steps >= 20 * took_s - 4
    assert after.telemetry_dropped - before.telemetry_dropped > 20 * 10 * took_s
    assert grown < 20e6
    for tablet in tablets:
        tablet.close()


@pytest.fixture
def board(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A simulated board on a device of its own, and the device; its cable is pulled by a word."""
    device = tmp_path / "board"
    with subprocess.Popen(
        [*PROGRAM, "simulate", "--link", str(device)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as program:
        assert until(device.exists)
        yield program, device
        program.communicate("quit\n", PATIENCE_S)


def test_a_pulled_cable_is_told_and_drives_nothing_when_it_is_back(
    page: Any, board: tuple[subprocess.Popen[str], Path], tmp_path: Path
) -> None:
    """In mid-drive: the page tells the fault and the board; plugged in and armed, the old key drives nothing."""
    program, device = board

    def say(word: str) -> None:
        assert program.stdin is not None
        program.stdin.write(word + "\n")
        program.stdin.flush()

    robot = RunningRobot(tmp_path, device=device)
    try:
        open_page(page, robot)
        with robot.client() as client:
            page.keyboard.down("KeyW")
            assert moves(client)
            say("unplug")
            mode_is(page, DRIVES_PERHAPS)
            sync_api.expect(page.locator("#mode-reason")).to_contain_text("The board is not connected")
            sync_api.expect(page.locator("#pose")).to_contain_text("speed not known")
            page.locator("#estop").click()
            unreached = page.get_by_role("alert").filter(
                has_text="The emergency stop did not reach the robot"
            )
            sync_api.expect(unreached).to_be_visible()
            sync_api.expect(page.locator("#link")).to_contain_text("not connected")
            say("plug")
            sync_api.expect(page.locator("#link")).to_have_text("connected")
            mode_is(page, "Emergency stop")
            sync_api.expect(unreached).to_be_hidden()
            page.locator("#arm").click()
            mode_is(page, "Ready to drive")
            assert only_a_new_press_drives(page, client)
    finally:
        robot.end()


TOKEN = "browser-token-0123456789"


@pytest.mark.parametrize("robot", [{"token": TOKEN}], indirect=True)
def test_a_token_lets_in(page: Any, robot: RunningRobot) -> None:
    """Nothing is shown before it; a wrong one is told; the right one is in no address, no log and no cookie."""
    addresses: list[str] = []
    page.on("request", lambda request: addresses.append(request.url))
    page.goto(robot.url)
    sync_api.expect(page.locator("#login")).to_be_visible()
    for _ in range(3):  # it stays: without a token there is nothing else to do, and no stop reaches the robot
        page.keyboard.press("Escape")
    sync_api.expect(page.locator("#unreached")).to_contain_text("did not reach the robot Log in first.")
    page.get_by_role("button", name="I have seen it").click()
    page.locator("#token").fill("another-token-0123456789")
    page.keyboard.press("Enter")
    sync_api.expect(page.locator("#login-told")).to_have_text(
        "The robot does not know this token. Copy one from its token file."
    )
    page.locator("#token").fill(TOKEN)
    page.keyboard.press("Enter")
    mode_is(page, "Ready to drive")
    page.reload()
    mode_is(page, "Ready to drive")
    assert page.context.cookies() == []
    assert not any("0123456789" in address for address in addresses)
    assert "0123456789" not in robot.log


@pytest.mark.parametrize("robot", [{"token": TOKEN, "role": "observe"}], indirect=True)
def test_a_token_that_only_observes_offers_nothing_else(page: Any, robot: RunningRobot) -> None:
    """No joystick, no gains to set, no arm; a key drives nothing and logs nothing; the emergency stop works."""
    page.goto(robot.url)
    page.locator("#token").fill(TOKEN)
    page.keyboard.press("Enter")
    mode_is(page, "Ready to drive")
    sync_api.expect(page.locator("#role")).to_have_text("watch and stop")
    for part in ("#driving", "#gains", "#arm"):
        sync_api.expect(page.locator(part)).to_be_hidden()
    page.keyboard.down("KeyW")
    time.sleep(0.5)
    page.keyboard.up("KeyW")
    sync_api.expect(page.locator("#alert")).to_be_empty()
    assert "role_required" not in robot.log
    page.locator("#estop").click()
    mode_is(page, "Emergency stop")
    sync_api.expect(page.locator("#mode-reason")).to_contain_text("Somebody who may drive")


def test_clients_are_counted(page: Any, robot: RunningRobot) -> None:
    """The page is one, and a program beside it another."""
    open_page(page, robot)
    sync_api.expect(page.locator("#clients")).to_have_text("1")
    with robot.client():
        sync_api.expect(page.locator("#clients")).to_have_text("2")

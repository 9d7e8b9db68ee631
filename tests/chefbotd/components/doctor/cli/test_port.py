"""A board's port without a daemon: absent, forbidden, held, at the wrong rate; and what is behind other ports."""

import asyncio
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.cli import host, walk
from chefbotd.components.doctor.cli.diagnosis import Diagnosis
from chefbotd.components.doctor.listening.ports import Behind, SerialPort, look_behind
from chefbotd.components.simulation.lidar import heard_at
from firmware_protocol.lidar import rplidar
from tests.chefbotd.components.doctor.cli.bench import Answers, configured, diagnosis_of, found
from tests.chefbotd.components.doctor.listening.test_listener import Talker
from tests.fakes.lidar import ld19_bytes, noisy_box

CYCLES = b"".join(
    f"t\t{50_000 * n}\t0.05\ne\t{n}\t{-n}\ns\t0.00\t0.00\nb\t3000.00\n".encode() for n in range(10)
)
GARBAGE = heard_at(CYCLES, 0.5)


def diagnosis_at(says: Mapping[int, bytes], **overrides: object) -> tuple[Diagnosis, Talker]:
    """A diagnosis of a port that says so at each rate."""
    device = Talker(says, every_s=0.5)
    diagnosis = diagnosis_of(configured(**overrides), Answers())
    diagnosis.opener = device.open
    return diagnosis, device


def test_the_configured_rate():
    """A board that is understood at once is listened to once, and told nothing."""

    async def scenario() -> None:
        diagnosis, device = diagnosis_at({115_200: CYCLES})
        result = await walk.find_baud(diagnosis)
        assert result is not None
        assert result[0] == 115_200
        assert found(diagnosis)["baud"].verdict is Verdict.OK
        assert not device.written

    run_virtual(scenario())


def test_a_wrong_rate_is_found_out():
    """57600 is configured and gives garbage; at 115200 the board is understood, and that is said."""

    async def scenario() -> None:
        diagnosis, device = diagnosis_at({57_600: GARBAGE, 115_200: CYCLES}, link__baud=57_600)
        result = await walk.find_baud(diagnosis)
        assert result is not None
        assert result[0] == 115_200
        finding = found(diagnosis)["baud"]
        assert finding.verdict is Verdict.PROBLEM
        assert finding.advice == "set [link] baud = 115200"
        assert not device.written

    run_virtual(scenario())


def test_garbage_at_every_rate_and_silence():
    """Neither is a board; after silence no other rate is tried."""

    async def scenario() -> None:
        diagnosis, _ = diagnosis_at(dict.fromkeys((9_600, 57_600, 115_200, 230_400), GARBAGE))
        assert await walk.find_baud(diagnosis) is not None
        assert found(diagnosis)["baud"].verdict is Verdict.PROBLEM
        silent, _ = diagnosis_at({})
        began_s = asyncio.get_running_loop().time()
        await walk.find_baud(silent)
        assert asyncio.get_running_loop().time() - began_s < walk.LISTEN_S + 0.5
        assert found(silent)["baud"].verdict is Verdict.SKIPPED

    run_virtual(scenario())


def test_a_port_that_cannot_be_opened():
    """The reason is a finding, not an error."""

    async def scenario() -> None:
        diagnosis, device = diagnosis_at({})
        device.unplug()
        assert await walk.find_baud(diagnosis) is None
        assert found(diagnosis)["open"].verdict is Verdict.PROBLEM

    run_virtual(scenario())


HOLD = "import sys; file = open(sys.argv[1]); print('ready', flush=True); sys.stdin.read()"


def test_a_port_that_another_program_holds(tmp_path: Path):
    """The program is named with its pid, and the port is not opened."""
    device = tmp_path / "board"
    device.touch()
    diagnosis, _ = diagnosis_at({}, link__device=str(device))
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(device)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        name = Path(f"/proc/{other.pid}/comm").read_text().strip()
        is_free = walk.examine_port(
            diagnosis, host.look_at_port(diagnosis.settings.link), daemon_answers=False
        )
    assert not is_free
    finding = found(diagnosis)["holder"]
    assert finding.verdict is Verdict.PROBLEM
    assert f"held by {name} (pid {other.pid})" in finding.measured


def test_a_port_that_is_not_there_or_not_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Absent: which ones are there. Forbidden: what gives permission. Neither is opened."""
    device = tmp_path / "board"
    diagnosis, _ = diagnosis_at({}, link__device=str(device))
    assert not walk.examine_port(diagnosis, host.look_at_port(diagnosis.settings.link), daemon_answers=False)
    assert "serial port" in found(diagnosis)["device"].measured
    device.touch()
    monkeypatch.setattr("chefbotd.components.doctor.listening.ports.os.access", lambda *_: False)
    diagnosis, _ = diagnosis_at({}, link__device=str(device))
    assert not walk.examine_port(diagnosis, host.look_at_port(diagnosis.settings.link), daemon_answers=False)
    assert found(diagnosis)["permission"].verdict is Verdict.PROBLEM


def test_a_governor_is_read(tmp_path: Path):
    """One for each processor; none where the kernel tells of none."""
    for number, governor in enumerate(("powersave", "performance")):
        folder = tmp_path / f"cpu{number}" / "cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(f"{governor}\n")
    assert host.governors(tmp_path) == ["powersave", "performance"]
    assert host.governors(tmp_path / "none") == []


def behind(device: Talker, *ports: SerialPort) -> list[Behind]:
    """What is found at ports that all lead to one device."""

    async def scenario() -> list[Behind]:
        return [each async for each in look_behind(ports, device.open, LoopClock())]

    return run_virtual(scenario())


FREE = SerialPort("/dev/ttyUSB0")


def test_a_board_and_lidars_are_found_by_listening():
    """A board at 115200, an LD19 at 230400: by what they say alone, nothing is written to either."""
    board = Talker({115_200: CYCLES}, every_s=0.5)
    (found_board,) = behind(board, FREE)
    assert (found_board.kind, found_board.baud) == ("board", 115_200)
    lidar = Talker(
        {115_200: b"\xff\x00\xf8" * 40, 230_400: b"".join(ld19_bytes(noisy_box(), 20))}, every_s=0.1
    )
    (found_lidar,) = behind(lidar, FREE)
    assert (found_lidar.kind, found_lidar.baud) == ("ld06_ld19", 230_400)
    assert not board.written
    assert not lidar.written


def test_an_rplidar_is_asked_only_where_nothing_is_heard():
    """Silent for 2.5 s, then asked; the two bytes are all that is written."""
    device = Talker({})
    info = bytes([0x28, 0x1D, 0x01, 0x07, *range(16)])

    def answer(data: bytes) -> None:
        device.written.extend(data)
        device.feed(rplidar.descriptor(0x04) + info)

    device.on_write = answer
    (found_lidar,) = behind(device, FREE)
    assert found_lidar.kind == "rplidar"
    assert "A2" in found_lidar.told
    assert bytes(device.written) == b"\xa5\x50"


def test_other_devices():
    """Text of something else, garbage, silence: each has its own word; nothing is written where anything was heard."""
    texts = dict.fromkeys(
        (115_200, 230_400, 57_600, 9_600, 38_400, 19_200, 256_000), b"$GPGGA,1,2*33\r\n" * 4
    )
    gps = Talker(texts, every_s=0.3)
    assert behind(gps, FREE)[0].kind == "text"
    noise = Talker(dict.fromkeys(texts, b"\xf8\xe3\x80" * 20), every_s=0.3)
    assert behind(noise, FREE)[0].kind == "garbage"
    assert not gps.written
    assert not noise.written
    assert behind(Talker({}), FREE)[0].kind == "silent"


def test_ports_that_are_left_alone():
    """One that is held, and one that is not ours, are not even opened."""
    device = Talker({})
    held, forbidden = behind(
        device, SerialPort("/dev/a", held_by="minicom (pid 3)"), SerialPort("/dev/b", permission="dialout")
    )
    assert held.told == "held by minicom (pid 3)"
    assert "dialout" in forbidden.told
    assert device.transport is None

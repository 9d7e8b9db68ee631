"""The square wave, and the driving of it, on a virtual clock."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.cli.common.exits import Exit
from chefbotd.client import Client
from chefbotd.components.tuning.cli.excitation import Exciter, Wave, speed_m_s
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control

WAVE = Wave(amplitude_m_s=0.1, half_period_s=1.0)


def excite(
    daemon: FakeDaemon, script: Callable[[Exciter], Awaitable[None]], complaints: list[str] | None = None
) -> list[tuple[float, str, float | None]]:
    """Run an exciter while ``script`` turns it on and off: when it asked what of the daemon, and which speed."""

    async def main() -> float:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            exciter = Exciter(robot, WAVE, (complaints if complaints is not None else []).append)
            began_s = asyncio.get_running_loop().time()
            running = asyncio.create_task(exciter.run())
            await script(exciter)
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            return began_s

    began_s = daemon.run(main())
    return [(round(at_s - began_s, 2), name, given.get("linear_m_s")) for at_s, name, given in daemon.calls]


def test_the_wave() -> None:
    """Forward for one half period, back for the next, from the beginning."""
    assert [speed_m_s(WAVE, t) for t in (0.0, 0.99, 1.0, 1.99, 2.0)] == [0.1, 0.1, -0.1, -0.1, 0.1]


@pytest.mark.parametrize("amplitude_m_s", ["0.0", "0.21"])
def test_the_amplitude_is_bounded(control: Control, amplitude_m_s: str) -> None:
    """Nothing faster than 0.2 m/s: somebody may have forgotten the blocks."""
    refused = control("pid", "tune", "--amplitude", amplitude_m_s)
    assert refused.exit_code == Exit.USAGE
    assert "0.01<=x<=0.2" in refused.stderr


def test_it_drives_at_20_hz_and_turns_round(daemon: FakeDaemon) -> None:
    """In 1.5 s some 30 commands go out, the first two thirds of them forward; then zero, and its source back."""

    async def script(exciter: Exciter) -> None:
        exciter.start()
        await asyncio.sleep(1.501)
        exciter.end()
        await asyncio.sleep(1.0)

    asked = excite(daemon, script)
    driven = [(at_s, speed) for at_s, name, speed in asked if name == "drive" and speed]
    assert len(driven) == pytest.approx(30, abs=1)
    assert {speed for at_s, speed in driven if at_s < 0.99} == {0.1}
    assert {speed for at_s, speed in driven if at_s > 1.01} == {-0.1}
    assert asked[-2:] == [(1.5, "drive", 0.0), (1.5, "release_control", None)]


def test_a_stop_ends_everybodys_motion(daemon: FakeDaemon) -> None:
    """Whoever stops the wave by the stop key stops whoever drives."""

    async def script(exciter: Exciter) -> None:
        exciter.start()
        await asyncio.sleep(0.31)
        exciter.stop()
        await asyncio.sleep(0.5)

    assert excite(daemon, script)[-1] == (0.31, "stop", None)


def test_a_stop_at_rest_is_sent(daemon: FakeDaemon) -> None:
    """Whoever asks for a stop gets one, though this exciter drives nothing."""

    async def script(exciter: Exciter) -> None:
        exciter.stop()
        await asyncio.sleep(0.1)

    assert excite(daemon, script) == [(0.0, "stop", None)]


def test_its_end_leaves_no_motion_behind(daemon: FakeDaemon) -> None:
    """Cancelled in the middle, it commands zero and gives its source back."""

    async def script(exciter: Exciter) -> None:
        exciter.start()
        await asyncio.sleep(0.3)

    (_, *zero), (_, released, _) = excite(daemon, script)[-2:]
    assert (zero, released) == (["drive", 0.0], "release_control")


def test_a_refusal_turns_it_off(daemon: FakeDaemon) -> None:
    """It is told once; the next start tries again."""
    daemon.refuse["drive"] = "disarmed"
    complaints: list[str] = []

    async def script(exciter: Exciter) -> None:
        exciter.start()
        await asyncio.sleep(0.3)
        assert not exciter.on
        daemon.refuse.clear()
        exciter.start()
        await asyncio.sleep(0.3)
        assert exciter.on

    asked = excite(daemon, script, complaints)
    assert complaints == ["disarmed: it will not"]
    assert [name for at_s, name, _ in asked if at_s < 0.29] == ["drive"]
    assert [name for at_s, name, _ in asked if 0.29 < at_s < 0.59] == ["drive"] * 6

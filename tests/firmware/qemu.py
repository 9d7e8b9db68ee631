"""The Stellaris board's image in QEMU: its serial line, its memory, and its own clock.

The machine counts its time by instructions (``-icount``) and does not wait for the computer's: a test that waits takes
as long as the machine needs to compute it, and nothing depends on how busy the computer is.
"""

import json
import re
import socket
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tests.firmware import tools
from tests.firmware.host import seal, unsealed

MOST_WAIT_S = 300.0
"""Of the computer's time, for a machine that never does what is awaited; on a busy computer it computes slowly."""


class Observed(NamedTuple):
    """The duty of the motors, when they last left a standstill and came to one, and when the last byte came in.

    By the board's microseconds.
    """

    duty: tuple[int, int]
    began_us: int
    ended_us: int
    heard_us: int


def symbol(image: Path, name: str) -> int:
    """The address of a variable of the image."""
    listed = subprocess.run(["arm-none-eabi-nm", image], capture_output=True, text=True, check=True).stdout
    found = re.search(rf"^([0-9a-f]+) \w {name}$", listed, re.MULTILINE)
    assert found is not None, name
    return int(found[1], 16)


class Qemu:
    """A machine that runs; ``text`` is what it has sent since `forget`."""

    def __init__(self, image: str = "lm3s6965.elf") -> None:
        tools.need("make", "arm-none-eabi-gcc", "qemu-system-arm")
        tools.make("build/lm3s6965.elf")
        tools.make("build/lm3s6965_hangs.elf")
        path = tools.BUILD / image
        self._observed = symbol(path, "observed")
        self._serial, serial = socket.socketpair()
        self._monitor, monitor = socket.socketpair()
        wires = [serial.fileno(), monitor.fileno()]
        machine = ["qemu-system-arm", "-M", "lm3s6965evb", "-nographic", "-icount", "shift=4,sleep=off"]
        machine += ["-chardev", f"socket,id=line,fd={wires[0]}", "-serial", "chardev:line"]
        machine += ["-chardev", f"socket,id=monitor,fd={wires[1]}", "-mon", "chardev=monitor,mode=control"]
        self._process = subprocess.Popen(
            [*machine, "-kernel", str(path)], pass_fds=wires, stderr=subprocess.DEVNULL
        )
        serial.close()
        monitor.close()
        self._answers = self._monitor.makefile("r")
        self._sequence = 0
        self._received = bytearray()
        self._arrived = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()
        self._answers.readline()
        self._ask("qmp_capabilities")

    def close(self) -> None:
        """End the machine."""
        self._process.kill()
        self._process.wait()
        self._serial.close()
        self._answers.close()
        self._monitor.close()

    def _read(self) -> None:
        """Always drain: a machine of which nobody reads the serial line stands still."""
        try:
            while data := self._serial.recv(4096):
                with self._arrived:
                    self._received += data
                    self._arrived.notify_all()
        except OSError:
            return

    def _ask(self, command: str, **arguments: str) -> str:
        self._monitor.sendall(json.dumps({"execute": command, "arguments": arguments}).encode() + b"\n")
        while "return" not in (answer := json.loads(self._answers.readline())):
            pass
        return str(answer["return"])

    @property
    def text(self) -> str:
        """What was sent."""
        with self._arrived:
            return self._received.decode("latin-1")

    def forget(self) -> None:
        """Look at later bytes only."""
        with self._arrived:
            self._received.clear()

    @property
    def line(self) -> socket.socket:
        """The host's end of its serial line, for a process that writes."""
        return self._serial

    def write(self, data: bytes) -> None:
        """Put bytes on the wire."""
        self._serial.sendall(data)

    def seal(self, body: str) -> int:
        """Put a line on the wire, with its sequence number, which it gives, and CRC."""
        number, self._sequence = self._sequence, (self._sequence + 1) % 255  # 255 is that of no command
        self.write(seal(f"{body} {number}").encode() + b"\r")
        return number

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Until it has sent this; raises TimeoutError if it does not."""
        return self._wait(lambda: re.search(pattern, self._received.decode("latin-1")), pattern)

    def _wait(self, found: Callable[[], re.Match[str] | None], what: str) -> re.Match[str]:
        until_s = time.monotonic() + MOST_WAIT_S
        with self._arrived:
            while (match := found()) is None:
                if not self._arrived.wait(until_s - time.monotonic()):
                    raise TimeoutError(f"{what} was not sent, but {self._received[-400:]!r}")
        return match

    def board_us(self) -> int:
        """The board's clock in a cycle that began after this call."""
        with self._arrived:
            begin = len(self._received)
        pattern = re.compile(r"\nt\t(\d+)\t[^\n]*\n")
        return int(self._wait(lambda: pattern.search(self._received.decode("latin-1"), begin), "t")[1])

    def pass_time(self, duration_s: float) -> None:
        """Let the board's clock go on by this at least."""
        begun_us = self.board_us()
        while self.board_us() - begun_us < duration_s * 1e6:
            pass

    def observed(self) -> Observed:
        """What the motors get, by the variable of `firmware/boards/lm3s6965/board.h`."""
        listed = self._ask("human-monitor-command", **{"command-line": f"xp /4wx {self._observed:#x}"})
        duty, began_us, ended_us, heard_us = (
            int(word, 16) for word in re.findall(r"0x([0-9a-f]{8})", listed)
        )
        return Observed((_int16(duty & 0xFFFF), _int16(duty >> 16)), began_us, ended_us, heard_us)

    def await_standstill(self) -> Observed:
        """What the motors get once that is 0; raises TimeoutError if it never is."""
        return self._await(lambda duty: not any(duty))

    def await_motion(self) -> Observed:
        """What the motors get once that is not 0; raises TimeoutError if it never is."""
        return self._await(any)

    def _await(self, is_so: Callable[[tuple[int, int]], bool]) -> Observed:
        until_s = time.monotonic() + MOST_WAIT_S
        while not is_so((observed := self.observed()).duty):
            if time.monotonic() > until_s:
                raise TimeoutError(f"the motors have {observed}")
        return observed

    def fields(self, kind: str) -> list[list[str]]:
        """The fields of the whole sealed lines of one kind, without sequence number."""
        lines = [line for line in self.text.split("\n")[1:-1] if line.startswith(f"{kind}\t") and "*" in line]
        return [unsealed(line).split("\t")[1:-1] for line in lines]


def _int16(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word

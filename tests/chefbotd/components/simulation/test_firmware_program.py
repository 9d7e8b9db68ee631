"""The simulator's model of our firmware says and does what the real one does, byte for byte."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from chefbotd.components.simulation.firmware_motors import Kept
from chefbotd.components.simulation.firmware_program import FirmwareProgram
from tests.firmware import conversations

CONVERSATIONS = sorted((Path(__file__).parents[3] / "vectors" / "firmware").glob("*.jsonl"))
EVERYTHING = 31
"""Every capability, as the host build has."""


class Board:
    """The model with a line without end of speed; the conversation plays the sensors and the encoders."""

    def __init__(self, micros: int, has_imu: bool) -> None:
        self.now_us, self._has_imu, self._kept = micros, has_imu, Kept()
        self._edges = [(0, micros)] * 2
        self.out, self.duty, self.restarts = b"", (0, 0), 0
        self.start(1)

    def start(self, cause: int) -> None:
        """The program begins; after a restart by software for the cause that it noted: 5, a command.

        The host build's converter keeps its last reading, which no reading of the new program is.
        """
        if cause == 1:
            self._kept = Kept()
        battery = 0 if cause == 1 else self.program.readings.battery_level
        self.program = FirmwareProgram(
            self,
            self._kept,
            self.now_us,
            cause or 5,
            capabilities=EVERYTHING,
            has_imu=self._has_imu,
        )
        self.program.readings.battery_level = battery

    def write_motors(self, duty: tuple[int, ...]) -> None:
        """Keep it."""
        self.duty = (duty[0], duty[1])

    def edges(self) -> list[tuple[int, int]]:
        """What the conversation has told."""
        return self._edges

    def trigger_ultrasonic(self, now_us: int) -> None:
        """The conversation answers."""

    def send(self, data: bytes) -> None:
        """Keep it."""
        self.out += data

    def room_bytes(self) -> int:
        """What is sent is read at once."""
        return 255

    def restart(self) -> None:
        """The conversation starts the program again."""
        self.restarts += 1

    def advance(self, to_us: int) -> Iterator[int]:
        """Run until then; the times at which something may have happened."""
        while not self.restarts and self.program.next_us() <= to_us:
            self.now_us = self.program.next_us()
            self.program.run(self.now_us)
            yield self.now_us
        self.now_us = to_us

    def play(self, row: dict[str, Any]) -> None:
        """What comes in, and a pass for it."""
        readings = self.program.readings
        match row:
            case {"in": text}:
                self.program.receive(text.encode("latin-1"), self.now_us)
            case {"lost": count}:
                for _ in range(count):
                    self.program.receiver.lose()
            case {"edges": edges}:
                before = [count for count, _ in self._edges]
                self._edges = [
                    (count + edge, self.now_us) if edge else old
                    for count, edge, old in zip(before, edges, self._edges, strict=True)
                ]
            case {"imu": counts}:
                readings.imu, readings.imu_us, readings.is_new_imu = tuple(counts), self.now_us, True
            case {"battery": adc}:
                readings.battery_level, readings.has_battery = adc, True
            case {"current": [wheel, adc]}:
                readings.current[wheel] = adc
            case {"echo": rising}:
                self.program.echo(rising, self.now_us)
            case {"start": cause}:
                self.restarts = 0
                self.start(cause)
        if not self.restarts:
            self.program.run(self.now_us)


def held(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The conversation as the model holds it: what comes in as it stands, and what comes out by the model."""
    first, *rest = rows
    board = Board(first["micros"], first["imu"])
    told: tuple[tuple[int, int], int] = ((0, 0), 0)

    def came_out(at_us: int) -> Iterator[dict[str, Any]]:
        nonlocal told
        if board.out:
            yield {"at_us": at_us - first["micros"], "out": board.out.decode()}
            board.out = b""
        if board.duty != told[0]:
            yield {"at_us": at_us - first["micros"], "duty": list(board.duty)}
        if board.restarts > told[1]:
            yield {"at_us": at_us - first["micros"], "restart": True}
        told = board.duty, board.restarts

    yield first
    yield from came_out(board.now_us)
    for row in rest:
        for at_us in board.advance(first["micros"] + row["at_us"]):
            yield from came_out(at_us)
        if not row.keys() & {"out", "duty", "restart"}:
            yield row
            board.play(row)
            yield from came_out(board.now_us)


@pytest.mark.parametrize("path", CONVERSATIONS, ids=[path.stem for path in CONVERSATIONS])
def test_the_model_holds_each_golden_conversation(path: Path):
    """Whatever the real firmware sent and put on its motors, the model does at the same microsecond."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    assert list(held(rows)) == rows


def test_there_are_golden_conversations():
    """Negotiation, dead-man, e-stop and the rest: no folder that is empty passes for agreement."""
    assert {"negotiation", "deadman", "estop", "refusals"} <= {path.stem for path in CONVERSATIONS}


def test_a_shorter_dead_man_that_has_passed_already_stops_at_the_next_tick():
    """What is due lies never behind: the simulator would wait for it for ever."""
    board = Board(0, has_imu=False)
    board.play({"in": conversations.sealed("hello 1 2000", 0)})
    list(board.advance(300_400))
    board.play({"in": conversations.sealed("hello 1 50", 1)})
    assert board.program.next_us() == 301_000
    list(board.advance(301_000))
    assert board.program.motors.deadman_stops == 1

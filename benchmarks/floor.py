"""The least that Python can do on this wire: the floor that chefbotd's cost is held against.

``python -m benchmarks.floor run --config FILE --port DEVICE --listen HOST:PORT`` takes the daemon's arguments and does
only what cannot be left out: uvloop, pyserial-asyncio, one ``split`` a line, one proportional step a wheel, JSON out. It
checks nothing, guards nothing and stops for nothing: it is a yardstick, never a way to drive a robot.
"""

import argparse
import asyncio
import json
from typing import Any, cast

import serial_asyncio
import uvloop

BAUD = 115200
GAIN_DUTY_S_PER_COUNT = 0.02
COUNTS_PER_M = 14854.0
TRACK_WIDTH_M = 0.3


class Floor(asyncio.Protocol):
    """The serial side; ``subscribers`` are the clients of each of its two topics."""

    def __init__(self) -> None:
        self.subscribers: dict[str, list[asyncio.Transport]] = {"odometry": [], "wheels": []}
        self.target_counts_s = (0.0, 0.0)
        self._rest = b""
        self._board_s, self._counts = 0.0, (0, 0)
        self._board: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: the port is open; the motors stand."""
        self._board = cast(asyncio.Transport, transport)
        self._board.write(b"s 0 0\r")

    def data_received(self, data: bytes) -> None:
        """Asyncio: split into lines and fields; an encoder line is answered."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            fields = line.split(b"\t")
            if fields[0] == b"t":
                self._time_s = int(fields[1]) * 1e-6
            elif fields[0] == b"e":
                self._on_counts(int(fields[1]), int(fields[2]))

    def _on_counts(self, left: int, right: int) -> None:
        dt_s, before = self._time_s - self._board_s, self._counts
        self._board_s, self._counts = self._time_s, (left, right)
        if dt_s <= 0:
            return
        speed = ((left - before[0]) / dt_s, (right - before[1]) / dt_s)
        target = self.target_counts_s
        duty = tuple([round(GAIN_DUTY_S_PER_COUNT * (t - s)) for t, s in zip(target, speed, strict=True)])
        self._board.write(b"s %d %d\r" % duty)
        self._tell("odometry", {"x_m": (left + right) / 2 / COUNTS_PER_M, "linear_m_s": speed[0]})
        self._tell("wheels", {"velocity": speed, "target": target, "duty": duty})

    def _tell(self, topic: str, data: dict[str, object]) -> None:
        if not self.subscribers[topic]:
            return
        event = {"jsonrpc": "2.0", "method": "event", "params": {"topic": topic, "data": data}}
        line = json.dumps(event).encode() + b"\n"
        for client in self.subscribers[topic]:
            client.write(line)

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Take a velocity, and put its proportional step on the wire at once."""
        turn = angular_rad_s * TRACK_WIDTH_M / 2
        self.target_counts_s = ((linear_m_s - turn) * COUNTS_PER_M, (linear_m_s + turn) * COUNTS_PER_M)
        duty = tuple([round(GAIN_DUTY_S_PER_COUNT * target) for target in self.target_counts_s])
        self._board.write(b"s %d %d\r" % duty)


class Client(asyncio.Protocol):
    """One connection of the socket: a request a line, answered with an empty result or what the benchmarks read."""

    def __init__(self, floor: Floor) -> None:
        self._floor, self._rest = floor, b""
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: a client is there."""
        self._transport = cast(asyncio.Transport, transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: it is gone."""
        for clients in self._floor.subscribers.values():
            if self._transport in clients:
                clients.remove(self._transport)

    def data_received(self, data: bytes) -> None:
        """Asyncio: carry requests out in their order."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            request = json.loads(line)
            result = self._carry_out(request["method"], request.get("params", {}))
            answer = {"jsonrpc": "2.0", "id": request.get("id"), "result": result}
            self._transport.write(json.dumps(answer).encode() + b"\n")

    def _carry_out(self, method: str, params: dict[str, Any]) -> dict[str, object]:
        if method == "drive":
            self._floor.drive(params["linear_m_s"], params["angular_rad_s"])
        elif method == "stop":
            self._floor.drive(0.0, 0.0)
        elif method == "subscribe":
            for topic in params["topics"]:
                self._floor.subscribers[topic].append(self._transport)
        elif method == "get_state":
            return {"link": {"state": "up"}}
        return {"ok": True}


async def serve(device: str, host: str, port: int) -> None:
    """Open the device, listen, and run until the process is ended."""
    loop, floor = asyncio.get_running_loop(), Floor()
    await serial_asyncio.create_serial_connection(loop, lambda: floor, device, baudrate=BAUD)
    server = await loop.create_server(lambda: Client(floor), host, port)
    await server.serve_forever()


def main() -> None:
    """Take the daemon's command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.floor", description=__doc__)
    parser.add_argument("run", choices=["run"])
    parser.add_argument("--config", help="accepted as the daemon's is, and not read")
    parser.add_argument("--port", required=True)
    parser.add_argument("--listen", required=True)
    options = parser.parse_args()
    host, _, port = options.listen.rpartition(":")
    uvloop.run(serve(options.port, host, int(port)))


if __name__ == "__main__":
    main()

"""The far end: a daemon's command socket in front of a robot that moves exactly as it is told."""

import asyncio
import json
import math
import socket
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from chefbotd.client.models import RecordingData
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.encoding import plain
from chefbotd.rpc.methods import describe
from tests.fakes.robot import methods_of_socket, topics_of

T = TypeVar("T")
TICK_S = 0.02
DEAD_MAN_S = 0.5
MOST = 50.0
WHEELS = ("left_wheel", "right_wheel")
PID = PidParameters(kp=400.0, ki=100.0, output_limit=255.0).model_dump()


MAPPING = {"state": "mapping", "name": None, "keyframes": 40, "loops": 2, "path_m": 12.4}


RECORDED = {
    "name": "evening_1",
    "file": "/recordings/evening_1.mcap",
    "seconds": 12.5,
    "size_bytes": 4_200_000,
    "messages": 321,
    "dropped": 0,
}


class FakeDaemon:
    """Answers on a port of its own; ``calls`` is everything it was asked, in order.

    ``refuse`` maps a method to a kind of refusal; ``hang_up_on`` names a method that ends the connection
    instead; one that ``coasts`` stops only by the dead-man; a ``silent`` one sends no events; ``stuck`` wheels
    do not turn; ``slip`` is the share of its motion that the robot does not make, though its wheels do, and
    ``drift_rad_s`` how it turns though they do not; every answer takes ``latency_s``. ``MOST`` is the most that it
    allows of any speed, and ``held_by`` what it says holds it up. ``scan`` is what its lidar sees (None: nothing), and
    ``lidar_condition`` how that is (empty: there is none); everything that it tells is ``age_s`` old.
    """

    def __init__(self) -> None:
        # the protocol is named because asyncio turns Nagle's algorithm off only where it is
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        self._listener.bind(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.calls: list[tuple[float, str, dict[str, Any]]] = []
        self.refuse: dict[str, str] = {}
        self.hang_up_on: str | None = None
        self.stuck = self.silent = self.coasts = False
        self.simulated = True
        self.unknown_sources: set[str] = set()
        self.protocol = "1.0"
        self.gains: list[dict[str, Any]] = [dict.fromkeys(WHEELS, PID)]
        self.held_by: str | None = None
        self.latch = 0
        self.scan: dict[str, Any] | None = None
        recording = RecordingData(state="recording", name="evening_1")
        self.recording: dict[str, Any] = plain(recording)
        self.recordings: list[dict[str, Any]] = []
        self.lidar_condition = "healthy"
        self.age_s = 0.004
        self.slip = self.drift_rad_s = self.latency_s = 0.0
        self.pose, self.truth, self.twist = Pose2D(), Pose2D(1.0, 2.0, 0.5), STANDING
        self._driven_s = -math.inf
        self._conversations: set[asyncio.Task[None]] = set()
        self._subscribed: dict[asyncio.StreamWriter, list[str]] = {}
        self._seq = 0

    def close(self) -> None:
        """Give the port back, for a daemon that never served."""
        self._listener.close()

    def methods(self) -> list[str]:
        """The names of the methods called, repetitions folded."""
        names = [name for _, name, _ in self.calls]
        return [name for i, name in enumerate(names) if i == 0 or name != names[i - 1]]

    def run(self, main: Coroutine[Any, Any, T]) -> T:
        """A runner for the programs: ``main`` on a virtual clock, with this daemon serving beside it."""
        return run_virtual(self.beside(main))

    async def beside(self, main: Coroutine[Any, Any, T]) -> T:
        """Serve while ``main`` runs."""
        server = await asyncio.start_server(self._converse, sock=self._listener)
        moving = asyncio.create_task(self._move())
        try:
            return await main
        finally:
            moving.cancel()
            server.close()
            for writer in self._subscribed:
                writer.transport.abort()
            await asyncio.gather(*self._conversations)

    async def _move(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(TICK_S)
            if self.stuck or loop.time() - self._driven_s > DEAD_MAN_S:
                self.twist = STANDING
            turned_rad = self.twist.angular_rad_s * TICK_S
            step = Pose2D(self.twist.linear_m_s * TICK_S, 0.0, turned_rad)
            self.pose = self.pose.compose(step)
            drifted_rad = turned_rad + self.drift_rad_s * TICK_S
            self.truth = self.truth.compose(Pose2D(step.x_m * (1 - self.slip), 0.0, drifted_rad))
            if not self.silent:
                self._publish(loop.time())

    def _publish(self, now_s: float) -> None:
        self._seq += 1
        for writer, wanted in self._subscribed.items():
            for topic in wanted:
                if topic in self._topics():
                    event = {"topic": topic, **self._latest(topic, now_s)}
                    _send(writer, {"method": "event", "params": event})

    def _topics(self) -> dict[str, dict[str, Any]]:
        speed = {"linear_m_s": self.twist.linear_m_s, "angular_rad_s": self.twist.angular_rad_s}
        topics: dict[str, dict[str, Any]] = {
            "odometry": {**_pose(self.pose), **speed, "covariance": [0.0] * 9},
            "wheels": {
                "name": list(WHEELS),
                "position_rad": [3.5, -7.0],
                "velocity_rad_s": [1.0, -2.0],
                "target_rad_s": [1.5, -2.0],
                "duty": [1, 0],
            },
            "imu": {
                "orientation": None,
                "heading_rad": 0.5,
                "angular_velocity_rad_s": None,
                "linear_acceleration_m_s2": None,
            },
            "ranges": {"ranges": [BEAM]},
            "battery": {"voltage_v": 12.34, "percentage": 78.0, "status": "ok"},
            "safety": {
                "mode": "armed",
                "reason": "started",
                "limited_by": self.held_by,
                "source": None,
                "armed": True,
                "control": {},
                "latch": self.latch,
            },
            "link": {"state": "up", "device": "/dev/ttyACM0", "reason": ""},
        }
        topics["recording"] = self.recording
        if self.scan is not None:
            topics["scan"] = self.scan
        if self.lidar_condition:
            topics["lidars"] = {"lidars": [{**LIDAR, "condition": self.lidar_condition}]}
        if self.simulated:
            topics["sim"] = {**_pose(self.truth), **speed, "in_contact": False}
        return topics

    def _latest(self, topic: str, now_s: float) -> dict[str, Any]:
        age_s = self.age_s
        return {"seq": self._seq, "stamp_s": now_s - age_s, "age_s": age_s, "data": self._topics()[topic]}

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._conversations.add(task)
        greeting = {"robot": "fake", "session": "s1", "link": "up", "auth": "none", "capabilities": []}
        _send(writer, {"method": "hello", "params": {"protocol": self.protocol, **greeting}})
        self._subscribed[writer] = []
        while line := await _next_line(reader):
            request = json.loads(line)
            now_s = asyncio.get_running_loop().time()
            if request["method"] == "ping" and "id" not in request:  # a client that says that it is there
                continue
            self.calls.append((now_s, request["method"], request["params"]))
            if request["method"] == self.hang_up_on:
                break
            if self.latency_s:
                await asyncio.sleep(self.latency_s)
            answer = self._answer(writer, now_s, request)
            if "id" in request:  # a notification, such as cancel, has no answer
                _send(writer, {"id": request["id"], **answer})
        del self._subscribed[writer]
        writer.close()

    def _answer(self, writer: asyncio.StreamWriter, now_s: float, request: dict[str, Any]) -> dict[str, Any]:
        method, params = request["method"], request["params"]
        known = params.get("source") not in self.unknown_sources
        if kind := self.refuse.get(method, None if known else "unknown_source"):
            return {"error": {"code": -32000, "message": "it will not", "data": {"kind": kind}}}
        if method == "drive":
            allowed = _allowed(params)
            if self.coasts and not any((allowed["linear_m_s"], allowed["angular_rad_s"])):
                return {"result": allowed}
            self.twist, self._driven_s = Twist2D(allowed["linear_m_s"], allowed["angular_rad_s"]), now_s
        elif method in ("stop", "estop"):
            self.twist = self.twist if self.coasts else STANDING
        elif method == "subscribe":
            self._subscribed[writer] = params["topics"]
        answers: dict[str, Callable[[], dict[str, Any]]] = {
            "ping": lambda: {"pong": True, "stamp_s": now_s},
            "get_state": lambda: self._state(now_s),
            "get_stats": lambda: STATS,
            "drive": lambda: _allowed(params),
            "set_wheel_velocities": lambda: _allowed(params),
            "take_control": lambda: {"source": params.get("source", "teleop"), "taken_from": None},
            "release_control": lambda: {"sources": []},
            "get_pid": lambda: {"wheels": self.gains[-1]},
            "undo_pid": lambda: {"wheels": self._undo_pid()},
            "start_mapping": lambda: MAPPING,
            "pause_mapping": lambda: MAPPING | {"state": "paused"},
            "finish_mapping": lambda: MAPPING | {"name": params["name"], "version": 3},
            "discard_mapping": lambda: MAPPING | {"state": "idle"},
            "start_recording": lambda: {"name": "evening_1", "file": "/recordings/evening_1.mcap"},
            "stop_recording": lambda: RECORDED,
            "save_ring": lambda: {"file": "/recordings/ring_asked_1.mcap", "seconds": 118.4},
            "list_recordings": lambda: {"folder": "/recordings", "files": self.recordings},
            "set_pid": lambda: {"wheels": self._set_pid(**params)},
            "describe": lambda: description(simulated=self.simulated),
        }
        return {"result": answers.get(method, lambda: {"ok": True})()}

    def _set_pid(self, wheel: str, **changes: object) -> dict[str, Any]:
        changed = {name: {**self.gains[-1][name], **changes} for name in WHEELS if wheel in (name, "all")}
        self.gains.append({**self.gains[-1], **changed})
        return self.gains[-1]

    def _undo_pid(self) -> dict[str, Any]:
        if len(self.gains) > 1:
            self.gains.pop()
        return self.gains[-1]

    def _state(self, now_s: float) -> dict[str, Any]:
        topics = self._topics()
        latest = {topic: self._latest(topic, now_s) for topic in topics}
        return {"stamp_s": now_s, "link": topics["link"], "safety": topics["safety"], "topics": latest}


def description(*, simulated: bool) -> dict[str, Any]:
    """What a real daemon says of itself."""
    return plain(describe(methods_of_socket(), topics_of(simulated=simulated)))


BEAM = {
    "sensor": "front",
    "status": "ok",
    "range_m": 1.5,
    "min_range_m": 0.02,
    "max_range_m": 4.0,
    "field_of_view_rad": 0.26,
    "stamp_s": 3.0,
}

LIDAR = {
    "lidar": "top",
    "model": "ld19",
    "device": "/dev/ttyUSB0",
    "state": "up",
    "healthy": False,
    "reason": "nothing received for 2.0 s",
    "stamp_s": 3.0,
}

STATS: dict[str, Any] = {
    "uptime_s": 12.0,
    "frames": {"EncoderCounts": 100, "BoardTime": 100},
    "refused": {"not_ascii": 1},
    "lines_out": 50,
    "clients": 1,
    "encoder_readings_refused": 0,
    "board_restarts": 2,
    "bus_dropped": {},
    "telemetry_dropped": 0,
}


def _allowed(params: dict[str, Any]) -> dict[str, Any]:
    """The answer to a velocity, or to one of each wheel: slowed together until the fastest is ``MOST``."""
    speeds = params.get("velocity_rad_s") or [params["linear_m_s"], params["angular_rad_s"]]
    fastest = max(map(abs, speeds))
    slowed = [speed * min(1.0, MOST / fastest) if fastest else 0.0 for speed in speeds]
    told = {"ok": True, "limited_by": "limits.linear" if fastest > MOST else None}
    if "name" in params:
        return {**told, "name": params["name"], "velocity_rad_s": slowed}
    return {**told, "linear_m_s": slowed[0], "angular_rad_s": slowed[1]}


def _pose(pose: Pose2D) -> dict[str, float]:
    return {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad}


async def _next_line(reader: asyncio.StreamReader) -> bytes:
    """The next line; empty when the client is gone, also where that shows in what was being sent to it."""
    try:
        return await reader.readline()
    except ConnectionError:
        return b""


def _send(writer: asyncio.StreamWriter, message: dict[str, Any]) -> None:
    writer.write(json.dumps({"jsonrpc": "2.0", **message}).encode() + b"\n")

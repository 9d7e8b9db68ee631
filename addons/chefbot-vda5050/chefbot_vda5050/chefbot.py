"""A ChefBot behind its daemon's socket, as ``robot.Robot``: goals, questions to people, and what is known of it.

It is an agent of the daemon. When the connection is lost, the daemon ends its goal and the robot stands.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, suppress
from typing import Any, Final

import structlog
from msgspec.structs import replace

from chefbot_vda5050 import versions
from chefbot_vda5050.known_ways import KnownWays
from chefbot_vda5050.messages import EStop, NodePosition, OperatingMode
from chefbot_vda5050.problems import AFTER_STOP
from chefbot_vda5050.robot import CannotDo, DriveFailed
from chefbot_vda5050.state import is_driving
from chefbot_vda5050.vehicle import Facts
from chefbotd.client import CallError, ChefbotError, Client, GoalNotReached
from chefbotd.client.models import (
    AgentEventData,
    BatteryData,
    LocalizationData,
    MapPoseData,
    NavigationData,
    OdometryData,
    PathData,
    SafetyData,
)
from chefbotd.components.agents.agent import BY_PEOPLE

log = structlog.get_logger("vda5050")

AGENT, VERSION = "fleet", "0.1"
AGAIN_S: Final = 1.0
STANDING_WITHIN_S: Final = 5.0
POSE_HZ, SPEED_HZ, PATH_HZ, BATTERY_HZ = 10.0, 10.0, 2.0, 0.2
GO_ON_BUTTON: Final = "Go on with the fleet's order"

STOPPED: Final = frozenset({"disarmed", "estopped", "overtaken", "stopped", "stopped_since"})
"""Kinds of a goal's refusal after which a person is to agree before the robot drives on, as after ``BY_PEOPLE``."""

HINTS: Final = {
    "blocked": "Clear the way; the robot tries again by itself.",
    "unreachable": "Open the way on the robot's map, or cancel the order.",
    "lost": "Tell the robot where it is: initPosition, or on its page.",
    "fault": "Look after the robot, then arm it.",
    "cancelled": "Send stopPause, or press 'Go on' on the robot's page.",
}
OTHERWISE: Final = "Look after the robot; it tries again by itself."

Connect = Callable[[], AbstractAsyncContextManager[Client]]


class ChefBot:
    """``run`` keeps the connection; everything else may be called at any time.

    In version 2.1 a robot that is driven by hand deletes its order; 3.0 has a mode in which it is kept.
    """

    def __init__(self, connect: Connect, version: versions.Version = versions.V2) -> None:
        self._connect, self._tells_path = connect, version is versions.V3
        self._by_hand = OperatingMode.INTERVENED if version is versions.V3 else OperatingMode.MANUAL
        self._facts = Facts(missing="not connected yet")
        self._ways = KnownWays()
        self._client: Client | None = None
        self._drives: list[
            asyncio.Task[str]
        ] = []  # under way: the latest replaces the others when it is accepted
        self._heard = asyncio.Event()
        self._changed: Callable[[], None] = lambda: None
        self._go_on: Callable[[], None] = lambda: None

    @property
    def facts(self) -> Facts:
        """What is known of it now."""
        return self._facts

    def listen(self, changed: Callable[[], None], go_on: Callable[[], None]) -> None:
        """Have these called from now on."""
        self._changed, self._go_on = changed, go_on

    async def run(self) -> None:
        """Be connected until cancelled."""
        while True:
            why = "the daemon has closed the connection"
            try:
                async with self._connect() as client:
                    await self._work(client)
            except* (ChefbotError, OSError, TimeoutError) as problems:
                why = "; ".join(str(problem) for problem in problems.exceptions)
                log.warning("no connection to the robot's daemon", why=why)
            self._client = None
            self._ways.clear()
            self._set(Facts(missing=why, stop_number=self._facts.stop_number))
            await asyncio.sleep(AGAIN_S)

    async def _work(self, client: Client) -> None:
        await client.register_agent(AGENT, VERSION)
        button = (await client.add_button(GO_ON_BUTTON)).button_id
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._watch_state(client))
            tasks.create_task(self._watch(client, "map_pose", POSE_HZ))
            tasks.create_task(self._watch(client, "odometry", SPEED_HZ))
            tasks.create_task(self._watch(client, "battery", BATTERY_HZ))
            if self._tells_path:
                tasks.create_task(self._watch(client, "path", PATH_HZ))
            tasks.create_task(self._watch_button(client, button))

    async def _watch_state(self, client: Client) -> None:
        """The first of these is how the gate stands, so that a stop while nothing was heard counts before all else."""
        topics = ("safety", "localization", "navigation")
        async with client.subscribe(topics, policy="ordered") as events:
            async for event in events:
                if self._client is None:
                    self._client = client
                    self._facts = replace(self._facts, connected=True, missing="")
                self._take(event.data)

    async def _watch(self, client: Client, topic: str, rate_hz: float) -> None:
        async with client.subscribe([topic], max_rate_hz=rate_hz) as events:
            async for event in events:
                self._take(event.data)

    async def _watch_button(self, client: Client, button: int) -> None:
        async with client.subscribe("agent_events", policy="ordered") as events:
            async for event in events:
                data: AgentEventData = event.data
                is_ours = data.agent == AGENT and data.button_id == button
                if is_ours and data.stop_number >= self._facts.stop_number:  # not stopped after the press
                    self._go_on()

    def _take(self, data: Any) -> None:
        self._set(updated(self._facts, data, self._by_hand))
        if isinstance(data, OdometryData):
            self._heard.set()

    def _set(self, facts: Facts) -> None:
        self._facts = facts
        self._changed()

    async def drive_to(self, position: NodePosition, max_speed_m_s: float | None = None) -> None:
        """Drive there, and no faster; a goal of ours that is under way is replaced.

        The daemon refuses it where the robot was stopped in a way that is not known here yet.
        """
        client = self._client
        if client is None:
            raise DriveFailed(self._facts.missing, OTHERWISE)
        driving = asyncio.create_task(
            client.navigate_to(
                position.x,
                position.y,
                position.theta,
                tolerance_m=position.allowed_deviation_xy,
                max_speed_m_s=max_speed_m_s,
                if_stop_number=self._facts.stop_number or None,
            )
        )
        earlier = list(self._drives)
        self._drives.append(driving)
        try:
            await asyncio.wait({driving})
        finally:
            driving.cancel()
            self._drives.remove(driving)
        if driving.cancelled() or driving.exception() is not None:
            for drive in earlier:  # it was not replaced, and would go on
                drive.cancel()
        try:
            await driving
        except asyncio.CancelledError:
            raise DriveFailed("it was given up") from None
        except GoalNotReached as ended:
            if ended.end != "cancelled":
                self._ways.clear()
            hint = AFTER_STOP if ended.cause == "not_armed" else HINTS.get(ended.end, OTHERWISE)
            raise DriveFailed(ended.reason, hint, by_people=ended.cause in BY_PEOPLE) from ended
        except CallError as refused:
            is_stopped = refused.kind in STOPPED
            hint = AFTER_STOP if is_stopped else OTHERWISE
            raise DriveFailed(refused.message, hint, by_people=is_stopped) from refused
        except (ChefbotError, OSError) as error:
            raise DriveFailed(str(error), OTHERWISE) from error

    async def stop(self) -> None:
        """Give up all goals, and wait until the robot stands.

        Also one that is to be replaced: where its successor is given up before it is accepted, it would go on.
        """
        if drives := list(self._drives):
            for drive in drives:
                drive.cancel()
            await asyncio.wait(drives)
        await self._until_standing()

    async def resume(self) -> None:
        """Go on, where somebody at the robot has paused navigation."""
        if self._client is not None and self._facts.paused:
            with suppress(ChefbotError):
                await self._client.resume_navigation(if_stop_number=self._facts.stop_number or None)

    async def _until_standing(self) -> None:
        """By odometry that came after the call; a robot that is silent is not waited for."""
        with suppress(TimeoutError):
            async with asyncio.timeout(STANDING_WITHIN_S):
                while self._client is not None:
                    self._heard.clear()
                    await self._heard.wait()
                    if not is_driving(self._facts):
                        return

    async def unreachable(self, position: NodePosition) -> str:
        """Why there is no path there on the map; empty: there is one, or there was lately.

        What is not on the map may leave: for that the robot waits when it drives.
        """
        if self._client is None:
            return self._facts.missing
        now_s = asyncio.get_running_loop().time()
        if self._ways.has(position, now_s):
            return ""
        try:
            plan = await self._client.plan_to(
                position.x, position.y, position.theta, tolerance_m=position.allowed_deviation_xy or 0.0
            )
        except ChefbotError as error:
            return str(error)
        if plan.possible:
            self._ways.add(position, now_s)
        return "" if plan.possible or plan.only_for_now else plan.reason

    async def set_pose(self, position: NodePosition) -> None:
        """Tell the robot where it is on the map in use."""
        if position.map_id != self._facts.map_id:
            raise CannotDo(f"the map is {self._facts.map_id or 'none'!a}, and not {position.map_id!a}")
        await self._call("set_pose", x_m=position.x, y_m=position.y, heading_rad=position.theta or 0.0)

    async def say(self, text: str) -> None:
        """Say a sentence on the robot's page and to whoever listens."""
        await self._call("say", text=text)

    async def ask(self, question: str, choices: list[str], timeout_s: float) -> str | None:
        """Ask on the robot's page; the answer, or None: also while the daemon is away, after ``AGAIN_S``."""
        if self._client is not None:
            try:
                return (await self._client.ask(question, choices, timeout_s)).choice
            except CallError as refused:
                raise CannotDo(refused.message) from refused
            except (ChefbotError, OSError) as error:
                log.warning("the daemon is away, with a question", question=question, why=str(error))
        await asyncio.sleep(AGAIN_S)
        return None

    async def _call(self, method: str, **params: Any) -> dict[str, Any]:
        if self._client is None:
            raise CannotDo(self._facts.missing)
        try:
            return await self._client.call(method, **params)
        except CallError as refused:
            raise CannotDo(refused.message) from refused
        except (ChefbotError, OSError) as error:
            raise CannotDo(str(error)) from error


def updated(facts: Facts, data: Any, by_hand: OperatingMode) -> Facts:
    """The facts after what a topic has told; ``by_hand`` is the mode in which somebody else drives."""
    match data:
        case MapPoseData() if data.state == "ended":
            return replace(facts, localized=False)
        case MapPoseData():
            if data.map is not None and facts.map_id and data.map != facts.map_id:
                return facts  # of a map that is no longer in use, or not yet
            return replace(facts, x_m=data.x_m, y_m=data.y_m, heading_rad=data.heading_rad, fit=data.fit)
        case OdometryData():
            return replace(facts, linear_m_s=data.linear_m_s, angular_rad_s=data.angular_rad_s)
        case LocalizationData():
            localized = data.state in ("localized", "uncertain")
            return replace(facts, map_id=data.map or "", localized=localized)
        case PathData():
            return replace(facts, path=tuple(zip(data.x_m, data.y_m, strict=True)))
        case NavigationData():
            return replace(facts, paused=data.state == "paused")
        case BatteryData():
            return replace(facts, voltage_v=data.voltage_v, charge_percent=data.percentage)
        case SafetyData():
            estopped = data.mode == "estopped"
            return replace(
                facts,
                mode=_mode(data.source, by_hand),
                armed=data.armed,
                e_stop=EStop.MANUAL if estopped else EStop.NONE,
                fault=data.fault or "",
                missing="" if data.armed else data.reason,
                held_back=data.limited_by is not None,
                stop_number=data.stop_number,
            )
    return facts


def _mode(source: str | None, by_hand: OperatingMode) -> OperatingMode:
    """Whoever else drives has the robot by hand; calibration is its service."""
    if source is None or source in ("navigation", "safety"):
        return OperatingMode.AUTOMATIC
    return OperatingMode.SERVICE if source == "calibration" else by_hand

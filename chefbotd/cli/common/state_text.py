"""The robot's state as short texts: pure functions of the socket's data.

``status`` and the teleop screen show the same texts.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from enum import StrEnum
from functools import partial
from typing import Any

from msgspec.structs import force_setattr

from chefbotd.component import StatusRow, resolve
from chefbotd.component_list import own_components
from chefbotd.core.geometry import Pose2D
from chefbotd.core.printable import one_line
from chefbotd.core.record import Record, replace

Data = Mapping[str, Any]

STALE_S = 1.0
"""Telemetry comes several times a second; an older value is shown faint."""


class Style(StrEnum):
    """How a fact is shown, as a style of rich."""

    PLAIN = "default"
    GOOD = "green"
    NOTICE = "yellow"
    ALARM = "bold red"
    FAINT = "dim"


class Fact(Record, frozen=True):
    """A line of a status display; ``age_s`` is None for what does not age."""

    label: str
    text: str
    style: Style = Style.PLAIN
    age_s: float | None = None

    def __post_init__(self) -> None:
        force_setattr(self, "text", one_line(self.text))  # the board, or another client, may have written it


def link(data: Data) -> Fact:
    """Up or down, with the device, and what is wrong with it."""
    if data["state"] == "up" and data.get("healthy") is False:
        condition = data["condition"].replace("_", " ")
        return Fact("link", f"up on {data['device']}, {condition}: {data['reason']}", Style.ALARM)
    if data["state"] == "up":
        return Fact("link", f"up on {data['device']}", Style.GOOD)
    device = f"{data['device']}: " if data["device"] else ""
    return Fact("link", f"down, {device}{data['reason'] or 'no device yet'}", Style.ALARM)


def firmware(data: Data) -> Fact:
    """Our own firmware on the board: its version, whether it stops by itself, and what it has refused."""
    name = " on ".join(filter(None, (data["version"] or "unknown", data["board"])))
    if data["deadman_ms"] is None:
        return Fact(
            "firmware", ", ".join([name, "does not stop by itself now", *reason_of(data)]), Style.NOTICE
        )
    refused = f"{data['crc_errors']} lines damaged, {data['refused']} refused"
    return Fact("firmware", f"{name}, stops by itself after {data['deadman_ms']} ms, {refused}", Style.GOOD)


CLASSIC = Fact("firmware", "not chefbotd's own, not known to stop by itself")
"""While no board of ours has named itself, as it does once a second."""


def safety(data: Data) -> Fact:
    """Whether the robot may move, and who drives."""
    if not data["armed"]:
        return Fact("mode", f"{data['mode']}: {data['reason']}", Style.ALARM)
    driver = _driver(data["source"], data.get("control", {}))
    if warning := data.get("guard_warning"):
        return Fact("mode", f"{data['mode']}, {driver}; {warning}", Style.ALARM)
    if data["limited_by"] is None:
        return Fact("mode", f"{data['mode']}, {driver}", Style.GOOD)
    return Fact("mode", f"{data['mode']}, {driver}, slowed by {data['limited_by']}", Style.NOTICE)


def _driver(source: str | None, control: Mapping[str, str]) -> str:
    """The driver: the source whose command is in force, with the client that controls it; else who controls what."""
    if source:
        return f"driven by {control[source]} as {source}" if source in control else f"driven by {source}"
    held = [f"{name} has {held}" for held, name in control.items()]
    return "nobody drives" + (f" ({', '.join(held)})" if held else "")


def odometry(data: Data) -> Fact:
    """The pose in ``odom``: from where the robot stood at the start, by what its wheels have turned."""
    return Fact("pose", f"{pose(Pose2D(data['x_m'], data['y_m'], data['heading_rad']))}, by odometry")


def map_pose(data: Data) -> Fact:
    """The pose on the map in use."""
    return Fact("on the map", pose(Pose2D(data["x_m"], data["y_m"], data["heading_rad"])))


def pose(value: Pose2D) -> str:
    """A pose in metres and degrees."""
    return f"x {value.x_m:+.3f} m  y {value.y_m:+.3f} m  heading {math.degrees(value.heading_rad):+.1f}°"


def speed(data: Data) -> Fact:
    """The measured twist."""
    return Fact("speed", twist(data["linear_m_s"], data["angular_rad_s"]))


def twist(linear_m_s: float, angular_rad_s: float) -> str:
    """A twist in m/s and rad/s."""
    return f"{linear_m_s:+.3f} m/s  {angular_rad_s:+.3f} rad/s"


def wheels(data: Data) -> Fact:
    """Each wheel's speed, and its duty in brackets."""
    rows = zip(data["name"], data["velocity_rad_s"], data["duty"], strict=True)
    return Fact(
        "wheels", ", ".join(f"{n.removesuffix('_wheel')} {v:+.2f} rad/s ({d:+d})" for n, v, d in rows)
    )


def battery(data: Data) -> Fact:
    """Volts, percentage, and whether that is low."""
    style = {"ok": Style.GOOD, "low": Style.NOTICE, "critical": Style.ALARM}[data["status"]]
    return Fact("battery", f"{data['voltage_v']:.2f} V, {data['percentage']:.0f} %, {data['status']}", style)


def ranges(data: Data) -> Fact:
    """Each beam's distance, or why there is none."""
    return Fact("ranges", ", ".join(map(_beam, data["ranges"])) or "none")


def _beam(data: Data) -> str:
    reading = f"{data['range_m']:.2f} m" if data["status"] == "ok" else data["status"].replace("_", " ")
    return f"{data['sensor']} {reading}"


def lidars(data: Data) -> Fact:
    """How each lidar is."""
    conditions = ", ".join(
        f"{lidar['lidar']} {lidar['condition'].replace('_', ' ')}" for lidar in data["lidars"]
    )
    good = all(lidar["condition"] == "healthy" for lidar in data["lidars"])
    return Fact("lidars", conditions or "none", Style.GOOD if good else Style.NOTICE)


def imu(data: Data) -> Fact:
    """The IMU's own heading, or its turning rate where it has no heading."""
    if data["heading_rad"] is not None:
        return Fact("imu", f"heading {math.degrees(data['heading_rad']):+.1f}°")
    if data["angular_velocity_rad_s"] is not None:
        return Fact("imu", f"turning {data['angular_velocity_rad_s'][2]:+.3f} rad/s")
    return Fact("imu", "no data", Style.NOTICE)


def reason_of(data: Data) -> list[str]:
    """The reason as a part of a sentence, where there is one."""
    return [data["reason"]] if data["reason"] else []


def counters(data: Data) -> Fact:
    """The daemon's counters; errors only when there are any."""
    wrong = {
        "lines refused": sum(data["refused"].values()),
        "encoder readings refused": data["encoder_readings_refused"],
        "board restarts": data["board_restarts"],
        "events dropped": sum(data["bus_dropped"].values()) + data["telemetry_dropped"],
    }
    problems = [f"{n} {what}" for what, n in wrong.items() if n]
    lines = f"{sum(data['frames'].values())} lines in, {data['lines_out']} out"
    clients = "1 client" if data["clients"] == 1 else f"{data['clients']} clients"
    text = ", ".join([f"up {data['uptime_s']:.0f} s", lines, clients, *problems])
    return Fact("counters", text, Style.NOTICE if problems else Style.PLAIN)


def drive_warning(data: Data) -> Fact:
    """Wheels that do not follow their commands."""
    return Fact("wheels", data["reason"], Style.ALARM)


def left_out_imu(data: Data) -> Fact:
    """Why odometry leaves the IMU out."""
    return Fact("imu", data["reason"], Style.ALARM)


Words = Callable[[Data], Fact]
Rows = Sequence[tuple[str, Words]]

CORE_ROWS: Rows = (
    ("safety", safety),
    ("link", link),
    ("firmware", firmware),
    ("odometry", odometry),
    ("map_pose", map_pose),
    ("odometry", speed),
    ("wheels", wheels),
    ("drive_warning", drive_warning),
    ("imu", imu),
    ("odometry_condition", left_out_imu),
    ("ranges", ranges),
    ("lidars", lidars),
    ("battery", battery),
)
AGEING = {"odometry", "map_pose", "wheels", "imu", "ranges", "battery"}
"""Topics that are sent periodically. The others are sent when they change, and do not age."""

WITH_REASON = {"drive_warning", "odometry_condition"}
"""Topics that are shown only while they have a reason: nothing is wrong otherwise."""


def plugins(values: Sequence[Data]) -> Fact:
    """Each plug-in that the configuration allows; why one does not run."""
    is_complete = not any(plugin["reason"] for plugin in values)
    text = "; ".join(_plugin(plugin) for plugin in values)
    return Fact("plugins", text, Style.PLAIN if is_complete else Style.NOTICE)


def _plugin(data: Data) -> str:
    name = " ".join(filter(None, (data["name"], data["version"])))
    return f"{name} is left out: {data['reason']}" if data["reason"] else name


def with_rows(rows: Iterable[StatusRow]) -> Rows:
    """The rows, with those of components where they stand; one that fails says so in its place."""
    placed, waiting = list(CORE_ROWS), list(rows)
    while waiting:
        topics = [topic for topic, _ in placed]
        row = next((row for row in waiting if row.after in topics), waiting[0])
        waiting.remove(row)
        place = len(topics) - topics[::-1].index(row.after) if row.after in topics else len(topics)
        placed.insert(place, (row.topic, partial(_of_component, row)))
    return placed


def _of_component(row: StatusRow, data: Data) -> Fact:
    try:
        fact = resolve(row.fact)(data)
        if not isinstance(fact, Fact):
            raise TypeError(f"expected a Fact, got {fact!r}")
    except Exception as error:  # noqa: BLE001 - somebody else's code, and it is shown
        return Fact(row.topic, f"its row fails: {type(error).__name__}: {error}", Style.NOTICE)
    return fact


def of_topics(
    latest: Mapping[str, Data], rows: Rows = CORE_ROWS, ageing: Collection[str] = AGEING
) -> list[Fact]:
    """The latest values by topic, each with ``data`` and ``age_s``; what is stale is faint."""
    return [
        mark_age(word, latest[topic], ages=topic in ageing)
        for topic, word in rows
        if topic in latest and (topic not in WITH_REASON or latest[topic]["data"].get("reason"))
    ]


def mark_age(word: Words, value: Data, *, ages: bool) -> Fact:
    """What the words say of the data; faint where it is old and ``ages``."""
    fact = word(value["data"])
    if not ages:
        return fact
    age_s = value["age_s"]
    return replace(fact, age_s=age_s, style=fact.style if age_s < STALE_S else Style.FAINT)


def of_state(state: Data, rows: Iterable[StatusRow] = ()) -> list[Fact]:
    """Everything in an answer of ``get_state``, the rows of components, and the allowed plug-ins where it has any."""
    rows = [*(row for component in own_components() for row in component.status), *rows]
    ageing = AGEING | {row.topic for row in rows if row.ages}
    always = {"safety": {"data": state["safety"]}, "link": {"data": state["link"]}}
    facts = of_topics({**state["topics"], **always}, with_rows(rows), ageing)
    if state["link"]["state"] == "up" and "firmware" not in state["topics"]:
        facts.insert(2, CLASSIC)
    return [*facts, plugins(state["plugins"])] if state.get("plugins") else facts

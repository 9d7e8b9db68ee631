"""What the robot tells while nobody touches it: lines, clock, battery, sensors, lidars, latency."""

import asyncio
import time
from collections import Counter
from collections.abc import Sequence
from statistics import median
from typing import Any

from msgspec import convert

from chefbotd.client import Client, Event
from chefbotd.client.state import State
from chefbotd.components.doctor.algorithms.analogue import AnalogueInput, check_adc
from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.components.doctor.algorithms.firmware import FirmwareFacts, check_firmware
from chefbotd.components.doctor.algorithms.host import check_baud
from chefbotd.components.doctor.algorithms.latency import check_latency
from chefbotd.components.doctor.algorithms.lidar import check_lidar
from chefbotd.components.doctor.algorithms.lines import (
    LinesHeard,
    check_at_rest,
    check_clock,
    check_damaged,
    check_formats,
    check_heard,
)
from chefbotd.components.doctor.algorithms.missing_lines import check_missing
from chefbotd.components.doctor.algorithms.sensors import Beams, check_battery, check_beams, check_imu
from chefbotd.components.doctor.algorithms.sketches import Expected, check_expected, check_sketch
from chefbotd.components.doctor.cli.collecting import attitude, collect_events, of_topic, scan
from chefbotd.components.doctor.cli.diagnosis import Diagnosis
from chefbotd.components.doctor.listening.line_survey import LineSurvey, line_bytes
from chefbotd.settings import Settings

TOPICS = ("raw", "firmware", "imu", "ranges", "battery", "scan", "lidars", "odometry", "stats")
PINGS, PING_EVERY_S = 50, 0.02


async def examine_robot(diagnosis: Diagnosis, robot: Client, *, rate_is_known: bool = False) -> LinesHeard:
    """Listen for ``diagnosis.seconds``, and say what was found; what was heard of the board.

    ``rate_is_known``: the baud rate has been found out already.
    """
    state = await robot.get_state()
    async with collect_events(robot, TOPICS) as events:
        await asyncio.sleep(diagnosis.seconds)
    heard = _survey(diagnosis, of_topic(events, "raw"))
    if state.link.state != "up":
        diagnosis.find(
            problem(
                "link", f"the daemon has no link to the board: {state.link.reason}", "see the findings above"
            )
        )
    else:
        if not rate_is_known:
            diagnosis.find(_rate(diagnosis, heard, state))
        diagnosis.find(*line_findings(diagnosis, heard, of_topic(events, "firmware")))
    diagnosis.find(_safety(state))
    if state.safety.guard_warning:
        diagnosis.find(warning("guard", state.safety.guard_warning, "delete it, and restart the daemon"))
    diagnosis.find(*_sensor_findings(diagnosis, heard, events, await robot.get_state()))
    diagnosis.find(_odometry(of_topic(events, "odometry"), diagnosis.seconds))
    diagnosis.find(check_latency(await _round_trips_s(robot), _loop_lag_s(of_topic(events, "stats"))))
    return heard


def _survey(diagnosis: Diagnosis, lines: Sequence[Event[Any]]) -> LinesHeard:
    inward = [event for event in lines if event.data.direction == "in"]
    if not inward:
        return LinesHeard(seconds=diagnosis.seconds)
    survey = LineSurvey(diagnosis.settings.robot.wire, inward[-1].stamp_s - diagnosis.seconds)
    for event in inward:
        survey.feed(line_bytes(event.data.line), event.stamp_s)
    return survey.heard(inward[-1].stamp_s)


def expect_board(diagnosis: Diagnosis) -> Expected:
    """What the configuration takes for granted of the board."""
    settings = diagnosis.settings
    return Expected(
        settings.robot.wire,
        len(settings.chassis.wheels),
        settings.drive.max_duty,
        settings.link.board_buffer_bytes,
    )


def _rate(diagnosis: Diagnosis, heard: LinesHeard, state: State) -> Finding:
    baud = diagnosis.settings.link.baud
    if heard.is_garbled or state.link.condition == "wrong_baud":
        return problem(
            "baud",
            f"at {baud} baud only garbage is heard",
            "stop the daemon and run the doctor again: it then tries the other rates",
        )
    return check_baud(baud, baud if heard.is_board else None, heard_anything=heard.bytes > 0)


def line_findings(
    diagnosis: Diagnosis, heard: LinesHeard, reports: Sequence[Event[Any]] = ()
) -> list[Finding]:
    """What the lines themselves say, and what the daemon says of our firmware on the board."""
    firmware = FirmwareFacts(heard.firmware, "", None) if heard.firmware else None
    if reports:
        firmware = convert(reports[-1].data, FirmwareFacts, from_attributes=True)
    return [
        check_heard(heard),
        *check_formats(heard),
        check_missing_of(diagnosis.settings, heard),
        check_damaged(heard),
        check_sketch(heard),
        check_firmware(firmware, is_board=heard.is_board),
        check_expected(heard, expect_board(diagnosis)),
        check_clock(heard),
        check_at_rest(heard, diagnosis.settings.encoders.counts_per_turn),
    ]


def check_missing_of(settings: Settings, heard: LinesHeard) -> Finding:
    """What this robot does not notice, as its board leaves out kinds of lines."""
    guard = settings.safety.guard
    others = [sensor.name for sensor in settings.infrared]
    others += [lidar.name for lidar in settings.lidar]
    others += [scanner.name for scanner in settings.further_scanners if scanner.guards]
    return check_missing(
        heard,
        others if guard.enabled else (),
        silent_is_obstacle=guard.enabled and guard.silent_is_obstacle and settings.ultrasonic is not None,
    )


def _safety(state: State) -> Finding:
    safety = state.safety
    if safety.armed:
        return ok("safety", "the robot is armed: it may be driven")
    return warning(
        "safety",
        f"the robot is {safety.mode}: {safety.reason}",
        "mend what is told, keep clear of the wheels, then 'chefbotctl arm'",
    )


def _sensor_findings(
    diagnosis: Diagnosis, heard: LinesHeard, events: Sequence[Event[Any]], state: State
) -> list[Finding]:
    settings, findings = diagnosis.settings, [_battery(diagnosis, heard, of_topic(events, "battery"))]
    attitudes = [attitude(event.data) for event in of_topic(events, "imu")]
    left_out = state.odometry_condition.reason if "odometry_condition" in state.topics else ""
    findings.append(
        check_imu(
            attitudes,
            configured=settings.imu is not None,
            sends_imu=heard.sends("i"),
            left_out=left_out,
        )
    )
    beams = _beams(of_topic(events, "ranges"))
    if settings.ultrasonic is not None:
        findings.append(check_ultrasonic(settings.ultrasonic.name, beams, sends=heard.sends("u")))
    findings += [
        check_beams(sensor.name, beams.get(sensor.name), kind="infrared") for sensor in settings.infrared
    ]
    adc = check_adc_of(diagnosis.settings, heard)
    return [*findings, *([] if adc is None else [adc]), *_lidars(diagnosis, events, state)]


def check_adc_of(settings: Settings, heard: LinesHeard) -> Finding | None:
    """Whether the analogue readings fit the bits that the configuration says."""
    battery = settings.battery
    full_scale = 4095 if battery is None else battery.adc_full_scale
    volts_per_count = 0.0 if battery is None else battery.reference_v * battery.divider_ratio / full_scale
    return check_adc(
        None if battery is None else heard.battery,
        full_scale,
        volts_per_count,
        (0.0, 0.0) if battery is None else (battery.critical_v, battery.full_v),
        [
            AnalogueInput(
                sensor.name, heard.analogue.get(sensor.channel), sensor.adc_bits, sensor.reference_v
            )
            for sensor in settings.infrared
        ],
    )


def check_ultrasonic(name: str, beams: dict[str, Beams], *, sends: bool) -> Finding:
    """A sketch without an ultrasonic sends no line of it."""
    if not sends and name not in beams:
        return skip_check(
            f"ultrasonic {name}",
            "the board sends no 'u' lines",
            "sketches B and D have none: then remove [ultrasonic] from the configuration",
        )
    return check_beams(name, beams.get(name), kind="ultrasonic")


def _battery(diagnosis: Diagnosis, heard: LinesHeard, events: Sequence[Event[Any]]) -> Finding:
    parameters = diagnosis.settings.battery
    if parameters is None:
        return skip_check(
            "battery",
            "no [battery] is configured: the robot does not notice an empty one",
            "measure it by hand, or wire a divider to the board and describe it in [battery]",
        )
    return check_battery(
        events[-1].data.voltage_v if events else None,
        events[-1].data.status if events else "",
        sends_battery=heard.sends("b"),
        absent_below_v=diagnosis.settings.safety.battery.absent_below_v,
        low_v=parameters.low_v,
        critical_v=parameters.critical_v,
    )


def _beams(events: Sequence[Event[Any]]) -> dict[str, Beams]:
    statuses: dict[str, Counter[str]] = {}
    metres: dict[str, list[float]] = {}
    for event in events:
        for beam in event.data.ranges:
            statuses.setdefault(beam.sensor, Counter())[str(beam.status)] += 1
            if beam.range_m is not None:
                metres.setdefault(beam.sensor, []).append(beam.range_m)
    return {
        name: Beams(dict(counts), median(metres[name]) if name in metres else None)
        for name, counts in statuses.items()
    }


def _lidars(diagnosis: Diagnosis, events: Sequence[Event[Any]], state: State) -> list[Finding]:
    """Each lidar's condition as the daemon tells it, with the same reason as ``status``."""
    rows = state.lidars.lidars if "lidars" in state.topics else ()
    conditions = {row.lidar: row for row in rows}
    findings = []
    for lidar in diagnosis.settings.lidar:
        turns = [event for event in of_topic(events, "scan") if event.data.lidar == lidar.name]
        condition = conditions.get(lidar.name)
        if condition is None:
            findings.append(
                problem(
                    f"lidar {lidar.name}",
                    f"the daemon knows no lidar {lidar.name}",
                    "start the daemon again: its configuration has changed",
                )
            )
            continue
        how, why = condition.condition, condition.reason
        covered = 0.0
        if turns:
            ranges = scan(turns[-1].data).range_m
            covered = sum(row > 0 for row in ranges) / max(len(ranges), 1)
        findings.append(check_lidar(lidar.name, how, why, len(turns) / diagnosis.seconds, covered))
    return findings


def _odometry(events: Sequence[Event[Any]], seconds: float) -> Finding:
    if not events:
        return problem("pose", "the robot tells no pose", "it needs encoder lines: see the findings on lines")
    pose = events[-1].data
    return ok(
        "pose",
        f"odometry says x {pose.x_m:.2f} m, y {pose.y_m:.2f} m, {len(events) / seconds:.0f} times a second",
    )


def _loop_lag_s(stats: Sequence[Event[Any]]) -> float | None:
    lags = [
        event.data.loop_lag_s for event in stats if isinstance(getattr(event.data, "loop_lag_s", None), float)
    ]
    return max(lags) if lags else None


async def _round_trips_s(robot: Client) -> list[float]:
    """By the computer's own clock: the loop's may be virtual, or tell whole milliseconds."""
    trips = []
    for _ in range(PINGS):
        began_s = time.perf_counter()
        await robot.ping()
        trips.append(time.perf_counter() - began_s)
        await asyncio.sleep(PING_EVERY_S)
    return trips

"""Drives one wheel at a time, on blocks, after a typed yes. The motors stop however this ends."""

import asyncio
from functools import partial
from typing import Any

from chefbotd.cli.drive.control import ignoring_too_old, release_source
from chefbotd.client import CallError, Client, Event
from chefbotd.components.doctor.algorithms.finding import Finding, Verdict, skip_check
from chefbotd.components.doctor.algorithms.latency import check_echo
from chefbotd.components.doctor.algorithms.wheels import (
    TURNED_RAD,
    WheelRun,
    WheelSample,
    WheelSetting,
    check_faults,
    check_hand_turns,
    check_motor,
    check_scale,
)
from chefbotd.components.doctor.cli.collecting import collect_events, of_topic
from chefbotd.components.doctor.cli.diagnosis import YES, Diagnosis
from chefbotd.components.doctor.listening.line_survey import echo_delays_s, line_bytes
from chefbotd.core.record import replace
from chefbotd.safety.faults import FaultKind

PERIOD_S = 0.05
CREEP, STEADY, HARD = (0.1, 0.8), (0.3, 1.0), (0.8, 1.0)
"""Shares of ``max_rim_speed_m_s``, and for how long. A wheel that turned at the first goes on with the second, so that a
board with another scale is noticed at a creep; one that did not is asked for the third, so that friction is overcome."""

STANDSTILL_S = 0.8

PROVOKED = frozenset(
    {FaultKind.OVERSPEED, FaultKind.WHEEL_STALLED, FaultKind.WHEEL_REVERSED, FaultKind.ENCODER_JUMPS}
)
"""What wrong signs, plugs and scales lead to, and what is over when the wheel stands. Any other fault ends the test."""

QUESTION = """\
The doctor can turn each wheel forward, slowly, one after the other, for two seconds each.
Put the robot on blocks, so that all its wheels hang free, and keep hands and cables away from them.
A fault that this provokes stops the motors; the doctor then arms the robot again for the next wheel.
Ctrl-C stops everything. Type yes to begin, or press Enter to leave it out."""

TURN_BY_HAND = """\
The wheels' speeds do not fit the duty's scale. Wrong counts per turn of the encoders look the same.
Mark {name}, turn it forward by hand, exactly ten turns, and then type yes; press Enter to leave it out."""

ANSWERS = {
    "yes": "forward",
    "y": "forward",
    "forward": "forward",
    "back": "backward",
    "backward": "backward",
    "other": "other",
    "none": "nothing",
    "no": "nothing",
}


async def examine_motors(diagnosis: Diagnosis, robot: Client) -> None:
    """Ask, drive each wheel, ask what was seen, and conclude."""
    if (why := await _why_not(diagnosis, robot)) is not None:
        diagnosis.find(skip_check("motors", *why))
        return
    runs: list[WheelRun] = []
    delays_s: list[float] = []
    try:
        for wheel in diagnosis.wheels:
            if (stopped := await _not_ready(robot, runs)) is not None:
                diagnosis.find(
                    skip_check(
                        f"motor {wheel.name}", f"it was not driven: {stopped}", "mend that, then 'arm'"
                    )
                )
                break
            run, lines = await run_wheel(diagnosis, robot, wheel)
            delays_s += echo_delays_s(lines, len(diagnosis.wheels))
            run = replace(run, seen=await _ask_what_was_seen(diagnosis, wheel.name))
            runs.append(run)
            diagnosis.find(check_motor(diagnosis.wheels, run))
    finally:
        if robot.connected:
            await release_source(robot)
    await _examine_scale(diagnosis, robot, runs)
    diagnosis.find(check_echo(delays_s), *check_faults(runs))


async def _examine_scale(diagnosis: Diagnosis, robot: Client, runs: list[WheelRun]) -> None:
    """Conclude about the duty's scale; where it does not fit, only after a wheel was turned by hand."""
    drive, wheels = diagnosis.settings.drive, diagnosis.wheels
    check = partial(
        check_scale, wheels, runs, max_duty=drive.max_duty, max_rim_speed_m_s=drive.max_rim_speed_m_s
    )
    finding = check()
    if finding.verdict is Verdict.PROBLEM:
        counted = await _turn_by_hand(diagnosis, robot, wheels[0].name)
        if counted is not None:
            diagnosis.find(counted)
        finding = check(counts_are_right=counted is not None and counted.verdict is Verdict.OK)
    diagnosis.find(finding)


async def _turn_by_hand(diagnosis: Diagnosis, robot: Client, name: str) -> Finding | None:
    """Have a wheel turned ten times by hand; None where nobody does so."""
    before_rad = await _position_rad(robot, name)
    if await diagnosis.asker.ask(TURN_BY_HAND.format(name=name)) != YES:
        return None
    turned_rad = await _position_rad(robot, name) - before_rad
    return check_hand_turns(name, turned_rad, diagnosis.settings.encoders.counts_per_turn)


async def _position_rad(robot: Client, name: str) -> float:
    async with robot.subscribe("wheels") as events:
        async for event in events:
            return dict(zip(event.data.name, event.data.position_rad, strict=True))[name]
    raise ConnectionError("the daemon has ended")


async def _why_not(diagnosis: Diagnosis, robot: Client) -> tuple[str, str] | None:
    """Why the wheels are not driven, and what to do; None: somebody has typed yes, and they may be."""
    if not diagnosis.motors:
        return (
            "the motors were not driven",
            "'chefbotctl doctor --motors' does so, on blocks, once you have typed yes",
        )
    safety = (await robot.get_state()).safety
    if not safety.armed:
        return f"the robot is {safety.mode}: {safety.reason}", "'chefbotctl arm', then ask the doctor again"
    if safety.control:
        who = ", ".join(safety.control.values())
        return f"{who} drives the robot", "have them let go first"
    if await diagnosis.asker.ask(QUESTION) != YES:
        return "nobody typed yes", "run it again with somebody beside the robot"
    return None


async def _not_ready(robot: Client, runs: list[WheelRun]) -> str | None:
    """Arm again after a fault that the run before has provoked; else why the next wheel is not driven."""
    safety = (await robot.get_state()).safety
    if safety.armed:
        return None
    if not runs or safety.fault not in PROVOKED or safety.fault != runs[-1].fault:
        return f"the robot is {safety.mode}: {safety.reason}"
    await robot.arm(safety.latch)  # not what somebody has pressed meanwhile
    return None


async def run_wheel(
    diagnosis: Diagnosis, robot: Client, wheel: WheelSetting
) -> tuple[WheelRun, list[tuple[float, bool, bytes]]]:
    """Drive one wheel: what all wheels did, and the lines on the wire meanwhile. Zero is commanded on every exit."""
    top_rad_s = diagnosis.settings.drive.max_rim_speed_m_s / wheel.radius_m
    async with collect_events(robot, ("wheels", "raw", "safety")) as events:
        try:
            refused = await turn_wheel(robot, wheel.name, CREEP[0] * top_rad_s, CREEP[1])
            if not refused:
                share, seconds = STEADY if _has_turned(events) else HARD
                refused = await turn_wheel(robot, wheel.name, share * top_rad_s, seconds)
            samples = _samples(events)
        finally:
            if robot.connected:
                await release_source(robot)
        safety = (await robot.get_state()).safety
        await asyncio.sleep(STANDSTILL_S)
    held = {event.data.limited_by for event in of_topic(events, "safety")} - {None}
    fault = safety.fault or ""
    run = WheelRun(
        wheel.name,
        samples,
        fault=fault,
        reason=safety.reason if fault else "",
        held_by=", ".join(sorted(held)),
        refused=refused,
    )
    return run, _lines(events)


async def turn_wheel(robot: Client, name: str, speed_rad_s: float, seconds: float) -> str:
    """Repeat the command within the dead-man's time; why the daemon refuses it, as after a fault (empty: it does not).

    A command that came too late on a busy computer is sent again.
    """
    loop = asyncio.get_running_loop()
    ends_s = loop.time() + seconds
    try:
        while loop.time() < ends_s:
            with ignoring_too_old():
                await robot.set_wheel_velocities({name: speed_rad_s})
            await asyncio.sleep(PERIOD_S)
    except CallError as error:
        return error.message
    return ""


def _samples(events: list[Event[Any]]) -> tuple[WheelSample, ...]:
    return tuple(
        WheelSample(
            event.stamp_s,
            dict(zip(event.data.name, event.data.position_rad, strict=True)),
            dict(zip(event.data.name, event.data.velocity_rad_s, strict=True)),
            dict(zip(event.data.name, event.data.duty, strict=True)),
        )
        for event in of_topic(events, "wheels")
    )


def _has_turned(events: list[Event[Any]]) -> bool:
    samples = _samples(events)
    if not samples:
        return False
    before, after = samples[0].position_rad, samples[-1].position_rad
    return any(abs(after[name] - before[name]) > TURNED_RAD for name in before)


def _lines(events: list[Event[Any]]) -> list[tuple[float, bool, bytes]]:
    return [
        (event.stamp_s, event.data.direction == "out", line_bytes(event.data.line))
        for event in of_topic(events, "raw")
    ]


async def _ask_what_was_seen(diagnosis: Diagnosis, name: str) -> str:
    answer = await diagnosis.asker.ask(
        f"{name} was driven forward. What did you see? Type yes (it turned forward), back (it turned backward), "
        "other (another wheel turned) or none (nothing turned); Enter if you did not look."
    )
    return ANSWERS.get((answer or "").lower(), "")

"""The control loop between the gate and the wire."""

import asyncio

import pytest

from chefbotd.core.events import BoardRestarted, EncodersCounted, LinkClosed, WheelsMeasured
from chefbotd.core.geometry import Twist2D
from tests.chefbotd.driving.rig import AHEAD, FULL_DUTY, Rig, on_rig


def test_every_encoder_frame_is_answered_with_a_duty():
    """Also at rest: a stop that was lost on the wire is repeated with every frame."""

    async def scenario(rig: Rig) -> None:
        before = len(rig.written)
        await rig.frames(0.1)
        assert [duty for _, duty in rig.written[before:]] == [(0, 0)] * 10
        assert rig.service.memory.steps == 10

    on_rig(scenario)


def test_an_encoder_frame_is_answered_before_publishing_it_returns():
    """No turn of the loop lies between the bytes of a frame and its duty."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02)
        before = len(rig.written)
        rig.bus.publish(
            EncodersCounted(rig.clock.now_s(), rig.clock.now_s(), rig.clock.now_s() + 0.01, (0, 0))
        )
        assert [duty for _, duty in rig.written[before:]] == [(0, 0)]

    on_rig(scenario)


def test_a_command_is_on_the_wire_before_the_call_returns():
    """No frame and no turn of the loop lies between the command and its duty."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02)
        await asyncio.sleep(0.005)
        rig.service.command("teleop", AHEAD)
        assert rig.duty == (45, 45)  # 40 + 1000 * (1 m/s² * 5 ms)

    on_rig(scenario)


def test_nothing_moves_before_the_first_reading_of_a_link():
    """Newly opened, or opened again after a drive: only stops until the encoders are heard, and that is told."""

    async def scenario(rig: Rig) -> None:
        for _ in range(2):
            before = len(rig.written)
            rig.service.command("teleop", AHEAD)
            await asyncio.sleep(0.1)
            rig.service.command("teleop", AHEAD)
            assert {duty for _, duty in rig.written[before:]} <= {(0, 0)}
            assert [rig.safety.take_event() for _ in range(len(rig.safety))][
                -1
            ].limited_by == "encoders_stale"
            await rig.drive_for(0.1)
            assert any(rig.duty)
            rig.bus.publish(LinkClosed(rig.clock.now_s(), "fake", "unplugged"))
            await asyncio.sleep(0)
            await rig.open_link()
            rig.arm()

    on_rig(scenario)


def test_speed_ramps_up_within_the_acceleration_limit():
    """At 1 m/s² the setpoint is 0.1 m/s after 0.1 s and 0.2 m/s from 0.2 s on."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.1)
        assert rig.duty == (140, 140)
        await rig.drive_for(0.15)
        assert rig.duty == FULL_DUTY

    on_rig(scenario)


def test_the_dead_man_ramps_down_and_brakes():
    """0.5 s after the last command the setpoint falls at 1 m/s²: still at 0.45 s, at rest by 0.75 s."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        await rig.frames(0.45)
        assert rig.duty == FULL_DUTY
        await rig.frames(0.15)
        assert 0 < rig.duty[0] < 240
        await rig.frames(0.15)
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_the_dead_man_does_not_need_encoder_frames():
    """Encoders fall silent while driving: the ramp to zero happens all the same, on the watch period."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        await asyncio.sleep(0.8)
        assert rig.duty == (0, 0)
        stopped_s = next(at for at, duty in rig.written if at > 0.4 and duty == (0, 0))
        assert stopped_s <= 0.3 + 0.5 + 0.2 + 2 * 0.02 + 0.011

    on_rig(scenario)


def test_stop_ramps_down_at_once():
    """Stop does not wait for the dead-man: at rest after the 0.2 s that braking from 0.2 m/s takes."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.stop()
        await rig.frames(0.1)
        assert 0 < rig.duty[0] < 240
        await rig.frames(0.12)
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_a_released_source_gives_way_at_once():
    """Teleop held the robot still; once it is forgotten, navigation's command is on the wire in the same call."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02)
        rig.service.command("navigation", AHEAD)
        rig.service.command("teleop", Twist2D())
        await rig.frames(0.05)
        assert rig.duty == (0, 0)
        await asyncio.sleep(0.005)
        rig.service.release("teleop")
        assert rig.duty == (45, 45)
        rig.service.release("safety")
        await rig.frames(0.01)
        assert rig.modes()[-1] == ("armed", "navigation")

    on_rig(scenario)


def test_releasing_the_last_source_brakes_within_the_limits():
    """Nobody else asks for anything: the robot ramps down, at rest 0.2 s later; also unlinked nobody minds."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.release("teleop")
        await rig.frames(0.1)
        assert 0 < rig.duty[0] < 240
        await rig.frames(0.12)
        assert rig.duty == (0, 0)
        rig.bus.publish(LinkClosed(rig.clock.now_s(), "fake", "pulled"))
        await asyncio.sleep(0)
        rig.service.release("teleop")
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_braking_is_zero_at_once_and_no_command_is_left():
    """Zero in the same call and ever after, although the command was a moment old; a new one moves it again."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.brake()
        assert rig.duty == (0, 0)
        before = len(rig.written)
        await rig.frames(0.3)
        assert {duty for _, duty in rig.written[before:]} == {(0, 0)}
        await rig.drive_for(0.05)
        assert rig.duty[0] > 0

    on_rig(scenario)


def test_each_wheel_is_driven_as_it_was_named():
    """2 rad/s on a radius of 0.05 m: 40 + 1000 * 0.1 for the right one, nothing for the left one."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        for _ in range(20):
            rig.service.command("teleop", rig.service.wheels.wheel_velocities({"right_wheel": 2.0}))
            await rig.frames(0.01)
        assert rig.duty == (0, 140)

    on_rig(scenario)


def test_wheels_are_measured_in_radians_and_board_time():
    """500 of 1000 counts in 0.5 s of board time are pi rad travelled; half of a wheel's turn."""

    async def scenario(rig: Rig) -> None:
        rig.bus.publish(EncodersCounted(rig.clock.now_s(), rig.clock.now_s(), 10.0, (0, 0)))
        rig.bus.publish(EncodersCounted(rig.clock.now_s(), rig.clock.now_s(), 10.5, (500, -500)))
        await asyncio.sleep(0)
        measured = [
            e
            for e in (rig.wheels.take_event() for _ in range(len(rig.wheels)))
            if isinstance(e, WheelsMeasured)
        ]
        assert measured[-1].travel_rad == pytest.approx((3.14159265, -3.14159265))
        assert measured[-1].velocity_rad_s == pytest.approx((6.2831853, -6.2831853))

    on_rig(scenario)


def test_an_impossible_jump_moves_nothing_and_is_counted():
    """Counts that lost digits: no wheel event, one refusal; the next good reading carries on."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02, counts=(12345, 12345))
        before = len(rig.wheels)
        await rig.frames(0.01, counts=(12345, 123))
        assert len(rig.wheels) == before
        assert rig.service.reader.memory.refused == 1
        await rig.frames(0.01, counts=(12346, 12346))
        assert rig.wheels.take_event().position_rad == (0.0, 0.0)

    on_rig(scenario)


def test_a_board_restart_rebases_the_encoders():
    """Counts at zero after the restart are no travel, and positions go on."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02, counts=(5000, 5000))
        rig.bus.publish(BoardRestarted(rig.clock.now_s(), "banner"))
        await rig.frames(0.02, counts=(0, 0))
        measured = [
            e
            for e in (rig.wheels.take_event() for _ in range(len(rig.wheels)))
            if isinstance(e, WheelsMeasured)
        ]
        assert len(measured) == 4
        assert all(event.travel_rad == (0.0, 0.0) for event in measured)
        assert rig.service.reader.memory.refused == 0

    on_rig(scenario)


def test_gains_change_while_it_drives():
    """The gains that are exchanged are the ones that it has, and the duty goes on as it was."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        changed = {
            name: gains.model_copy(update={"kp": 5.0}) for name, gains in rig.service.wheels.gains().items()
        }
        rig.service.wheels.retune(changed)
        assert rig.service.wheels.gains() == changed
        rig.service.command("teleop", AHEAD)
        assert rig.duty == FULL_DUTY

    on_rig(scenario)

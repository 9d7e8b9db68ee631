"""An encoder of KHAN's dies while it drives: its healthy mate is believed, and the robot does not run away."""

import asyncio
from dataclasses import dataclass, field

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.wires import frozen, rewire

TWIST = tuple[float, float]

MOTIONS: dict[str, tuple[TWIST, TWIST]] = {
    "turns on the spot from rest": ((0.0, 0.0), (0.0, 1.0)),
    "starts into a tight arc": ((0.0, 0.0), (0.15, -0.8)),
    "turns out of driving": ((0.2, 0.0), (0.0, 1.0)),
    "drives out of turning": ((0.0, 1.0), (0.3, 0.0)),
    "turns round": ((-0.3, 0.0), (0.3, 0.0)),
    "starts straight": ((0.0, 0.0), (0.3, 0.0)),
}
"""What it does before the encoder dies, and what it is asked for from then on: m/s and rad/s."""

KNOWN_S = 0.3
"""A wheel that dies while its side slows down is told from its mate after so long at most."""


@dataclass
class Seen:
    """The fastest that the robot truly moved, and who was named."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    names: set[str] = field(default_factory=set)


async def watch(robot: SimulatedRobot, command: TWIST, is_known: bool, seen: Seen) -> None:
    """Command for a twentieth of a second, and look as often as the encoders do."""
    await robot.client.drive(*command)
    for _ in range(5):
        await asyncio.sleep(0.01)
        twist = robot.board.truth(0.0).twist
        seen.linear_m_s = max(seen.linear_m_s, abs(twist.linear_m_s))
        seen.angular_rad_s = max(seen.angular_rad_s, abs(twist.angular_rad_s))
    if is_known:
        seen.names.update((await robot.client.call("get_state"))["topics"]["wheels"]["data"]["excluded"])


def drive(settings: Settings, before: TWIST, after: TWIST, dead: int | None) -> Seen:
    """Drive so for a second, and then otherwise until the stall is found, for 4 s at most."""
    seen = Seen()

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            for _ in range(20):
                await watch(robot, before, False, Seen())
            if dead is not None:
                rewire(robot, b"e", frozen(dead))
            try:
                for number in range(80):
                    await watch(robot, after, number * 0.05 >= KNOWN_S, seen)
            except CallError:  # the stall was found
                reason = (await robot.client.call("get_state"))["topics"]["safety"]["data"]["reason"]
                seen.names.add(reason.split()[0])

    run_virtual(run())
    return seen


@pytest.mark.parametrize("motion", sample(list(MOTIONS)))
@pytest.mark.parametrize(
    ("scrub_duty", "dead_wheels"),
    sample([(250.0, (0, 3)), (0.0, (1, 2))]),
    ids=["on a known floor", "on a floor that the feedforward knows nothing of"],
)
def test_a_dead_encoder_makes_the_robot_no_faster(
    motion: str, scrub_duty: float, dead_wheels: tuple[int, int]
) -> None:
    """Never more than 0.15 rad/s and 0.04 m/s beyond what the healthy robot reaches; only the dead wheel is named."""
    settings = load(
        packaged("khan"), overrides={"safety.guard.enabled": False, "drive.scrub_duty": scrub_duty}
    )
    healthy = drive(settings, *MOTIONS[motion], dead=None)
    assert healthy.names == set()
    for wheel in dead_wheels:
        seen = drive(settings, *MOTIONS[motion], dead=wheel)
        assert seen.angular_rad_s < healthy.angular_rad_s + 0.15
        assert seen.linear_m_s < healthy.linear_m_s + 0.04
        assert seen.names == {settings.chassis.wheels[wheel].name}

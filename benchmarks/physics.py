"""What a simulated second costs, by our physics in the plane and by MuJoCo.

The robot drives curves of both directions in its room, braking in between, and its board sends all its lines.
"""

import time
from importlib.util import find_spec

from benchmarks.figures import Figure, Outcome
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.components.simulation.simulation import build_launchpad
from chefbotd.settings import load, packaged

SECONDS = 60.0
ROUND = ((0.35, 0.25), (0.0, 0.0), (-0.25, -0.35), (0.0, 0.0))
"""PWM shares of the left and the right side, a second each."""

MOST_MS = {("chefbot", "mujoco"): 1000 / 30}


def run(*, quick: bool = False) -> Outcome:
    """Processor time of a simulated second, in milliseconds; the least of three runs."""
    if find_spec("mujoco") is None:
        return Outcome((), ("MuJoCo is not installed: pip install 'chefbotd[mujoco]'",))
    seconds = SECONDS / 4 if quick else SECONDS
    figures, told = [], []
    for robot in ("chefbot", "khan"):
        for physics in ("planar", "mujoco"):
            ms = min(_ms_per_second(robot, physics, seconds) for _ in range(3))
            figures.append(
                Figure(f"{robot}, {physics}: a simulated second", ms, "ms", MOST_MS.get((robot, physics)))
            )
            told.append(f"{robot} {physics} {1000 / ms:.0f}")
    return Outcome(tuple(figures), (f"times real time on a core: {', '.join(told)}",))


def _ms_per_second(robot: str, physics: str, seconds: float) -> float:
    """Processor time of the robot and its board."""
    settings = load(
        packaged(robot), overrides={"sim.physics": physics, "sim.board.blocking_ultrasonic": False}
    )
    launchpad = build_launchpad(simulation_of(settings))
    launchpad.advance(1.0)
    sides = [wheel.side == "left" for wheel in settings.chassis.wheels]
    began_s = time.process_time()
    for second in range(int(seconds)):
        left, right = ROUND[second % len(ROUND)]
        duty = [round(settings.drive.max_duty * (left if is_left else right)) for is_left in sides]
        launchpad.receive(b"s " + " ".join(map(str, duty)).encode() + b"\r", 1.0 + second)
        launchpad.advance(2.0 + second)
    return (time.process_time() - began_s) * 1000 / seconds

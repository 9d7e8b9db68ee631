"""The calibration of motors, and the wheels' speed before and after it, on simulated robots that are drawn at random.

Every robot is wrong in everything within ``sim.true``'s bounds ("imperfect"), each by another seed. ``motors`` compares
what the step finds with what the robot is. ``wheel_speed`` starts each robot to several speeds, forward and in reverse,
by its configuration and by what the step has found; also with a battery at 11.8 V, calibrated with a full one.

A start has settled when the last wheel stays within 5 % of its commanded speed, counted from the end of the ramp.
"""

import asyncio
import math
from collections.abc import Mapping, Sequence
from statistics import mean, median

from benchmarks.figures import Figure, Outcome, percentile
from chefbotd.clock import run_virtual
from chefbotd.components.calibration.events import Status, StepResult
from chefbotd.components.simulation.process.true_values import true_values
from chefbotd.settings import Settings, load, packaged
from chefbotd.settings.values import apply_calibration
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot

SEEDS, QUICK_SEEDS = 20, 2
BOTH_WAYS_M_S = (0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
START_S, BAND, STEADY_FROM_S = 3.0, 0.05, 1.0
SAMPLE_S, COMMAND_S = 0.005, 0.05
LOW = {"sim.battery.start_charge_share": 0.3, "battery.critical_v": 10.5}
"""A battery that has 11.81 V at rest, and a robot that goes on with it."""


def imperfect(seed: int, **more: object) -> Settings:
    """A ChefBot that is not as it is configured."""
    drawn = {"sim.true.drawn": "imperfect", "sim.true.seed": seed, "sim.seed": seed}
    return load(packaged("chefbot"), overrides={**drawn, **more})


def found_on(settings: Settings) -> tuple[StepResult, float]:
    """The result of the step, and the robot's time that it took."""

    async def measure() -> tuple[StepResult, float]:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.5)
            began_s = asyncio.get_running_loop().time()
            result = await robot.client.calibrate("motors", space_m=1.0)
            return result, asyncio.get_running_loop().time() - began_s

    return run_virtual(measure())


def values_of(result: StepResult) -> dict[str, float]:
    """What would be written into the configuration."""
    return {estimate.key: estimate.after for estimate in result.estimates}


def run(*, quick: bool = False) -> Outcome:
    """How far off each motor's parameters are: every wheel and direction of every robot."""
    off: dict[str, list[float]] = {"dead_zone_duty": [], "gain_rad_s_per_duty": [], "time_constant_s": []}
    before = {key: list[float]() for key in off}
    seconds, faults, repeats = [], [], []
    seeds = QUICK_SEEDS if quick else SEEDS
    for seed in range(1, seeds + 1):
        settings = imperfect(seed)
        result, took_s = found_on(settings)
        seconds.append(took_s)
        if result.status is not Status.PASSED:
            faults.append(f"seed {seed}: {result.status}: {result.reason}")
            continue
        truth = true_values(settings, values_of(result)["drive.motor_voltage_v"])
        again, _ = found_on(
            settings.model_copy(update={"sim": settings.sim.model_copy(update={"seed": seed + 1000})})
        )
        second = {estimate.key: estimate for estimate in again.estimates}
        for estimate in result.estimates:
            if (true := truth.get(estimate.key)) is None:
                continue
            kind = estimate.key.rpartition(".")[2]
            whole = true if kind == "gain_rad_s_per_duty" else 1.0
            off[kind].append(abs(estimate.after - true) / whole)
            before[kind].append(abs(estimate.before - true) / whole)
            other = second[estimate.key]
            repeats.append(abs(other.after - estimate.after) / math.hypot(other.sigma, estimate.sigma))
    figures = [
        *_errors("dead zone", "duty", 1.0, 1.0, off["dead_zone_duty"], before["dead_zone_duty"]),
        *_errors("gain", "%", 100.0, 2.0, off["gain_rad_s_per_duty"], before["gain_rad_s_per_duty"]),
        *_errors("time constant", "ms", 1e3, 15.0, off["time_constant_s"], before["time_constant_s"]),
        Figure("robot's time", max(seconds), "s", 60.0),
        Figure("two runs differ, median", median(repeats), "sigma"),
        Figure("two runs differ by more than 3 sigma", 100 * mean([one > 3 for one in repeats]), "%"),
    ]
    return Outcome(tuple(figures), (f"{seeds} robots, two wheels, both directions",), tuple(faults))


def _errors(
    name: str, unit: str, scale: float, target: float, off: Sequence[float], before: Sequence[float]
) -> list[Figure]:
    return [
        Figure(f"{name}, off before, median", scale * median(before), unit),
        Figure(f"{name}, off, median", scale * median(off), unit),
        Figure(f"{name}, off, worst", scale * max(off), unit, target),
    ]


# The speed of the wheels


def run_wheel_speed(*, quick: bool = False) -> Outcome:
    """Starts from rest: as configured, calibrated, and calibrated with a battery at 11.8 V."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    for seed in range(1, (QUICK_SEEDS if quick else SEEDS) + 1):
        settings = imperfect(seed)
        values = values_of(found_on(settings)[0])
        found.setdefault("as configured", []).extend(starts(settings, {}))
        found.setdefault("calibrated", []).extend(starts(settings, values))
        low = imperfect(seed, **LOW)
        found.setdefault("at 11.8 V", []).extend(starts(low, values))
    figures = []
    for name, results in found.items():
        targets = {"calibrated": (0.15, 3.0, 0.5), "at 11.8 V": (0.3, None, None)}.get(
            name, (None, None, None)
        )
        columns = list(zip(*results, strict=True))
        for what, unit, scale, values_of_all, target in (
            ("settled after the ramp", "s", 1.0, columns[0], targets[0]),
            ("overshoot", "%", 100.0, columns[1], targets[1]),
            ("off when steady", "%", 100.0, columns[2], targets[2]),
        ):
            figures.append(Figure(f"{name}: {what}, median", scale * median(values_of_all), unit))
            figures.append(
                Figure(f"{name}: {what}, 95 %", scale * percentile(values_of_all, 95), unit, target)
            )
            figures.append(Figure(f"{name}: {what}, worst", scale * max(values_of_all), unit))
    return Outcome(tuple(figures), (__doc__.rpartition("\n\n")[2].strip().replace("\n", " "),))


def starts(
    settings: Settings,
    values: Mapping[str, float],
    speeds_m_s: Sequence[float] = BOTH_WAYS_M_S,
    phase_s: float = 0.0,
) -> list[tuple[float, float, float]]:
    """Every start's time to settle in s, overshoot and steady error as shares: the worst of its wheels.

    The first start is ``phase_s`` later in the board's cycle.
    """
    guard = settings.safety.guard.model_copy(update={"enabled": False})
    settings = settings.model_copy(update={"safety": settings.safety.model_copy(update={"guard": guard})})
    settings = apply_calibration(settings, values)

    async def measure() -> list[tuple[float, float, float]]:
        results = []
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(2.0 + phase_s)
            for speed_m_s in speeds_m_s:
                results.append(await _start(robot, settings, speed_m_s))
                await robot.client.stop()
                await asyncio.sleep(1.0)
        return results

    return run_virtual(measure())


async def _start(robot: SimulatedRobot, settings: Settings, speed_m_s: float) -> tuple[float, float, float]:
    loop = asyncio.get_running_loop()
    began_s, told_s = loop.time(), -math.inf
    seen: list[tuple[float, tuple[float, ...]]] = []
    while (now_s := loop.time()) < began_s + START_S:
        if now_s - told_s >= COMMAND_S - 1e-9:
            told_s = now_s
            await robot.client.drive(speed_m_s, 0.0)
        await asyncio.sleep(SAMPLE_S)
        seen.append((loop.time() - began_s, robot.board.wheel_speeds_rad_s()))
    ramp_s = abs(speed_m_s) / settings.limits.linear.acceleration_m_s2
    worst = [0.0, 0.0, 0.0]
    for number, wheel in enumerate(settings.chassis.wheels):
        shares = [(at_s, speeds[number] * wheel.radius_m / speed_m_s) for at_s, speeds in seen]
        outside = [at_s for at_s, share in shares if abs(share - 1) > BAND]
        steady = mean([share for at_s, share in shares if at_s >= STEADY_FROM_S]) - 1
        own = (outside[-1] - ramp_s, max(share for _, share in shares) - 1, abs(steady))
        worst = [max(pair) for pair in zip(worst, own, strict=True)]
    return worst[0], worst[1], worst[2]

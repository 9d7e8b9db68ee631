"""Fits in a process of its own: the control loop goes on meanwhile, and a fit that never ends is killed.

What goes to the process is pickled, and the result comes back as JSON; both ends are this program.
"""

import asyncio
import os
import pickle
import signal
import sys
from collections.abc import Awaitable, Callable
from typing import Final, TypeAlias

from msgspec import json

from chefbotd.child import send_signal
from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, Measurements, Status, StepResult

TIMEOUT_S: Final = 300.0
"""The longest fit, of 40 stops with a lidar, takes a tenth of that on a small computer (assumed)."""

NICENESS: Final = 10
LAST_BYTES: Final = 500

Fitter: TypeAlias = Callable[[str, ConfiguredRobot, Measurements], Awaitable[StepResult]]
"""Fits a step, by its name, to what was measured."""


async def fit_in_process(step: str, robot: ConfiguredRobot, measured: Measurements) -> StepResult:
    """The step's result; ``refused`` where the process fails or takes longer than ``TIMEOUT_S``."""
    given = await asyncio.to_thread(pickle.dumps, (step, robot, measured))
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "chefbotd.components.calibration.fit_process",
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        async with asyncio.timeout(TIMEOUT_S):
            answer, errors = await process.communicate(given)
    except TimeoutError:
        return StepResult(step, Status.REFUSED, f"the computation took longer than {TIMEOUT_S:.0f} s")
    finally:
        send_signal(process, signal.SIGKILL)
        await asyncio.shield(process.wait())
    if process.returncode:
        why = errors.decode(errors="replace").strip()[-LAST_BYTES:]
        return StepResult(step, Status.REFUSED, f"the computation failed ({process.returncode}): {why}")
    return json.decode(answer, type=StepResult)


async def fit_here(step: str, robot: ConfiguredRobot, measured: Measurements) -> StepResult:
    """The same in this process, for tests on a virtual clock and for programs without a control loop."""
    from chefbotd.components.calibration.algorithms.steps import fit_step

    return fit_step(step, robot, measured)


def main() -> None:
    """Read a step's measurements, and write its result."""
    from chefbotd.components.calibration.algorithms.steps import fit_step

    os.nice(NICENESS)
    step, robot, measured = pickle.load(sys.stdin.buffer)  # noqa: S301 - what the daemon has written
    sys.stdout.buffer.write(json.encode(fit_step(step, robot, measured)))


if __name__ == "__main__":
    main()

"""The process of one run: ``python -m chefbot_devtools.child OUTCOME`` reads a job from its standard input."""

import asyncio
import os
import sys
import time
import types
from importlib import import_module
from pathlib import Path
from typing import Any

import msgspec

from chefbot_devtools.job import Job, Outcome
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.storage import replace_file
from chefbotd.testing.on_map import localized_robot

LONGEST_TEXT = 500


def load(job: Job) -> types.ModuleType:
    """The program as a module."""
    if job.source is None:
        return import_module(job.program)
    module = types.ModuleType(job.program.removesuffix(".py"))
    module.__file__ = job.program
    exec(compile(job.source, job.program, "exec"), vars(module))  # noqa: S102 - the user's own program
    return module


async def run(job: Job) -> tuple[str, str, float]:
    """How it ended, what it said, and the simulated seconds; the robot's setting up is not counted."""
    program, clock, began_s = load(job), LoopClock(), None
    try:
        keywords: dict[str, Any] = (
            dict(program.simulated(job.world, job.seed)) if hasattr(program, "simulated") else {}
        )
        overrides = {"sim.seed": job.seed, **keywords.pop("overrides", {})}
        async with localized_robot(job.world, overrides=overrides, **keywords) as robot:
            began_s = clock.now_s()
            async with asyncio.timeout(job.limit_s) as limit:
                end, text = "done", str(await program.main(robot.client))
    except TimeoutError as error:
        if began_s is None or not limit.expired():
            end, text = "failed", f"TimeoutError: {error}"
        else:
            end, text = "timed_out", f"not done after {job.limit_s:g} simulated seconds"
    except Exception as error:  # noqa: BLE001 - somebody else's program: whatever it raises is the outcome
        end, text = "failed", f"{type(error).__name__}: {error}"
    return end, text[:LONGEST_TEXT], 0.0 if began_s is None else clock.now_s() - began_s


def main() -> None:
    """Run it, and write the outcome at once, so that there is a whole one or none."""
    began_s = time.monotonic()
    job, path = msgspec.json.decode(sys.stdin.buffer.read(), type=Job), Path(sys.argv[1])
    end, text, simulated_s = run_virtual(run(job))
    outcome = Outcome(job.world, job.seed, end, text, simulated_s, time.monotonic() - began_s)
    replace_file(path, msgspec.json.encode(outcome))
    sys.stdout.flush()
    os._exit(0)  # a program's threads keep nobody waiting


if __name__ == "__main__":
    main()

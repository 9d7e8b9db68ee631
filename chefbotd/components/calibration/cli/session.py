"""Calibrates the robot at the other end of the connection: asks for what is to be prepared, and shows each result."""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator
from pathlib import Path

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import CallError, Client
from chefbotd.client.models import CalibrationApplied, CalibrationReport, CalibrationStep
from chefbotd.components.calibration.cli.report import draw_plots, finish, require_plots, show_result
from chefbotd.components.calibration.events import Ask, StepResult
from chefbotd.components.doctor.cli.diagnosis import TerminalAsker
from chefbotd.components.maps.cli.asking import progress_bar
from chefbotd.core.printable import plain

NO_FILE = (
    "the daemon runs with the packaged configuration, which is not written to: 'chefbotd init FOLDER' makes one of your "
    "own, or name a file on this computer with --config"
)
MOST_SPACE_M = 100.0
ABSENT = "this daemon does not calibrate: its configuration has no [safety.sources.calibration]"

CANNOT_CALIBRATE = -32056
"""The code of the daemon's own refusal (docs/api.md)."""


class CalibrationSession:
    """One run of the command; without ``steps`` all that this robot can take. ``is_ready``: all is prepared."""

    def __init__(
        self, context: CommandContext, steps: tuple[str, ...], space_m: float | None, *, is_ready: bool
    ) -> None:
        self._context, self._steps, self._space_m, self._is_ready = context, steps, space_m, is_ready
        self._asker = TerminalAsker()

    def run(self, config: Path | None, out: Path | None, *, applies: bool) -> None:
        """Calibrate, and write what has passed if that is wanted.

        Raises:
            ProgramError: any failure, with its exit code.
        """
        require_plots(out)
        self._context.run_with_client(
            lambda robot: self._with_robot(robot, config, out, applies=applies), absent=ABSENT
        )

    async def _with_robot(
        self, robot: Client, config: Path | None, out: Path | None, *, applies: bool
    ) -> None:
        report = await robot.get_calibration()
        if applies and config is None and not report.writes_to:
            raise ProgramError(Exit.REFUSED, NO_FILE)
        results, refused = list[StepResult](), None
        for step in self._chosen(report):
            try:
                results.append(await self._carry_out(robot, step))
            except CallError as error:
                if not results:
                    raise
                refused = error  # the results so far count, and are written if that is wanted
                break
        pictures = draw_plots(results, out)
        applied = await self._apply(robot, results, config) if applies else None
        if not self._context.as_json:
            for picture in pictures:
                echo(str(picture))
            if applied is not None:
                echo(f"\n{applied.difference}\n\nWritten to {applied.path}; it was {applied.kept}.")
                echo("It counts from the daemon's next start.")
            elif any(result.status == "passed" for result in results):
                echo("\nNothing was written: --apply does that.")
        finish(self._context, results, applied, refused)

    def _chosen(self, report: CalibrationReport) -> list[CalibrationStep]:
        """The steps to take: those that were named, or all that this robot can take."""
        steps = {step.name: step for step in report.steps}
        if unknown := [name for name in self._steps if name not in steps]:
            raise ProgramError(Exit.REFUSED, f"this daemon has no step {', '.join(unknown)}")
        if self._steps:
            return [steps[name] for name in self._steps]
        for step in report.steps:
            if step.missing and not self._context.as_json:
                echo(plain(f"{step.name}: left out, {step.missing}"))
        return [step for step in report.steps if not step.missing and not step.on_request]

    async def _carry_out(self, robot: Client, step: CalibrationStep) -> StepResult:
        if step.missing:  # said before anybody draws a mark or clears the floor
            raise CallError(
                CANNOT_CALIBRATE, "cannot_calibrate", f"{step.name} cannot be calibrated: {step.missing}"
            )
        space_m = await self._prepare(step, sees_space="topic.scan" in robot.hello.capabilities)
        async with self._questions(robot):
            with progress_bar(step.name, quiet=self._context.as_json) as show:
                result = await robot.calibrate(step.name, space_m, on_progress=show)
        if not self._context.as_json:
            show_result(result)
        return result

    async def _prepare(self, step: CalibrationStep, *, sees_space: bool) -> float | None:
        """Have everything prepared; returns the free floor, asked for where no lidar sees it.

        Raises:
            ProgramError: nobody answers, or nobody can be asked how much floor is free.
        """
        needs_space = bool(step.space_m) and self._space_m is None and not sees_space
        if self._is_ready:
            if needs_space:
                raise ProgramError(
                    Exit.USAGE,
                    f"{step.name} needs {step.space_m:g} m of free floor around the robot, and no lidar sees whether "
                    f"there is: --space {step.space_m:g} says so",
                )
            return self._space_m
        room = f" It needs {step.space_m:g} m of free floor around it." if step.space_m else ""
        if not needs_space:
            question = f"{step.name}: {step.preparation}{room} Press Enter to begin."
            if await self._asker.ask(question) is None:
                raise ProgramError(Exit.USAGE, "nobody pressed Enter; --yes says that everything is prepared")
            return self._space_m
        return await self._ask_space(step, f"{step.name}: {step.preparation}{room}")

    async def _ask_space(self, step: CalibrationStep, preparation: str) -> float:
        """How much floor is free, until it is a number that is enough; the step begins then."""
        question = (
            f"{preparation} No lidar sees that: type how many metres are free on every side of the robot, and the step "
            "begins (Ctrl-C ends it)."
        )
        while True:
            text = await self._asker.ask(question)
            if text is None:
                raise ProgramError(Exit.USAGE, "nobody said how much floor is free; --space M says so")
            try:
                free_m = float(text.lower().removesuffix("m").replace(",", "."))
            except ValueError:
                free_m = math.nan
            if step.space_m <= free_m <= MOST_SPACE_M:
                return free_m
            tell(f"{text!r}: a number from {step.space_m:g} to {MOST_SPACE_M:g} metres is expected")

    @contextlib.asynccontextmanager
    async def _questions(self, robot: Client) -> AsyncIterator[None]:
        """Pass the step's questions on to the person, and the answers to the robot."""
        asking = asyncio.create_task(self._answer_all(robot))
        try:
            yield
        finally:
            asking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await asking

    async def _answer_all(self, robot: Client) -> None:
        asked: Ask | None = None
        async for event in robot.subscribe("calibration"):
            question = event.data.question
            if question is not None and question != asked:
                await self._answer(robot, question)
            asked = question

    async def _answer(self, robot: Client, question: Ask) -> None:
        """Ask until the robot takes the answer; where nobody is there, end the step."""
        while True:
            unit = f" ({question.unit})" if question.unit else ""
            text = await self._asker.ask(f"{question.text}{unit}")
            if text is None:
                await robot.stop()
                return
            try:
                await robot.answer_calibration(question.key, float(text.replace(",", ".")))
            except ValueError:
                tell(f"{text!r} is no number")
            except CallError as refused:
                tell(refused.message)
            else:
                return

    async def _apply(
        self, robot: Client, results: list[StepResult], config: Path | None
    ) -> CalibrationApplied | None:
        passed = [result for result in results if result.status == "passed"]
        if not passed:
            return None
        if config is None:
            return await robot.apply_calibration([result.step for result in passed])
        from chefbotd.components.calibration.cli.recorded import save_here

        return save_here(config, passed)

"""Calibrates from a recorded drive, on this computer: the same fits, and the same result each time."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError, extra
from chefbotd.cli.programs.load import bad_configuration
from chefbotd.client.models import CalibrationApplied
from chefbotd.components.calibration.algorithms.step import Measurements, Status, StepResult
from chefbotd.components.calibration.algorithms.steps import STEPS, fit_step
from chefbotd.components.calibration.build import robot_with
from chefbotd.components.calibration.cli.report import draw_plots, finish, require_plots, show_result
from chefbotd.components.calibration.measuring import as_calibrated, measurements
from chefbotd.components.recording.cli.info import open_recording
from chefbotd.components.recording.replay.recorded import NotReplayable
from chefbotd.components.recording.replay.run import settings_of
from chefbotd.core.printable import plain
from chefbotd.core.record import replace
from chefbotd.settings import Settings, SettingsError


def calibrate_recorded(
    context: CommandContext,
    path: Path,
    steps: Sequence[str],
    config: Path | None,
    out: Path | None,
    answers: Mapping[str, float],
    *,
    applies: bool,
) -> None:
    """Fit the steps to the recording at ``path``; without ``steps`` all that its robot can take.

    ``answers`` are what a person knows of the drive.

    Raises:
        ProgramError: the file is no recording of a robot, a step has not passed, or nothing can be written.
    """
    if applies and config is None:
        raise ProgramError(Exit.USAGE, "--apply with --from needs --config FILE: the configuration to write")
    require_plots(out)
    settings, measured = read_drive(path)
    measured = replace(measured, answers=dict(answers))
    results: list[StepResult] = []
    for name in steps or [step.name for step in STEPS.values() if not step.on_request]:
        robot = robot_with(
            settings, {e.key: e.after for one in results for e in one.estimates if _has_passed(one)}
        )
        if missing := STEPS[name].missing(robot):
            if steps:
                raise ProgramError(Exit.REFUSED, f"{name} cannot be calibrated: {missing}")
            continue
        results.append(fit_step(name, robot, as_calibrated(measured, robot_with(settings, {}), robot)))
        if not context.as_json:
            show_result(results[-1])
    pictures = draw_plots(results, out)
    passed = [result for result in results if _has_passed(result)]
    applied = save_here(config, passed) if config is not None and passed else None
    if not context.as_json:
        for picture in pictures:
            echo(str(picture))
        if applied is not None:
            echo(f"\n{applied.difference}\n\nWritten to {applied.path}; it was {applied.kept}.")
    finish(context, results, applied)


def read_drive(path: Path) -> tuple[Settings, Measurements]:
    """The robot's configuration then, and all that was measured.

    Raises:
        ProgramError: the file is no recording, or has no configuration.
    """
    with open_recording(path) as reader:
        measured = measurements(reader.events())
        configuration = reader.metadata.get("configuration", {}).get("json", "")
        problem = reader.problem
    if not configuration:
        raise ProgramError(Exit.FAILED, f"{path} has no configuration, so chefbotd did not record it")
    if problem is not None:
        echo(plain(f"{path}: {problem}"))
    try:
        return settings_of(configuration), measured
    except NotReplayable as error:
        raise ProgramError(Exit.FAILED, str(error)) from error


def save_here(config: Path, passed: Sequence[StepResult]) -> CalibrationApplied:
    """Write the results into a configuration on this computer.

    Raises:
        ProgramError: it is no configuration, or cannot be written.
    """
    with extra("tune", "tomlkit"):
        from chefbotd.components.calibration.calibrated_file import save
    values = {estimate.key: estimate.after for result in passed for estimate in result.estimates}
    try:
        saved = save(config, values)
    except SettingsError as error:
        raise bad_configuration(error) from error
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{config} was not written: {error.strerror}") from error
    return CalibrationApplied(saved.path, saved.kept, saved.difference, tuple(values))


def _has_passed(result: StepResult) -> bool:
    return result.status is Status.PASSED

"""Builds the calibration, which knows the configuration as values by the paths of their keys."""

from pathlib import Path

from chefbotd.component_context import Context
from chefbotd.components.calibration.algorithms.step import ConfiguredRobot
from chefbotd.components.calibration.fit_process import fit_in_process
from chefbotd.components.calibration.models import CalibrationApplied
from chefbotd.components.calibration.outside import Values
from chefbotd.components.calibration.service import CalibrationService
from chefbotd.components.calibration.service import calibration as feature
from chefbotd.composition.scanners import robot_outline
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence
from chefbotd.extras import how_to_add_extra
from chefbotd.features.feature import Feature
from chefbotd.settings import Settings, SettingsError
from chefbotd.settings.values import apply_calibration


def calibration_of(context: Context[None]) -> Feature:
    """The feature that calibrates the robot."""
    settings, daemon = context.settings, context.parts.context
    if context.driver is None:
        raise ValueError("[safety.sources] has no calibration")
    service = CalibrationService(
        context.bus,
        context.clock,
        context.driver,
        lambda values: robot_with(settings, values),
        lambda values: _save(daemon.config_file, values),
        context.substitute or fit_in_process,
        "" if daemon.config_file is None else str(daemon.config_file),
    )
    return feature(service)


def robot_with(settings: Settings, values: Values) -> ConfiguredRobot:
    """What a step of the calibration gets to know: the robot as it is configured, with these values.

    Raises:
        Refused: the values do not fit the configuration.
    """
    if values:
        try:
            settings = apply_calibration(settings, values)
        except SettingsError as error:
            raise Refused(RefusalKind.CANNOT_CALIBRATE, str(error)) from error
    return ConfiguredRobot(
        chassis=settings.chassis,
        encoders=settings.encoders,
        drive=settings.drive,
        gains=settings.gains(),
        limits=settings.limits,
        battery=settings.battery,
        outline_radius_m=robot_outline(settings).radius_m,
        imu=settings.imu,
        ultrasonic=settings.ultrasonic,
        infrared=settings.infrared,
        lidars=settings.lidar,
        fusion=settings.odometry.fusion,
    )


def _save(path: Path | None, values: Values) -> CalibrationApplied:
    if path is None:
        reason = Sentence(
            "calibration.packaged",
            "the daemon runs with the packaged configuration, which is not written to: make a file of your own of it "
            "('chefbotd init FOLDER'), and start the daemon with --config",
        )
        raise Refused(RefusalKind.STORAGE_FAILED, reason)
    try:
        from chefbotd.components.calibration.calibrated_file import save
    except ModuleNotFoundError as error:
        reason = Sentence(
            "calibration.needs_extra",
            "writing a configuration needs the extra '{extra}': {how}",
            extra="tune",
            how=how_to_add_extra("tune"),
        )
        raise Refused(RefusalKind.STORAGE_FAILED, reason) from error
    try:
        saved = save(path, values)
    except SettingsError as error:
        raise Refused(RefusalKind.STORAGE_FAILED, str(error)) from error
    except OSError as error:
        raise Refused(
            RefusalKind.STORAGE_FAILED,
            Sentence(
                "calibration.not_written", "{path} was not written: {why}", path=path, why=error.strerror
            ),
        ) from error
    return CalibrationApplied(saved.path, saved.kept, saved.difference, tuple(values))

"""Calibration: its methods' parameters and results, and the topic ``calibration``."""

from typing import Annotated

from msgspec import Meta
from msgspec.structs import asdict
from pydantic import Field

from chefbotd.components.calibration.events import CalibrationChanged, CalibrationData, StepResult
from chefbotd.core.record import Record
from chefbotd.rpc.models import MotionParams, Params
from chefbotd.rpc.topics import Topic

StepName = Annotated[str, Field(min_length=1, max_length=40)]


class CalibrateParams(MotionParams):
    """The step, and the free floor around the robot where nothing on it sees that."""

    step: StepName = Field(
        examples=["wheels"], description="encoders, battery, motors, wheels, umbmark, lidar, imu or sensors"
    )
    space_m: float | None = Field(
        None, ge=0, le=100, description="free floor around the robot, as a person says; null: the lidar sees"
    )


class AnswerCalibrationParams(Params):
    """The answer to the question that the topic ``calibration`` shows."""

    key: StepName = Field(examples=["voltage_v"])
    value: float = Field(examples=[12.4])


class ApplyCalibrationParams(Params):
    """Whose results are written."""

    steps: list[StepName] | None = Field(None, max_length=20, description="null: of all that have passed")


class CalibrationStep(Record, frozen=True):
    """A step that this robot may take."""

    name: str
    purpose: str
    preparation: Annotated[str, Meta(description="what a person does first")]
    space_m: Annotated[
        float, Meta(description="free floor that it needs around the robot; 0: it stays in place")
    ]
    missing: Annotated[str, Meta(description="why this robot cannot take it; empty: it can")]
    on_request: Annotated[
        bool, Meta(description="another step finds the same, so it is done only if it is named")
    ]


class CalibrationReport(Record, frozen=True):
    """All steps, and the newest result of each, with its plots."""

    steps: tuple[CalibrationStep, ...]
    results: tuple[StepResult, ...]
    writes_to: Annotated[str, Meta(description="the configuration that is written to; empty: there is none")]


class CalibrationApplied(Record, frozen=True):
    """What was written, and where the configuration from before is kept; it counts from the daemon's next start."""

    path: str
    kept: str
    difference: Annotated[str, Meta(description="a unified diff")]
    keys: tuple[str, ...]


def _data(event: CalibrationChanged | None) -> CalibrationData:
    if event is None:
        return CalibrationData()
    fields = asdict(event)
    del fields["stamp_s"]
    return CalibrationData(**fields)


TOPICS = (Topic("calibration", (CalibrationChanged,), CalibrationData, _data, always_known=True),)

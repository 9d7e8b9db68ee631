"""Parameters are checked strictly, and a refusal says what is wrong in words."""

from typing import Any

import pytest
from pydantic import ValidationError

from chefbotd.components.tuning.models import SetPidParams
from chefbotd.driving.models import DriveParams
from chefbotd.driving.odometry.models import ResetOdometryParams
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.dispatch import explain
from chefbotd.rpc.models import SubscribeParams


@pytest.mark.parametrize("value", [True, "0.5", None, float("nan"), float("inf"), [0.5]])
def test_a_speed_is_a_finite_number_and_nothing_else(value: Any) -> None:
    """Neither true nor "0.5" drives a robot."""
    with pytest.raises(ValidationError):
        DriveParams.model_validate({"linear_m_s": value, "angular_rad_s": 0.0})


def test_an_integer_is_a_number() -> None:
    """A client need not write 1.0."""
    params = DriveParams.model_validate({"linear_m_s": 1, "angular_rad_s": -2})
    assert (params.linear_m_s, params.angular_rad_s, params.source) == (1.0, -2.0, None)


def test_drive_needs_both_speeds() -> None:
    """A missing speed is not taken for zero."""
    with pytest.raises(ValidationError, match="angular_rad_s"):
        DriveParams.model_validate({"linear_m_s": 1.0})


def problem_of(model: Any, params: dict[str, Any]) -> tuple[str, list[dict[str, str]]]:
    """What is said about parameters that do not fit."""
    with pytest.raises(ValidationError) as caught:
        model.model_validate(params)
    return explain(caught.value)


def test_a_problem_names_field_value_and_expectation() -> None:
    """Both the sentence and the data say which field, what came, and what should have."""
    message, fields = problem_of(DriveParams, {"linear_m_s": "fast", "angular_rad_s": 0.0})
    assert message == "linear_m_s: Input should be a valid number, got 'fast'"
    assert fields == [{"field": "linear_m_s", "expected": "Input should be a valid number", "got": "'fast'"}]


def test_every_problem_is_named() -> None:
    """A missing field and an unknown one are told together."""
    message, fields = problem_of(DriveParams, {"linear_m_s": 1.0, "speed": 2})
    assert [f["field"] for f in fields] == ["angular_rad_s", "speed"]
    missing, unknown = message.split("; ")
    assert missing.startswith("angular_rad_s: ")
    assert unknown.startswith("speed: ")
    assert unknown.endswith("got 2")


def test_a_long_value_is_shortened() -> None:
    """A refusal does not send a whole request back."""
    _, (field,) = problem_of(SubscribeParams, {"topics": "x" * 3000})
    assert len(field["got"]) < 70


def test_set_pid_takes_each_gain_by_its_short_name() -> None:
    """Every gain of the controller can be changed, alone."""
    for name in PidParameters.model_fields:
        value = True if name == "conditional_integration" else 0.5
        params = SetPidParams.model_validate({"wheel": "all", name: value})
        assert params.changes() == {name: value}


@pytest.mark.parametrize(
    "params",
    [
        {"wheel": "left"},
        {"kp": 1.0},
        {"wheel": "left", "kp": None},
        {"wheel": "left", "kp": -1.0},
        {"wheel": "left", "kp": True},
        {"wheel": "left", "conditional_integration": 1},
        {"wheel": "left", "gain": 1.0},
    ],
)
def test_set_pid_refuses_what_changes_nothing_or_does_not_fit(params: dict[str, Any]) -> None:
    """A wheel alone, no wheel, null, a negative gain, a bool for a number: all refused."""
    with pytest.raises(ValidationError):
        SetPidParams.model_validate(params)


def test_a_limit_can_be_taken_away() -> None:
    """Null is a value where the controller has one, and then it is a change."""
    params = SetPidParams.model_validate({"wheel": "left", "integral_limit": None})
    assert params.changes() == {"integral_limit": None}


@pytest.mark.parametrize(
    "params",
    [
        {"topics": []},
        {"topics": ["odometry"], "max_rate_hz": 0},
        {"topics": ["odometry"], "max_rate_hz": 1001},
        {"topics": ["odometry"], "policy": "newest"},
        {"topics": [7]},
    ],
)
def test_subscribe_refuses_what_makes_no_sense(params: dict[str, Any]) -> None:
    """No topics, no rate, an unknown policy: refused."""
    with pytest.raises(ValidationError):
        SubscribeParams.model_validate(params)


@pytest.mark.parametrize("params", [{"x_m": 1.1e6}, {"y_m": -1.1e6}, {"x_m": 1e308}])
def test_odometry_is_not_set_to_another_country(params: dict[str, Any]) -> None:
    """Up to 1000 km either way; any finite heading will do."""
    with pytest.raises(ValidationError):
        ResetOdometryParams.model_validate(params)
    ResetOdometryParams.model_validate({"x_m": 1e6, "y_m": -1e6, "heading_rad": 1e9})

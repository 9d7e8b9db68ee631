"""What each method asks of the robot and answers, and how every failure is answered."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from structlog.testing import capture_logs

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import TextReceived
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.rpc.encoding import EventPayload
from tests.budget import examples
from tests.chefbotd.rpc.desk import Desk

COMMANDS = [
    ("drive", {"linear_m_s": 0.2, "angular_rad_s": -1}, ("drive", "teleop", Twist2D(0.2, -1.0))),
    (
        "drive",
        {"linear_m_s": 0, "angular_rad_s": 0, "source": "navigation"},
        ("drive", "navigation", Twist2D()),
    ),
    (
        "set_wheel_velocities",
        {"name": ["right", "left"], "velocity_rad_s": [3, -1.5], "source": "safety"},
        ("set_wheel_velocities", "safety", {"right": 3.0, "left": -1.5}),
    ),
    ("stop", {}, ("stop",)),
    ("estop", {"reason": "smoke"}, ("estop", "smoke")),
    ("arm", {}, ("arm",)),
    ("reset_odometry", {}, ("set_odometry", Pose2D())),
    ("reset_odometry", {"x_m": 1, "y_m": 2.5, "heading_rad": -3}, ("set_odometry", Pose2D(1.0, 2.5, -3.0))),
    ("reset_board", {}, ("reset_board",)),
]


@pytest.mark.parametrize(("method", "params", "call"), COMMANDS)
def test_a_command_reaches_the_robot_before_it_is_answered(
    method: str, params: dict[str, Any], call: tuple[object, ...]
) -> None:
    """Each command is one synchronous call on the robot, and then ``ok``."""
    desk = Desk()
    answer = desk.ask(method, **params)
    assert (answer["id"], answer["result"]["ok"]) == (1, True)
    assert desk.robot.calls == [call]


@pytest.mark.parametrize(
    ("linear_m_s", "told"),
    [
        (0.5, {"ok": True, "linear_m_s": 0.5, "angular_rad_s": 2.0, "limited_by": None}),
        (-3.0, {"ok": True, "linear_m_s": -1.0, "angular_rad_s": 2.0, "limited_by": "limits.linear"}),
    ],
)
def test_drive_is_answered_with_what_is_allowed(linear_m_s: float, told: dict[str, Any]) -> None:
    """The fake goes 1 m/s at most: the velocity that it goes for, and the limit that the command is beyond."""
    assert Desk().ask("drive", linear_m_s=linear_m_s, angular_rad_s=2.0)["result"] == told


@pytest.mark.parametrize(
    ("asked", "allowed", "limited_by"),
    [([5.0, -2.0], [5.0, -2.0], None), ([40.0, -20.0], [10.0, -5.0], "drive.max_rim_speed_m_s")],
)
def test_wheels_are_answered_with_what_is_allowed(
    asked: list[float], allowed: list[float], limited_by: str | None
) -> None:
    """In the order in which they were named, and none but those; the fake's turn at 10 rad/s at most."""
    desk = Desk()
    both = desk.ask("set_wheel_velocities", name=["right", "left"], velocity_rad_s=asked)["result"]
    assert both == {
        "ok": True,
        "name": ["right", "left"],
        "velocity_rad_s": allowed,
        "limited_by": limited_by,
    }
    one = desk.ask("set_wheel_velocities", name=["right"], velocity_rad_s=[3.0])["result"]
    assert (one["name"], one["velocity_rad_s"]) == (["right"], [3.0])


@pytest.mark.parametrize(
    ("name", "velocity_rad_s", "told"),
    [
        (["left", "left"], [1.0, 2.0], "repeated: 'left'"),
        (["left", "right"], [1.0], "2 names for 1 velocities"),
        ([], [], "name"),
        ([""], [1.0], "name.0"),
        ([3], [1.0], "name.0"),
        (["left"], ["1"], "velocity_rad_s.0"),
        (["left"], [True], "velocity_rad_s.0"),
    ],
)
def test_wheels_are_named_once_with_a_velocity_each(
    name: list[Any], velocity_rad_s: list[Any], told: str
) -> None:
    """What is wrong is refused by name, and the robot is asked for nothing."""
    desk = Desk()
    error = desk.ask("set_wheel_velocities", name=name, velocity_rad_s=velocity_rad_s)["error"]
    assert error["data"]["kind"] == "invalid_params"
    assert told in error["message"]
    assert desk.robot.calls == []


def test_a_wheel_that_is_not_there_gives_no_lease() -> None:
    """The robot refuses the name; the source stays free for others."""
    desk = Desk()
    assert desk.kind("set_wheel_velocities", name=["middle"], velocity_rad_s=[1.0]) == "unknown_wheel"
    assert desk.ask("release_control")["result"] == {"sources": []}


def test_wheel_commands_need_and_renew_the_lease() -> None:
    """Who commands wheels has control of the source, as who drives has; another client's are refused."""
    desk, other = Desk(), Desk()
    other.dispatcher = desk.dispatcher
    assert desk.ask("set_wheel_velocities", name=["left"], velocity_rad_s=[1.0])["result"]["ok"]
    assert other.kind("set_wheel_velocities", name=["left"], velocity_rad_s=[1.0]) == "lease_held"
    assert desk.ask("release_control")["result"] == {"sources": ["teleop"]}


def test_a_lease_is_taken_and_given_back_by_name() -> None:
    """The default source if none is named; what nobody had, or we had ourselves, was taken from nobody."""
    desk = Desk()
    assert desk.ask("take_control")["result"] == {"source": "teleop", "taken_from": None}
    assert desk.ask("take_control", source="teleop")["result"]["taken_from"] is None
    assert desk.ask("take_control", source="navigation")["result"]["source"] == "navigation"
    assert desk.ask("get_state")["result"]["safety"]["control"] == {
        "teleop": "127.0.0.1:50000",
        "navigation": "127.0.0.1:50000",
    }
    assert desk.ask("release_control")["result"] == {"sources": ["teleop", "navigation"]}
    assert desk.robot.calls == [("release", "teleop"), ("release", "navigation")]


def test_control_of_a_source_that_there_is_not_is_refused() -> None:
    """The known ones are listed, and no lease is made."""
    desk = Desk()
    error = desk.ask("take_control", source="wheel")["error"]
    assert (error["data"]["kind"], "safety, teleop, navigation" in error["message"]) == (
        "unknown_source",
        True,
    )
    assert desk.ask("release_control")["result"] == {"sources": []}


def test_a_drive_that_the_robot_refuses_takes_no_lease() -> None:
    """Who could not drive does not keep others from it."""
    desk = Desk()
    desk.robot.answer = Refused(RefusalKind.DISARMED, "not now")
    assert desk.kind("drive", linear_m_s=0.1, angular_rad_s=0.0) == "disarmed"
    assert desk.ask("get_state")["result"]["safety"]["control"] == {}


@pytest.mark.parametrize("client", ["", "x" * 65, "line\nend", "\x1b[2J", "\x7f"])
def test_a_name_is_short_and_printable(client: str) -> None:
    """It is shown on terminals and in logs of others."""
    assert Desk().kind("set_client_name", client=client) == "invalid_params"


def test_estop_needs_no_reason() -> None:
    """In a hurry, the word alone is enough."""
    desk = Desk()
    assert "result" in desk.ask("estop")
    assert desk.robot.calls == [("estop", "asked by a client")]


@pytest.mark.parametrize("kind", list(RefusalKind))
def test_a_refusal_is_answered_with_its_kind(kind: RefusalKind) -> None:
    """What the robot refuses has that kind's code, its name, and the robot's own words."""
    desk = Desk()
    desk.robot.answer = Refused(kind, "not now")
    error = desk.ask("drive", linear_m_s=0.1, angular_rad_s=0.0)["error"]
    assert error == {"code": kind.code, "message": "not now", "data": {"kind": kind.value}}


def test_a_fault_is_answered_logged_and_counted() -> None:
    """A handler that breaks says ``internal``, keeps its secrets for the log, and breaks nothing else."""
    desk = Desk()
    desk.robot.answer = ZeroDivisionError("a secret")
    with capture_logs() as logs:
        answer = desk.ask("get_stats")
    assert (answer["error"]["code"], answer["error"]["data"]) == (-32603, {"kind": "internal"})
    assert "secret" not in json.dumps(answer)
    assert [entry["method"] for entry in logs] == ["get_stats"]
    assert desk.dispatcher.faults == {"get_stats": 1}
    assert "result" in desk.ask("ping")


def test_a_fault_after_the_answer_is_counted_and_not_answered_again() -> None:
    """One request, one answer, even if what follows it breaks."""
    desk = Desk()
    desk.fanout.publish(TextReceived(99.5, "hi"))

    def broken(payload: EventPayload, latest: bool) -> None:
        raise BufferError(payload.topic)

    desk.send_event = broken  # type: ignore[method-assign]
    with capture_logs() as logs:
        assert desk.ask("subscribe", topics=["text"])["result"] == {"topics": ["text"]}
    assert len(desk.heard) == 1
    assert desk.dispatcher.faults == {"subscribe": 1}
    assert [entry["event"] for entry in logs] == ["handler_fault"]


def test_unknown_methods_and_bad_params_are_told_apart() -> None:
    """Each has its kind, and neither reaches the robot."""
    desk = Desk()
    assert desk.kind("fly") == "method_not_found"
    assert desk.kind("arm", now=True) == "invalid_params"
    assert desk.ask("drive", linear_m_s=True)["error"]["data"]["fields"][0]["field"] == "linear_m_s"
    assert desk.robot.calls == []


def test_a_notification_is_carried_out_and_not_answered() -> None:
    """Without an id there is no answer, whether it went well, was refused or makes no sense."""
    desk = Desk()
    desk.dispatcher.serve(desk, b'{"jsonrpc":"2.0","method":"stop"}')
    desk.dispatcher.serve(desk, b'{"jsonrpc":"2.0","method":"fly"}')
    assert (desk.robot.calls, desk.heard) == ([("stop",)], [])


def test_a_line_that_is_no_request_is_answered_without_id() -> None:
    """Who sends nonsense is told, under the id null."""
    desk = Desk()
    desk.dispatcher.serve(desk, b"go forward")
    assert (desk.heard[0]["id"], desk.heard[0]["error"]["data"]["kind"]) == (None, "parse_error")


PARAM_NAMES = [
    "linear_m_s",
    "angular_rad_s",
    "source",
    "topics",
    "max_rate_hz",
    "policy",
    "wheel",
    "kp",
    "x_m",
]
PARAM_VALUES = (
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats()
    | st.sampled_from(["all", "left", "text", "raw", "latest"])
    | st.text(max_size=5)
    | st.lists(st.sampled_from(["text", "raw", "lidar"]) | st.integers(), max_size=3)
)


@settings(max_examples=examples(150), deadline=None)
@given(
    method=st.sampled_from(
        [name for name, *_ in COMMANDS] + ["subscribe", "unsubscribe", "set_pid", "get_pid"]
    ),
    params=st.dictionaries(st.sampled_from(PARAM_NAMES), PARAM_VALUES, max_size=4),
)
def test_no_parameters_break_a_method(method: str, params: dict[str, Any]) -> None:
    """Whatever the parameters, a request has one answer, and it is never ``internal``."""
    desk = Desk()
    answer = desk.ask(method, **params)
    assert len([m for m in desk.heard if "method" not in m]) == 1
    assert answer.get("error", {}).get("data", {}).get("kind") != "internal"


def test_a_refusal_has_an_id_and_arguments_beside_its_sentence() -> None:
    """So that a client can say it in another language; the sentence is the English one."""
    error = Desk().ask("take_control", source="nobody")["error"]
    assert error["message"].startswith("no source named 'nobody'; there are ")
    assert (error["data"]["kind"], error["data"]["id"]) == ("unknown_source", "driving.unknown_source")
    assert error["data"]["arguments"].keys() == {"source", "others"}
    assert error["data"]["arguments"]["source"] == "nobody"

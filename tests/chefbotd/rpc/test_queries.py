"""What is asked and changes no motion: time, gains, state, topics, descriptions."""

import json

import pytest

from chefbotd.core.events import LinkOpened, SafetyChanged, TextReceived
from chefbotd.core.geometry import Twist2D
from chefbotd.rpc import models
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.jsonrpc import ERRORS
from chefbotd.rpc.method import Caller, Method
from chefbotd.rpc.methods import NOTIFICATIONS
from chefbotd.rpc.parameters import Role
from tests.chefbotd.rpc.desk import Desk
from tests.fakes.robot import FakeRobot


def test_ping_tells_the_daemons_time() -> None:
    """Pong, and the clock that stamps telemetry."""
    assert Desk().ask("ping")["result"] == {"pong": True, "stamp_s": 100.0}


def test_pid_gains_are_read_and_changed_by_wheel() -> None:
    """Gains are shown by their short names; a change touches the wheel it names, or all."""
    desk = Desk()
    assert desk.ask("get_pid")["result"]["wheels"]["left"]["kp"] == 400.0
    wheels = desk.ask("set_pid", wheel="left", kp=10)["result"]["wheels"]
    assert (wheels["left"]["kp"], wheels["right"]["kp"]) == (10.0, 400.0)
    wheels = desk.ask("set_pid", wheel="all", ki=5, deadband=0.01)["result"]["wheels"]
    assert [(w["ki"], w["deadband"]) for w in wheels.values()] == [(5.0, 0.01), (5.0, 0.01)]
    assert desk.kind("set_pid", wheel="third", kp=1) == "unknown_wheel"
    assert desk.ask("undo_pid")["result"]["wheels"].keys() == wheels.keys()
    assert desk.robot.calls[-1] == ("undo_pid",)


def test_state_has_link_and_gate_even_before_they_speak() -> None:
    """A fresh daemon says: link down, not armed, no topic yet."""
    state = Desk().ask("get_state")["result"]
    assert (state["link"]["state"], state["safety"]["armed"], state["topics"]) == ("down", False, {})


def test_state_has_the_latest_of_each_topic_with_its_age() -> None:
    """After events, their data as in the topics, and how old it is."""
    desk = Desk()
    desk.fanout.publish(LinkOpened(98.0, "/dev/ttyACM0"))
    desk.fanout.publish(SafetyChanged(99.0, "armed", "asked", None))
    desk.fanout.publish(TextReceived(99.5, "hi"))
    state = desk.ask("get_state")["result"]
    assert (state["stamp_s"], state["link"]["state"], state["safety"]["armed"]) == (100.0, "up", True)
    assert state["topics"]["text"] == {"seq": 1, "stamp_s": 99.5, "age_s": 0.5, "data": {"text": "hi"}}
    assert set(state["topics"]) == {"link", "log", "safety", "text"}


def test_stats_are_asked_of_the_robot() -> None:
    """The counters as they stand now, not as last published."""
    desk = Desk()
    desk.ask("stop")
    assert desk.ask("get_stats")["result"]["control_steps"] == 2


def test_subscribe_answers_first_then_sends_the_snapshot() -> None:
    """The answer lists all topics now subscribed; the latest value follows it, once."""
    desk = Desk()
    desk.fanout.publish(TextReceived(99.5, "hi"))
    assert desk.ask("subscribe", topics=["text", "link", "text"])["result"] == {"topics": ["link", "text"]}
    _, snapshot = desk.heard
    assert snapshot["params"]["data"] == {"text": "hi"}


def test_unsubscribe_some_or_all() -> None:
    """What is left is listed; no topics named means all of them."""
    desk = Desk()
    desk.ask("subscribe", topics=["text", "link", "stats"], max_rate_hz=5, policy="ordered")
    assert desk.ask("unsubscribe", topics=["link"])["result"] == {"topics": ["stats", "text"]}
    assert desk.ask("unsubscribe")["result"] == {"topics": []}


@pytest.mark.parametrize("method", ["subscribe", "unsubscribe"])
def test_an_unknown_topic_is_refused_as_a_whole(method: str) -> None:
    """Nothing is subscribed when one of the names is unknown, and the known ones are listed."""
    desk = Desk()
    error = desk.ask(method, topics=["text", "lidar"])["error"]
    assert (error["code"], error["data"]["kind"]) == (-32602, "unknown_topic")
    assert "odometry" in error["message"]
    assert desk.ask("unsubscribe", topics=["stats"])["result"] == {"topics": []}


def test_the_robots_description_is_served() -> None:
    """The URDF as it stands, and null where there is none."""
    robot = FakeRobot()
    assert Desk(robot).ask("get_description")["result"] == {"urdf": "<robot name='fake'/>"}
    robot.description = None
    assert Desk(robot).ask("get_description")["result"] == {"urdf": None}


def test_a_command_without_a_source_is_the_default_ones() -> None:
    """A robot whose people drive by joystick has no teleop: the lease and the command are the joystick's."""
    robot = FakeRobot()
    robot.default_source, robot.sources = "joystick", ("joystick",)
    desk = Desk(robot)
    assert desk.ask("drive", linear_m_s=0.1, angular_rad_s=0.0)["result"]["ok"]
    assert desk.robot.calls == [("drive", "joystick", Twist2D(0.1, 0.0))]
    assert desk.ask("take_control")["result"]["source"] == "joystick"


def test_describe_covers_the_whole_interface() -> None:
    """Every method, topic, notification and error kind, with schemas that say types, ranges and needs."""
    desk = Desk()
    described = desk.ask("describe")["result"]
    contract = (
        "authenticate cancel set_client_name describe get_description ping get_state get_stats subscribe unsubscribe "
        "drive set_wheel_velocities take_control release_control stop estop arm get_pid set_pid "
        "undo_pid reset_odometry reset_board list_maps load_map get_map import_map rename_map delete_map save_place "
        "list_places delete_place set_pose localize start_mapping pause_mapping finish_mapping discard_mapping "
        "navigate_to follow_waypoints go_home dock plan_to cancel_navigation pause_navigation resume_navigation "
        "start_recording stop_recording list_recordings save_ring"
    )
    assert set(described["methods"]) >= set(contract.split())
    assert set(described["topics"]) == set(desk.fanout.topics)
    assert set(described["notifications"]) == set(NOTIFICATIONS)
    assert set(described["errors"]) == {kind.value for kind in ERRORS}
    assert all(m["summary"] for m in (described["methods"] | described["topics"]).values())
    drive = described["methods"]["drive"]["params"]
    assert drive["required"] == ["linear_m_s", "angular_rad_s"]
    assert drive["properties"]["linear_m_s"]["type"] == "number"
    assert described["methods"]["set_pid"]["params"]["properties"]["kp"]["minimum"] == 0
    assert "kp" in json.dumps(described["methods"]["get_pid"]["result"])
    assert "default" not in described["methods"]["set_pid"]["params"]["properties"]["kp"]


@pytest.mark.parametrize(("constant", "told"), [(True, [1.0, 1.0, 1.0]), (False, [1.0, 2.0, 3.0])])
def test_what_never_changes_is_made_once(constant: bool, told: list[float]) -> None:
    """A constant answer is the same for everybody; its handler is not asked again."""
    desk, stamps_s = Desk(), iter([1.0, 2.0, 3.0])

    def handle(caller: Caller, params: models.NoParams) -> models.Pong:
        return models.Pong(stamp_s=next(stamps_s))

    method = Method(Role.OBSERVE, models.NoParams, models.Pong, handle, constant=constant)
    desk.dispatcher = Dispatcher({"count": method}, desk.clock, desk.arrivals, 0.5)
    assert [desk.ask("count")["result"]["stamp_s"] for _ in range(3)] == told

"""What is written by ``make client``, and what type checkers infer from it for users of the clients."""

import asyncio
from enum import StrEnum
from pathlib import Path
from typing import Any, assert_type

import pytest
from msgspec.structs import replace

from chefbotd.client import Client, NotReported, SyncClient, models
from chefbotd.client.blocking import SyncSubscription
from chefbotd.client.generated import GeneratedMethods
from chefbotd.client.models import BatteryData, Driven, MapList, OdometryData, PathData
from chefbotd.client.state import parse_state
from chefbotd.client.subscription import Subscription
from chefbotd.core.record import Record
from chefbotd.rpc.encoding import plain
from chefbotd.rpc.method import Method
from chefbotd.rpc.models import Params
from tests.chefbotd.client import api_page
from tests.chefbotd.client.api_page import Pair, inputs_of, is_possible, page
from tests.chefbotd.client.generate import written
from tests.fakes.example import example
from tests.fakes.robot import methods_of_socket, topics_of

METHODS, TOPICS = methods_of_socket(), topics_of(simulated=True)
FILES = ("models.py", "generated.py", "generated_sync.py", *(["api.md"] if api_page.PAGE.exists() else []))


@pytest.fixture(scope="module")
def files() -> dict[str, tuple[Path, str]]:
    """Each file and what it should say; it is made for these tests alone, not wherever tests are collected."""
    made = {path.name: (path, text) for path, text in written(METHODS, TOPICS).items()}
    assert set(made) == set(FILES)
    return made


@pytest.mark.parametrize("name", FILES)
def test_what_is_written_is_what_follows_from_the_methods_and_topics(
    files: dict[str, tuple[Path, str]], name: str
) -> None:
    """A method or topic that was added, changed or removed is in the client and in docs/api.md."""
    path, text = files[name]
    assert path.read_text(encoding="utf-8") == text, f"{name} is out of date: run `make client`"


class Recorder(GeneratedMethods):
    """Keeps what it is asked, and answers with an example."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, Any]]] = []

    async def call(self, method: str, /, *, on_progress: object = None, **params: Any) -> dict[str, Any]:
        self.asked.append((method, params))
        answer: dict[str, Any] = plain(example(METHODS[method].result))
        return answer


@pytest.mark.parametrize("name", [name for name in vars(GeneratedMethods) if name in METHODS])
def test_a_written_method_asks_for_what_it_is_named_after(name: str) -> None:
    """Each parameter goes along by its name, what is None does not; the answer is the method's own model."""
    recorder, method = Recorder(), METHODS[name]
    params = example(method.params).model_dump(mode="json", exclude_unset=True)
    answer = asyncio.run(getattr(recorder, name)(**params))
    ((asked, sent),) = recorder.asked
    defaults = {n: f.default for n, f in method.params.model_fields.items() if not f.is_required()}
    lists = {n: None for n, default in defaults.items() if default in ([], {})}  # the daemon has the default
    expected = {name: value for name, value in {**defaults, **lists, **params}.items() if value is not None}
    assert (asked, sent) == (name, expected)
    assert answer is None if method.result is models.Done else issubclass(method.result, type(answer))


def test_two_models_of_one_name_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The client has all of them in one module."""
    other = type("Pong", (Record,), {"__module__": __name__})
    monkeypatch.setitem(globals(), "Pong", other)
    with pytest.raises(ValueError, match="both have a model Pong"):
        written({**METHODS, "pong": replace(METHODS["ping"], result=other)}, TOPICS)


def test_what_the_writer_does_not_understand_is_to_be_written_by_hand() -> None:
    """A parameter that is a model of its own: the error names the method, the parameter and the file."""
    with pytest.raises(
        TypeError, match=r"waypoints: waypoints is <class .*: .* by hand, in client/methods\.py"
    ):
        written({"waypoints": renamed(METHODS["follow_waypoints"], "waypoints")}, TOPICS)


def renamed(method: Method, name: str) -> Method:
    """The method by another name, which the client does not have."""

    def handle() -> None:
        raise NotImplementedError

    handle.__name__ = name
    return replace(method, handle=handle)


class Unit(StrEnum):
    """In what a mark is given."""

    VOLT = "volt"
    PERCENT = "percent"


class MarkParams(Params):
    """Where the mark is."""

    above: float
    unit: Unit = Unit.VOLT


def test_a_parameter_of_a_few_values_is_typed_by_them() -> None:
    """Those of an enum, by their values, as they go over the socket; so does the default."""
    mark = renamed(replace(METHODS["ping"], params=MarkParams), "mark")
    text = {path.name: text for path, text in written({**METHODS, "mark": mark}, TOPICS).items()}[
        "generated.py"
    ]
    assert "async def mark(self, above: float, unit: Literal['volt', 'percent'] = 'volt') -> m.Pong:" in text


def test_a_bar_in_a_docstring_stays_as_it_is() -> None:
    """No table holds it; and the entry stays as it is when it is written again."""
    mark = renamed(METHODS["ping"], "mark")
    mark.handle.__doc__ = "Mark ``a`` | b."
    told = page(PAGE, {"mark": mark}, {"battery": TOPICS["battery"]})
    assert inputs_of(told)["mark"][:3] == ("Mark `a` | b.", "none", "`pong`, `stamp_s`")
    assert page(told, {"mark": mark}, {"battery": TOPICS["battery"]}) == told


def test_a_page_keeps_its_words_and_gets_what_is_missing() -> None:
    """What names everything stays; what lacks something or names too much, and a new entry, is written."""
    methods = {name: METHODS[name] for name in ("set_pose", "delete_place", "arm", "ping")}
    told = page(PAGE, methods, {"battery": TOPICS["battery"]})
    entries = inputs_of(told)
    assert list(entries) == ["delete_place", "arm", "set_pose", "ping"]
    assert entries["delete_place"][:3] == ("Forgets it.", "its `name` and `map`", "`ok`")
    given = "`state`, `map`, `fit`, `alternatives`, `searched`, `jumps`, `reason`"
    assert entries["set_pose"][:3] == ("As it was.", "`x_m`, `y_m`, `heading_rad` = 0.0", given)
    assert entries["arm"][:3] == ("Allows motion.", "`latch` = null", "`ok`")
    assert entries["ping"][:3] == ("Answer at once, with the daemon's time.", "none", "`pong`, `stamp_s`")
    assert "| `battery` | The battery. `voltage_v`, `percentage`, `status` |" in told
    assert "- Role: drive\n- Parameters: `latch` = null" in told
    assert "Before the methods." in told
    assert "fly" not in told
    assert page(told, methods, {"battery": TOPICS["battery"]}) == told


def test_an_example_that_is_possible_stays_and_any_other_is_written() -> None:
    """One request has a member that there is not, one answer lacks what it must have; the numbers follow the order."""
    methods = {name: METHODS[name] for name in ("set_pose", "delete_place", "arm", "ping")}
    examples = {
        name: entry.examples
        for name, entry in inputs_of(page(PAGE, methods, {"battery": TOPICS["battery"]})).items()
    }
    ((request, answer),) = examples["delete_place"]
    assert (request["id"], request["params"], answer["id"]) == (1, {"name": "table 3"}, 1)
    ((request, answer),) = examples["arm"]
    assert ("params" in request, answer["result"]) == (False, {"ok": True})
    ((request, answer),) = examples["set_pose"]
    assert request["params"] == {"x_m": 1.0, "y_m": 1.0}
    assert set(answer["result"]) > {"state", "map", "jumps"}
    ((request, answer),) = examples["ping"]
    assert (request["id"], answer["id"]) == (4, 4)
    assert set(answer["result"]) == {"pong", "stamp_s"}


def test_an_answer_that_is_cut_short_says_so() -> None:
    """Then a member may be missing; none may be unknown."""
    request = {"method": "ping"}
    assert not is_possible(Pair(request, {"result": {"pong": True}}), METHODS["ping"])
    assert is_possible(Pair(request, {"result": {"pong": True, "…": "…"}}), METHODS["ping"])
    assert not is_possible(Pair(request, {"result": {"ping": True, "…": "…"}}), METHODS["ping"])


PAGE = """
## Methods

Before the methods.

### `delete_place`

Forgets it.

- Role: drive
- Parameters: its `name` and `map`
- Result: `ok`

```json
{"jsonrpc":"2.0","id":2,"method":"delete_place","params":{"name":"table 3"}}
{"jsonrpc":"2.0","id":2,"result":{"ok":true}}
```

### `arm`

Allows motion.

- Role: drive
- Parameters: `latch` = `newest`, `force`
- Result: `ok`

```json
{"jsonrpc":"2.0","id":4,"method":"arm","params":{"force":true}}
{"jsonrpc":"2.0","id":4,"result":{"ok":true}}
```

### `fly`

Is gone.

- Role: drive
- Parameters: none
- Result: `ok`

```json
{"jsonrpc":"2.0","id":3,"method":"fly"}
{"jsonrpc":"2.0","id":3,"result":{"ok":true}}
```

### `set_pose`

As it was.

- Role: observe
- Parameters: `x_m`, `y_m`
- Result: `state`

```json
{"jsonrpc":"2.0","id":7,"method":"set_pose","params":{"x_m":2.1,"y_m":-0.4}}
{"jsonrpc":"2.0","id":7,"result":{"state":"uncertain"}}
```

## Topics

| topic | data |
|---|---|
| `battery` | `voltage_v` |

## Limits
"""


def test_a_state_has_the_data_of_each_topic_by_its_name_and_type() -> None:
    """Of a robot whose battery was read once, and nothing else: the other topics say that they were not reported."""
    battery = {"voltage_v": 12.5, "percentage": 81.0, "status": "ok"}
    link = {
        "state": "down",
        "device": "/dev/ttyACM0",
        "reason": "unplugged",
        "condition": "down",
        "healthy": None,
    }
    safety = plain(TOPICS["safety"].data(None))
    event = {"seq": 1, "stamp_s": 9.0, "age_s": 1.0, "data": battery}
    state = parse_state({"stamp_s": 10.0, "link": link, "safety": safety, "topics": {"battery": event}})
    assert assert_type(state.battery, BatteryData).percentage == 81.0
    for topic in TOPICS.keys() - {"battery", "link", "safety"}:
        with pytest.raises(NotReported, match=f"not reported {topic} yet; the link is down: unplugged"):
            getattr(state, topic)


def test_both_clients_infer_the_same_types() -> None:
    """A literal topic gives its model; the plain client's methods return what the asyncio client's await.

    This is for mypy: nothing of it runs.
    """

    async def with_asyncio(robot: Client) -> None:
        assert_type(robot.subscribe("path", max_rate_hz=2.0), Subscription[PathData])
        assert_type(robot.subscribe(["path", "odometry"]), Subscription[Any])
        assert_type(await robot.drive(0.1, -0.2, source="joystick"), Driven)
        assert_type(await robot.arm(latch=3), None)

    def without(robot: SyncClient) -> None:
        assert_type(robot.subscribe("path", max_rate_hz=2.0), SyncSubscription[PathData])
        assert_type(robot.subscribe("odometry").next(1.0).data, OdometryData)
        assert_type(robot.subscribe(["path", "odometry"]), SyncSubscription[Any])
        assert_type(robot.drive(0.1, -0.2, source="joystick"), Driven)
        assert_type(robot.list_maps(on_progress=print), MapList)
        assert_type(robot.take_control(source="teleop"), str | None)
        robot.drive("fast", 0.0)  # type: ignore[arg-type]
        robot.navigate_to(plaice="kitchen")  # type: ignore[call-arg]
        robot.subscribe("path", rate=2.0)  # type: ignore[call-overload]

    assert callable(with_asyncio)
    assert callable(without)

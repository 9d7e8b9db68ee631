"""The synchronous client: the same methods, on threads instead of a loop."""

import importlib.resources
import inspect
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from chefbotd.client import CallError, CallTimeout, CannotConnect, Client, ConnectionLost, SyncClient
from chefbotd.client.models import DATA_BY_TOPIC
from chefbotd.transport.ports import reserve_port
from tests.chefbotd.client.real_time import simulated_daemon
from tests.fakes.robot import topics_of
from tests.waiting import PATIENCE_S


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """A simulated daemon's."""
    with simulated_daemon() as port:
        yield port


def public(kind: type) -> dict[str, list[str]]:
    """The methods and what each takes."""
    members = inspect.getmembers(kind, inspect.isfunction)
    return {n: list(inspect.signature(f).parameters) for n, f in members if not n.startswith("_")}


def test_it_has_the_methods_of_the_asyncio_client() -> None:
    """Every public method has the same name and the same parameters; only ``close`` is added."""
    plain = public(SyncClient)
    assert plain.pop("close") == ["self"]
    assert plain == public(Client)
    asked, plainly = (inspect.signature(kind.connect).parameters for kind in (Client, SyncClient))
    assert list(asked) == list(plainly)


def test_every_method_of_the_socket_is_a_method(port: int) -> None:
    """What the daemon lists as capabilities can be called by name, and every topic has a model."""
    with SyncClient.connect(port=port) as robot:
        listed = {c.removeprefix("method.") for c in robot.hello.capabilities if c.startswith("method.")}
        assert listed - {"unsubscribe", "cancel"} <= public(SyncClient).keys()  # leaving does both
    models = {name: topic.model for name, topic in topics_of(simulated=True).items()}
    assert models.keys() == DATA_BY_TOPIC.keys()
    assert all(issubclass(models[name], DATA_BY_TOPIC[name]) for name in models)


def test_refusals_and_time_outs_are_raised_where_it_is_called(port: int) -> None:
    """A refusal has its kind; an event that does not come is a ``CallTimeout`` that names the topic."""
    with SyncClient.connect(port=port) as robot:
        with pytest.raises(CallError) as refused:
            robot.drive(0.1, 0.0, "nobody")
        assert refused.value.kind == "unknown_source"
        with (
            robot.subscribe("text", max_rate_hz=0.01) as texts,
            pytest.raises(CallTimeout, match=r"no event of text within 0\.1 s"),
        ):
            [texts.next(timeout_s=0.1) for _ in range(2)]


def test_closing_ends_whoever_waits(port: int) -> None:
    """A thread that waits for an event gets ``ConnectionLost``, and so does every later call; closing twice is fine."""
    robot = SyncClient.connect(port=port)
    ended: list[type[Exception]] = []

    def wait() -> None:
        try:
            for _ in robot.subscribe("text"):
                pass
        except ConnectionLost as lost:
            ended.append(type(lost))

    waiting = threading.Thread(target=wait)
    waiting.start()
    robot.ping()
    robot.close()
    robot.close()
    waiting.join(PATIENCE_S)
    assert ended == [ConnectionLost]
    assert not robot.connected
    with pytest.raises(ConnectionLost, match="closed"):
        robot.stop()


def test_nobody_listens() -> None:
    """Connecting to a closed port raises at once, and leaves no thread behind."""

    def of_clients() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread.name == "chefbotd-client"]

    before = of_clients()
    with pytest.raises(CannotConnect):
        SyncClient.connect(port=reserve_port())
    assert of_clients() == before


def test_type_checkers_find_the_types() -> None:
    """The marker of PEP 561 is in the package, in the built wheel too."""
    assert importlib.resources.files("chefbotd").joinpath("py.typed").is_file()


def test_a_stop_does_not_wait_for_the_models() -> None:
    """Building them takes longer than connecting, so the client is imported without pydantic."""
    program = "import sys, chefbotd.client; sys.exit('pydantic' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0

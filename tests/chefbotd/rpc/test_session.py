"""What one client may do and how long it may take, with time as an argument."""

import pytest

from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session

LIMITS = ApiParameters(
    authenticate_timeout_s=5.0,
    request_timeout_s=10.0,
    idle_timeout_s=60.0,
    requests_per_s=10.0,
    requests_burst=2,
)


def session(role: Role | None = Role.ADMIN, host: str = "10.0.0.7") -> Session:
    """A client that came at 100 s."""
    return Session(LIMITS, host, 50312, role, 100.0)


def overdue(client: Session, now_s: float, *, subscribed: bool = False) -> str | None:
    """What the client has taken too long for, in words."""
    failure = client.overdue(now_s, lambda: subscribed)
    assert failure is None or failure.kind == ErrorKind.TIMED_OUT
    return None if failure is None else failure.message


@pytest.mark.parametrize(
    ("host", "client", "shown"),
    [
        ("10.0.0.7", "", "10.0.0.7:50312"),
        ("10.0.0.7", "Ann's joystick", "Ann's joystick (10.0.0.7:50312)"),
        ("fd00::7", "", "[fd00::7]:50312"),
    ],
)
def test_a_client_is_shown_by_its_name_and_its_address(host: str, client: str, shown: str) -> None:
    """A name is only what the client says; the address is always there with it."""
    known = session(host=host)
    known.client = client
    assert str(known) == shown


def test_a_client_without_a_token_has_five_seconds() -> None:
    """At 105 s there is still time, after that there is not; with a role there is no such limit."""
    assert overdue(session(None), 105.0) is None
    assert overdue(session(None), 105.1) == "not authenticated within 5 s"
    assert overdue(session(), 105.1) is None


def test_a_request_may_take_ten_seconds_however_its_bytes_drip() -> None:
    """Counted from its first byte; a line end in time ends the count, and the next begins its own."""
    client = session()
    client.record_activity(110.0)
    client.set_incomplete(True)
    client.record_activity(119.0)
    client.set_incomplete(True)
    assert overdue(client, 120.0) is None
    assert overdue(client, 120.1) == "a request was not complete within 10 s"
    client.set_incomplete(False)
    client.set_incomplete(True)
    assert overdue(client, 129.0) is None
    assert overdue(client, 129.1) == "a request was not complete within 10 s"


def test_a_silent_client_may_stay_a_minute_and_a_subscriber_for_ever() -> None:
    """Silence is counted from the last bytes."""
    client = session()
    client.record_activity(150.0)
    assert overdue(client, 210.0) is None
    assert overdue(client, 210.1) == "neither a request nor a subscription for 60 s"
    assert overdue(client, 10_000.0, subscribed=True) is None


def test_requests_and_refusals_are_rationed_apart() -> None:
    """Two at once of each; a tenth of a second later one more of each."""
    client = session()
    assert [client.admit_request(100.0) for _ in range(3)] == [True, True, False]
    assert [client.admit_error(100.0) for _ in range(3)] == [True, True, False]
    assert (client.admit_request(100.11), client.admit_error(100.11)) == (True, True)

"""Enough, and not without end."""

from chefbotd.rpc.parameters import ApiParameters
from chefbotd.transport.unread import DRAIN_BYTES, DRAIN_LINES, DrainLimit


def test_the_same_is_done_once_until_more_has_come() -> None:
    """Of stop, stop, estop, nothing, stop three are asked for in vain; after that a stop is one again."""
    drain = DrainLimit()
    assert [drain.admit_line(m) for m in ("stop", "stop", "estop", None, "stop")] == [
        True,
        False,
        True,
        False,
        False,
    ]
    drain.count_bytes(1)
    assert drain.admit_line("stop")


def test_it_is_over_after_so_many_lines() -> None:
    """The last of a thousand lines is looked at, the next is not."""
    drain = DrainLimit()
    for _ in range(DRAIN_LINES - 1):
        drain.admit_line(None)
    assert drain.admit_line("stop")
    assert not drain.exceeded
    assert not drain.admit_line("estop")
    assert drain.exceeded


def test_it_is_over_after_so_many_bytes() -> None:
    """More than can have been on its way when the connection's end began."""
    drain = DrainLimit()
    most = type(ApiParameters()).model_fields["backlog_bytes"].metadata
    assert max(limit.le for limit in most if hasattr(limit, "le")) * 2 + 65_536 < DRAIN_BYTES
    drain.count_bytes(DRAIN_BYTES)
    assert not drain.exceeded
    drain.count_bytes(1)
    assert (drain.exceeded, drain.admit_line("stop")) == (True, False)

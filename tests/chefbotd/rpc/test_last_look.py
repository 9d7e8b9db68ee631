"""Enough, and not without end."""

from chefbotd.rpc.last_look import LAST_LOOK_BYTES, LAST_LOOK_LINES, LastLook
from chefbotd.rpc.parameters import ApiParameters


def test_the_same_is_done_once_until_more_has_come() -> None:
    """Of stop, stop, estop, nothing, stop three are asked for in vain; after that a stop is one again."""
    look = LastLook()
    assert [look.is_to_do(m) for m in ("stop", "stop", "estop", None, "stop")] == [
        True,
        False,
        True,
        False,
        False,
    ]
    look.read(1)
    assert look.is_to_do("stop")


def test_it_is_over_after_so_many_lines() -> None:
    """The last of a thousand lines is looked at, the next is not."""
    look = LastLook()
    for _ in range(LAST_LOOK_LINES - 1):
        look.is_to_do(None)
    assert look.is_to_do("stop")
    assert not look.over
    assert not look.is_to_do("estop")
    assert look.over


def test_it_is_over_after_so_many_bytes() -> None:
    """More than can have been on its way when the connection's end began."""
    look = LastLook()
    most = type(ApiParameters()).model_fields["backlog_bytes"].metadata
    assert max(limit.le for limit in most if hasattr(limit, "le")) * 2 + 65_536 < LAST_LOOK_BYTES
    look.read(LAST_LOOK_BYTES)
    assert not look.over
    look.read(1)
    assert (look.over, look.is_to_do("stop")) == (True, False)

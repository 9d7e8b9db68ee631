"""What outlives a daemon of its gate."""

import json

import pytest

from chefbotd.safety.faults import RECOVERABLE, FaultKind
from chefbotd.safety.gate import GateState, Mode, Trigger, change_mode
from chefbotd.safety.latch import MAX_REASON_CHARACTERS, UNCLEAN_SHUTDOWN, UNREADABLE, read, write

ESTOPPED = GateState(Mode.ESTOPPED, "smoke")
STALLED = GateState(Mode.DISARMED, "left_wheel stalled", fault=FaultKind.WHEEL_STALLED)


@pytest.mark.parametrize(
    ("left", "found"),
    [
        (ESTOPPED, ESTOPPED),
        (STALLED, STALLED),
        (UNCLEAN_SHUTDOWN, UNCLEAN_SHUTDOWN),
        (UNREADABLE, UNREADABLE),
        (GateState(Mode.ARMED, "started"), UNCLEAN_SHUTDOWN),
        (GateState(Mode.ARMED, "armed"), UNCLEAN_SHUTDOWN),
    ],
)
def test_the_next_daemon_begins_as_the_last_one_was_but_never_armed(left: GateState, found: GateState):
    """A latch stays with its reason and fault; who was armed, and left word of it, did not end in order."""
    assert read(write(left)) == found


def test_what_is_written_can_be_read_by_people():
    """Mode, fault and reason as JSON."""
    assert json.loads(write(STALLED)) == {
        "mode": "disarmed",
        "fault": "wheel_stalled",
        "reason": "left_wheel stalled",
    }


@pytest.mark.parametrize("reason", ["x" * 10 * MAX_REASON_CHARACTERS, "half a pair: \ud83d", "☃\n\0", ""])
def test_no_reason_keeps_a_latch_from_being_remembered(reason: str):
    """Too long, or not to be encoded: the mode comes through."""
    assert read(write(GateState(Mode.ESTOPPED, reason))).mode is Mode.ESTOPPED


@pytest.mark.parametrize(
    "left",
    [
        b"",
        b"null",
        b"\xff\xfe",
        b"[" * 60_000,
        b'{"mode":"estopped","fault":null,"reas',
        b'{"mode":"flying","fault":null,"reason":"r"}',
        b'{"mode":"disarmed","fault":"dragons","reason":"r"}',
        b'{"mode":"armed","reason":"r"}',
        b'{"mode":"armed","fault":null,"reason":7}',
    ],
)
def test_what_no_daemon_wrote_is_refused(left: bytes):
    """Empty, cut short, another encoding, unknown names, missing keys: a ValueError, never a state."""
    with pytest.raises(ValueError, match="not what a daemon wrote"):
        read(left)


@pytest.mark.parametrize("state", [UNCLEAN_SHUTDOWN, UNREADABLE])
def test_a_daemon_that_ended_badly_is_left_by_arm_only(state: GateState):
    """No recovery of the link arms the robot; a person does."""
    assert FaultKind.UNCLEAN_SHUTDOWN not in RECOVERABLE
    assert change_mode(state, Trigger.RECOVERY, "the link is back") == state
    assert change_mode(state, Trigger.ARM, "armed").mode is Mode.ARMED

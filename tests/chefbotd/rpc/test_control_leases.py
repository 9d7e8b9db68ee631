"""Who drives: the leases on sources of commands, with time as an argument."""

import pytest
from msgspec import convert, to_builtins

from chefbotd.core.events import ControlChanged
from chefbotd.rpc.control_leases import ControlLeases, LeasesState
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.method import Unserved
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session


def client(name: str, port: int) -> Session:
    """A client with a name; its number is its port."""
    session = Session(ApiParameters(), "10.0.0.7", port, Role.DRIVE, 0.0)
    session.client, session.number = name, port
    return session


ANN, BOB = client("Ann", 1), client("Bob", 2)


class Desk:
    """Leases of three seconds, and what they led to."""

    def __init__(self) -> None:
        self.withdrawn: list[str] = []
        self.told: list[ControlChanged] = []
        self.control = ControlLeases(3.0, 1.0, self.withdrawn.append, self.told.append)

    def drive(self, session: Session, now_s: float, source: str = "teleop") -> None:
        """What a drive does."""
        self.control.require(source, session, now_s)
        self.control.renew(source, session, now_s)

    def holders(self) -> list[dict[str, str]]:
        """All that was told of who drives."""
        return [event.holders for event in self.told]


def test_the_first_drive_takes_the_lease_and_says_so_once() -> None:
    """A hundred drives of one client are one announcement."""
    desk = Desk()
    for i in range(100):
        desk.drive(ANN, i / 10)
    assert desk.told == [ControlChanged(0.0, {"teleop": "Ann (10.0.0.7:1)"})]
    assert desk.withdrawn == []


def test_a_second_driver_is_refused_and_told_who_drives() -> None:
    """Kind, source and holder are in the error; the lease stays where it is."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    with pytest.raises(Unserved, match=r"controlled by Ann .*take control") as caught:
        desk.drive(BOB, 1.0)
    assert caught.value.kind == ErrorKind.LEASE_HELD
    assert caught.value.details == {"source": "teleop", "holder": "Ann (10.0.0.7:1)"}
    assert desk.control.holder("teleop", 1.0) is ANN


def test_each_source_has_a_lease_of_its_own() -> None:
    """Ann at the joystick and Bob's navigation do not get in each other's way here."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    desk.drive(BOB, 0.0, "navigation")
    assert desk.holders()[-1] == {"teleop": "Ann (10.0.0.7:1)", "navigation": "Bob (10.0.0.7:2)"}


def test_a_lease_ends_three_seconds_after_the_last_drive() -> None:
    """At 3.0 s it still holds, later it does not, whether or not anyone has swept."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    with pytest.raises(Unserved):
        desk.drive(BOB, 3.0)
    desk.drive(BOB, 3.1)
    assert desk.control.holder("teleop", 3.1) is BOB
    assert desk.withdrawn == []


def test_a_swept_lease_is_told() -> None:
    """What has ended with time disappears from the topic; what has not stays."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    desk.drive(BOB, 2.0, "navigation")
    desk.control.expire(2.9)
    assert len(desk.told) == 2
    desk.control.expire(3.1)
    assert desk.told[-1] == ControlChanged(3.1, {"navigation": "Bob (10.0.0.7:2)"})


def test_control_is_taken_over_explicitly() -> None:
    """Who had it is named, its command is withdrawn, and its next drive is refused."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    assert desk.control.take_source("teleop", BOB, 1.0) is ANN
    assert desk.withdrawn == ["teleop"]
    with pytest.raises(Unserved, match="controlled by Bob"):
        desk.drive(ANN, 1.1)
    desk.drive(BOB, 1.1)


@pytest.mark.parametrize("holder", [None, BOB])
def test_taking_what_is_free_or_ones_own_withdraws_nothing(holder: Session | None) -> None:
    """Nobody's motion ends; the lease is renewed."""
    desk = Desk()
    if holder is not None:
        desk.drive(holder, 0.0)
    assert desk.control.take_source("teleop", BOB, 2.0) is holder
    assert desk.withdrawn == []
    assert desk.control.holder("teleop", 5.0) is BOB


def test_the_end_of_a_client_withdraws_all_it_drives() -> None:
    """Its sources are free at once; another client's are not touched; one announcement."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    desk.drive(ANN, 0.0, "safety")
    desk.drive(BOB, 0.0, "navigation")
    before = len(desk.told)
    assert desk.control.release(ANN, 1.0) == ["teleop", "safety"]
    assert desk.withdrawn == ["teleop", "safety"]
    assert desk.holders()[before:] == [{"navigation": "Bob (10.0.0.7:2)"}]


def test_a_client_that_drives_nothing_ends_quietly() -> None:
    """No announcement, nothing withdrawn."""
    desk = Desk()
    assert desk.control.release(ANN, 1.0) == []
    assert (desk.told, desk.withdrawn) == ([], [])


def test_at_the_daemons_end_nothing_is_withdrawn() -> None:
    """The robot is stopped by others then; a withdrawn command could let a lower one through."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    desk.control.forget()
    assert desk.control.release(ANN, 0.1) == []
    assert desk.withdrawn == []


def test_a_new_name_is_told_of_those_who_drive() -> None:
    """A driver's name changes on the topic; others' names are nobody's business."""
    desk, carol = Desk(), client("", 3)
    desk.control.renamed(carol, 0.0)
    assert desk.told == []
    desk.drive(carol, 0.0)
    carol.client = "Carol"
    desk.control.renamed(carol, 0.5)
    assert desk.told[-1] == ControlChanged(0.5, {"teleop": "Carol (10.0.0.7:3)"})


def test_a_lease_lasts_for_as_long_as_its_client_tries() -> None:
    """Refused by the robot for 6 s at 20 Hz: the source is still Ann's 3 s later, and nobody's after that."""
    desk = Desk()
    desk.drive(ANN, 10.0)
    for i in range(120):
        desk.control.require("teleop", ANN, 10.0 + i / 20)
    assert desk.control.holder("teleop", 18.9) is ANN
    assert desk.control.holder("teleop", 19.0) is None


def test_what_is_recorded_names_clients_by_their_numbers_and_own_drivers_below_zero() -> None:
    """Ann drives by hand and as safety, the robot itself navigates: so it is written, and so it is read again."""
    desk, later, own = Desk(), Desk(), client("navigation", 0)
    for each in (desk, later):
        each.control.add_own(own)
    desk.drive(ANN, 1.0)
    desk.drive(ANN, 2.0, "safety")
    desk.drive(own, 3.0, "navigation")
    state = {
        "clients": [{"number": 1, "client": "Ann", "host": "10.0.0.7", "port": 1, "role": "drive"}],
        "leases": {"teleop": [1, 1.0], "safety": [1, 2.0], "navigation": [-1, 3.0]},
    }
    assert to_builtins(desk.control.state()) == state
    later.control.restore(convert(state, LeasesState))
    assert to_builtins(later.control.state()) == state
    assert later.control.holder("navigation", 3.0) is own
    assert str(later.control.holder("teleop", 3.0)) == "Ann (10.0.0.7:1)"
    with pytest.raises(KeyError, match="7"):
        later.control.restore(convert({"clients": [], "leases": {"teleop": [7, 0.0]}}, LeasesState))
    assert to_builtins(later.control.state()) == state


def test_a_client_without_a_lease_is_forgotten() -> None:
    """Bob takes over: Ann is in the state no longer."""
    desk = Desk()
    desk.drive(ANN, 0.0)
    desk.control.take_source("teleop", BOB, 1.0)
    assert [holder.client for holder in desk.control.state().clients] == ["Bob"]
    assert not desk.control.has(ANN)

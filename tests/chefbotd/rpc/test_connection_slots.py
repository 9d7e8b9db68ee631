"""A bounded number of connections that addresses share."""

import pytest

from chefbotd.rpc.connection_slots import ConnectionSlots, NoSlot, address_group

CROWD = tuple([f"127.0.0.{number}" for number in range(1, 5)])


@pytest.mark.parametrize(
    ("host", "group"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("::ffff:10.0.0.7", "10.0.0.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::9", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::1", "::/64"),
        ("a name", "a name"),
    ],
)
def test_an_ipv6_subscriber_is_one_address(host: str, group: str) -> None:
    """An IPv4 address stands for itself, however it is written; IPv6 addresses of one /64 are one."""
    assert address_group(host) == group


def test_the_address_with_most_gives_up_its_oldest() -> None:
    """Three of one address and one of another fill four slots; a third address takes the oldest of the three."""
    slots = ConnectionSlots[str](4)
    for number, name in enumerate(("a1", "b1", "a2", "a3")):
        assert slots.add(name, f"10.0.0.{1 if name[0] == 'a' else 2}", 0.1 * number) == []
    assert slots.add("c1", "10.0.0.3", 0.4) == ["a1"]
    assert (len(slots), "a1" in slots, "b1" in slots) == (4, False, True)


def test_a_slot_is_kept_for_a_second_from_its_own_address() -> None:
    """Of 16 that came at once the newest two give way to others in turn; after a second the oldest does."""
    slots = ConnectionSlots[int](16)
    for number in range(16):
        slots.add(number, "10.0.0.1", 0.0)
    assert [slots.add(number, "10.0.0.1", 0.99) for number in (16, 17, 18)] == [[13], [14], [15]]
    assert slots.add(19, "10.0.0.1", 1.0) == [0]


def test_who_comes_when_a_burst_is_over_finds_a_slot() -> None:
    """3,000 connections of an address at once, and one more: it gets in, and none of the first 1,700 has gone."""
    slots = ConnectionSlots[int](2048)
    for number in range(3001):
        slots.add(number, "10.0.0.1", number / 30_000)
    assert 3000 in slots
    assert all(number in slots for number in range(1700))


def test_who_is_renewed_counts_as_just_come() -> None:
    """The other one gives way, though it came later."""
    slots = ConnectionSlots[str](2)
    slots.add("old", "10.0.0.1", 0.0)
    slots.add("new", "10.0.0.1", 0.5)
    slots.renew("old", 1.4)
    assert slots.add("next", "10.0.0.1", 1.5) == ["new"]


def test_a_slot_that_was_given_back_is_free() -> None:
    """Twice is once, and what has none gives none back."""
    slots = ConnectionSlots[str](1)
    slots.add("first", "10.0.0.1", 0.0)
    for _ in range(2):
        slots.remove("first")
    slots.renew("first", 0.1)
    assert slots.add("second", "10.0.0.1", 0.1) == []


def test_where_there_is_room_for_nobody_nobody_comes_in() -> None:
    """A capacity of 0, and nobody to take a slot from."""
    with pytest.raises(NoSlot):
        ConnectionSlots[str](0).add("first", "10.0.0.1", 0.0)


def test_where_descriptors_are_scarce_two_give_way_for_one() -> None:
    """However young they are: else the descriptors of those that go would be taken without anybody going for them."""
    slots = ConnectionSlots[int](100)
    for number in range(4):
        slots.add(number, "10.0.0.1", 0.0)
    assert slots.add(4, "10.0.0.1", 0.0, scarce=True) == [0, 1]
    assert len(slots) == 3


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9"])
def test_a_crowd_of_four_addresses_leaves_everybody_a_second(host: str) -> None:
    """1,000 connections a second of four addresses and 2,000 slots: who comes beside them has its slot for 1 s.

    So it is from an address of its own, and from one of theirs: 250 a second come from that, and it has a quarter of
    the slots or more, which is 2 s.
    """
    slots = ConnectionSlots[object](2000)
    came_s: dict[object, float] = {}
    for number in range(20_000):
        now_s = number / 1000
        for key, place in ((number, CROWD[number % 4]), (f"late {number}", host))[: 1 + (number % 100 == 0)]:
            came_s[key] = now_s
            for evicted in slots.add(key, place, now_s):
                assert now_s - came_s[evicted] >= 1.0

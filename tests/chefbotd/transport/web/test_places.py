"""Who gets a place among those without a token, and who gives way."""

import pytest

from chefbotd.transport.web.places import NoPlace, Places, network_of


def taken(places: Places[str], host: str, count: int, now_s: float) -> list[str]:
    """Take so many places, each with a key of its own."""
    keys = [f"{host} {now_s} {number}" for number in range(count)]
    for key in keys:
        places.take(key, host, now_s)
    return keys


def test_an_address_has_a_share_and_then_replaces_its_own_oldest() -> None:
    """4 of 6 places for one address: the fifth replaces the first, and another address finds room."""
    places: Places[str] = Places(6, 4, 1.0)
    first, *_ = taken(places, "10.0.0.1", 4, 0.0)
    assert places.take("new", "10.0.0.1", 1.0) == first
    assert places.take("other", "10.0.0.2", 1.0) is None
    assert len(places) == 5


def test_each_keeps_its_place_for_a_second() -> None:
    """A newcomer waits until the oldest of its address could have shown its token."""
    places: Places[str] = Places(6, 4, 1.0)
    taken(places, "10.0.0.1", 4, 0.0)
    with pytest.raises(NoPlace, match=r"already 4 connections from 10.0.0.1"):
        places.take("new", "10.0.0.1", 0.9)
    assert len(places) == 4


def test_the_fullest_address_gives_way() -> None:
    """All 6 places are taken, 4 by one address: a newcomer from elsewhere replaces the oldest of those 4."""
    places: Places[str] = Places(6, 4, 1.0)
    taken(places, "10.0.0.2", 2, 0.0)
    first, *_ = taken(places, "10.0.0.1", 4, 0.5)
    assert places.take("new", "10.0.0.3", 2.0) == first
    assert places.take("again", "10.0.0.1", 2.0) == f"{first[:-1]}1"


def test_who_has_left_has_no_place() -> None:
    """Leaving makes room at once, and leaving twice is nothing."""
    places: Places[str] = Places(1, 1, 1.0)
    places.take("a", "10.0.0.1", 0.0)
    places.leave("a")
    places.leave("a")
    assert places.take("b", "10.0.0.1", 0.0) is None


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("192.168.1.7", "192.168.1.7"),
        ("::ffff:192.168.1.7", "192.168.1.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("robot.local", "robot.local"),
    ],
)
def test_an_ipv6_network_counts_as_one_address(host: str, network: str) -> None:
    """Whoever has one address of a prefix has 2**64 of them."""
    assert network_of(host) == network

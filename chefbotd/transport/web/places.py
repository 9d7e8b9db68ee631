"""The places of connections that have not shown a token yet: who gets one, and who gives way. Pure: time is an argument.

An address has a share of the places, so that a crowd from one leaves room for others. Who is new replaces the oldest of
an address that has at least as many, once that one has had its place for ``least_s``: so nobody is replaced before it
can have said who it is. Who has shown a token leaves these places, and is never replaced.
"""

import ipaddress
from collections import Counter
from collections.abc import Hashable
from typing import Generic, TypeVar

from chefbotd.core.record import Record

Key = TypeVar("Key", bound=Hashable)
IPV6_PREFIX = 64
"""Whoever has one IPv6 address has all of this prefix (RFC 6177)."""


class Place(Record, frozen=True):
    """Whose network it is, and since when."""

    network: str
    since_s: float


class NoPlace(Exception):
    """There is no place now; the message says why."""


def network_of(host: str) -> str:
    """The address that counts as one: an IPv4 address, or the prefix of an IPv6 address."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv6Address):
        mapped = address.ipv4_mapped
        return str(mapped or ipaddress.ip_network((address, IPV6_PREFIX), strict=False))
    return str(address)


class Places(Generic[Key]):
    """At most ``total`` places, of them ``per_network`` for one network."""

    def __init__(self, total: int, per_network: int, least_s: float) -> None:
        self._total, self._per_network, self._least_s = total, per_network, least_s
        self._places: dict[Key, Place] = {}  # the oldest first

    def __len__(self) -> int:
        return len(self._places)

    def take(self, key: Key, host: str, now_s: float) -> Key | None:
        """Give ``key`` a place; whom it replaces, if anybody.

        Raises:
            NoPlace: all places are taken by others that have had theirs too shortly, or by networks with fewer.
        """
        network = network_of(host)
        replaced = self._replaceable(network, now_s)
        if replaced is not None:
            del self._places[replaced]
        self._places[key] = Place(network, now_s)
        return replaced

    def _replaceable(self, network: str, now_s: float) -> Key | None:
        counts = Counter(place.network for place in self._places.values())
        if counts[network] >= self._per_network:
            return self._oldest(network, now_s, f"{counts[network]} connections from {network}")
        if len(self._places) < self._total:
            return None
        fullest, count = counts.most_common(1)[0]
        crowd = f"{len(self._places)} connections"
        if counts[network] >= count:
            fullest = network
        return self._oldest(fullest, now_s, crowd)

    def _oldest(self, network: str, now_s: float, crowd: str) -> Key:
        key, place = next((key, place) for key, place in self._places.items() if place.network == network)
        if now_s - place.since_s < self._least_s:
            raise NoPlace(f"already {crowd} that have shown no token")
        return key

    def leave(self, key: Key) -> None:
        """It needs its place no longer."""
        self._places.pop(key, None)

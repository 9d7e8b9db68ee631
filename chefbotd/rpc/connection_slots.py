"""Shares a bounded number of connections fairly among the addresses that they come from; time is an argument.

For connections that have shown nothing yet that sets one apart from another: no token, no request. A crowd of them
comes from few addresses, and an address is the only thing that costs a crowd something.
"""

import ipaddress
from collections import OrderedDict
from functools import lru_cache
from itertools import islice
from typing import Generic, TypeVar

HOLD_S = 1.0
"""How long a slot is kept: a client that is 20 ms away needs 0.1 s to connect, to be greeted and to show its token."""
IPV6_PREFIX_BITS = 64
"""What one subscriber has at least (RFC 6177, BCP 157): its addresses are one client's."""

NEWEST_PART = 8

K = TypeVar("K")


class NoSlot(Exception):
    """There is no slot for a connection; the text says why."""


@lru_cache(maxsize=1024)
def address_group(host: str) -> str:
    """What shares its slots with this address: itself for IPv4, its prefix for IPv6; the text itself if it is none."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(ipaddress.ip_network((address, IPV6_PREFIX_BITS), strict=False))


class ConnectionSlots(Generic[K]):
    """At most ``capacity`` connections, each known by a hashable key.

    When all slots are taken, the address with the most of them gives up its oldest one. That one has had it for
    ``hold_s``, unless the newcomer's address has fewer, or descriptors are scarce. If the newcomer's own address has the
    most and came faster than that, the oldest of its newest eighth gives way: so the others keep theirs, and who comes
    when a burst is over finds a slot.
    """

    def __init__(self, capacity: int, hold_s: float = HOLD_S) -> None:
        self.capacity, self._hold_s = capacity, hold_s
        self._groups: dict[str, OrderedDict[K, float]] = {}  # oldest first, with when it came
        self._group_of: dict[K, str] = {}

    def __len__(self) -> int:
        return len(self._group_of)

    def __contains__(self, key: object) -> bool:
        return key in self._group_of

    def add(self, key: K, host: str, now_s: float, *, scarce: bool = False) -> list[K]:
        """Give a connection a slot; returns those that have lost their own for it, which are to be closed.

        ``scarce``: descriptors are, so two give way for one, however few they are.

        Raises:
            NoSlot: there is none, and nobody to take one from.
        """
        group = address_group(host)
        evicted = []
        if len(self) >= self.capacity or (scarce and self._group_of):
            evicted.append(self._evict(group, now_s, 0.0 if scarce else self._hold_s))
        if scarce and len(self):
            evicted.append(self._evict(group, now_s, 0.0))
        self._group_of[key] = group
        self._groups.setdefault(group, OrderedDict())[key] = now_s
        return evicted

    def _evict(self, newcomer: str, now_s: float, hold_s: float) -> K:
        """Take the slot of the oldest connection of the address with most."""
        largest = max(self._groups.values(), key=len, default=None)
        if largest is None:
            raise NoSlot("there is room for no connection")
        key, since_s = next(iter(largest.items()))
        if now_s - since_s < hold_s and len(self._groups.get(newcomer, ())) >= len(largest):
            key = next(islice(reversed(largest), len(largest) // NEWEST_PART, None))
        self.remove(key)
        return key

    def renew(self, key: K, now_s: float) -> None:
        """A connection keeps its slot for as long as if it had come just now."""
        group = self._groups.get(self._group_of.get(key, ""))
        if group is not None:
            group[key] = now_s
            group.move_to_end(key)

    def remove(self, key: K) -> None:
        """A connection needs its slot no longer; nothing for one that has none."""
        group = self._group_of.pop(key, None)
        if group is not None:
            del self._groups[group][key]
            if not self._groups[group]:
                del self._groups[group]

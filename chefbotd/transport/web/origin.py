"""Recognizes requests of the robot's own page by the headers Host and Origin, which no foreign page can choose."""

import ipaddress
from collections.abc import Collection
from urllib.parse import urlsplit


def is_own_host(host: str, allowed: Collection[str]) -> bool:
    """Whether a Host header names this robot: an address, ``localhost``, or an allowed name.

    A page elsewhere can have its own name resolve to this computer (DNS rebinding); it cannot do so with an address.
    """
    name = _hostname(f"//{host}")
    if name is None:
        return False
    return name == "localhost" or name in allowed or _is_address(name)


def is_own_origin(origin: str | None, host: str, *, tls: bool, allowed: Collection[str] = ()) -> bool:
    """Whether a request was made by a page of this server, or by one of a proxy whose origin is allowed.

    One without an Origin is from no browser.
    """
    if origin is None or origin.lower() in allowed:
        return True
    return origin.lower() == f"{'https' if tls else 'http'}://{host}".lower()


def _hostname(url: str) -> str | None:
    try:
        parts = urlsplit(url)
        _ = parts.port  # raises where it is no number
    except ValueError:
        return None
    if parts.path or parts.query or parts.fragment or parts.username is not None:
        return None
    return parts.hostname


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True

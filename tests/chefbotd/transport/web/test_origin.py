"""Whose requests are the page's own."""

import pytest

from chefbotd.transport.parameters import PageParameters
from chefbotd.transport.web.origin import is_own_host, is_own_origin


@pytest.mark.parametrize(
    ("host", "own"),
    [
        ("127.0.0.1:7380", True),
        ("192.168.178.20:7380", True),
        ("[::1]:7380", True),
        ("localhost", True),
        ("LocalHost:7380", True),
        ("chefbot.local:7380", True),
        ("CHEFBOT.local", True),
        ("evil.example:7380", False),
        ("127.0.0.1.evil.example", False),
        ("chefbot.local.evil.example:7380", False),
        ("evil.example@127.0.0.1", False),
        ("127.0.0.1:7380/x", False),
        ("127.0.0.1:port", False),
        ("[::1", False),
        ("", False),
    ],
)
def test_a_name_that_anybody_can_point_here_is_foreign(host: str, own: bool) -> None:
    """Addresses, localhost and allowed names are the robot's; any other name may be an attack by DNS rebinding."""
    assert is_own_host(host, ("chefbot.local",)) is own


@pytest.mark.parametrize(
    ("origin", "own"),
    [
        (None, True),
        ("http://10.0.0.7:7380", True),
        ("https://10.0.0.7:7380", False),
        ("http://10.0.0.7", False),
        ("http://10.0.0.8:7380", False),
        ("http://evil.example", False),
        ("null", False),
        ("", False),
    ],
)
def test_only_the_same_origin_is_own(origin: str | None, own: bool) -> None:
    """Scheme, host and port; a sandboxed frame says null."""
    assert is_own_origin(origin, "10.0.0.7:7380", tls=False) is own


@pytest.mark.parametrize("name", ["http://chefbot.local", "chefbot.local:7380", "*.local", ""])
def test_an_allowed_host_is_a_bare_name(name: str) -> None:
    """Anything else would never match, and its owner would wonder."""
    with pytest.raises(ValueError, match="expected names without scheme and port"):
        PageParameters(allowed_hosts=(name,))

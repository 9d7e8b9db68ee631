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


def test_an_allowed_origin_is_a_proxys_page() -> None:
    """Exactly that one: not its name over http, on another port, or with more behind it; and its own stays its own."""
    allowed = PageParameters(origins=("HTTPS://Robot.example:443/", "https://robot.example:8443")).origins
    assert allowed == ("https://robot.example", "https://robot.example:8443")
    for origin, own in (
        ("https://robot.example", True),
        ("https://Robot.example:8443", True),
        ("http://127.0.0.1:7380", True),
        ("http://robot.example", False),
        ("https://robot.example:444", False),
        ("https://robot.example.evil.example", False),
        ("null", False),
    ):
        assert is_own_origin(origin, "127.0.0.1:7380", tls=False, allowed=allowed) is own, origin


def test_a_proxy_may_pass_its_own_name_on() -> None:
    """The names of the origins are names of the robot too."""
    names = PageParameters(origins=("https://robot.example:8443",), allowed_hosts=("bot.local",)).host_names
    assert [is_own_host(host, names) for host in ("robot.example", "bot.local", "evil.example")] == [
        True,
        True,
        False,
    ]


@pytest.mark.parametrize(
    "origin",
    [
        "robot.example",
        "*",
        "https://*.example",
        "https://robot.example/page",
        "ftp://a",
        "https://",
        "https://a:b",
        "null",
    ],
)
def test_an_origin_is_a_scheme_and_a_name(origin: str) -> None:
    """Anything else would never match, or match too much."""
    with pytest.raises(ValueError, match="expected scheme and name"):
        PageParameters(origins=(origin,))

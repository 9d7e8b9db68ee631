"""A daemon inside another program."""

from chefbotd.process.own_daemon import alone
from chefbotd.settings import load


def test_it_takes_nothing_that_a_service_of_the_same_name_may_use():
    """A free port of loopback without tokens; no page, latch, map, worker, recording, announcement; the same robot."""
    settings = load(
        overrides={
            "api.host": "0.0.0.0",
            "api.token_file": "/etc/chefbotd/tokens",
            "page.enabled": True,
            "latch.folder": "/run/chefbotd",
            "maps.folder": "/var/lib/chefbotd/maps",
            "discovery.enabled": True,
        }
    )
    private = alone(settings)
    assert (private.api.host, private.api.port, private.api.token_file) == ("127.0.0.1", 0, None)
    assert not private.page.enabled
    assert private.latch.folder is None
    assert private.maps is None
    assert not private.worker.enabled
    assert not private.recording.enabled
    assert not private.discovery.enabled
    for same in ("link", "chassis", "drive", "pid", "limits", "safety", "watchdog"):
        assert getattr(private, same) == getattr(settings, same)

"""Addresses that cannot be listened on."""

import pytest

from chefbotd.clock import run_virtual
from chefbotd.transport.tcp import CannotListen
from tests.fakes.api import new_server, tcp_server


def test_a_host_that_is_not_there() -> None:
    """The error names the address in words, ready to be shown, without the resolver's number."""
    server, _, _ = new_server(host="no-such-host.invalid", token_file="tokens")
    with pytest.raises(CannotListen) as caught:
        run_virtual(tcp_server(server).run())
    assert str(caught.value).startswith("cannot listen on no-such-host.invalid:0: ")

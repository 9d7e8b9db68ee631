"""Addresses that cannot be listened on."""

import resource
import socket

import pytest

from chefbotd.clock import run_virtual
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.transport import tcp
from chefbotd.transport.tcp import CannotListen, DescriptorLimit, require_descriptors
from tests.fakes.api import new_server, tcp_server


def test_a_host_that_is_not_there() -> None:
    """The error names the address in words, ready to be shown, without the resolver's number."""
    server, _, _ = new_server(host="no-such-host.invalid", token_file="tokens")
    with pytest.raises(CannotListen) as caught:
        run_virtual(tcp_server(server).run())
    assert str(caught.value).startswith("cannot listen on no-such-host.invalid:0: ")


def test_too_few_descriptors_are_refused_at_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """24 files: nobody could be served. 64 are enough, and both numbers are said, and what to do."""
    monkeypatch.setattr(tcp.resource, "getrlimit", lambda _: (24, 24))
    with pytest.raises(CannotListen, match=r"may open 24 files, and needs 64 .*ulimit -n 1024.*LimitNOFILE"):
        require_descriptors(8)
    monkeypatch.setattr(tcp.resource, "getrlimit", lambda _: (64, 64))
    require_descriptors(8)


def test_clients_leave_the_low_descriptors_to_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where many files are allowed theirs begin at 1024, since ``select`` knows only those below; else they stay."""
    near, far = socket.socketpair()
    with far:
        monkeypatch.setattr(tcp.resource, "getrlimit", lambda _: (1024, 1024))
        assert DescriptorLimit(8).move_up(near) is near
        monkeypatch.undo()
        if (allowed := resource.getrlimit(resource.RLIMIT_NOFILE)[0]) <= tcp.FIRST_CLIENT_DESCRIPTOR + 1:
            pytest.skip(f"this system allows {allowed} files only")
        monkeypatch.setattr(tcp.resource, "getrlimit", lambda _: (20_000, 20_000))
        with DescriptorLimit(8).move_up(near) as moved:
            assert moved.fileno() >= 1024
            assert near.fileno() == -1
            far.send(b"over")
            assert moved.recv(4) == b"over"


def test_what_may_be_sent_ahead_holds_two_segments_on_loopback_too() -> None:
    """Otherwise who reads a long answer acknowledges each part only after 40 ms."""
    [listener] = tcp.listen("127.0.0.1", 0, 65_536, "--listen")
    with listener, socket.create_connection(listener.getsockname()) as client:
        listener.setblocking(True)
        served, _ = listener.accept()
        with served:
            segment_bytes = served.getsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG)
            assert 1000 < segment_bytes <= ApiParameters().write_buffer_bytes // 2
            assert client.getpeername() == listener.getsockname()

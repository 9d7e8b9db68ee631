"""The board's serial port in time."""

import math

import pytest

from chefbotd.components.simulation.peripherals import Uart


def test_a_line_has_left_when_its_last_byte_has() -> None:
    """At 100 bytes/s, 10 bytes sent at 1 s are gone at 1.1 s, and 10 more queued behind them at 1.2 s."""
    uart = Uart(100, transmit_buffer_bytes=100, receive_buffer_bytes=10)
    uart.send(b"0123456789", 1.0)
    uart.send(b"abcdefghij", 1.0)
    assert uart.next_s == pytest.approx(1.1)
    assert [line for _, line in uart.take_lines(1.15)] == [b"0123456789"]
    [(left_s, line)] = uart.take_lines(1.25)
    assert left_s == pytest.approx(1.2)
    assert line == b"abcdefghij"
    assert uart.next_s == math.inf


def test_a_full_buffer_holds_the_sender() -> None:
    """With room for 4 bytes, a sender of 10 goes on when 6 have left: after 0.06 s at 100 bytes/s."""
    uart = Uart(100, transmit_buffer_bytes=4, receive_buffer_bytes=10)
    assert uart.send(b"0123456789", 1.0) == pytest.approx(1.06)
    assert uart.send(b"x", 2.0) == 2.0


def test_what_overflows_the_receive_buffer_is_lost_and_counted() -> None:
    """Of 7 bytes into room for 5, two are lost; reading makes room again."""
    uart = Uart(100, transmit_buffer_bytes=4, receive_buffer_bytes=5)
    uart.receive(b"012")
    uart.receive(b"3456")
    assert uart.read() == b"01234"
    assert uart.received_dropped == 2
    uart.receive(b"789")
    assert uart.read() == b"789"
    assert uart.read() == b""

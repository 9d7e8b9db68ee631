"""Reading an event's age off its line."""

import pytest

from benchmarks.subscribers import ages_s


def test_every_event_of_a_chunk_has_its_age() -> None:
    """Stamps of 1.5 and 1.75 s read at 2 s are 0.5 and 0.25 s old; a greeting has none."""
    lines = (
        b'{"method":"hello","params":{}}\n'
        b'{"method":"event","params":{"seq":1,"stamp_s":1.500000,"age_s":0.1}}\n'
        b'{"method":"event","params":{"seq":2,"stamp_s":1.750000,"age_s":0.1}}\n'
    )
    assert ages_s(lines, 2.0) == pytest.approx([0.5, 0.25])

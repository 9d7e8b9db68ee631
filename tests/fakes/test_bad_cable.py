"""The bad cable: seeded, and the same however the bytes are chunked."""

import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from tests.budget import examples
from tests.fakes.bad_cable import BadCable, CableParameters, Fault

EVERYTHING = CableParameters(flip_share=0.02, drop_share=0.02, double_share=0.02, noise_share=0.02)
BYTES = random.Random(1).randbytes(20_000)


def test_a_good_cable_changes_nothing():
    """Without faults what arrives is what was sent."""
    cable = BadCable(CableParameters(), seed=1)
    assert cable.carry(BYTES) == BYTES
    assert not cable.counts


@given(st.lists(st.integers(0, len(BYTES)), max_size=30))
@settings(max_examples=examples(30))
def test_chunks_make_no_difference(cuts: list[int]):
    """Cut anywhere, the same bytes are hit in the same way."""
    whole, chunked = BadCable(EVERYTHING, seed=3), BadCable(EVERYTHING, seed=3)
    edges = [0, *sorted(cuts), len(BYTES)]
    pieces = [chunked.carry(BYTES[a:b]) for a, b in itertools.pairwise(edges)]
    assert b"".join(pieces) == whole.carry(BYTES)


def test_another_seed_is_another_damage():
    """The seed decides what is hit, and nothing else does."""
    first, again, other = (BadCable(EVERYTHING, seed=seed).carry(BYTES) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_every_fault_is_as_frequent_as_asked():
    """2 % of 20,000 bytes are 400 of each kind, give or take four standard deviations of 20."""
    cable = BadCable(EVERYTHING, seed=5)
    arrived = cable.carry(BYTES)
    assert all(320 <= cable.counts[fault] <= 480 for fault in Fault)
    longer = cable.counts[Fault.DOUBLE] + cable.counts[Fault.NOISE] - cable.counts[Fault.DROP]
    assert len(arrived) == len(BYTES) + longer


def test_a_flip_is_one_bit():
    """Flipped bytes differ from those sent in exactly one bit, and no byte is added or lost."""
    cable = BadCable(CableParameters(flip_share=0.05), seed=2)
    differing = [sent ^ got for sent, got in zip(BYTES, cable.carry(BYTES), strict=True) if sent != got]
    assert len(differing) == cable.counts[Fault.FLIP]
    assert all(bits.bit_count() == 1 for bits in differing)


def test_a_doubled_byte_comes_twice_in_a_row():
    """Of bytes that all differ from their neighbours, those doubled are the only pairs."""
    cable = BadCable(CableParameters(double_share=0.1), seed=2)
    arrived = cable.carry(bytes(range(256)))
    pairs = sum(a == b for a, b in itertools.pairwise(arrived))
    assert pairs == cable.counts[Fault.DOUBLE] > 0
    assert bytes(dict.fromkeys(arrived)) == bytes(range(256))


def test_a_share_out_of_range_is_refused():
    """A cable that hits half of all bytes is none; the bad value's name is told."""
    with pytest.raises(ValidationError, match="flip_share"):
        CableParameters(flip_share=0.5)

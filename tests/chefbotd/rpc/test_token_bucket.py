"""The token bucket: what it lets through in any stretch of time."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.rpc.session import TokenBucket
from tests.budget import examples


def test_a_full_bucket_gives_its_size_and_then_its_inflow() -> None:
    """Three at once; after a quarter of a second at 4 a second, exactly one more."""
    bucket = TokenBucket(per_s=4.0, size=3.0, now_s=10.0)
    assert [bucket.take_token(10.0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take_token(10.25) for _ in range(2)] == [True, False]


def test_rest_fills_it_no_further_than_its_size() -> None:
    """An hour of rest is worth three, not 14,400."""
    bucket = TokenBucket(per_s=4.0, size=3.0, now_s=0.0)
    assert sum(bucket.take_token(3600.0) for _ in range(10)) == 3


@settings(max_examples=examples(100), deadline=None)
@given(st.lists(st.floats(0.0, 2.0), max_size=60))
def test_no_stretch_of_time_gets_more_than_its_share(pauses_s: list[float]) -> None:
    """From any moment to any later one at most ``size + per_s * seconds`` are let through."""
    bucket, now_s, taken_s = TokenBucket(per_s=5.0, size=4.0, now_s=0.0), 0.0, []
    for pause_s in pauses_s:
        now_s += pause_s
        if bucket.take_token(now_s):
            taken_s.append(now_s)
    for i, first_s in enumerate(taken_s):
        for j in range(i, len(taken_s)):
            assert j - i + 1 <= 4.0 + 5.0 * (taken_s[j] - first_s) + 1e-6


@pytest.mark.parametrize("size", [1.0, 500.0])
def test_a_steady_asker_within_the_rate_is_never_refused(size: float) -> None:
    """Ten seconds at exactly half of the rate."""
    bucket = TokenBucket(per_s=100.0, size=size, now_s=0.0)
    assert all(bucket.take_token(i / 50.0) for i in range(500))

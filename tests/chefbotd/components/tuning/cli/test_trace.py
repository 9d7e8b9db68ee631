"""The samples behind the plots."""

import pytest

from chefbotd.components.tuning.cli.plots import Trace


def sample(target: float, speed: float, duty: int) -> dict[str, object]:
    """One of the topic ``wheels``; the right wheel stands."""
    return {
        "name": ["left", "right"],
        "target_rad_s": [target, 0.0],
        "velocity_rad_s": [speed, 0.0],
        "duty": [duty, 0],
    }


def test_curves_by_wheel() -> None:
    """Each wheel has its own curves; ages count back from the newest sample."""
    trace = Trace(window_s=8.0)
    trace.add(100.0, sample(2.0, 1.0, 200))
    trace.add(100.5, sample(2.0, 2.5, 300))
    left = trace.of("left")
    assert left.age_s.tolist() == [-0.5, 0.0]
    assert left.target_rad_s.tolist() == [2.0, 2.0]
    assert left.error_rad_s.tolist() == [1.0, -0.5]
    assert left.duty.tolist() == [200.0, 300.0]
    assert left.rms_error_rad_s() == pytest.approx(0.790569)  # sqrt((1 + 0.25) / 2)
    assert trace.of("right").rms_error_rad_s() == 0.0


def test_what_is_too_old_goes() -> None:
    """With a window of 1 s, a sample 1.1 s older than the newest is forgotten."""
    trace = Trace(window_s=1.0)
    for stamp_s in (5.0, 5.5, 6.1):
        trace.add(stamp_s, sample(0.0, 0.0, 0))
    assert trace.of("left").age_s.tolist() == pytest.approx([-0.6, 0.0])


def test_a_restarted_daemon_begins_anew() -> None:
    """Stamps that go back belong to another clock."""
    trace = Trace(window_s=8.0)
    trace.add(500.0, sample(0.0, 0.0, 0))
    trace.add(3.0, sample(0.0, 0.0, 0))
    assert trace.of("left").age_s.tolist() == [0.0]


def test_before_the_first_sample() -> None:
    """There are no wheels yet, and curves without points."""
    trace = Trace(window_s=8.0)
    assert list(trace.wheels) == []
    assert trace.of("left").age_s.size == 0
    assert trace.of("left").rms_error_rad_s() == 0.0


def test_an_unknown_wheel() -> None:
    """A name that the samples do not know is an error."""
    trace = Trace(window_s=8.0)
    trace.add(1.0, sample(0.0, 0.0, 0))
    with pytest.raises(ValueError, match="third"):
        trace.of("third")

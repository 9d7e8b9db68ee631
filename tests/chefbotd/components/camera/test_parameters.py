"""The section [camera] is refused where a camera that works would be started again for ever."""

import pytest
from pydantic import ValidationError

from chefbotd.components.camera.parameters import CameraParameters


@pytest.mark.parametrize(
    ("rate_hz", "silence_s"), [(15.0, 0.5), (4.0, 0.5), (0.5, 4.0), (0.2, 10.0), (0.3, 6.667)]
)
def test_the_time_of_two_pictures_is_long_enough(rate_hz: float, silence_s: float) -> None:
    """4 a second: two of them come in half a second."""
    parameters = CameraParameters(rate_hz=rate_hz, silence_timeout_s=silence_s)
    assert parameters.silence_timeout_s == silence_s


@pytest.mark.parametrize(
    ("rate_hz", "silence_s", "least"), [(0.5, 3.0, "4 s"), (0.2, 9.9, "10 s"), (3.0, 0.6, "0.667 s")]
)
def test_less_than_two_pictures_time_is_refused(rate_hz: float, silence_s: float, least: str) -> None:
    """The sentence has both keys, what is expected and what was given."""
    with pytest.raises(ValidationError) as refused:
        CameraParameters(rate_hz=rate_hz, silence_timeout_s=silence_s)
    said = refused.value.errors()[0]["msg"]
    assert f"silence_timeout_s: expected at least {least}" in said
    assert f"rate_hz = {rate_hz:g}, got {silence_s:g}" in said


def test_a_picture_less_often_than_every_five_seconds_is_refused() -> None:
    """0.2 a second is the least."""
    with pytest.raises(ValidationError, match="rate_hz"):
        CameraParameters(rate_hz=0.19, silence_timeout_s=60.0)

"""Whether bytes are a whole JPEG picture."""

import io

import pytest
from PIL import Image

from chefbotd.components.camera.algorithms.jpeg import NotAPicture, read_picture
from tests.chefbotd.components.camera.pictures import picture, without_tables

MOST = 100_000


def test_a_whole_picture_is_passed_on_byte_for_byte_with_its_size() -> None:
    """Nothing is encoded anew."""
    read = read_picture(picture(), MOST)
    assert (read.jpeg, read.width_px, read.height_px) == (picture(), 32, 24)


def test_the_zeros_that_a_driver_leaves_behind_a_picture_are_cut_off() -> None:
    """Buffers are longer than what is in them."""
    assert read_picture(picture() + bytes(500), MOST).jpeg == picture()


def test_a_picture_without_huffman_tables_gets_the_standard_ones_and_can_be_decoded() -> None:
    """Webcams leave them out, and a browser shows nothing without them. Pillow's are the standard's, too."""
    bare = without_tables(picture(200))
    assert b"\xff\xc4" not in bare
    mended = read_picture(bare, MOST).jpeg
    assert sorted(mended) == sorted(picture(200))
    assert Image.open(io.BytesIO(mended)).tobytes() == Image.open(io.BytesIO(picture(200))).tobytes()


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "does not begin as a JPEG"),
        (b"YUYV" * 100, "does not begin as a JPEG"),
        (picture()[:-2], "its end is missing"),
        (picture()[:30] + b"\xff\xd9", "head"),
        (b"\xff\xd8" + bytes(40) + b"\xff\xd9", "head is damaged"),
        (picture() + picture(3, 400, 400), "at most 2000 are passed on"),
    ],
)
def test_what_is_no_whole_picture_is_refused_with_the_reason(data: bytes, why: str) -> None:
    """Cut at its end, cut in its head, of another format, or too long."""
    with pytest.raises(NotAPicture, match=why):
        read_picture(data, 2000)


def test_no_beginning_of_a_picture_passes_as_one() -> None:
    """Whichever byte it is cut at."""
    whole = picture()
    for end in range(len(whole)):
        with pytest.raises(NotAPicture):
            read_picture(whole[:end], MOST)

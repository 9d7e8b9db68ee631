"""The images that come with chefbotd: in the sources and in the installed package alike."""

import pytest

from chefbotd.components.flash.boards import BOARDS, Board
from chefbotd.components.flash.images import packaged_image


@pytest.mark.parametrize("board", BOARDS.values(), ids=lambda board: board.name)
def test_every_board_has_an_image_that_fits_it(board: Board) -> None:
    """It is whole, has a version, and is no longer than what the board keeps for a program."""
    image = packaged_image(board.image)
    assert image.version.count(".") == 1
    assert 1000 < program_bytes(image.path.read_bytes(), image.path.suffix) <= board.kept_bytes


def program_bytes(data: bytes, suffix: str) -> int:
    """The length of the program; Intel hex has a record a line, whose first byte is how many bytes of data it has."""
    if suffix == ".bin":
        return len(data)
    records = [bytes.fromhex(line[1:]) for line in data.decode().split()]
    assert all(sum(record) % 256 == 0 for record in records)
    return sum(record[0] for record in records if record[3] == 0)

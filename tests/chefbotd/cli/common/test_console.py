"""What a console can show: colors, and pictures over pictures."""

import io

import pytest

from chefbotd.cli.common.console import Printer


@pytest.mark.parametrize(
    ("environment", "draws_color", "redraws"),
    [
        ({"TERM": "xterm-256color"}, True, True),
        ({"TERM": "xterm-256color", "NO_COLOR": "1"}, False, True),
        ({"TERM": "dumb"}, False, False),
    ],
)
def test_a_map_is_not_drawn_in_colors_that_nobody_sees(
    environment: dict[str, str], draws_color: bool, redraws: bool
) -> None:
    """With NO_COLOR a map of half blocks is one plain area; a dumb terminal shows nothing until the end."""
    printer = Printer(file=io.StringIO(), force_terminal=True, _environ=environment)
    assert (printer.draws_color, printer.redraws) == (draws_color, redraws)


def test_a_file_is_no_terminal() -> None:
    """It gets lines."""
    printer = Printer(file=io.StringIO(), _environ={"TERM": "xterm-256color"})
    assert (printer.draws_color, printer.redraws) == (False, False)

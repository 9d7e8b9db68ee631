"""What docs/notifications.md says holds."""

import re
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.programs.chefbotd import main
from chefbotd.components.notifications import outbox
from chefbotd.components.notifications.delivery import AGE_TOLD_S, ATTEMPT_S, NotTaken
from chefbotd.components.notifications.episodes import CALM_S, LOW_S, NEARER_M
from chefbotd.components.notifications.parameters import NoticeKind, NotificationsParameters

PAGE = (Path(__file__).parents[4] / "docs" / "notifications.md").read_text(encoding="utf-8")


def test_its_sections_are_valid():
    """As they stand there."""
    sections = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert len(sections) == 2
    for text in sections:
        assert NotificationsParameters(**tomllib.loads(text)["notifications"]).enabled


def test_its_table_has_every_kind():
    """But the one of a test message, which nobody chooses."""
    assert re.findall(r"(?m)^\| `(\w+)` \|", PAGE)[1:] == [
        kind for kind in NoticeKind if kind is not NoticeKind.TEST
    ]


def test_its_line_of_the_unit_is_a_command_that_there_is(tmp_path: Path):
    """With a robot's file that enables nothing it says nothing, and ends well."""
    (line,) = re.findall(r"(?m)^ExecStopPost=-\S+/chefbotd (.*)$", PAGE)
    (tmp_path / "chefbot.toml").write_text('extends = "chefbot"\n', encoding="utf-8")
    words = line.replace("/etc/chefbotd", str(tmp_path)).split()
    result = CliRunner().invoke(main, words)
    assert (result.exit_code, result.output) == (0, "")


def test_its_figures_are_those_of_the_program():
    """Waits, ages and bounds."""
    assert (outbox.QUEUE_LENGTH, outbox.FIRST_WAIT_S, outbox.LONGEST_WAIT_S) == (32, 5.0, 300.0)
    assert (outbox.GIVE_UP_S, ATTEMPT_S, AGE_TOLD_S) == (6 * 3600.0, 15.0, 30.0)
    assert (LOW_S, CALM_S, NEARER_M, NotificationsParameters().stuck_after_s) == (5.0, 60.0, 0.2, 60.0)


@pytest.mark.parametrize(
    ("status", "again"),
    [
        (408, True),
        (425, True),
        (429, True),
        (500, True),
        (503, True),
        (302, False),
        (401, False),
        (404, False),
    ],
)
def test_which_answers_are_tried_again(status: int, again: bool):
    """What may pass, and nothing else."""
    assert NotTaken(status).again is again

"""The manual pages: one for every command, with all that ``--help`` says, and readable by man."""

import shutil
import subprocess
from pathlib import Path

import click
import pytest

from chefbotd.cli.programs.manual import markdown, pages, roff, write


def test_every_command_has_its_page(tmp_path: Path) -> None:
    """Of both programs, and of groups within them; each names the page above it."""
    count = write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert len(names) == count > 50
    assert {
        "chefbotctl.1",
        "chefbotd.1",
        "chefbotctl-drive.1",
        "chefbotctl-log-plot.1",
        "chefbotd-run.1",
    } <= names
    assert "chefbotctl\\-log(1)" in (tmp_path / "chefbotctl-log-plot.1").read_text().replace(
        "-log(1)", "\\-log(1)"
    )


def test_a_page_has_what_help_says() -> None:
    """Options with their defaults, environment, commands, and exit codes."""
    by_name = dict(pages())
    text = roff("chefbotctl", by_name["chefbotctl"]).replace("\\-", "-")
    for expected in ("--connect", "default: 127.0.0.1:7333", "CHEFBOTCTL_TOKEN_FILE", ".B teleop", "refused"):
        assert expected in text
    for name, context in by_name.items():
        page = roff(name, context).replace("\\-", "-")
        for each in context.command.get_params(context):
            if isinstance(each, click.Option) and not each.hidden:
                assert each.opts[0] in page, f"{name} lacks {each.opts[0]}"


def test_nothing_in_a_text_is_taken_for_a_command_of_roff() -> None:
    """A line that begins with a dot, and a backslash."""
    command = click.Command("odd", help="Reads\n\n.profile and C:\\n.", epilog=".SH not a title")
    page = roff("odd", click.Context(command, info_name="odd"))
    assert "\\&.profile and C:\\en." in page
    assert "\\&.SH not a title" in page


def test_the_sites_page_has_them_too() -> None:
    """A bar within a choice does not end its cell."""
    text = markdown("chefbotd-run", dict(pages())["chefbotd-run"])
    assert text.startswith("## `chefbotd run`")
    assert "tiva\\|tiva_bare" in text


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed")
def test_man_shows_a_page_without_a_warning(tmp_path: Path) -> None:
    """As ``man chefbotctl`` does."""
    write(tmp_path)
    command = ["man", "--warnings", "-l", str(tmp_path / "chefbotctl.1")]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={"MANWIDTH": "100", "PATH": "/usr/bin:/bin"}
    )
    assert done.stderr == ""
    assert "chefbotctl - Watch, drive and configure a robot" in done.stdout

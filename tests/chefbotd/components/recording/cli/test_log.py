"""chefbotctl log info, export and plot, on recordings that are whole, cut, empty, or none."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from mcap.writer import Writer
from PIL import Image

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.components.recording.status import About
from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import EventsDropped
from chefbotd.core.geometry import Pose2D
from chefbotd.core.scan import LaserScan
from tests.chefbotd.components.recording.events import ABOUT, START_S, cycle, fault, recorder


def run(*arguments: str | Path) -> Result:
    """``chefbotctl log ARGS...``, which needs no daemon."""
    return CliRunner().invoke(main, ["log", *map(str, arguments)])


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Two seconds at 50 Hz with a battery, a scan, a gap and a fault."""
    made = recorder(tmp_path)
    made.start("drive", START_S)
    for k in range(101):
        made.record(cycle(START_S + k / 50), START_S + k / 50)
    made.record(
        [BatteryMeasured(12.25, 80.0, BatteryLevelStatus.OK, stamp_s=START_S, arrival_s=START_S)],
        START_S + 2.0,
    )
    beams = np.linspace(-3.0, 3.0, 40)
    made.record(
        [ScanMeasured(START_S, "top", Pose2D(), LaserScan(START_S, beams, beams**2, beams))], START_S + 2.0
    )
    made.record([EventsDropped(START_S + 1.0, 9, "slow")], START_S + 2.0)
    made.record([fault(START_S + 1.5)], START_S + 2.0)
    made.stop(START_S + 2.0)
    (path,) = tmp_path.glob("*.mcap")
    return path


def test_info_tells_what_is_in_it(recorded: Path) -> None:
    """Topics with counts and rates, length, robot, and what is missing."""
    told = json.loads(run("info", recorded, "--json").output)
    assert told["topics"]["/events/WheelsDriven"]["messages"] == 101
    assert told["topics"]["/events/WheelsDriven"]["hz"] == pytest.approx(50.5, abs=0.6)
    assert told["topics"]["/tf"]["schema"] == "foxglove.FrameTransforms"
    assert told["seconds"] == pytest.approx(2.0, abs=0.01)
    assert told["complete"]
    assert told["dropped"] == 9
    assert told["robot"]["robot"] == "kitchen-bot"
    assert told["attachments"] == ["robot.urdf"]
    words = run("info", recorded).output
    assert "robot kitchen-bot" in words
    assert "9 events are missing" in words
    assert "/events/WheelsDriven" in words


def test_info_counts_what_is_repeated_apart_and_names_no_file_as_a_reason(tmp_path: Path) -> None:
    """Recording and info count the same messages, and a reason is told where there is one beside the file's name."""
    made = recorder(tmp_path)
    made.record([fault(START_S)], START_S)
    made.start("drive", START_S + 1.0)
    made.record(cycle(START_S + 1.0), START_S + 1.0)
    status = made.stop(START_S + 2.0)
    (path,) = tmp_path.glob("*.mcap")
    told = json.loads(run("info", path, "--json").output)
    assert told["repeated"] > 0
    assert told["messages"] + told["repeated"] == status.messages
    words = " ".join(run("info", path).output.split())
    assert f"{told['messages']} messages, and {told['repeated']} that repeat what held" in words
    assert "recorded for" not in words


def test_a_file_that_was_cut_is_told_and_read(recorded: Path) -> None:
    """What is left is shown, with a warning; its tables and picture can still be made."""
    recorded.write_bytes(recorded.read_bytes()[:-200])
    told = json.loads(run("info", recorded, "--json").output)
    assert not told["complete"]
    assert told["topics"]["/events/WheelsDriven"]["messages"] > 50
    assert "Beware" in run("info", recorded).output
    assert run("export", recorded, "--csv", recorded.parent / "tables").exit_code == 0
    assert run("plot", recorded, "--out", recorded.parent / "cut.png").exit_code == 0


def test_wheels_are_named_as_in_the_configuration_that_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the unit of each axis; a recording without a configuration numbers them."""
    from chefbotd.components.recording.cli import plot

    drawn: list[tuple[str, str, str]] = []

    def keep(figure: Any, out: Path, *, force: bool) -> None:
        drawn.extend((axis.get_title("left"), axis.get_ylabel(), axis.get_xlabel()) for axis in figure.axes)

    monkeypatch.setattr(plot, "_save", keep)
    names = json.dumps({"chassis": {"wheels": [{"name": "front_left"}, {"name": "rear_right"}]}})
    configured = {**ABOUT.metadata, "configuration": {"json": names}}
    made = recorder(tmp_path, about=About(configured, None))
    made.start("drive", START_S)
    made.record(cycle(START_S), START_S)
    made.stop(START_S + 1.0)
    assert run("plot", next(tmp_path.glob("*.mcap"))).exit_code == 0
    assert ("front left", "speed, rad/s", "time, s") in drawn
    assert ("rear right", "speed, rad/s", "time, s") in drawn
    assert drawn[-1][1:] == ("y in odom, m", "x in odom, m")


@pytest.mark.slow
def test_a_picture_is_named_after_its_recording(
    recorded: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is written where the command is called, which may differ from where the recording is."""
    here = tmp_path_factory.mktemp("here")
    monkeypatch.chdir(here)
    result = run("plot", recorded)
    assert result.exit_code == 0, result.output
    assert [path.name for path in here.iterdir()] == [f"{recorded.stem}.png"]
    assert f"{recorded.stem}.png" in result.output


@pytest.mark.parametrize("command", [["info"], ["export", "--csv", "tables"], ["plot", "--out", "x.png"]])
@pytest.mark.parametrize(
    ("content", "told"),
    [(b"", "is empty"), (b"PK not at all", "is not an MCAP file"), (None, "No such file")],
)
def test_what_is_no_recording_is_an_error(
    tmp_path: Path, command: list[str], content: bytes | None, told: str
) -> None:
    """Every command says what is wrong with which file, and writes nothing."""
    path = tmp_path / "odd.mcap"
    if content is not None:
        path.write_bytes(content)
    options = [tmp_path / each if each in ("tables", "x.png") else each for each in command[1:]]
    result = run(command[0], path, *options)
    assert result.exit_code == Exit.FAILED
    assert str(path) in result.output
    assert told in result.output
    assert [each.name for each in tmp_path.iterdir()] == ([] if content is None else ["odd.mcap"])


def foreign(path: Path) -> Path:
    """A recording of another program: 20 messages in 1.8 s, half of them JSON, none of them numbered."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        text = writer.register_channel(
            "/chatter", "ros1", writer.register_schema("std_msgs/String", "ros1msg", b"")
        )
        json_schema = writer.register_schema("Volts", "jsonschema", b"{}")
        volts = writer.register_channel("/volts", "json", json_schema)
        for k in range(10):
            writer.add_message(text, k * 200_000_000, b"\x05\0\0\0hello", k * 200_000_000)
            writer.add_message(volts, k * 200_000_000, b'{"volts": 12.5}', k * 200_000_000)
        writer.finish()
    return path


def test_a_recording_of_another_program_is_told_and_its_json_exported(tmp_path: Path) -> None:
    """All its messages count; what is not JSON is refused by its topic, and the rest can be had without it."""
    path, tables = foreign(tmp_path / "ros.mcap"), tmp_path / "tables"
    told = json.loads(run("info", path, "--json").output)
    assert {topic: row["messages"] for topic, row in told["topics"].items()} == {"/chatter": 10, "/volts": 10}
    assert told["seconds"] == pytest.approx(1.8)
    refused = run("export", path, "--csv", tables)
    assert refused.exit_code == Exit.FAILED
    assert "/chatter (std_msgs/String) are not JSON" in refused.output
    assert not tables.exists()
    assert run("export", path, "--csv", tables, "--topic", "/volts").exit_code == 0
    assert (tables / "volts.csv").read_text().count("12.5") == 10


def test_names_in_a_strangers_file_reach_neither_the_terminal_nor_other_folders(tmp_path: Path) -> None:
    """Topics that are paths, commands of a terminal, too long, or the same file: as text, tables beside each other."""
    path, tables = tmp_path / "odd.mcap", tmp_path / "tables"
    topics = ("/../../pwn", "..", "/" + "a" * 400, "/a b", "/a_b", "/A_B", "/nul\0", "/\x1b[31mred\x9b2J")
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("\x1b]0;title\x07", "jsonschema", b"{}")
        for topic in topics:
            writer.add_message(writer.register_channel(topic, "json", schema), 1, b'{"volts": 12.5}', 1)
        writer.finish()
    told = run("info", path)
    assert told.exit_code == Exit.OK
    assert not set(told.output) & {"\0", "\x07", "\x1b", "\x9b"}
    assert run("export", path, "--csv", tables).exit_code == Exit.OK
    names = sorted(each.name for each in tables.iterdir())
    assert names == sorted(
        [
            "A_B~3.csv",
            "_.._pwn.csv",
            "_31mred_2J.csv",
            "a" * 100 + ".csv",
            "a_b.csv",
            "a_b~2.csv",
            "nul_.csv",
            "topic.csv",
        ]
    )
    assert not list(tmp_path.parent.glob("*pwn*"))


def test_tables_have_a_row_for_each_message(recorded: Path) -> None:
    """Nested values have columns of their own, a long list is one cell, and numbers are as they were."""
    folder = recorded.parent / "tables"
    result = run("export", recorded, "--csv", folder)
    assert result.exit_code == 0, result.output
    with (folder / "events_OdometryUpdated.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 101
    assert float(rows[50]["odom_from_base.x_m"]) == (START_S + 1.0) / 3
    assert float(rows[50]["covariance.1"]) == 2e-4
    with (folder / "events_ScanMeasured.csv").open(newline="") as file:
        (scan,) = csv.DictReader(file)
    assert len(json.loads(scan["scan.range_m"])) == 40
    again = run("export", recorded, "--csv", folder)
    assert again.exit_code == Exit.FAILED
    assert "--force replaces it" in again.output
    assert run("export", recorded, "--csv", folder, "--force").exit_code == 0


def test_one_topic_is_exported_alone(recorded: Path) -> None:
    """And one that there is not is refused with those that there are."""
    folder = recorded.parent / "tables"
    assert run("export", recorded, "--csv", folder, "--topic", "/pose").exit_code == 0
    assert [each.name for each in folder.iterdir()] == ["pose.csv"]
    result = run("export", recorded, "--csv", folder, "--topic", "/posse")
    assert result.exit_code == Exit.FAILED
    assert "has no topic /posse" in result.output
    assert "/pose" in result.output


def test_a_picture_is_drawn(recorded: Path) -> None:
    """Of more than one colour, the fault's red among them; another name than .png and an existing file are refused."""
    out = recorded.parent / "drive.png"
    result = run("plot", recorded, "--out", out)
    assert result.exit_code == 0, result.output
    with Image.open(out) as image:
        colors = {color for _, color in image.convert("RGB").getcolors(1 << 24) or ()}
    assert (214, 39, 40) in colors
    assert (31, 119, 180) in colors
    assert run("plot", recorded, "--out", out).exit_code == Exit.FAILED
    assert run("plot", recorded, "--out", recorded.parent / "drive.pdf").exit_code == Exit.USAGE


def test_a_recording_without_motion_has_nothing_to_draw(tmp_path: Path) -> None:
    """The message names what would be drawn."""
    made = recorder(tmp_path)
    made.start("nothing", START_S)
    made.record([EventsDropped(START_S, 1, "x")], START_S)
    made.stop(START_S + 1.0)
    (path,) = tmp_path.glob("*.mcap")
    result = run("plot", path, "--out", tmp_path / "x.png")
    assert result.exit_code == Exit.FAILED
    assert "WheelsDriven" in result.output


def stranger_file(path: Path, *messages: tuple[str, bytes]) -> Path:
    """A recording of another program: a topic and its data for each message."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channels: dict[str, int] = {}
        for topic, data in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schema)
            writer.add_message(channels[topic], 1, data, 1)
        writer.finish()
    return path


def test_no_cell_is_a_formula(tmp_path: Path) -> None:
    """A text that a spreadsheet would calculate has an apostrophe in front; numbers are numbers."""
    texts = ['=HYPERLINK("http://x","y")', "+1", "-1", "@SUM(A1)", "\t=1", "plain"]
    messages = [("/t", json.dumps({"reason": text, "=key": -1.5}).encode()) for text in texts]
    path = stranger_file(tmp_path / "formulas.mcap", *messages)
    assert run("export", path, "--csv", tmp_path / "tables").exit_code == Exit.OK
    with (tmp_path / "tables" / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["reason"] for row in rows] == [*[f"'{text}" for text in texts[:-1]], "plain"]
    assert {row["'=key"] for row in rows} == {"-1.5"}


def test_what_is_nested_too_deep_is_told_or_is_one_cell(tmp_path: Path) -> None:
    """50 levels are one cell; 100,000 are no JSON that is read."""
    deep = stranger_file(tmp_path / "deep.mcap", ("/t", b'{"a":' * 50 + b"1" + b"}" * 50))
    assert run("export", deep, "--csv", tmp_path / "deep").exit_code == Exit.OK
    deepest = stranger_file(tmp_path / "deepest.mcap", ("/t", b"[" * 100_000 + b"]" * 100_000))
    refused = run("export", deepest, "--csv", tmp_path / "deepest")
    assert refused.exit_code == Exit.FAILED
    assert "are not JSON" in refused.output


def test_very_many_topics_are_refused_at_once(tmp_path: Path) -> None:
    """20,000 of nearly the same name: no table is opened for any."""
    path = stranger_file(tmp_path / "many.mcap", *((f"/t {number}", b"{}") for number in range(20_000)))
    refused = run("export", path, "--csv", tmp_path / "many")
    assert refused.exit_code == Exit.FAILED
    assert "20000 topics, more than 500 tables" in refused.output
    assert not (tmp_path / "many").exists()

"""A robot of one's own, asked question by question: what was measured comes into its file, and nothing else."""

import asyncio
import os
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.new_robot.answers import FoundValue, unmeasured_keys
from chefbotd.components.new_robot.board import Serial
from chefbotd.components.new_robot.command import _keep_unfinished, converse
from chefbotd.components.new_robot.interview import Interview, NobodyAnswersError
from chefbotd.components.new_robot.walk import Walk
from chefbotd.settings import Settings, load
from tests.chefbotd.components.new_robot.own_board import OwnBoard

DEVICE = "/dev/ttyUSB7"
RADIUS_M, TRACK_M = 0.033, 0.17
ROLLED_CM = "20.735"
"""A turn of a wheel of 33 mm: 2 pi 3.3 cm = 20.735 cm."""

Step = tuple[str, str | Callable[[], str] | None]


class Person:
    """Answers the questions in their order, each known by words in it, and does what they ask."""

    def __init__(self, *steps: Step) -> None:
        self.steps = list(steps)
        self.said: list[str] = []

    async def ask(self, question: str) -> str | None:
        """The next answer."""
        assert self.steps, f"a question too many: {question}"
        words, answer = self.steps.pop(0)
        assert words in question, (words, question, self.said[-3:])
        await asyncio.sleep(1.0)
        if callable(answer):
            answer = answer()
            await asyncio.sleep(0.5)
        return answer


def hand(board: OwnBoard, wheel: int, turns: float, typed: str = "10") -> Callable[[], str]:
    """Turn a wheel, and type how often."""

    def turn() -> str:
        board.turn(wheel, turns)
        return typed

    return turn


def pivot(board: OwnBoard, turns: float, typed: str = "3") -> Callable[[], str]:
    """Turn the robot to the left."""

    def turn() -> str:
        board.pivot(turns, TRACK_M, RADIUS_M)
        return typed

    return turn


def conversation(
    path: Path, board: OwnBoard | None, person: Person, present: Settings | None = None
) -> tuple[Walk, bool]:
    """Have it asked, on the virtual clock."""
    unmeasured = unmeasured_keys(path.read_text(encoding="utf-8")) if path.exists() else frozenset()

    async def scenario() -> tuple[Walk, bool]:
        device = board.device if board else None
        ports = [SerialPort(DEVICE)] if board else []
        opener = device.open if device else None
        interview = Interview(person, person.said.append)
        connect = board.connect if board else None
        base = None if present is None else "chefbot"
        serial = Serial(lambda: ports, opener, LoopClock())  # type: ignore[arg-type]
        walk = Walk(interview, serial, connect, present, base, unmeasured)  # type: ignore[arg-type]
        running = asyncio.create_task(board.run()) if board else None
        try:
            return walk, await converse(interview, walk, None, path, is_new=present is None)
        finally:
            if running:
                running.cancel()

    return run_virtual(scenario())


def whole(board: OwnBoard) -> list[Step]:
    """Every question, answered; the outline is a box of 20 by 15 cm."""
    return [
        ("name", "rover"),
        ("how far did it go", ROLLED_CM),
        ("How far apart", "17"),
        ("Mark left_wheel", hand(board, 0, 10)),
        ("Mark right_wheel", hand(board, 1, 10)),
        ("AT FULL SPEED", "yes"),
        ("on the spot to the left", pivot(board, 3)),
        ("length", "20"),
        ("width", "15 cm"),
        ("height", "10"),
    ]


def test_the_whole_way_from_a_board_to_a_file(tmp_path: Path) -> None:
    """Counts, motors and track are those of the board; sensors of which no line comes are left out."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    person = Person(*whole(board))
    conversation(path, board, person)
    assert person.steps == []
    settings = load(path)
    assert (settings.robot.name, settings.link.device) == ("rover", DEVICE)
    assert (settings.imu, settings.ultrasonic, settings.battery) == (None, None, None)
    assert settings.encoders.counts_per_turn == 1440
    assert [wheel.radius_m for wheel in settings.chassis.wheels] == pytest.approx([RADIUS_M] * 2, abs=1e-5)
    assert settings.chassis.track_width_m == pytest.approx(TRACK_M, abs=5e-4)
    assert settings.body is not None
    assert (settings.body.length_m, settings.body.width_m, settings.body.height_m) == (0.2, 0.15, 0.1)
    # 225 duties beyond the dead zone at 0.08 rad/s each are 18 rad/s, 0.594 m/s free, nine tenths of it under load
    assert settings.drive.max_rim_speed_m_s == pytest.approx(0.9 * 18 * RADIUS_M, rel=0.02)
    assert settings.encoders.max_speed_rad_s == pytest.approx(36, rel=0.02)
    assert settings.pid.kv == pytest.approx(1 / 0.08 / RADIUS_M, rel=0.05)
    assert settings.pid.ks == pytest.approx(30, abs=5)
    assert settings.pid.kp / settings.pid.kv == pytest.approx(200 / 598, rel=0.01)
    assert [wheel.motor_sign for wheel in settings.chassis.wheels] == [1, 1]


def test_only_what_differs_is_in_the_file(tmp_path: Path) -> None:
    """The file extends ChefBot, names no key that is ChefBot's, and is short."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    conversation(path, board, Person(*whole(board)))
    text = path.read_text(encoding="utf-8")
    values = tomllib.loads(text)
    assert values["extends"] == "chefbot"
    assert "wire" not in values["robot"]  # classic, as ChefBot's
    assert "baud" not in values["link"]
    assert "safety" not in values
    assert "encoder_sign" not in text
    assert len(text.splitlines()) < 60


def test_motors_and_encoders_that_are_wired_the_other_way(tmp_path: Path) -> None:
    """The hand's direction is forward: an encoder that counts down and a motor that turns back get signs of -1."""
    path = tmp_path / "rover.toml"
    board = OwnBoard(motor_signs=(1, -1), encoder_signs=(-1, 1))
    conversation(path, board, Person(*whole(board)))
    left, right = load(path).chassis.wheels
    assert (left.encoder_sign, left.motor_sign, right.encoder_sign, right.motor_sign) == (-1, 1, 1, -1)


def test_encoders_whose_plugs_are_exchanged_are_said_and_turned_again(tmp_path: Path) -> None:
    """The wheel that was turned is not the one that counted."""
    path, board = tmp_path / "rover.toml", OwnBoard(swaps_encoders=True)

    def exchange() -> str:
        board.swaps_encoders = False
        board.turned_rad = [0.0, 0.0]
        return hand(board, 0, 10)()

    steps = whole(board)
    steps.insert(4, ("Mark left_wheel", exchange))
    person = Person(*steps)
    conversation(path, board, person)
    assert any("exchange their plugs" in said for said in person.said)
    assert load(path).encoders.counts_per_turn == 1440


def test_a_turn_that_was_missed_is_noticed(tmp_path: Path) -> None:
    """Nine turns called ten differ from the other wheel's by a tenth: both are turned again."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    steps = whole(board)
    steps[3:3] = [("Mark left_wheel", hand(board, 0, 9)), ("Mark right_wheel", hand(board, 1, 10))]
    person = Person(*steps)
    conversation(path, board, person)
    assert any("differ by more than 3%" in said for said in person.said)
    assert load(path).encoders.counts_per_turn == 1440


def test_nothing_turns_without_the_whole_word_yes(tmp_path: Path) -> None:
    """Enter, y and nonsense skip the motors; the file says that they are ChefBot's still."""
    for typed in ("", "y", "Yes please", "YES"):
        path, board = tmp_path / f"rover{len(typed)}.toml", OwnBoard()
        steps = whole(board)
        steps[5] = ("AT FULL SPEED", typed)
        conversation(path, board, Person(*steps))
        assert board.hardest_duty == 0
        text = path.read_text(encoding="utf-8")
        assert "# Not measured yet, and still chefbot's: drive.max_rim_speed_m_s and the gains" in text
        assert "[pid]" not in text
        assert load(path).encoders.counts_per_turn == 1440


def test_the_motors_stand_after_the_measurement(tmp_path: Path) -> None:
    """Full duty was driven, one wheel at a time, and zero is in force at the end."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    conversation(path, board, Person(*whole(board)))
    assert board.hardest_duty == 255
    assert board.duty == [0, 0]


def test_a_motor_that_does_not_turn_is_said_and_left_out(tmp_path: Path) -> None:
    """It never gets full duty: 0.35 of 255 is 89."""
    path, board = tmp_path / "rover.toml", OwnBoard(gain_rad_s=0.0)
    person = Person(*whole(board))
    conversation(path, board, person)
    assert any("left_wheel did not turn" in said and "left out" in said for said in person.said)
    assert board.hardest_duty == 89
    assert board.duty == [0, 0]
    assert "[pid]" not in path.read_text(encoding="utf-8")


def test_nonsense_is_asked_again(tmp_path: Path) -> None:
    """Words, other units, and numbers out of range: each is said with what is expected, and costs nothing."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    steps = whole(board)
    steps[1:1] = [
        ("how far did it go", typed) for typed in ("a bit", "20.7 mm", "-3", "1e9", "nan", "inf", "20,7,3")
    ]
    person = Person(*steps)
    conversation(path, board, person)
    assert sum("cannot be used: a number from 1 to 300 cm is expected" in said for said in person.said) == 6
    assert any("'20.7 mm' is in mm: type it in cm." in said for said in person.said)
    assert load(path).chassis.wheels[0].radius_m == pytest.approx(RADIUS_M, abs=1e-5)


def test_without_a_board_what_is_typed_is_written(tmp_path: Path) -> None:
    """And the file says what was not measured."""
    path = tmp_path / "rover.toml"
    steps: list[Step] = [
        ("name", ""), ("how far did it go", ROLLED_CM), ("How far apart", "17"), ("length", ""),
    ]  # fmt: skip
    person = Person(*steps)
    conversation(path, None, person)
    assert any("named with --port" in said for said in person.said)
    settings = load(path)
    assert (settings.robot.name, settings.chassis.track_width_m, settings.body) == ("my_robot", 0.17, None)
    assert "# Not measured yet, and still chefbot's: encoders.counts_per_turn" in path.read_text(
        encoding="utf-8"
    )


def test_run_again_with_the_same_answers_nothing_changes(tmp_path: Path) -> None:
    """Enter keeps what the file says; the same measurements change no byte."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    conversation(path, board, Person(*whole(board)))
    before = path.read_bytes()
    again = OwnBoard()
    steps = [
        (words, "" if isinstance(answer, str) and answer != "yes" else answer)
        for words, answer in whole(again)
    ]
    conversation(path, again, Person(*steps), load(path))
    assert path.read_bytes() == before


def test_run_again_nothing_of_the_packaged_robot_is_offered_for_what_was_skipped(tmp_path: Path) -> None:
    """Enter on a question that was skipped before skips it again; a board that is not listed can be named."""
    path = tmp_path / "rover.toml"
    skipped: list[Step] = [("name", ""), ("how far did it go", ""), ("How far apart", "17"), ("length", "")]
    conversation(path, None, Person(*skipped))
    before = path.read_bytes()
    again: list[Step] = [
        ("name", ""), ("(cm) [Enter: skip]", ""), ("[Enter: 17]", ""), ("(cm) [Enter: skip]", ""),
    ]  # fmt: skip
    conversation(path, None, Person(*again), load(path))
    assert path.read_bytes() == before
    assert "# Not measured yet, and still chefbot's: chassis.wheels radius_m" in before.decode()


def test_a_first_run_that_is_interrupted_leaves_the_packaged_robots_outline_out(tmp_path: Path) -> None:
    """Of what was not asked the file says that it was not measured, and Enter does not make it a measurement."""
    path = tmp_path / "rover.toml"
    walk, _ = conversation(
        tmp_path / "other.toml", None, Person(("name", ""), ("how far", ""), ("apart", ""), ("length", ""))
    )
    walk.answers = {"robot.name": FoundValue("rover", ""), "link.baud": FoundValue(57600, "")}
    _keep_unfinished(path, walk, is_new=True)
    assert load(path).body is None
    assert {"chassis.wheels radius_m", "chassis.track_width_m"} <= unmeasured_keys(
        path.read_text(encoding="utf-8")
    )


def test_run_again_it_proposes_what_changed(tmp_path: Path) -> None:
    """New wheels: the difference is shown, and written after a yes; comments and the old file are kept."""
    path, board = tmp_path / "rover.toml", OwnBoard()
    conversation(path, board, Person(*whole(board)))
    path.write_text("# the blue one\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    before = path.read_bytes()
    for typed, is_written in (("", False), ("no", False), ("yes", True)):
        other = OwnBoard(counts_per_turn=2880.0)
        steps = [*whole(other), ("Write this to", typed)]
        steps[5] = ("AT FULL SPEED", "")
        conversation(path, other, Person(*steps), load(path))
        assert (path.read_bytes() != before) is is_written
        assert load(tmp_path / "rover.proposed.toml").encoders.counts_per_turn == 2880
    assert load(path).encoders.counts_per_turn == 2880
    assert path.read_text(encoding="utf-8").startswith("# the blue one\n")
    assert (tmp_path / "rover.toml.before").read_bytes() == before


def test_an_answer_that_never_comes_ends_it_with_the_motors_at_rest(tmp_path: Path) -> None:
    """The end of the input is no answer; nothing turns."""
    board = OwnBoard()
    steps = [*whole(board)[:4], ("Mark right_wheel", None)]
    with pytest.raises(NobodyAnswersError):
        conversation(tmp_path / "rover.toml", board, Person(*steps))
    assert (board.duty, board.hardest_duty) == ([0, 0], 0)


def test_a_place_that_cannot_hold_the_file_is_refused_before_anything_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody measures for half an hour first: a folder of others, and a file that stands where a folder should."""
    (tmp_path / "notes").touch()
    said = CliRunner().invoke(main, ["new-robot", str(tmp_path / "notes" / "robot.toml")])
    assert (said.exit_code, said.output) == (
        Exit.FAILED,
        f"Error: {tmp_path}/notes/robot.toml: cannot be written: {tmp_path}/notes is no folder\n",
    )
    monkeypatch.setattr(os, "access", lambda place, mode: False)
    said = CliRunner().invoke(main, ["new-robot", str(tmp_path / "not" / "there" / "robot.toml")])
    assert said.exit_code == Exit.FAILED
    assert said.output.endswith(f"cannot be written: you may not write to {tmp_path}\n")


def test_a_file_that_cannot_be_written_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was measured is not lost."""
    (tmp_path / "file").write_text("")
    board = OwnBoard()
    with pytest.raises(ProgramError, match="its text is above"):
        conversation(tmp_path / "file" / "rover.toml", board, Person(*whole(board)))
    assert "counts_per_turn = 1440" in capsys.readouterr().out

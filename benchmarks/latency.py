"""How long a command takes to reach the wire, and an encoder frame to be answered.

Command: the robot stands, ``drive`` goes to the socket, the board reads the first motor command that is not zero. Then
the robot is stopped and stands again before the next one, at no fixed phase to the board's cycle. Frame: the robot
drives, commanded anew twenty times a second; from the encoder frame's writing to the reading of the next ``s``.
"""

import random
import time
from collections.abc import Sequence

from benchmarks.board import Board, board
from benchmarks.figures import Outcome, latencies
from benchmarks.rig import connect, daemon, until
from benchmarks.rpc import Caller

CYCLE_S = 0.02
COMMANDS = 300
DRIVE_S = 0.03
REST_S = (0.04, 0.08)
FRAMES_CYCLE_S = 0.01
COMMAND_PERIOD_S = 0.05
FRAMES = 2000
ECHO_S = 0.003  # half a metre and back
TWIST = (0.2, 0.3)

Command = tuple[int, tuple[int, ...]]


def run(*, quick: bool = False) -> Outcome:
    """Both latencies, from a few hundred commands and a few thousand frames."""
    share = 0.25 if quick else 1.0
    with board() as instrument, daemon(instrument.device) as running, connect(running) as caller:
        instrument.start(CYCLE_S, echo_s=ECHO_S)
        time.sleep(0.5)
        to_wire, unanswered = command_to_wire(instrument, caller, round(COMMANDS * share))
        instrument.start(FRAMES_CYCLE_S, echo_s=ECHO_S)
        to_answer = frame_to_answer(instrument, caller, round(FRAMES * share) * FRAMES_CYCLE_S)
    return Outcome(
        (
            *latencies("drive to first s", to_wire, {50: 0.6, 99: 4.0}, {50: "18-28", 95: "32-42"}),
            *latencies("encoders to s", to_answer, {50: 0.4, 99: 3.0}, {50: "17-21", 95: "33-37"}),
        ),
        faults=(f"{unanswered} drive commands moved nothing",) if unanswered else (),
    )


def command_to_wire(instrument: Board, caller: Caller, samples: int) -> tuple[list[float], int]:
    """Seconds per command, and how many commands were never followed by a duty."""
    phase = random.Random(1)
    latencies_s = []
    for _ in range(samples):
        instrument.collect()
        time.sleep(phase.uniform(*REST_S))
        sent_ns, _ = caller.timed_call("drive", linear_m_s=0.3, angular_rad_s=0.0)
        time.sleep(DRIVE_S)
        caller.call("stop")
        commands = instrument.collect().commands
        moved_ns = next((at_ns for at_ns, duty in commands if at_ns > sent_ns and any(duty)), None)
        if moved_ns is not None:
            latencies_s.append((moved_ns - sent_ns) * 1e-9)
        _await_rest(instrument, commands)
    return latencies_s, samples - len(latencies_s)


def _await_rest(instrument: Board, commands: list[Command]) -> None:
    """Wait until the last motor command read is a zero."""

    def rests() -> bool:
        commands.extend(instrument.collect().commands)
        return not any(commands[-1][1])

    until(rests, "the robot does not come to rest")


def frame_to_answer(instrument: Board, caller: Caller, seconds: float) -> list[float]:
    """Seconds from each encoder frame to the motor command that answers it, while the robot drives."""
    caller.drive_for(0.5, *TWIST, COMMAND_PERIOD_S)
    instrument.collect()
    caller.drive_for(seconds, *TWIST, COMMAND_PERIOD_S)
    journal = instrument.collect()
    return answers_s(journal.encoder_frames_ns, journal.commands)


def answers_s(frames_ns: Sequence[int], commands: Sequence[Command]) -> list[float]:
    """From each frame to the first command read after it; frames after the last command have no answer yet."""
    read_ns = iter([at_ns for at_ns, _ in commands])
    answers = []
    answer_ns = next(read_ns, None)
    for frame_ns in frames_ns:
        while answer_ns is not None and answer_ns <= frame_ns:
            answer_ns = next(read_ns, None)
        if answer_ns is None:
            break
        answers.append((answer_ns - frame_ns) * 1e-9)
    return answers

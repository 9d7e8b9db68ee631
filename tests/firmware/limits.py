"""What the Duemilanove's image can carry and how soon it stops, measured in simavr on the cycle."""

import math
import random
import re
import subprocess
from itertools import pairwise

from chefbotd.components.simulation.simavr import CYCLES_S
from tests.firmware import tools
from tests.firmware.emulator import Emulated, built

HANGS = "atmega328p_hangs.elf"
GPIOR2_AT = 0x4B
RAM_BEGIN, RAM_END = 0x0100, 0x08FF
PAINT = 0xC5
SENSES = (1, 2, 3, 4, 5, 6)
MOST_EDGES_S = (11_600, -11_600)
COUNTS_PER_TURN = 8400


def sections() -> dict[str, int]:
    """The bytes of each section of the image."""
    built()
    listed = subprocess.run(
        ["avr-size", "-A", tools.BUILD / "atmega328p.elf"], capture_output=True, text=True, check=True
    )
    return {name: int(size) for name, size in re.findall(r"^\.(\w+)\s+(\d+)", listed.stdout, re.MULTILINE)}


def static_bytes() -> int:
    """Static RAM."""
    size = sections()
    return size["data"] + size["bss"] + size["noinit"]


def flash_bytes() -> int:
    """What the image takes of the flash."""
    size = sections()
    return size["text"] + size["data"]


def hang(how: int) -> tuple[float, float, Emulated]:
    """Let the main loop hang in a drive (1: that, 2: with interrupts shut, 3: without a tick).

    Returns:
        The seconds until the motors are off and until the banner begins, and the board after its start.
    """
    board = Emulated(image=HANGS)
    board.hello(2000)
    board.seal("s 200 200")
    board.run(0.05)
    board.forget()
    hung_s = board.now_s
    board.board.poke(GPIOR2_AT, how)
    while "Initializing" not in board.text and board.now_s < hung_s + 1.0:
        board.run(0.005)
    banner_s = board.now_s - hung_s
    board.run(0.1)
    return board.changed_s((0, 0), hung_s) - hung_s, banner_s, board


def silences_s(times: int) -> list[float]:
    """How long the duty outlives the last whole line of hosts that end in a line, a cycle or a turn of the wheels."""
    chance = random.Random(22)
    board = Emulated()
    board.hello()
    took_s = []
    for _ in range(times):
        for _ in range(chance.randrange(1, 6)):
            fed_s = board.seal(f"s {chance.randrange(50, 255)} {chance.randrange(-255, -50)}")
            board.run(0.005 * chance.randrange(1, 8), edges_s=(2_000, -1_800))
        board.run_to(board.now_s + chance.random() * 0.01)
        if chance.random() < 0.5:
            board.board.receive(b"s 255 255 9", round(board.now_s * CYCLES_S))
        board.run(0.3)
        took_s.append(board.changed_s((0, 0), fed_s) - fed_s)
        board.write("")
    return took_s


def busiest_share(seconds: float) -> float:
    """The most of 0.1 s in which the processor had work: 23,200 edges and 50 duties a second, and every sensor."""
    board = Emulated(echo_us=5_800, imu=SENSES)
    board.hello()
    busiest = 0.0
    for _ in range(round(seconds / 0.1)):
        slept, begun = board.board.slept_cycles, board.board.cycle
        for _ in range(5):
            board.seal("s 120 -80")
            board.run(0.02, edges_s=MOST_EDGES_S)
        busiest = max(busiest, 1 - (board.board.slept_cycles - slept) / (board.board.cycle - begun))
    return busiest


def lost_edges(edges: int, *lines: str) -> int:
    """How many of so many edges are not counted, at 23,200 a second, while the host repeats these lines."""
    board = Emulated(echo_us=5_800, imu=SENSES)
    board.hello()
    set_up_loop(board, kp=2_000)
    for number in range(round(edges / sum(map(abs, MOST_EDGES_S)) / 0.1)):
        board.seal(lines[number % len(lines)])
        board.run(0.1, edges_s=MOST_EDGES_S)
        board.forget()
    board.run(0.03)
    counted = [int(field) for field in board.fields("e")[-1]]
    return sum(abs(turned - count) for turned, count in zip(board.turned, counted, strict=True))


def set_up_loop(board: Emulated, kp: int) -> None:
    """Give the board's wheel loop its parameters: a gain in 1/256 duty per rad/s, and nothing else."""
    for parameter, value in enumerate((COUNTS_PER_TURN, kp, 0, 0, 0)):
        board.seal(f"g {parameter} {value}")
        board.run(0.01)


def unevenness_rad_s(edges_s: int, seconds: float) -> float:
    """How far the speed that the wheel loop measures is off at most, of wheels that turn evenly: by its duty."""
    kp, ahead_rad_s = 20_000, 0.1
    speed_rad_s = edges_s / COUNTS_PER_TURN * math.tau
    board = Emulated(echo_us=5_800, imu=SENSES)
    board.hello()
    set_up_loop(board, kp)
    board.run(0.5, edges_s=(edges_s, edges_s))
    aim = round(1000 * (speed_rad_s + ahead_rad_s))
    for _ in range(round(seconds / 0.1)):
        board.seal(f"w {aim} {aim}")
        board.run(0.1, edges_s=(edges_s, edges_s))
        board.forget()
    per_duty = 256 / kp
    duties = [duty for change in board.duties for duty in change.duty if duty]
    return max(abs(duty * per_duty - ahead_rad_s) for duty in duties)


def jitter_us() -> int:
    """How much two cycles differ from 10 ms at most, while lines come in at any time and the wheels turn."""
    chance = random.Random(5)
    board = Emulated(imu=SENSES)
    board.hello()
    board.forget()
    for _ in range(150):
        board.seal("s 120 -80")
        board.run(0.005 * chance.randrange(1, 5), edges_s=(11_000, -9_000))
        board.run_to(board.now_s + chance.random() * 0.001)
    begun_us = [int(line.split("\t")[1]) for line in board.lines if re.match(r"t\t\d+\t", line)]
    assert len(begun_us) > 100
    return max(abs(after - before - 10_000) for before, after in pairwise(begun_us))


def stack_bytes() -> int:
    """The deepest stack, painted before: every word, motion, and interrupts in interrupts."""
    board = Emulated(imu=SENSES, echo_us=5_800, boot_s=0.0)
    end = RAM_BEGIN + static_bytes()
    for address in range(end, RAM_END + 1):
        board.board.poke(address, PAINT)
    board.run(0.1)
    board.hello()
    for line in (
        "s 120 -80",
        "g 0 8400",
        "g 1 3000",
        "g 2 2000",
        "g 3 1000",
        "g 4 3000",
        "w 9000 -9000",
        "x 1",
    ):
        for _ in range(3):
            board.seal(line)
            board.run(0.02, edges_s=MOST_EDGES_S)
    board.write("estop")
    board.run(0.4)
    painted = (address for address in range(end, RAM_END + 1) if board.board.peek(address) != PAINT)
    return RAM_END + 1 - next(painted)


def commands_s(times: int) -> list[float]:
    """From the first byte of a duty on the wire to that duty on the pins."""
    chance = random.Random(7)
    board = Emulated(imu=SENSES, echo_us=5_800)
    board.hello()
    took_s = []
    for number in range(times):
        begun_s = board.now_s
        duty = 100 + number % 100, -50 - number % 70
        board.seal(f"s {duty[0]} {duty[1]}")
        board.run_to(begun_s + 0.02)
        took_s.append(board.changed_s(duty, begun_s) - begun_s)
        board.run_to(board.now_s + chance.random() * 0.02)
    return took_s

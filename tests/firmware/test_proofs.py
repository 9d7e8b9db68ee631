"""Noise, bit errors and a fuzzer against the core, in sizes for every change; `make -C firmware full-proofs` has all."""

import json
import re
import subprocess
from math import comb
from pathlib import Path
from typing import Any

from tests.firmware import host, tools

LINES = 1_000_000
FUZZ_RUNS = 50_000
SAMPLES = (
    "s 120 -80",
    "s -255 255",
    "s 0 0",
    "s 1 -1",
    "w 3000 -2999",
    "r",
    "hello 1 2000",
    "arm 1",
    "estop",
)
SAMPLES += ("g 6 4095", "s 20 201")
"""The lines of firmware/host/bit_errors.c."""


def flips(*arguments: object) -> dict[str, Any]:
    """What the proof of this name counted."""
    tools.need("gcc", "make")
    tools.make("proofs")
    done = subprocess.run([tools.BUILD / "flips", *map(str, arguments)], capture_output=True, text=True)
    tally: dict[str, Any] = json.loads(done.stdout)
    assert done.returncode == (1 if tally["wrong_motions"] or tally["resets"] else 0)
    return tally


def test_a_noisy_line_moves_nothing_wrongly() -> None:
    """One byte in a hundred flipped: 0 wrong motions, 0 resets, and at least 78 of 100 lines obeyed."""
    tally = flips(LINES, 1)
    assert (tally["lines"], tally["wrong_motions"], tally["resets"]) == (LINES, 0, 0)
    assert tally["obeyed"] >= 0.78  # 20 bytes all intact: 0.99^20 = 0.82


def test_the_same_noise_without_seals_does() -> None:
    """So the proof sees a wrong motion where there is one: about 2 lines of 100 in the classic mode."""
    assert flips(100_000, 1, "plain")["wrong_motions"] > 1000


def test_all_errors_of_up_to_three_bits_are_refused() -> None:
    """Of 11 sample lines, every one: of a line of n bits, n over 1, over 2 and over 3."""
    tools.need("gcc", "make")
    tools.make("proofs")
    done = subprocess.run([tools.BUILD / "bit_errors"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    bits = [8 * len(host.seal(f"{body} {200 + number}") + "\r") for number, body in enumerate(SAMPLES)]
    errors = sum(comb(count, wrong) for count in bits for wrong in (1, 2, 3))
    assert done.stdout == f"errors of 1, 2 and 3 bits: {errors}, obeyed: 0\n"


def test_the_fuzzer_finds_nothing_under_sanitizers(tmp_path: Path) -> None:
    """Interrupts, time and bytes in any order: no undefined behaviour, no duty in spite of a stop, no lock left."""
    tools.need("gcc", "make", "clang")
    tools.make("fuzzer")
    done = subprocess.run(
        [
            tools.BUILD / "fuzz",
            "-max_len=400",
            f"-runs={FUZZ_RUNS}",
            "-seed=1",
            f"-artifact_prefix={tmp_path}/",
        ],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    assert f"Done {FUZZ_RUNS} runs" in done.stderr


def test_the_sources_are_clean() -> None:
    """Gcc and clang with all warnings as errors, and cppcheck."""
    tools.need("gcc", "make", "clang", "cppcheck")
    tools.make("lint")


def test_each_rule_that_is_not_kept_has_its_reason() -> None:
    """The rules that the check passes over are those of the README's table."""
    tools.need("make")
    text = (tools.FIRMWARE / "host/host.mk").read_text(encoding="utf-8")
    listed = re.findall(r"^MISRA_DEVIATIONS := (.*)$", text, re.MULTILINE)[0].split()
    rows = re.findall(
        r"^\| ([0-9., ]+) \|", (tools.FIRMWARE / "README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert [rule for row in rows for rule in row.split(", ")] == listed

"""The sketches that docs/protocol.md opens with compile, speak the wire, and stop by themselves."""

import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from firmware_protocol.codec import CLASSIC, from_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import BoardTime, DutyEcho, EncoderCounts

PAGE = Path(__file__).parents[2] / "docs" / "protocol.md"
CORE = Path(__file__).with_name("arduino.h")
PINS = {"arduino": (2, 4, 3, 9, 5, 7), "esp32": (32, 33, 34, 35, 25, 27)}
"""Of each: A and B of the left encoder, then of the right one, PWM and direction of the left motor."""

pytestmark = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")


def sketch(board: str) -> str:
    """The page's sketch for this board."""
    arduino, esp32 = re.findall(r"```cpp\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[:2]
    return arduino if board == "arduino" else esp32


RUN = """
#include <cassert>
static void run_ms(int milliseconds) { for (int i = 0; i < milliseconds; i++) { now_us += 1000; loop(); } }
int main() {
  setup();
  run_ms(100);
  level[%(left_b)d] = 1; handler[%(left_a)d](); handler[%(left_a)d](); level[%(right_b)d] = 0; handler[%(right_a)d]();
  Serial.in = "s 120 -80\\r"; run_ms(100);
  assert(pwm[%(pwm)d] == 120 && level[%(direction)d] == 0);
  Serial.in = std::string("s 255 255 0\\rs 20") + std::string(80, '1') + " 5\\rs 7\\r\\n"; run_ms(100);
  assert(pwm[%(pwm)d] == 120);  // a field too many, an overlong line, one wheel: none is obeyed
  Serial.in = "s -9999 0\\r"; run_ms(40);
  assert(pwm[%(pwm)d] == 255 && level[%(direction)d] == 1);
  run_ms(470); assert(pwm[%(pwm)d] == 0);  // its watchdog: 0.5 s after the last command
  run_ms(20);
}
"""


@pytest.mark.parametrize("board", ["arduino", "esp32"])
def test_a_sketch_of_the_page_speaks_the_wire(board: str, tmp_path: Path) -> None:
    """Every line decodes; counts, echo and watchdog are as the page says."""
    names = ("left_a", "left_b", "right_a", "right_b", "pwm", "direction")
    program = CORE.read_text() + sketch(board) + RUN % dict(zip(names, PINS[board], strict=True))
    source, binary = tmp_path / "sketch.cpp", tmp_path / "sketch"
    source.write_text(program)
    subprocess.run(["g++", "-std=c++17", "-w", "-o", binary, source], check=True)
    sent = subprocess.run([binary], capture_output=True, check=True).stdout
    decoder = Decoder(from_board(CLASSIC))
    messages = [message for _, message in decoder.feed(sent)]
    assert not decoder.malformed
    assert decoder.accepted.keys() == {"BoardTime", "EncoderCounts", "DutyEcho"}
    times = [message.micros for message in messages if isinstance(message, BoardTime)]
    assert {later - earlier for earlier, later in pairwise(times)} == {20_000}
    assert EncoderCounts((2, -1)) in messages
    echoes = [message for message in messages if isinstance(message, DutyEcho)]
    assert DutyEcho((120.0, -80.0)) in echoes
    assert echoes[-1] == DutyEcho((0.0, 0.0))


@pytest.mark.skipif(shutil.which("avr-g++") is None, reason="avr-gcc is not installed")
def test_the_sketch_for_an_arduino_compiles_for_its_chip(tmp_path: Path) -> None:
    """With declarations in place of the core; ``int`` has 16 bits there."""
    declared = """
    #include <stdio.h>
    #include <stdlib.h>
    typedef unsigned char byte; enum { INPUT, OUTPUT, RISING };
    unsigned long millis(); unsigned long micros(); void pinMode(int, int); int digitalRead(int);
    void digitalWrite(int, int); void analogWrite(int, int); int digitalPinToInterrupt(int);
    void attachInterrupt(int, void (*)(), int); void noInterrupts(); void interrupts();
    #define constrain(value, low, high) ((value) < (low) ? (low) : (value) > (high) ? (high) : (value))
    struct Port { void begin(long); int available(); int read(); void print(const char *); void print(long);
      void print(unsigned long); void print(int); };
    extern Port Serial;
    """
    source = tmp_path / "sketch.cpp"
    source.write_text(declared + sketch("arduino"))
    subprocess.run(
        ["avr-g++", "-mmcu=atmega328p", "-Os", "-Wall", "-Werror", "-c", source, "-o", tmp_path / "sketch.o"],
        check=True,
    )


def test_the_sketch_for_an_arduino_is_short() -> None:
    """Who reads the page first sees the whole board."""
    assert len(sketch("arduino").splitlines()) <= 28

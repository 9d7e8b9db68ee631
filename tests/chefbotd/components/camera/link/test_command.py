"""Pictures of a program: a small Python program in the place of rpicam-vid."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from chefbotd.components.camera.link.command import CommandCapture
from chefbotd.components.camera.link.source import CameraLost, TakenPicture
from chefbotd.components.camera.parameters import CameraParameters
from tests.chefbotd.components.camera.pictures import picture
from tests.waiting import wait_until

HEAD = "import os, sys, time\npicture = open(sys.argv[1], 'rb').read()\n"


def command(folder: Path, body: str) -> CommandCapture:
    """A program with the picture's file as its argument."""
    (folder / "picture.jpg").write_bytes(picture(99))
    (folder / "program.py").write_text(HEAD + body)
    words = (sys.executable, "-S", str(folder / "program.py"), str(folder / "picture.jpg"))
    return CommandCapture(CameraParameters(enabled=True, source="command", command=words, rate_hz=60.0))  # type: ignore[arg-type]


def run(program: CommandCapture, most: int = 1000) -> tuple[list[TakenPicture], str]:
    """What it delivers until it is lost, or there are so many; and why it is lost."""
    delivered: list[TakenPicture] = []
    ending = threading.Event()

    def deliver(taken: TakenPicture) -> None:
        delivered.append(taken)
        if len(delivered) >= most:
            ending.set()

    try:
        program.run(deliver, ending)
    except CameraLost as lost:
        return delivered, str(lost)
    return delivered, ""


def test_the_pictures_of_a_program_are_passed_on_and_it_is_ended_with_the_camera(tmp_path: Path) -> None:
    """However it cuts what it writes."""
    body = (
        "print(os.getpid(), file=open(sys.argv[1] + '.pid', 'w'), flush=True)\n"
        "while True:\n"
        "    os.write(1, picture[:100]); os.write(1, picture[100:]); time.sleep(0.05)\n"
    )
    delivered, why = run(command(tmp_path, body), most=3)
    assert [taken.picture.jpeg for taken in delivered] == [picture(99)] * 3
    assert why == ""
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "picture.jpg.pid").read_text()), 0)


def test_a_program_that_ends_is_lost_with_the_last_line_that_it_said(tmp_path: Path) -> None:
    """As rpicam-vid says that there is no camera."""
    _, why = run(command(tmp_path, "sys.exit('starting\\nno cameras available')\n"))
    assert why == f"{sys.executable} has ended: no cameras available"
    _, why = run(command(tmp_path, "sys.exit(3)\n"))
    assert why == f"{sys.executable} has ended with code 3"


def test_a_program_that_cannot_be_started_is_lost(tmp_path: Path) -> None:
    """Its name is misspelt, or it is not installed; with setpriv before it, that says so."""
    missing = str(tmp_path / "rpicam-vid")
    _, why = run(CommandCapture(CameraParameters(enabled=True), (missing,)))
    assert missing in why
    assert "No such file" in why


PARENT = """
import sys, threading, time
from chefbotd.components.camera.link.command import CommandCapture
from chefbotd.components.camera.parameters import CameraParameters
capture = CommandCapture(CameraParameters(enabled=True), sys.argv[1:])
threading.Thread(target=capture.run, args=(print, threading.Event()), daemon=True).start()
time.sleep(600)
"""


def has_ended(process: int) -> bool:
    """Whether a process is gone, or only its parent has not asked for its end."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_a_program_dies_with_the_thread_that_reads_it(tmp_path: Path) -> None:
    """So also with a daemon that is killed: the kernel kills it with its parent."""
    file = tmp_path / "pid"
    (tmp_path / "program.py").write_text(
        f"import os, time\nprint(os.getpid(), file=open({str(file)!r}, 'w'), flush=True)\ntime.sleep(600)\n"
    )
    words = [sys.executable, "-c", PARENT, sys.executable, str(tmp_path / "program.py")]
    with subprocess.Popen(words) as parent:
        wait_until(lambda: file.exists() and bool(file.read_text().strip()))
        child = int(file.read_text())
        assert not has_ended(child)
        parent.kill()
    wait_until(lambda: has_ended(child))


def test_what_a_program_has_started_ends_with_it(tmp_path: Path) -> None:
    """A shell that runs the camera's program, which hangs and writes nothing more: it would hold the device for ever."""
    file = tmp_path / "pid"
    body = (
        "import subprocess\n"
        "child = subprocess.Popen([sys.executable, '-S', '-c', 'import time; time.sleep(600)'])\n"
        f"print(child.pid, file=open({str(file)!r}, 'w'), flush=True)\n"
        "while True:\n    os.write(1, picture); time.sleep(0.05)\n"
    )
    delivered, why = run(command(tmp_path, body), most=2)
    assert (len(delivered), why) == (2, "")
    wait_until(lambda: has_ended(int(file.read_text())))

"""Pictures of a program that writes Motion JPEG to its output, such as rpicam-vid or ffmpeg."""

import contextlib
import fcntl
import os
import select
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable, Sequence

from chefbotd.components.camera.algorithms.jpeg import NotAPicture, read_picture
from chefbotd.components.camera.algorithms.mjpeg_stream import MjpegStream
from chefbotd.components.camera.link.source import CameraLost, RateLimit, TakenPicture, monotonic_s
from chefbotd.components.camera.parameters import CameraParameters
from chefbotd.core.sentence import Sentence

START_S = 15.0
"""What a program may take to its first picture (assumed)."""
LOOK_S = 0.25
PIPE_BYTES = 1 << 20
READ_BYTES = 1 << 18
LAST_WORDS_BYTES = 2000
LONGEST_WORDS = 200


class CommandCapture:
    """A program, which is killed with the thread that reads it, and so with the daemon."""

    def __init__(self, parameters: CameraParameters, command: Sequence[str] = ()) -> None:
        self._parameters = parameters
        self._command = tuple(command) or parameters.command

    def run(self, deliver: Callable[[TakenPicture], None], ending: threading.Event) -> None:
        """Deliver pictures until ``ending``.

        Raises:
            CameraLost: the program cannot be started, has ended, or writes no pictures.
        """
        name = self._command[0]
        try:
            process = subprocess.Popen(  # noqa: S603 - the command of the configuration, without a shell
                [*_killed_with_us(), *self._command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                start_new_session=True,  # a Ctrl-C in the terminal is for the daemon; and a group to kill
            )
        except OSError as error:
            raise CameraLost(
                Sentence(
                    "camera.not_started",
                    "{name} cannot be started: {why}",
                    name=name,
                    why=error.strerror or error,
                )
            ) from error
        assert process.stdout is not None and process.stderr is not None  # noqa: S101, PT018 - they were asked for
        try:
            words = self._read_pictures(process, deliver, ending)
        finally:
            _kill_group(process)
            with contextlib.suppress(subprocess.TimeoutExpired):  # it hangs in the kernel
                process.wait(1.0)
            process.stdout.close()
            process.stderr.close()
        if not ending.is_set():
            if words:
                raise CameraLost(
                    Sentence("camera.ended", "{name} has ended: {words}", name=name, words=words)
                )
            code = process.returncode
            raise CameraLost(
                Sentence("camera.ended_with", "{name} has ended with code {code}", name=name, code=code)
            )

    def _read_pictures(
        self,
        process: "subprocess.Popen[bytes]",
        deliver: Callable[[TakenPicture], None],
        ending: threading.Event,
    ) -> str:
        """Read until the program ends; returns the last line that it has said."""
        assert process.stdout is not None and process.stderr is not None  # noqa: S101, PT018 - they were asked for
        output, errors = process.stdout.fileno(), process.stderr.fileno()
        with contextlib.suppress(OSError):  # more than the system lets us have
            fcntl.fcntl(output, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        poll = select.poll()
        poll.register(output, select.POLLIN)
        poll.register(errors, select.POLLIN)
        reader, words = _Reader(self._parameters, deliver), b""
        while not ending.is_set():
            reader.require_pictures(self._command[0])
            for descriptor, _ in poll.poll(1000 * LOOK_S):
                data = os.read(descriptor, READ_BYTES)
                if not data:
                    poll.unregister(descriptor)
                if descriptor == errors:
                    words = (words + data)[-LAST_WORDS_BYTES:]
                elif data:
                    reader.add_output(data)
                else:
                    return _last_line(words + _rest_of(errors))
        return ""


class _Reader:
    """Bytes to pictures, as many as wanted."""

    def __init__(self, parameters: CameraParameters, deliver: Callable[[TakenPicture], None]) -> None:
        self._parameters, self._deliver = parameters, deliver
        self._stream, self._limit = MjpegStream(parameters.max_frame_bytes), RateLimit(parameters.rate_hz)
        self._last_s, self._patience_s = monotonic_s(), START_S
        self._damaged = self._reported = 0

    def add_output(self, data: bytes) -> None:
        for jpeg in self._stream.find_pictures(data):
            now_s = monotonic_s()
            if not self._limit.admit_at(now_s):
                continue
            try:
                picture = read_picture(jpeg, self._parameters.max_frame_bytes)
            except NotAPicture:
                self._damaged += 1
                continue
            self._last_s, self._patience_s = now_s, self._parameters.silence_timeout_s
            dropped = self._stream.dropped + self._damaged
            self._deliver(TakenPicture(picture, now_s, dropped - self._reported))
            self._reported = dropped

    def require_pictures(self, name: str) -> None:
        """Raises ``CameraLost`` where there was none for too long."""
        if monotonic_s() - self._last_s > self._patience_s:
            dropped = self._stream.dropped + self._damaged - self._reported
            longest = self._parameters.max_frame_bytes
            silent = Sentence(
                "camera.writes_nothing",
                "{name} has written no picture for {seconds:g} s",
                name=name,
                seconds=self._patience_s,
            )
            if not dropped:
                raise CameraLost(silent)
            raise CameraLost(
                Sentence(
                    "camera.writes_no_whole",
                    "{silent}; {dropped} were cut, damaged or longer than {longest} bytes",
                    silent=silent,
                    dropped=dropped,
                    longest=longest,
                )
            )


def _killed_with_us() -> tuple[str, ...]:
    """What has the kernel kill a program with its parent (util-linux); without it, its next picture ends it."""
    setpriv = shutil.which("setpriv")
    return () if setpriv is None else (setpriv, "--pdeathsig", "KILL", "--")


def _kill_group(process: "subprocess.Popen[bytes]") -> None:
    """Kill the program and those that it has started, such as what a shell runs: they would hold the camera.

    It has not been waited for yet, so its number is still its own.
    """
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _rest_of(errors: int) -> bytes:
    os.set_blocking(errors, False)
    try:
        return os.read(errors, READ_BYTES)
    except BlockingIOError:
        return b""


def _last_line(words: bytes) -> str:
    lines = [line.strip() for line in words.decode(errors="replace").splitlines() if line.strip()]
    text = lines[-1][:LONGEST_WORDS] if lines else ""
    return "".join(letter if letter.isprintable() else "?" for letter in text)

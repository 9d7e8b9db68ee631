"""A webcam by Video4Linux, on a kernel of the test."""

import ctypes
import errno
import mmap
import threading
from collections.abc import Callable

import pytest

from chefbotd.components.camera.link import v4l2_abi as abi
from chefbotd.components.camera.link.source import CameraLost, TakenPicture
from chefbotd.components.camera.link.v4l2 import V4l2Capture
from chefbotd.components.camera.parameters import CameraParameters
from tests.chefbotd.components.camera.pictures import picture, without_tables

DEVICE, BUFFER_BYTES = 33, 8192
MJPG, YUYV = abi.fourcc("MJPG"), abi.fourcc("YUYV")


class FakeKernel:
    """A device with these formats, whose buffers are filled with these bytes; then it ends with an error."""

    def __init__(self, formats: tuple[int, ...] = (YUYV, MJPG), frames: tuple[bytes | int, ...] = ()) -> None:
        self.formats, self.frames = formats, list(frames)
        self.capabilities = abi.CAN_CAPTURE | abi.CAN_STREAM
        self.open_error = self.end = 0
        self.asked: list[int] = []
        self.queued: list[int] = []
        self.mapped: list[mmap.mmap] = []
        self.size = self.rate = (0, 0)
        self.is_open = False
        self.taken_s, self.period_s = 1.0, 0.1  # of the kernel's own clock, which began before any test
        self.on_wait: Callable[[], None] = lambda: None

    def open_device(self, path: str) -> int:
        if self.open_error:
            raise OSError(self.open_error, "as the test says", path)
        self.is_open = True
        return DEVICE

    def close_device(self, device: int) -> None:
        assert (device, self.is_open) == (DEVICE, True)
        self.is_open = False

    def map_buffer(self, device: int, length: int, offset: int) -> mmap.mmap:
        self.mapped.append(mmap.mmap(-1, length))
        return self.mapped[-1]

    def wait_for_picture(self, device: int, timeout_s: float) -> bool:
        self.on_wait()
        return bool(self.frames or self.end)

    def ioctl(self, device: int, request: int, argument: abi.Argument) -> None:
        assert device == DEVICE
        self.asked.append(request)
        match argument:
            case abi.Capability():
                argument.capabilities = self.capabilities
            case abi.FormatDescription():
                if argument.index >= len(self.formats):
                    raise OSError(errno.EINVAL, "no more")
                argument.pixelformat = self.formats[argument.index]
            case abi.Format():
                self.size = argument.fmt.pix.width, argument.fmt.pix.height
            case abi.StreamParameters():
                self.rate = argument.parm.capture.numerator, argument.parm.capture.denominator
            case abi.Buffer():
                self._buffer(request, argument)

    def _buffer(self, request: int, buffer: abi.Buffer) -> None:
        if request == abi.QUERY_BUFFER:
            buffer.length, buffer.m.offset = BUFFER_BYTES, buffer.index * BUFFER_BYTES
        elif request == abi.QUEUE_BUFFER:
            self.queued.append(buffer.index)
        elif request == abi.DEQUEUE_BUFFER:
            if not self.frames:
                raise OSError(self.end, "as the test says")
            frame = self.frames.pop(0)
            if isinstance(frame, int):
                raise OSError(frame, "as the test says")
            buffer.index = self.queued.pop(0)
            self.mapped[buffer.index][: len(frame)] = frame
            buffer.bytesused = len(frame)
            buffer.flags = abi.STAMP_MONOTONIC
            self.taken_s += self.period_s
            buffer.timestamp.tv_sec, buffer.timestamp.tv_usec = divmod(round(1e6 * self.taken_s), 1_000_000)


def capture(kernel: FakeKernel, **keys: object) -> tuple[list[TakenPicture], str]:
    """What is delivered until the camera is lost, and why it is."""
    delivered: list[TakenPicture] = []
    parameters = CameraParameters.model_validate(
        {"enabled": True, "rate_hz": 60.0, "silence_timeout_s": 0.5, **keys}
    )
    camera = V4l2Capture(parameters, kernel)
    with pytest.raises(CameraLost) as lost:
        camera.run(delivered.append, threading.Event())
    assert not kernel.is_open
    return delivered, str(lost.value)


@pytest.mark.skipif(ctypes.sizeof(ctypes.c_void_p) != 8, reason="the figures are those of 64 bits")
def test_requests_have_the_numbers_of_the_kernels_own_header() -> None:
    """As a C compiler prints them from linux/videodev2.h of Linux 6.1 on x86-64, which has the layout of aarch64."""
    assert [
        *(abi.QUERY_CAPABILITY, abi.ENUMERATE_FORMATS, abi.SET_FORMAT, abi.REQUEST_BUFFERS, abi.QUERY_BUFFER),
        *(abi.QUEUE_BUFFER, abi.DEQUEUE_BUFFER, abi.STREAM_ON, abi.STREAM_OFF, abi.SET_PARAMETERS),
    ] == [
        *(0x80685600, 0xC0405602, 0xC0D05605, 0xC0145608, 0xC0585609),
        *(0xC058560F, 0xC0585611, 0x40045612, 0x40045613, 0xC0CC5616),
    ]
    fields = (abi.Buffer.bytesused, abi.Buffer.timestamp, abi.Buffer.m, abi.Buffer.length)
    assert [field.offset for field in fields] == [8, 24, 64, 72]
    assert (abi.Format.fmt.offset, abi.FormatDescription.pixelformat.offset) == (8, 44)


def test_a_webcam_is_asked_for_motion_jpeg_and_its_pictures_are_passed_on() -> None:
    """In the size and at the rate of the configuration; each buffer goes back to the driver."""
    kernel = FakeKernel(frames=(picture(1), picture(2) + bytes(100)))
    kernel.end = errno.ENODEV
    delivered, why = capture(kernel, width_px=800, height_px=600)
    assert kernel.size == (800, 600)
    assert kernel.rate == (1000, 60_000)
    assert [taken.picture.jpeg for taken in delivered] == [picture(1), picture(2)]
    assert [round(taken.taken_s, 6) for taken in delivered] == [1.1, 1.2]
    assert sorted(kernel.queued) == [0, 1, 2]
    assert why == "/dev/video0 is gone: was the camera unplugged?"


def test_of_a_webcam_that_sends_more_than_is_wanted_every_other_picture_is_passed_on() -> None:
    """Thirty a second, of which fifteen are wanted: ten of twenty."""
    kernel = FakeKernel(frames=tuple(picture(grey) for grey in range(20)))
    kernel.end, kernel.period_s = errno.ENODEV, 1 / 30
    delivered, _ = capture(kernel, rate_hz=15.0)
    assert [taken.picture.jpeg for taken in delivered] == [picture(grey) for grey in range(0, 20, 2)]


def test_a_webcam_without_motion_jpeg_is_refused_with_what_it_offers() -> None:
    """The sentence names the formats, and what helps."""
    _, why = capture(FakeKernel(formats=(YUYV, abi.fourcc("GREY"))))
    assert (
        why == "/dev/video0 offers no Motion JPEG, only YUYV, GREY: let a program convert it, such as ffmpeg"
    )


def test_the_second_device_of_a_webcam_that_sends_no_pictures_is_no_camera() -> None:
    """UVC cameras have one for metadata beside each."""
    kernel = FakeKernel()
    kernel.capabilities = abi.CAN_STREAM
    assert capture(kernel)[1] == "/dev/video0 is no camera: another /dev/video of the same one may be"


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (errno.ENOENT, "there is no /dev/video0: is the camera plugged in?"),
        (errno.EACCES, "/dev/video0 may not be opened: the daemon's user must be in the group video"),
        (errno.EBUSY, "/dev/video0 is used by another program"),
    ],
)
def test_a_device_that_cannot_be_opened_says_what_to_do(error: int, why: str) -> None:
    """Not there, not allowed, or taken by another program."""
    kernel = FakeKernel()
    kernel.open_error = error
    assert_lost = V4l2Capture(CameraParameters(enabled=True), kernel)
    with pytest.raises(CameraLost, match=why.replace("?", r"\?")):
        assert_lost.run(lambda taken: None, threading.Event())


def test_frames_that_are_cut_are_counted_and_not_passed_on() -> None:
    """As a bad USB cable cuts them; the next whole one says how many there were."""
    kernel = FakeKernel(frames=(picture(1)[:-30], b"", picture(2)[:200], without_tables(picture(3))))
    kernel.end = errno.ENODEV
    delivered, _ = capture(kernel, rate_hz=60.0)
    assert [(taken.dropped, taken.picture.width_px) for taken in delivered] == [(3, 32)]


def test_a_webcam_that_sends_nothing_is_given_up() -> None:
    """It is opened again by whoever runs it."""
    _, why = capture(FakeKernel())
    assert why == "/dev/video0 has sent nothing for 0.5 s"


def test_a_driver_that_announces_pictures_and_has_none_is_given_up_and_not_asked_without_a_pause() -> None:
    """In half a second it is asked some fifty times, not as often as a processor can."""
    kernel = FakeKernel()
    kernel.end = errno.EAGAIN
    _, why = capture(kernel)
    assert why == "/dev/video0 has sent nothing for 0.5 s"
    assert kernel.asked.count(abi.DEQUEUE_BUFFER) <= 60


def test_a_driver_that_does_not_know_a_request_is_not_called_no_camera() -> None:
    """ENOTTY: nothing is claimed that nobody knows."""
    kernel = FakeKernel(frames=(errno.ENOTTY,))
    assert capture(kernel)[1].startswith("/dev/video0 does not answer as a camera does")


def test_it_ends_when_it_is_told_to() -> None:
    """And leaves the device closed."""
    kernel, ending = FakeKernel(), threading.Event()
    kernel.on_wait = ending.set
    V4l2Capture(CameraParameters(enabled=True), kernel).run(lambda taken: None, ending)
    assert not kernel.is_open

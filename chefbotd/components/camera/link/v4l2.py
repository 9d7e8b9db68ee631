"""Pictures of a webcam by Video4Linux: Motion JPEG alone, read in a thread from buffers that the driver fills."""

import ctypes
import errno
import fcntl
import mmap
import os
import select
import threading
from collections.abc import Callable
from typing import Protocol

from chefbotd.components.camera.algorithms.jpeg import NotAPicture, read_picture
from chefbotd.components.camera.link import v4l2_abi as abi
from chefbotd.components.camera.link.source import CameraLost, RateLimit, TakenPicture, monotonic_s
from chefbotd.components.camera.parameters import CameraParameters

BUFFERS = 3
"""One that is filled, one that is read, and one between."""
LOOK_S = 0.25
"""How often the thread looks whether it is to end."""
NOT_THERE_S = 0.01
UNPLUGGED = (errno.ENODEV, errno.EIO, errno.ENXIO)


class Kernel(Protocol):
    """The calls of the kernel that a device needs; a test has its own."""

    def open_device(self, path: str) -> int:
        """Open the device, without waiting for pictures; raises ``OSError``."""
        ...

    def close_device(self, device: int) -> None:
        """Close it."""
        ...

    def ioctl(self, device: int, request: int, argument: abi.Argument) -> None:
        """Fill in ``argument``; raises ``OSError``."""
        ...

    def map_buffer(self, device: int, length: int, offset: int) -> mmap.mmap:
        """The memory of a buffer; raises ``OSError``."""
        ...

    def wait_for_picture(self, device: int, timeout_s: float) -> bool:
        """Whether a picture comes, or an error, within this time."""
        ...


class LinuxKernel:
    """The kernel itself."""

    def open_device(self, path: str) -> int:
        """Open the device."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def close_device(self, device: int) -> None:
        """Close it."""
        os.close(device)

    def ioctl(self, device: int, request: int, argument: abi.Argument) -> None:
        """Fill in ``argument``; a signal does not end the call."""
        while True:
            try:
                fcntl.ioctl(device, request, argument)
            except InterruptedError:
                continue
            return

    def map_buffer(self, device: int, length: int, offset: int) -> mmap.mmap:
        """The memory of a buffer, to be read."""
        return mmap.mmap(device, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset)

    def wait_for_picture(self, device: int, timeout_s: float) -> bool:
        """Wait for a picture or an error."""
        poll = select.poll()
        poll.register(device, select.POLLIN | select.POLLPRI)
        return bool(poll.poll(1000 * timeout_s))


class V4l2Capture:
    """A webcam."""

    def __init__(self, parameters: CameraParameters, kernel: Kernel | None = None) -> None:
        self._parameters, self._kernel = parameters, kernel or LinuxKernel()
        self._device = -1
        self._memory: list[mmap.mmap] = []

    def run(self, deliver: Callable[[TakenPicture], None], ending: threading.Event) -> None:
        """Deliver pictures until ``ending``.

        Raises:
            CameraLost: there is no such device, it cannot send Motion JPEG, it was unplugged, or it sends nothing.
        """
        path = self._parameters.device
        try:
            self._device = self._kernel.open_device(path)
        except OSError as error:
            raise CameraLost(_why_not_opened(path, error)) from error
        try:
            self._choose_format()
            self._map_buffers()
            self._kernel.ioctl(self._device, abi.STREAM_ON, ctypes.c_int(abi.CAPTURE))
            self._read_pictures(deliver, ending)
        except OSError as error:
            raise CameraLost(_why_ended(path, error)) from error
        finally:
            self._release()

    def _choose_format(self) -> None:
        kernel, device, parameters = self._kernel, self._device, self._parameters
        kernel.ioctl(device, abi.QUERY_CAPABILITY, capability := abi.Capability())
        has_own = capability.capabilities & abi.HAS_DEVICE_CAPS
        can = capability.device_caps if has_own else capability.capabilities
        if not can & abi.CAN_CAPTURE or not can & abi.CAN_STREAM:
            raise CameraLost(f"{parameters.device} is no camera: another /dev/video of the same one may be")
        offered = self._list_formats()
        jpeg_format = next((number for number in (abi.MJPEG, abi.JPEG) if number in offered), None)
        if jpeg_format is None:
            raise CameraLost(
                f"{parameters.device} offers no Motion JPEG, only {_names_of(offered)}: "
                "let a program convert it, such as ffmpeg"
            )
        asked = abi.Format(type=abi.CAPTURE)
        asked.fmt.pix.width, asked.fmt.pix.height = parameters.width_px, parameters.height_px
        asked.fmt.pix.pixelformat = jpeg_format
        kernel.ioctl(device, abi.SET_FORMAT, asked)
        if asked.fmt.pix.pixelformat != jpeg_format:
            raise CameraLost(
                f"{parameters.device} answers with {abi.fourcc_text(asked.fmt.pix.pixelformat)} "
                f"where Motion JPEG of {parameters.width_px}x{parameters.height_px} was asked for"
            )
        self._ask_for_rate()

    def _list_formats(self) -> list[int]:
        formats: list[int] = []
        for index in range(64):
            described = abi.FormatDescription(index=index, type=abi.CAPTURE)
            try:
                self._kernel.ioctl(self._device, abi.ENUMERATE_FORMATS, described)
            except OSError as error:
                if error.errno == errno.EINVAL:  # there are no more
                    break
                raise
            formats.append(described.pixelformat)
        return formats

    def _ask_for_rate(self) -> None:
        """Many devices have fixed rates, and choose the nearest; the rest is skipped here."""
        rate = abi.StreamParameters(type=abi.CAPTURE)
        rate.parm.capture.numerator = 1000
        rate.parm.capture.denominator = round(1000 * self._parameters.rate_hz)
        try:
            self._kernel.ioctl(self._device, abi.SET_PARAMETERS, rate)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTTY):
                raise

    def _map_buffers(self) -> None:
        asked = abi.RequestBuffers(count=BUFFERS, type=abi.CAPTURE, memory=abi.MAPPED)
        self._kernel.ioctl(self._device, abi.REQUEST_BUFFERS, asked)
        for index in range(asked.count):
            buffer = abi.Buffer(index=index, type=abi.CAPTURE, memory=abi.MAPPED)
            self._kernel.ioctl(self._device, abi.QUERY_BUFFER, buffer)
            self._memory.append(self._kernel.map_buffer(self._device, buffer.length, buffer.m.offset))
            self._kernel.ioctl(self._device, abi.QUEUE_BUFFER, buffer)
        if not self._memory:
            raise CameraLost(f"{self._parameters.device} has no memory for pictures")

    def _read_pictures(self, deliver: Callable[[TakenPicture], None], ending: threading.Event) -> None:
        parameters = self._parameters
        limit, last_s, dropped = RateLimit(parameters.rate_hz), monotonic_s(), 0
        why = "nothing"
        while not ending.is_set():
            if monotonic_s() - last_s > parameters.silence_timeout_s:
                raise CameraLost(_why_silent(parameters, why))
            if not self._kernel.wait_for_picture(self._device, LOOK_S):
                continue
            buffer = abi.Buffer(type=abi.CAPTURE, memory=abi.MAPPED)
            try:
                self._kernel.ioctl(self._device, abi.DEQUEUE_BUFFER, buffer)
            except (
                BlockingIOError
            ):  # a driver that announces what is not there must not keep the processor busy
                ending.wait(NOT_THERE_S)
                continue
            taken_s = _taken_s(buffer)
            if is_due := limit.admit_at(taken_s):
                data = self._memory[buffer.index][: buffer.bytesused]
                is_damaged = bool(buffer.flags & abi.BUFFER_ERROR)
            self._kernel.ioctl(self._device, abi.QUEUE_BUFFER, buffer)
            if not is_due:
                continue
            try:
                if is_damaged:
                    raise NotAPicture("it is damaged")
                picture = read_picture(data, parameters.max_frame_bytes)
            except NotAPicture as problem:
                dropped, why = dropped + 1, str(problem)
                continue
            deliver(TakenPicture(picture, taken_s, dropped))
            last_s, dropped = monotonic_s(), 0

    def _release(self) -> None:
        """As far as a device that was unplugged lets itself be released."""
        for memory in self._memory:
            memory.close()
        self._memory.clear()
        self._kernel.close_device(self._device)  # ends the stream, too


def _taken_s(buffer: abi.Buffer) -> float:
    """When it was taken; drivers whose stamps are of another clock say nothing of that."""
    stamp = buffer.timestamp
    if buffer.flags & abi.STAMP_MASK == abi.STAMP_MONOTONIC and (stamp.tv_sec or stamp.tv_usec):
        return min(float(stamp.tv_sec + 1e-6 * stamp.tv_usec), monotonic_s())
    return monotonic_s()


def _names_of(formats: list[int]) -> str:
    return ", ".join(abi.fourcc_text(number) for number in formats) or "nothing"


def _why_silent(parameters: CameraParameters, why: str) -> str:
    sends = "nothing" if why == "nothing" else f"no whole picture ({why})"
    return f"{parameters.device} has sent {sends} for {parameters.silence_timeout_s:g} s"


def _why_not_opened(path: str, error: OSError) -> str:
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"there is no {path}: is the camera plugged in?"
    if error.errno == errno.EACCES:
        return f"{path} may not be opened: the daemon's user must be in the group video"
    if error.errno == errno.EBUSY:
        return f"{path} is used by another program"
    return f"{path} cannot be opened: {error.strerror or error}"


def _why_ended(path: str, error: OSError) -> str:
    if error.errno in UNPLUGGED:
        return f"{path} is gone: was the camera unplugged?"
    if error.errno == errno.EBUSY:
        return f"{path} is used by another program"
    if error.errno == errno.ENOTTY:
        return f"{path} does not answer as a camera does: its driver lacks what is needed, or it is another device"
    if error.errno == errno.ENOSPC:
        return f"{path} finds no room on its USB port: use another one, or ask for fewer or smaller pictures"
    return f"{path} fails: {error.strerror or error}"

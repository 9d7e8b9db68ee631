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
from chefbotd.core.sentence import Sentence

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
            raise CameraLost(
                Sentence(
                    "camera.no_camera",
                    "{device} is no camera: another /dev/video of the same one may be",
                    device=parameters.device,
                )
            )
        offered = self._list_formats()
        jpeg_format = next((number for number in (abi.MJPEG, abi.JPEG) if number in offered), None)
        if jpeg_format is None:
            raise CameraLost(
                Sentence(
                    "camera.no_jpeg",
                    "{device} offers no Motion JPEG, only {formats}: let a program convert it, such as ffmpeg",
                    device=parameters.device,
                    formats=_names_of(offered),
                )
            )
        asked = abi.Format(type=abi.CAPTURE)
        asked.fmt.pix.width, asked.fmt.pix.height = parameters.width_px, parameters.height_px
        asked.fmt.pix.pixelformat = jpeg_format
        kernel.ioctl(device, abi.SET_FORMAT, asked)
        if asked.fmt.pix.pixelformat != jpeg_format:
            raise CameraLost(
                Sentence(
                    "camera.other_format",
                    "{device} answers with {format} where Motion JPEG of {width_px}x{height_px} was asked for",
                    device=parameters.device,
                    format=abi.fourcc_text(asked.fmt.pix.pixelformat),
                    width_px=parameters.width_px,
                    height_px=parameters.height_px,
                )
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
            raise CameraLost(
                Sentence(
                    "camera.no_memory", "{device} has no memory for pictures", device=self._parameters.device
                )
            )

    def _read_pictures(self, deliver: Callable[[TakenPicture], None], ending: threading.Event) -> None:
        parameters = self._parameters
        limit, last_s, dropped = RateLimit(parameters.rate_hz), monotonic_s(), 0
        why = ""
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
                    raise NotAPicture(Sentence("camera.damaged", "it is damaged"))
                picture = read_picture(data, parameters.max_frame_bytes)
            except NotAPicture as problem:
                dropped, why = dropped + 1, problem.words
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
    device, seconds = parameters.device, parameters.silence_timeout_s
    if not why:
        return Sentence(
            "camera.sends_nothing",
            "{device} has sent nothing for {seconds:g} s",
            device=device,
            seconds=seconds,
        )
    return Sentence(
        "camera.sends_no_whole",
        "{device} has sent no whole picture ({why}) for {seconds:g} s",
        device=device,
        why=why,
        seconds=seconds,
    )


def used_by_another(device: str) -> Sentence:
    """Why a device cannot be had that has a user."""
    return Sentence("camera.in_use", "{device} is used by another program", device=device)


def _why_not_opened(path: str, error: OSError) -> str:
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return Sentence("camera.not_plugged", "there is no {device}: is the camera plugged in?", device=path)
    if error.errno == errno.EACCES:
        return Sentence(
            "camera.no_right",
            "{device} may not be opened: the daemon's user must be in the group video",
            device=path,
        )
    if error.errno == errno.EBUSY:
        return used_by_another(path)
    return Sentence(
        "camera.not_opened", "{device} cannot be opened: {why}", device=path, why=error.strerror or error
    )


def _why_ended(path: str, error: OSError) -> str:
    if error.errno in UNPLUGGED:
        return Sentence("camera.unplugged", "{device} is gone: was the camera unplugged?", device=path)
    if error.errno == errno.EBUSY:
        return used_by_another(path)
    if error.errno == errno.ENOTTY:
        return Sentence(
            "camera.not_answering",
            "{device} does not answer as a camera does: its driver lacks what is needed, or it is another device",
            device=path,
        )
    if error.errno == errno.ENOSPC:
        return Sentence(
            "camera.no_room",
            "{device} finds no room on its USB port: use another one, or ask for fewer or smaller pictures",
            device=path,
        )
    return Sentence("camera.fails", "{device} fails: {why}", device=path, why=error.strerror or error)

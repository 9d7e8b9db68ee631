"""Video4Linux's requests and structures, as ``linux/videodev2.h`` (of Linux 6.1) has them.

Sizes follow from the types of this computer's C compiler, as there: they differ between 32 and 64 bits.
"""

import ctypes
from typing import Final, TypeAlias

CAPTURE: Final = 1
"""V4L2_BUF_TYPE_VIDEO_CAPTURE."""
MAPPED: Final = 1
"""V4L2_MEMORY_MMAP."""
CAN_CAPTURE, CAN_STREAM, HAS_DEVICE_CAPS = 0x0000_0001, 0x0400_0000, 0x8000_0000
"""V4L2_CAP_VIDEO_CAPTURE, V4L2_CAP_STREAMING, V4L2_CAP_DEVICE_CAPS."""
BUFFER_ERROR: Final = 0x0040
"""V4L2_BUF_FLAG_ERROR: what is in the buffer is damaged."""
STAMP_MASK, STAMP_MONOTONIC = 0xE000, 0x2000
"""V4L2_BUF_FLAG_TIMESTAMP_MASK and _MONOTONIC."""


def fourcc(code: str) -> int:
    """A pixel format's number (v4l2_fourcc)."""
    return int.from_bytes(code.encode("ascii"), "little")


def fourcc_text(number: int) -> str:
    """A pixel format's name; what is no letter is a question mark."""
    text = (number & 0x7FFF_FFFF).to_bytes(4, "little").decode("ascii", "replace")
    return "".join(letter if letter.isprintable() else "?" for letter in text).strip()


MJPEG, JPEG = fourcc("MJPG"), fourcc("JPEG")


class Capability(ctypes.Structure):
    """struct v4l2_capability."""

    _fields_ = (
        ("driver", ctypes.c_char * 16),
        ("card", ctypes.c_char * 32),
        ("bus_info", ctypes.c_char * 32),
        ("version", ctypes.c_uint32),
        ("capabilities", ctypes.c_uint32),
        ("device_caps", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32 * 3),
    )


class FormatDescription(ctypes.Structure):
    """struct v4l2_fmtdesc."""

    _fields_ = (
        ("index", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("description", ctypes.c_char * 32),
        ("pixelformat", ctypes.c_uint32),
        ("mbus_code", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32 * 3),
    )


class PixelFormat(ctypes.Structure):
    """struct v4l2_pix_format."""

    _fields_ = tuple(
        (name, ctypes.c_uint32)
        for name in (
            *("width", "height", "pixelformat", "field", "bytesperline", "sizeimage", "colorspace"),
            *("priv", "flags", "encoding", "quantization", "transfer"),
        )
    )


class _FormatUnion(ctypes.Union):
    """Its largest member has 200 bytes, and one (struct v4l2_window) has pointers, which decides the alignment."""

    _fields_ = (("pix", PixelFormat), ("raw", ctypes.c_uint8 * 200), ("pointer", ctypes.c_void_p))


class Format(ctypes.Structure):
    """struct v4l2_format."""

    _fields_ = (("type", ctypes.c_uint32), ("fmt", _FormatUnion))


class RequestBuffers(ctypes.Structure):
    """struct v4l2_requestbuffers."""

    _fields_ = (
        ("count", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("memory", ctypes.c_uint32),
        ("capabilities", ctypes.c_uint32),
        ("flags", ctypes.c_uint8),
        ("reserved", ctypes.c_uint8 * 3),
    )


class _TimeValue(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_usec", ctypes.c_long))


class _TimeCode(ctypes.Structure):
    _fields_ = (("type", ctypes.c_uint32), ("flags", ctypes.c_uint32), ("rest", ctypes.c_uint8 * 8))


class _BufferPlace(ctypes.Union):
    _fields_ = (("offset", ctypes.c_uint32), ("userptr", ctypes.c_ulong), ("planes", ctypes.c_void_p))


class Buffer(ctypes.Structure):
    """struct v4l2_buffer."""

    _fields_ = (
        ("index", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("bytesused", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("field", ctypes.c_uint32),
        ("timestamp", _TimeValue),
        ("timecode", _TimeCode),
        ("sequence", ctypes.c_uint32),
        ("memory", ctypes.c_uint32),
        ("m", _BufferPlace),
        ("length", ctypes.c_uint32),
        ("reserved2", ctypes.c_uint32),
        ("request_fd", ctypes.c_int32),
    )


class _CaptureParameters(ctypes.Structure):
    _fields_ = (
        ("capability", ctypes.c_uint32),
        ("capturemode", ctypes.c_uint32),
        ("numerator", ctypes.c_uint32),
        ("denominator", ctypes.c_uint32),
    )


class _StreamUnion(ctypes.Union):
    _fields_ = (("capture", _CaptureParameters), ("raw", ctypes.c_uint8 * 200))


class StreamParameters(ctypes.Structure):
    """struct v4l2_streamparm."""

    _fields_ = (("type", ctypes.c_uint32), ("parm", _StreamUnion))


Argument: TypeAlias = ctypes.Structure | ctypes.c_int
"""What a request is handed, and fills in."""


def _request(direction: int, number: int, kind: type[ctypes.Structure] | type[ctypes.c_int]) -> int:
    """_IOC(direction, 'V', number, sizeof(kind)) of asm-generic/ioctl.h."""
    return direction << 30 | ctypes.sizeof(kind) << 16 | ord("V") << 8 | number


_WRITE, _READ = 1, 2
QUERY_CAPABILITY = _request(_READ, 0, Capability)
ENUMERATE_FORMATS = _request(_READ | _WRITE, 2, FormatDescription)
SET_FORMAT = _request(_READ | _WRITE, 5, Format)
REQUEST_BUFFERS = _request(_READ | _WRITE, 8, RequestBuffers)
QUERY_BUFFER = _request(_READ | _WRITE, 9, Buffer)
QUEUE_BUFFER = _request(_READ | _WRITE, 15, Buffer)
DEQUEUE_BUFFER = _request(_READ | _WRITE, 17, Buffer)
STREAM_ON = _request(_WRITE, 18, ctypes.c_int)
STREAM_OFF = _request(_WRITE, 19, ctypes.c_int)
SET_PARAMETERS = _request(_READ | _WRITE, 22, StreamParameters)

"""A simulated Duemilanove on a pseudo-terminal: ATmegaBOOT's side of STK500 version 1, and a program that talks.

The boot loader's answers follow Atmel's application note AVR061.
"""

import os
import pty
import select
import threading
import tty

FLASH_BYTES = 32_768
BOOT_LOADER = range(0x7800, FLASH_BYTES)
IN_SYNC, OK = b"\x14", b"\x10"
SIGNATURE = b"\x1e\x95\x0f"
GET_SYNC = b"0 "
OLD_PROGRAM = b"the classic sketch" * 106
"""As long as the program that the tests write: of the last page avrdude writes back what the program does not fill."""


class Duemilanove:
    """``speech`` maps a program to what it says again and again, any other says ``otherwise`` and its ``counts``.

    ``refused_pages`` writes fail before one succeeds. Unless it is ``held_open``, no process has the device open but
    those that open it.
    """

    def __init__(
        self,
        speech: dict[bytes, bytes],
        *,
        refused_pages: int = 0,
        otherwise: bytes = b"",
        held_open: bool = True,
    ) -> None:
        self.otherwise, self.counts = otherwise, [0, 0]
        self.flash = bytearray(b"\xff" * FLASH_BYTES)
        self.flash[: len(OLD_PROGRAM)] = OLD_PROGRAM
        self.flash[BOOT_LOADER.start :] = b"B" * len(BOOT_LOADER)
        self.heard = b""
        self._speech, self._refused_pages = speech, refused_pages
        self._address = 0
        self._ours, theirs = pty.openpty()
        tty.setraw(self._ours)
        tty.setraw(theirs)
        self._theirs: int | None = theirs
        self.device = os.ttyname(theirs)
        if not held_open:
            os.close(theirs)
            self._theirs = None
        self._wake, self._end = os.pipe()
        self._thread = threading.Thread(target=self._run, name="duemilanove")
        self._thread.start()

    def close(self) -> None:
        """Power it off."""
        os.close(self._end)
        self._thread.join()
        for descriptor in (self._ours, self._theirs, self._wake):
            if descriptor is not None:
                os.close(descriptor)

    def program(self) -> bytes:
        """What is in its flash memory, before the boot loader."""
        return bytes(self.flash[: BOOT_LOADER.start]).rstrip(b"\xff")

    def _run(self) -> None:
        try:
            while True:
                self._run_program()
                self._run_boot_loader()
        except EOFError:
            return

    def _read(self, timeout_s: float | None) -> bytes:
        ready, _, _ = select.select([self._ours, self._wake], [], [], timeout_s)
        if self._wake in ready:
            raise EOFError
        try:
            return os.read(self._ours, 4096) if ready else b""
        except OSError:  # nobody has it open
            if select.select([self._wake], [], [], 0.05)[0]:
                raise EOFError from None
            return b""

    def _run_program(self) -> None:
        """Talk until a programmer comes. The line's opening would reset a real one; a pseudo-terminal has no DTR."""
        while (data := self._read(0.05)) != GET_SYNC:
            self.heard += data
            words = b"" if data else self._speech.get(self.program(), self._otherwise())
            if (
                words and select.select([], [self._ours], [], 0)[1]
            ):  # as a line does, it drops what nobody reads
                os.write(self._ours, words)

    def _otherwise(self) -> bytes:
        return self.otherwise and self.otherwise + b"e\t%d\t%d\n" % tuple(self.counts)

    def _run_boot_loader(self) -> None:
        os.write(self._ours, IN_SYNC + OK)
        data = b""
        while True:
            while (size := _size_of(data)) is None or len(data) < size:
                data += self._read(None)
            command, data = data[:size], data[size:]
            os.write(self._ours, IN_SYNC + self._answer(command) + OK)
            if command[:1] == b"Q":
                return

    def _answer(self, command: bytes) -> bytes:
        match command[:1]:
            case b"A":
                return {0x81: b"\x01", 0x82: b"\x10"}.get(command[1], b"\x03")
            case b"U":
                self._address = 2 * int.from_bytes(command[1:3], "little")
            case b"V":
                return b"\x00"
            case b"d":
                self._write_page(command[4:-1])
            case b"t":
                count = int.from_bytes(command[1:3], "big")
                return bytes(self.flash[self._address : self._address + count])
            case b"u":
                return SIGNATURE
        return b""

    def _write_page(self, page: bytes) -> None:
        if self._refused_pages:
            self._refused_pages -= 1
            page = b"\x00" * len(page)  # verification will see it
        self.flash[self._address : self._address + len(page)] = page


SIZES = {b"A": 3, b"B": 22, b"E": 7, b"U": 4, b"V": 6, b"t": 5}


def _size_of(data: bytes) -> int | None:
    """The length of the command that ``data`` begins with, as far as it can be told."""
    if not data:
        return None
    if data[:1] == b"d":
        return 5 + int.from_bytes(data[1:3], "big") if len(data) >= 3 else None
    return SIZES.get(data[:1], 2)

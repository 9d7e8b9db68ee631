"""The QR code of a link."""


def qr_rows(text: str) -> tuple[str, ...]:
    """The rows of the code, ``1`` for dark, without the quiet zone of four modules around it (ISO/IEC 18004)."""
    import segno

    return tuple("".join(str(int(module)) for module in row) for row in segno.make_qr(text, error="m").matrix)


def terminal_qr(rows: tuple[str, ...] | list[str]) -> str:
    """The code for a terminal with any background: black on white, two rows in a line, with the quiet zone."""
    width = len(rows[0]) + 8
    blank = "0" * width
    framed = [blank] * 4 + [f"0000{row}0000" for row in rows] + [blank] * (4 + len(rows) % 2)
    halves = {"00": " ", "01": "▄", "10": "▀", "11": "█"}
    lines = zip(framed[::2], framed[1::2], strict=True)
    return "\n".join(
        "\x1b[30;107m"
        + "".join(halves[upper + lower] for upper, lower in zip(*line, strict=True))
        + "\x1b[0m"
        for line in lines
    )

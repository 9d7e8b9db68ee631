"""``python -m fuzz TARGET CORPUS... [libFuzzer options]``: look for inputs that break a target's property."""

import sys

import atheris

with atheris.instrument_imports(include=["chefbotd.rpc", "firmware_protocol"]):
    from fuzz.properties import TARGETS


def main() -> None:
    """Fuzz the target named by the first argument; the rest is libFuzzer's."""
    name = sys.argv.pop(1) if len(sys.argv) > 1 else ""
    if name not in TARGETS:
        sys.exit(f"usage: python -m fuzz {'|'.join(TARGETS)} CORPUS... [libFuzzer options]; got {name!r}")
    atheris.Setup(sys.argv, TARGETS[name])
    atheris.Fuzz()


if __name__ == "__main__":
    main()

"""Every input that fuzzing started from or found is a test for good."""

from pathlib import Path

import pytest

from fuzz.properties import TARGETS

VECTORS = Path(__file__).parent.parent / "vectors" / "fuzz"
INPUTS = [(path.parent.name, path) for path in sorted(VECTORS.glob("*/*"))]


@pytest.mark.parametrize(("target", "path"), INPUTS, ids=[f"{t}/{p.name}" for t, p in INPUTS])
def test_no_known_input_breaks_its_target(target: str, path: Path):
    """The property that is fuzzed holds for each input that was ever kept."""
    TARGETS[target](path.read_bytes())


def test_every_target_has_inputs():
    """A target without a corpus would be fuzzed from nothing."""
    assert {target for target, _ in INPUTS} == set(TARGETS)

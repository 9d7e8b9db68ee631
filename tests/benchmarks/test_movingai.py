"""Moving AI's files, read."""

import gzip
from pathlib import Path

import pytest

from benchmarks.movingai import scenarios

MAP = "type octile\nheight 2\nwidth 3\nmap\n.@G\nST.\n"
SCENARIO = "version 1\n0\tx/little.map\t3\t2\t2\t0\t0\t1\t0\n"


@pytest.mark.parametrize("ending", ["", ".gz"])
def test_a_map_and_its_problems_are_read(tmp_path: Path, ending: str) -> None:
    """Points, G and S are free; x is the column, y the row from the top."""
    folder = tmp_path / "deep" / "down"
    folder.mkdir(parents=True)
    for name, text in (("little.map", MAP), ("little.map.scen", SCENARIO)):
        data = text.encode()
        (folder / (name + ending)).write_bytes(gzip.compress(data) if ending else data)
    (found,) = scenarios(tmp_path)
    assert found.name == "little"
    assert found.free.tolist() == [[True, False, True], [True, False, True]]
    (problem,) = found.problems
    assert (problem.start, problem.goal, problem.length) == ((0, 2), (1, 0), 0.0)

"""Sweeps: each run is an outcome, whatever becomes of it."""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from chefbot_devtools.job import Job, Outcome, checked_program, run_job
from chefbot_devtools.report import as_json, summary
from click.testing import CliRunner, Result

from chefbotd.cli.common.exits import ProgramError
from chefbotd.cli.programs.chefbotctl import main

PNG = b"\x89PNG\r\n"
GOOD = """
from chefbotd.core.geometry import Pose2D

def simulated(world, seed):
    return {"start": Pose2D(2.45, 2.6, 2.1)}

async def main(robot):
    await robot.drive_for(1.0, angular_rad_s=0.3)
    return "it turned"
"""
BY_SEED = """
import os, signal, sys, time

def simulated(world, seed):
    if seed == 1:
        raise ValueError("no such start")
    if seed == 2:
        print("about to die", flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)
    if seed == 3:
        sys.exit(3)
    time.sleep(1000)

async def main(robot):
    raise AssertionError
"""
FOR_EVER = GOOD.replace(
    "await robot.drive_for(1.0, angular_rad_s=0.3)", "import asyncio; await asyncio.sleep(1e6)"
)


def never() -> bool:
    """The sweep goes on."""
    return False


def job(source: str, seed: int = 1, *, limit_s: float = 60.0, patience_s: float = 600.0) -> Job:
    """A run in the flat."""
    return Job("program.py", source, "flat", seed, limit_s, patience_s)


def sweep(*words: str) -> Result:
    """The command's output and exit code."""
    return CliRunner().invoke(main, ["sweep", *words])


def test_a_run_that_is_done_says_what_it_returned_and_how_long_it_took() -> None:
    """A second's turn takes 1 to 4 simulated seconds, and the same seed takes exactly as long again."""
    first, again = run_job(job(GOOD), never), run_job(job(GOOD), never)
    assert (first.end, first.text) == ("done", "it turned")
    assert first.simulated_s is not None
    assert 1.0 < first.simulated_s < 4.0
    assert again.simulated_s == first.simulated_s


def test_whatever_a_program_does_is_an_outcome() -> None:
    """It raises, is killed, exits: each is said, with its last line where its process died."""
    raised, killed, left = (run_job(job(BY_SEED, seed), never) for seed in (1, 2, 3))
    assert (raised.end, raised.text) == ("failed", "ValueError: no such start")
    assert (killed.end, killed.text) == (
        "crashed",
        "its process was ended by SIGSEGV; it last printed: about to die",
    )
    assert left.end == "crashed"
    assert left.text.startswith("its process ended with exit code 3")


def test_a_program_that_hangs_is_killed_after_the_patience() -> None:
    """Its process sleeps in real time; so does one whose sweep is ended."""
    assert run_job(job(BY_SEED, 4, patience_s=3.0), never).end == "hung"
    assert run_job(job(BY_SEED, 4), lambda: True).end == "cancelled"


def test_a_program_that_never_ends_is_timed_out_in_the_simulation() -> None:
    """A million simulated seconds would be days."""
    outcome = run_job(job(FOR_EVER, limit_s=5.0), never)
    assert (outcome.end, outcome.text) == ("timed_out", "not done after 5 simulated seconds")
    assert outcome.simulated_s == pytest.approx(5.0, abs=1.0)


def test_a_sweep_goes_on_after_a_crash_and_draws_a_picture(tmp_path: Path) -> None:
    """Three seeds, none is done; each is said with its reason, and the exit code is that of what was not done."""
    (tmp_path / "program.py").write_text(BY_SEED)
    picture = tmp_path / "outcomes.png"
    result = sweep(str(tmp_path / "program.py"), "--seeds", "3", "--jobs", "2", "--plot", str(picture))
    assert result.exit_code == 6
    assert "flat, seed 2: crashed: its process was ended by SIGSEGV" in result.stdout
    assert "3 of 3 runs: 2 crashed, 1 failed" in result.stderr
    assert picture.read_bytes().startswith(PNG)
    again = sweep(str(tmp_path / "program.py"), "--plot", str(picture))
    assert (again.exit_code, "exists already" in again.stderr) == (6, True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("absent.py",), "cannot read absent.py"),
        (("no.such.module",), "there is no module 'no.such.module', and no file"),
        ((__file__, "--plot", "x.pdf"), "expected a name that ends in .png"),
        ((__file__, "--plot", "/no/such/x.png"), "cannot write /no/such/x.png: there is no such folder"),
        ((__file__, "--dask", "tcp://127.0.0.1:9"), "no dask scheduler answers at tcp://127.0.0.1:9"),
    ],
)
def test_what_cannot_be_begun_is_said_first(
    words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before a run."""
    monkeypatch.setattr("chefbot_devtools.sweep.CONNECTS_S", 2.0)
    result = sweep(*words)
    assert result.exit_code != 0
    assert said in result.stderr


def test_without_dask_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The exit code is that of what is not installed, and nothing is run."""
    monkeypatch.setattr("chefbot_devtools.commands.find_spec", lambda name: None)
    result = sweep(__file__, "--dask", "tcp://127.0.0.1:9")
    assert result.exit_code == 7
    assert "pip install './addons/chefbot-devtools[dask]'" in result.stderr


def test_a_file_that_is_no_python_is_said(tmp_path: Path) -> None:
    """With its line."""
    path = tmp_path / "bad.py"
    path.write_text("async def main(robot)\n")
    with pytest.raises(ProgramError, match=r"is no Python program: expected ':' .*line 1"):
        checked_program(str(path))


def test_a_world_that_there_is_not_is_an_outcome() -> None:
    """It names the worlds that there are."""
    outcome = run_job(Job("program.py", GOOD, "castle", 1, 60.0, 100.0), never)
    assert outcome.end == "failed"
    assert "there is no building 'castle'; there are: flat, office" in outcome.text


def test_ctrl_c_ends_the_sweep_and_its_runs(tmp_path: Path) -> None:
    """Exit code 130, and no process of it is left."""
    mark = f"mark-{os.getpid()}.py"
    (tmp_path / mark).write_text(
        "import os\nopen(os.environ['MARK'], 'w').write(str(os.getpid()))\n" + BY_SEED
    )
    told = tmp_path / "pid"
    os.mkfifo(told)
    command = [sys.executable, "-m", "chefbotd.cli.programs.chefbotctl", "sweep", str(tmp_path / mark)]
    process = subprocess.Popen(
        [*command, "--first-seed", "4", "--seeds", "1", "--jobs", "1"],
        env=os.environ | {"MARK": str(told)},
        stderr=subprocess.DEVNULL,
    )
    killer = threading.Timer(60.0, process.kill)
    killer.start()
    run = int(told.read_text())  # waits for the run
    process.send_signal(signal.SIGINT)
    assert process.wait() == 130
    killer.cancel()
    with pytest.raises(ProcessLookupError):
        os.kill(run, 0)


def test_the_same_sweep_on_a_dask_cluster(tmp_path: Path) -> None:
    """A scheduler and a worker on the loopback interface: the outcomes of a local sweep, in its order."""
    distributed = pytest.importorskip("distributed")
    (tmp_path / "program.py").write_text(BY_SEED)
    words = (str(tmp_path / "program.py"), "--seeds", "3", "--json")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        clustered = json.loads(sweep(*words, "--dask", cluster.scheduler_address).stdout)
    local = json.loads(sweep(*words).stdout)
    assert clustered["ends"] == {"failed": 1, "crashed": 2}
    same = ("world", "seed", "end", "text")
    assert [[run[key] for key in same] for run in clustered["runs"]] == [
        [run[key] for key in same] for run in local["runs"]
    ]


def test_the_summary_has_the_commonest_end_first() -> None:
    """And JSON has every run."""
    runs = [Outcome("flat", seed, end, "", None, 1.0) for seed, end in enumerate(["failed", "done", "done"])]
    assert summary(runs) == "2 done, 1 failed"
    assert as_json(runs)["ends"] == {"failed": 1, "done": 2}
    assert as_json(runs)["runs"][0]["seed"] == 0

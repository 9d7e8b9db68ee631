"""The figures of a whole robot: what happens to it is counted, and the dashboard shows only figures that there are."""

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import pytest

from chefbotd.clock import run_virtual
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import simulated_robot

DASHBOARD = Path(__file__).parents[4] / "config" / "grafana_dashboard.json"


async def _with_the_cable_pulled() -> dict[str, Any]:
    """A robot that drives, loses its cable and is asked twice what it has counted, with the first answer forgotten."""
    async with simulated_robot(load(packaged("chefbot_lidar"))) as robot:
        await robot.client.wait_until_armed()
        await robot.client.drive_for(0.5, linear_m_s=0.1)
        robot.device.unplug()
        await asyncio.sleep(0.5)
        return (await robot.client.get_stats()).members


@pytest.fixture(scope="module")
def figures() -> dict[str, Any]:
    """What that robot has counted."""
    return run_virtual(_with_the_cable_pulled())


def test_a_fault_is_counted_once_by_its_name(figures: dict[str, Any]) -> None:
    """However often it is announced afterwards."""
    assert figures["faults"] == {"link_lost": 1}


def test_every_control_step_is_in_the_histogram_of_its_time(figures: dict[str, Any]) -> None:
    """At 20 Hz more than ten steps in half a second of driving."""
    assert sum(figures["control_step_s"].values()) == figures["control_steps"] > 10


def test_the_battery_is_told_in_volts_and_percent(figures: dict[str, Any]) -> None:
    """Between empty (11.4 V) and full (12.9 V), and the percentage on the straight line between."""
    share = (figures["battery_v"] - 11.4) / (12.9 - 11.4)
    assert figures["battery_percentage"] == pytest.approx(100 * share)


@pytest.mark.skipif(not DASHBOARD.exists(), reason="the dashboard is beside the configurations")
def test_the_dashboard_shows_only_figures_that_there_are(figures: dict[str, Any]) -> None:
    """Each by the name that Prometheus' text gives it: counters end in ``_total``, histograms in ``_bucket``."""
    shown = set(re.findall(r"chefbotd_(\w+)\{", DASHBOARD.read_text(encoding="utf-8")))
    assert len(shown) > 15
    for name in shown:
        assert re.sub(r"_(total|bucket)$", "", name) in figures, name
    places = [panel["gridPos"] for panel in json.loads(DASHBOARD.read_text(encoding="utf-8"))["panels"]]
    assert len({(place["x"], place["y"]) for place in places}) == len(places)

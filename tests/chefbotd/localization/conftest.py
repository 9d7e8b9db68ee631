"""The compiled kernels take half a minute to compile where no cache has them: one worker does it for all."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.hookimpl
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put these tests into one group of pytest-xdist's."""
    if not config.pluginmanager.hasplugin("xdist"):
        return
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.xdist_group("kernels"))

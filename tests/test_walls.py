"""The walls of a small house, counted by hand, and what holds in this one."""

from pathlib import Path

from tests.house import ROOT, House
from tests.walls import Walls

FILES = {
    "chefbotd/__init__.py": "",
    "chefbotd/app.py": "def begun():\n    from chefbotd.components.maps.service import serve\n    return serve\n",
    "chefbotd/cli/__init__.py": "",
    "chefbotd/cli/look.py": """\
from chefbotd.components.maps import show
from chefbotd.components.agents.service import ask
""",
    "chefbotd/client/__init__.py": "",
    "chefbotd/client/models.py": "from chefbotd.components.agents.models import Ask\n",
    "chefbotd/components/__init__.py": "",
    "chefbotd/components/agents/__init__.py": "",
    "chefbotd/components/agents/service.py": "from chefbotd.components.maps.service import serve\n",
    "chefbotd/components/agents/models.py": "class Ask: ...\n",
    "chefbotd/components/maps/__init__.py": "",
    "chefbotd/components/maps/service.py": "class Maps:\n    def state(self): ...\n",
    "chefbotd/old/__init__.py": "",
    "chefbotd/old/maps/__init__.py": "",
}


def test_the_imports_of_a_small_house(tmp_path: Path) -> None:
    """Maps is imported by the app and by the command line, agents by the latter alone; maps has two folders."""
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    walls = Walls(House(tmp_path, ("chefbotd",)))
    assert walls.names == ["agents", "maps"]
    assert walls.imports_from_core() == {
        "agents": {"chefbotd.cli.look"},
        "maps": {"chefbotd.app", "chefbotd.cli.look"},
    }
    assert walls.folders(tmp_path) == {"agents": 1, "maps": 2}
    assert walls.bare_participles() == ["chefbotd.app:begun"]
    assert walls.core_lines() == 3
    rows = {name: figure for name, figure, _ in walls.report(tmp_path)}
    assert rows["imports from the core to a component"] == 3
    assert rows["files outside its folder that import a component"] == 2


def test_no_file_below_the_components_imports_one() -> None:
    """Each is found by its name in the one list; what is written of their models is generated."""
    knows = Walls(House(ROOT)).imports_from_core()
    assert {name: modules for name, modules in knows.items() if modules} == {}

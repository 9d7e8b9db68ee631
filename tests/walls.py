"""How far each capability keeps to its own folder, read from the sources; a part of what ``tests.house`` prints."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.house import House

COMPONENTS = "chefbotd.components"
ABOVE = "chefbotd.testing"
"""What stands above the components, by the contract of the layers."""

WRITTEN = frozenset({"chefbotd.client.generated", "chefbotd.client.generated_sync", "chefbotd.client.models"})
"""What ``make client`` writes from the components that there are."""

BESIDE_THE_CORE = ("chefbotd.components", "chefbotd.client", "chefbotd.cli", "chefbotd.testing")
"""What somebody who wants to know how the robot drives need not read."""

PARTICIPLE = re.compile(
    r"[a-z]+ed|begun|made|kept|told|found|known|taken|given|drawn|sent|held|left|put|read|shown|written"
)


class Walls:
    """The imports between the core and the components of a house."""

    def __init__(self, house: House) -> None:
        self._house = house
        self.names = sorted(
            {
                module.split(".")[2]
                for module in house.modules
                if module.startswith(f"{COMPONENTS}.") and module.count(".") > 2
            }
        )

    def imports_from_core(self) -> dict[str, set[str]]:
        """For each component, the modules below all components that import it; written ones are left out."""
        knows: dict[str, set[str]] = {name: set() for name in self.names}
        for module in self._house.modules.values():
            if module.name.startswith((COMPONENTS, ABOVE)) or module.name in WRITTEN:
                continue
            if "components" not in module.text:  # what does not name them imports none
                continue
            for origin, _ in module.imports:
                if origin.startswith(f"{COMPONENTS}.") and (name := origin.split(".")[2]) in knows:
                    knows[name].add(module.name)
        return knows

    def imports_from_above(self) -> int:
        """How many modules above the components import one, each counted once a component."""
        return len(
            {
                (module.name, origin.split(".")[2])
                for module in self._house.modules.values()
                if module.name.startswith(ABOVE)
                for origin, _ in module.imports
                if origin.startswith(f"{COMPONENTS}.")
            }
        )

    def folders(self, root: Path) -> dict[str, int]:
        """For each component, how many packages bear its name."""
        packages = [
            path.parent.name
            for path in (root / "chefbotd").rglob("__init__.py")
            if path.parent.parent != root
        ]
        return {name: packages.count(name) for name in self.names}

    def core_lines(self) -> int:
        """The lines of what drives the robot, with the wire's."""
        return sum(
            module.lines
            for module in self._house.modules.values()
            if not module.name.startswith(BESIDE_THE_CORE)
        )

    def bare_participles(self) -> list[str]:
        """Module functions whose whole name is a participle."""
        return [
            f"{module.name}:{node.name}"
            for module in self._house.modules.values()
            for node in module.tree.body
            if hasattr(node, "args") and PARTICIPLE.fullmatch(getattr(node, "name", "").lstrip("_"))
        ]

    def common_method_names(self) -> dict[str, int]:
        """Names that methods of four classes or more have; special ones are left out."""
        counts = Counter(
            name
            for module in self._house.modules.values()
            for node in module.classes()
            for name in {getattr(inner, "name", "") for inner in node.body if hasattr(inner, "args")}
            if not name.startswith("__")
        )
        return {name: count for name, count in counts.most_common() if count >= 4}

    def report(self, root: Path) -> Iterator[tuple[str, int, str]]:
        """A row for each figure: its name, the figure, and what it is made of."""
        knows = self.imports_from_core()
        free = [name for name, modules in knows.items() if not modules]
        yield "components", len(self.names), ", ".join(self.names)
        yield "components that no file outside imports", len(free), ", ".join(free)
        most = sorted(knows.items(), key=lambda item: -len(item[1]))
        yield (
            "files outside its folder that import a component",
            max(map(len, knows.values())),
            ", ".join(f"{name} {len(modules)}" for name, modules in most if modules),
        )
        imports = sum(map(len, knows.values()))
        yield "imports from the core to a component", imports, f"by {len(set().union(*knows.values()))} files"
        yield "imports from testing, above the components", self.imports_from_above(), ""
        folders = self.folders(root)
        yield "most folders of one component", max(folders.values()), max(folders, key=folders.__getitem__)
        yield "functions that are a bare participle", len(self.bare_participles()), ""
        common = self.common_method_names()
        yield "method names in four classes or more", len(common), ", ".join(list(common)[:8])
        yield "lines that a newcomer to driving reads", self.core_lines(), ""

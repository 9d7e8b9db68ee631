"""How pytest-xdist shares out the tests: by groups of files."""

from typing import Any

from xdist.scheduler import LoadScopeScheduling

from tests.groups import HERE, group_of


class GroupScheduling(LoadScopeScheduling):  # type: ignore[misc]
    """Gives whole groups to the workers: no two tests of the real clock at a time, and one process that compiles."""

    def _split_scope(self, nodeid: Any) -> str:
        return group_of(HERE.parent / str(nodeid).partition("::")[0])

"""The rule about names: what says nothing is refused, wherever it is defined."""

import ast

from tests.names import refused

SOURCE = '''
class Told:
    """A class."""

    found: int

    def each(self, known):
        """A method."""
        told, (self._way, pose) = known, (1, 2)
        return [wanted for wanted in told]


def heading(message):
    """Named for what they are."""
    poses = [message]
    return poses
'''


def test_definitions_that_say_nothing_are_named_with_their_lines() -> None:
    """Classes, functions, parameters, variables and attributes count; the fields of a record and uses do not."""
    assert sorted(refused(ast.walk(ast.parse(SOURCE)))) == [
        (2, "Told"),
        (7, "each"),
        (7, "known"),
        (9, "_way"),
        (9, "told"),
        (10, "wanted"),
    ]

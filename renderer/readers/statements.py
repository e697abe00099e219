"""Define the tables of the fields by which files change how their voxels are understood, one for each format.

The module of a format has its table as `STATEMENTS`. A reader applies an entry, or names it in a note: nothing that a
file states is passed over in silence. The site's page of formats is made from the tables, and a test has a file for
each entry.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from typing import Literal, NamedTuple

# The property of voxels that a field changes: their numbers; their place and direction; whether they are data; or their
# meaning (components, labels, times, units).
Effect = Literal["values", "place", "validity", "meaning"]


class Statement(NamedTuple):
    """A field of a format that changes how voxels are understood.

    field: the name of the field in the standard of the format. effect: the property of voxels that it changes. about: a
    noun phrase for its content, such as `a table of values`, for the note and the documentation. is_applied: whether
    the reader applies it; otherwise a note names it.
    """

    field: str
    effect: Effect
    about: str
    is_applied: bool = True


class FormatTable(NamedTuple):
    """The table of one format: its fields that change how voxels are understood.

    format: the name of the format in the documentation.
    """

    format: str
    statements: tuple[Statement, ...]

    def note(self, found: Container[str]) -> str | None:
        """Return the note that names the statements in a file that are not applied; None if there are none.

        found: the fields of the file that do not have their neutral value.
        """
        listed = [f"{each.field} ({each.about})" for each in self._unapplied() if each.field in found]
        return f"stated by the file and not applied: {', '.join(listed)}" if listed else None

    def _unapplied(self) -> Iterable[Statement]:
        return (each for each in self.statements if not each.is_applied)

"""Write the listing and the moving keys into docs/scene.md: `python tests/pages/scene_page.py`."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from renderer.scene import PATH_EXAMPLES, SECTIONS, join_words, scene_keys, schema

SCENE_PAGE = Path(__file__).resolve().parents[2] / "docs" / "scene.md"
# Each part that is made: the text before it, and the text after it.
_LISTING = ("```yaml\n", "```\n")
_MOVING = ("in place of these keys.\n\n", "\nColours of labels")

_WIDTH = 120
# The column of comments behind values, and the longest line that has its comment behind it.
_COLUMN = 34
_LONGEST = 66
# Sections that scenes have although they may be left out, and a key that is not for the first output.
_SHOWN = ("volume", "transfer_function")
_HIDDEN = ("output.every",)
# Sections with the keys of `volume`, and the keys in them that move as others of their names do.
_LIKE_VOLUME = ("volumes", "mask")
_REPEATED = (*(SECTIONS["volume"].table or {}), *SECTIONS)
# The most words for values in the listing. The formulas of volumes are more, and have a table of their own.
_MOST_WORDS = 12
# A path of several pieces.
_PIECES = "[{type: turntable, seconds: 2}, {type: hold, frames: 20}]"


def scene_page() -> str:
    """Return the page with the parts that follow from the types of all keys."""
    text = SCENE_PAGE.read_text("utf-8")
    for (before, after), lines in ((_LISTING, _listing()), (_MOVING, _moving())):
        head, _, rest = text.partition(before)
        text = f"{head}{before}" + "".join(f"{line}\n" for line in lines) + after + rest.partition(after)[2]
    return text


def _listing() -> Iterator[str]:
    told = _ToldKeys()
    for name, field in sorted(SECTIONS.items(), key=lambda item: item[0] != "version"):
        is_live = field.is_needed or name in _SHOWN
        own = {key: item for key, item in (field.table or {}).items() if key not in _others(name)}
        if field.default is not None:
            yield from _key_lines("", name, schema.yaml_flow(field.default), _text_of(field))
            yield from ["# or with keys:", f"# {name}:"] if own else []
        elif own:
            yield from _key_lines("" if is_live else "# ", name, "", _text_of(field))
        indents = ["  - ", *["    "] * len(own)] if name in ("clip", "volumes") else ["  "] * len(own)
        for indent, (key, item) in zip(indents, own.items(), strict=False):
            for number, value in enumerate(told.news_in(_values(key, item), item)):
                is_shown = is_live and number == 0 and _is_shown(f"{name}.{key}", item)
                text = told.text_of(name, key, item) if number == 0 else ""
                mark = "  # " if is_live and not is_shown else "" if is_live else f"# {indent}"
                yield from _key_lines(mark or indent, key, value, text)
            if key not in SECTIONS:
                start = "" if is_live else "# "
                yield from (each for line in told.of(item) for each in _wrapped(f"{start}  #   ", line))
        yield ""


def _wrapped(start: str, line: str) -> list[str]:
    """Return the lines of a comment, each behind the same start."""
    return [f"{start}{each}" for each in textwrap.wrap(line, _WIDTH - len(start), subsequent_indent="  ")]


class _ToldKeys:
    """The texts on keys, the keys that are needed inside of others, and their words for values. Each is told once."""

    def __init__(self) -> None:
        self._known: set[str] = set()
        self._keys: set[str] = set()
        self._sections: dict[str, str] = {}

    def text_of(self, section: str, key: str, field: schema.FieldType[Any]) -> str:
        """Return the text on a key, or the name of the section in which a key has the same name and text."""
        first = self._sections.setdefault(f"{key}: {_text_of(field)}", section)
        return _text_of(field) if first == section else f"As in `{first}`."

    def news_in(self, values: list[str], field: schema.FieldType[Any]) -> list[str]:
        """Return the values of a key without the mapping whose keys all stand in a mapping before it."""
        keys = set(field.table or {})
        is_known = len(values) > 1 and keys <= self._keys
        self._keys |= keys if len(values) > 1 else set()
        return values[:1] if is_known and keys else values

    def of(self, field: schema.FieldType[Any]) -> Iterator[str]:
        """Yield the lines on keys inside of a key that are not told yet."""
        table = field.table or {}
        needed = [key for key, item in table.items() if item.is_needed]
        lines = [f"needed: {join_words(needed, 'and')}"] if needed else []
        for key, item in table.items():
            words = [] if "black" in item.words else _words_in(item.plain_schema(False))
            lines += [f"{key}: {join_words(words)}"] if 1 < len(words) <= _MOST_WORDS else []
        yield from (line for line in lines if line not in self._known)
        self._known.update(lines)
        for item in table.values():
            yield from self.of(item)


def _words_in(shape: Any) -> list[str]:
    """Return the words for values in a JSON Schema."""
    found = [word for word in shape.get("enum", ()) if isinstance(word, str)]
    return found + [word for each in shape.get("anyOf", ()) for word in _words_in(each)]


def _others(name: str) -> tuple[str, ...]:
    """Return the keys of a section that the listing has in `volume` already."""
    return tuple(SECTIONS["volume"].table or {})[1:] if name in _LIKE_VOLUME else ()


def _is_shown(path: str, field: schema.FieldType[Any]) -> bool:
    """Return whether a key of a section may stand beside all others that are shown."""
    is_first = path in ("volume.file", "transfer_function.points")
    return (field.is_needed or field.default is not None or is_first) and path not in _HIDDEN


def _values(key: str, field: schema.FieldType[Any]) -> list[str]:
    """Return the values of a key in the listing, as YAML: its default or an example, and its other forms."""
    if key == "path":
        return [*PATH_EXAMPLES, _PIECES]
    if key in SECTIONS and field.table:
        return ["[...]" if key == "clip" else "{...}"]
    values = [schema.example_of(field)]
    if field.table and key != "points":
        values.append(f"{{{', '.join(f'{each}: {schema.example_of(item)}' for each, item in field.table.items())}}}")
    return [value for value in dict.fromkeys(values) if len(value) < _WIDTH]


def _text_of(field: schema.FieldType[Any]) -> str:
    """Return whether a key is needed, its text, and its default in words."""
    words = "" if field.text is None else field.text.sentence
    if field.text is not None and field.text.default:
        words += f" Default: {field.text.default}."
    return f"Needed. {words}" if field.is_needed else words


def _key_lines(indent: str, key: str, value: str, words: str) -> Iterator[str]:
    """Yield the lines of a key, its value, and the text on it.

    indent: the text before the key: blanks, and a # where the key is commented out.
    """
    line = f"{indent}{key}: {value}".rstrip()
    start = indent.rpartition("#")[0] + "#" if "#" in indent else ""
    if len(line) > _LONGEST:
        mark = indent if indent.startswith("  #") else f"{indent}# "
        yield from (f"{mark}{each}" for each in textwrap.wrap(words, _WIDTH - 10))
        yield line
        return
    column = max(_COLUMN, len(line) + 2)
    comments = textwrap.wrap(words, _WIDTH - column - 2) or [""]
    yield f"{line:{column}}# {comments[0]}" if comments[0] else line
    yield from (f"{start:{column}}# {each}" for each in comments[1:])


def _moving() -> Iterator[str]:
    by_section: dict[str, list[str]] = {}
    for key, field in scene_keys():
        section, _, rest = key.partition(".")
        is_repeated = section in _LIKE_VOLUME and rest.partition(".")[0] in _REPEATED
        is_color_of_entry = section == "annotation" and "." in rest
        if field.motion is not None and rest and not is_repeated and not is_color_of_entry:
            by_section.setdefault(section, []).append(f"`{rest}`")
    for section, keys in by_section.items():
        yield from textwrap.wrap(f"- `{section}`: {', '.join(keys)}", _WIDTH, subsequent_indent="  ")


if __name__ == "__main__":
    SCENE_PAGE.write_text(scene_page(), "utf-8")

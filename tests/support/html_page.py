"""Parse a page of the program as a browser does, and check the rules that every page keeps."""

from __future__ import annotations

import re
from collections import Counter
from html.parser import HTMLParser

_VOID = {"meta", "img", "br", "hr", "input"}


class Page(HTMLParser):
    """An HTML page: its tags, attributes and texts. An element that is not closed in its place is an AssertionError."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self._open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str, str]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in _VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, self.getpos()

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def values(self, name: str) -> list[str]:
        """Return the values of an attribute in all elements of the page that have it."""
        return [value for _, attribute, value in self.attributes if attribute == name]

    @property
    def prose(self) -> str:
        """Return all words of the page, with single spaces between them."""
        return " ".join(" ".join(self.words).split())


def assert_sound_and_alone(text: str) -> None:
    """Raise AssertionError unless a page is one document that loads nothing and refers only to places in itself."""
    page = Page(text)
    assert page.tags["html"] == page.tags["body"] == page.tags["h1"] == 1
    assert page.tags["link"] == page.tags["iframe"] == page.tags["object"] == page.tags["base"] == 0
    assert page.tags["script"] == 1 and page.values("src") == [v for v in page.values("src") if v.startswith("data:")]
    assert "@import" not in text and "http:" not in text and "https:" not in text
    ids = page.values("id")
    assert len(ids) == len(set(ids))
    references = page.values("href") + page.values("for") + re.findall(r"url\(([^)]*)\)", text)
    assert {reference.removeprefix("#") for reference in references} <= set(ids)


def assert_can_be_heard(text: str) -> None:
    """Raise AssertionError unless screen readers find a text for each picture and a scope for each table heading.

    Pictures that are decoration need no text.
    """
    page = Page(text)
    assert page.tags["img"] == sum(
        tag == "img" and name == "alt" and value != "" for tag, name, value in page.attributes
    )
    assert page.tags["th"] == len(page.values("scope"))
    assert page.tags["svg"] == sum(
        tag == "svg" and name in ("aria-label", "aria-hidden") for tag, name, _ in page.attributes
    )

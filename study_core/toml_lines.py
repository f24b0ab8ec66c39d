"""Where in a TOML text something stands: for messages that lead to a line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

_HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(#.*)?")
_KEY = re.compile(r"\s*([A-Za-z0-9_\-.\"' ]+?)\s*=")
_QUOTES = ('"""', "'''")

Location = tuple[str | int, ...]


def line_of(text: str, location: Sequence[str | int]) -> int | None:
    """Returns the line, from 1, on which something stands, or else what it is part of; None if nothing of it does.

    Args:
        text: A TOML text, valid or nearly so.
        location: Keys, and places in lists from 0.
    """
    found = dict(reversed(list(_entries(text))))
    for end in range(len(location), 0, -1):
        if tuple(location[:end]) in found:
            return found[tuple(location[:end])]
    return None


def _entries(text: str) -> Iterator[tuple[Location, int]]:
    """Gives where tables and keys begin, and on which line."""
    table: Location = ()
    n_of: dict[Location, int] = {}
    closing = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if closing:
            closing = "" if closing in line else closing
            continue
        closing = next((quotes for quotes in _QUOTES if line.count(quotes) == 1), "")
        if header := _HEADER.fullmatch(line):
            table = _placed(_parts(header[2]), n_of, is_list=header[1] == "[[")
            yield table, number
        elif key := _KEY.match(line):
            yield (*table, *_parts(key[1])), number


def _placed(parts: Location, n_of: dict[Location, int], is_list: bool) -> Location:
    """Returns where a table stands, with the places in lists of tables that it is in."""
    placed: Location = ()
    for place, part in enumerate(parts, start=1):
        placed = (*placed, part)
        if is_list and place == len(parts):
            n_of[placed] = n_of.get(placed, -1) + 1
        if placed in n_of:
            placed = (*placed, n_of[placed])
    return placed


def _parts(dotted: str) -> Location:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))

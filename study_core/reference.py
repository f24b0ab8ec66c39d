"""Every setting of a study file as a table, made from what reads the file: the documentation can't differ from it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from study_core.study_file import StudyFile

Json = dict[str, Any]

_LANGUAGE_TABLE = "patternProperties"
_HEADER = "| key | value | without it | meaning |\n| --- | --- | --- | --- |"


def settings_table() -> str:
    """Returns the reference of the study file in Markdown: a table for each of its sections."""
    schema = StudyFile.model_json_schema()
    own = {key: value for key, value in schema["properties"].items() if not _sections_in(value)}
    parts = [_table("At the top of the file", "", {**schema, "properties": own})]
    for key, value in schema["properties"].items():
        for name in _sections_in(value):
            parts += _section_tables(schema["$defs"], _title(key, value), name)
    return "\n\n".join(parts) + "\n"


def _section_tables(definitions: Json, title: str, name: str) -> Iterator[str]:
    section = definitions[name]
    kind = next((value["const"] for value in section["properties"].values() if "const" in value), None)
    yield _table(title if kind is None else f"{title}, {kind}", section.get("description", ""), section)
    for key, value in section["properties"].items():
        for inner in _sections_in(value):
            yield from _section_tables(definitions, f"{title}, {key}", inner)


def _table(title: str, words: str, section: Json) -> str:
    required = set(section.get("required", ()))
    rows = [
        f"| `{key}` | {_value(value)} | {_without(key in required, value)} | {_meaning(value)} |"
        for key, value in section["properties"].items()
        # What kind of section it is, its title says.
        if "const" not in value
    ]
    said = f"\n\n{' '.join(words.split())}" if words else ""
    return f"### {title}{said}\n\n{_HEADER}\n" + "\n".join(rows)


def _title(key: str, value: Json) -> str:
    """Returns how a section is written in the file."""
    if "items" in value:
        return f"`[[{key}]]`"
    if _LANGUAGE_TABLE in value:
        return f"`[[{key}.NAME]]`"
    return f"`[{key}.NAME]`" if "additionalProperties" in value else f"`[{key}]`"


def _sections_in(value: Any) -> list[str]:
    """Returns the names of the sections that a value may be, or be made of."""
    if isinstance(value, dict):
        if "$ref" in value:
            return [value["$ref"].rpartition("/")[2]]
        return [name for part in value.values() for name in _sections_in(part)]
    return [name for part in value for name in _sections_in(part)] if isinstance(value, list) else []


def _value(value: Json) -> str:
    """Returns what a setting may be, in words."""
    for several in ("anyOf", "oneOf"):
        if several in value:
            kinds = [_value(one) for one in value[several] if one.get("type") != "null"]
            return " or ".join(dict.fromkeys(kinds))
    if "const" in value or "enum" in value:
        return ", ".join(f"`{json.dumps(one)}`" for one in value.get("enum", [value.get("const")]))
    if value.get("type") == "array":
        return f"list of {_value(value['items'])}"
    return _KINDS[_kind(value)] + _limits(value)


_KINDS = {
    "string": "text",
    "integer": "whole number",
    "number": "number",
    "boolean": "`true` or `false`",
    "date-time": "moment with its offset",
    "name": "name: small letters, digits, hyphens",
    "languages": "one text for each language",
    "object": "table",
    "section": "table",
}


def _kind(value: Json) -> str:
    if "$ref" in value:
        return "section"
    if value.get("type") == "object":
        return "languages" if _LANGUAGE_TABLE in value else "object"
    is_name = str(value.get("pattern", "")).startswith("^[a-z0-9]")
    return "name" if is_name else str(value.get("format", value["type"]))


def _limits(value: Json) -> str:
    limits = (
        ("minimum", "at least"),
        ("exclusiveMinimum", "above"),
        ("maximum", "at most"),
        ("exclusiveMaximum", "below"),
    )
    said = [f"{words} {value[key]:g}" for key, words in limits if key in value]
    return f", {', '.join(said)}" if said else ""


def _without(is_required: bool, value: Json) -> str:
    if is_required:
        return "required"
    default = value.get("default")
    if default is None or default in ([], {}) or _sections_in(value):
        return ""
    return f"`{json.dumps(default)}`"


def _meaning(value: Json) -> str:
    return str(value.get("description", "")).replace("|", "\\|")

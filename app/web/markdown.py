"""A study's texts, written in Markdown, as HTML that can do no harm."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

_SAFE_LINK = re.compile(r"(https?|mailto):", re.IGNORECASE)
_LINK = {"target": "_blank", "rel": "noopener noreferrer"}
_SMALLEST_HEADING = 6


def render_markdown(text: str, values: Mapping[str, str] | None = None) -> Markup:
    """Returns a text as HTML.

    HTML in the text is shown, not obeyed, and there are no images. A link leads to the web or to a mail address, in a
    window of its own, which learns nothing of this one. Headings are one level lower than in the text, because the
    page has a title already.

    Args:
        text: CommonMark. `{name}` stands for a value; braces around any other word stay as they are.
        values: What the text may name, e.g. `{"duration": "12 minutes"}`; shown as it is, whatever it holds.
    """
    tokens = _MARKDOWN.parse(text)
    for token in _all_tokens(tokens):
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1:]) + 1, _SMALLEST_HEADING)}"
        elif token.type == "link_open":
            token.attrs.update(_LINK)
        elif token.type == "text":
            token.content = _filled(token.content, values or {})
    return Markup(_MARKDOWN.renderer.render(tokens, _MARKDOWN.options, {}))


def _all_tokens(tokens: list[Token]) -> Iterator[Token]:
    for token in tokens:
        yield token
        yield from token.children or []


def _filled(text: str, values: Mapping[str, str]) -> str:
    return re.sub(r"\{(\w+)\}", lambda name: values.get(name[1], name[0]), text)


def _safe_markdown() -> MarkdownIt:
    markdown = MarkdownIt("commonmark", {"html": False}).disable("image")
    markdown.validateLink = lambda url: _SAFE_LINK.match(url) is not None  # type: ignore[method-assign]
    return markdown


_MARKDOWN = _safe_markdown()

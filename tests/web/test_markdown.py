"""Texts of a study become HTML that can do no harm, whatever they hold."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from app.settings import STATIC
from app.web.markdown import render_markdown

# What Markdown has words for, apart from images.
TAGS = {
    "p",
    "h2",
    "h3",
    "h4",
    "h5",
    "h6",
    "em",
    "strong",
    "a",
    "ul",
    "ol",
    "li",
    "blockquote",
    "code",
    "pre",
    "hr",
    "br",
}
ATTRIBUTES = {
    "a": {"href", "title", "target", "rel"},
    "ol": {"start"},
    "code": {"class"},
}
INJECTIONS = [
    "<script>alert(1)</script>",
    "text <img src=x onerror=alert(1)>",
    "[a](javascript:alert(1))",
    "[a](JaVaScRiPt:alert(1))",
    "[a](\x01javascript:alert(1))",
    "[a](java&#10;script:alert(1))",
    "[a](data:text/html;base64,PHNjcmlwdD4=)",
    "[a](vbscript:x) [b](file:///etc/passwd) [c](//elsewhere.example) [d](/join/quickstart)",
    '[a](https://x.example "\\" onclick=\\"alert(1)")',
    "![a](https://x.example/a.png)",
    "<javascript:alert(1)>",
    "<https://x.example/\"onclick='alert(1)'>",
    "&lt;script&gt;alert(1)&lt;/script&gt;",
    "```html\n<script>alert(1)</script>\n```",
    '``` "><script>alert(1)</script>\n```',
    "[a]: javascript:alert(1)\n\n[a]",
    "# <svg onload=alert(1)>",
    "<!-- --> <style>*{}</style> <iframe src=//x.example>",
]


class Reader(HTMLParser):
    """Remembers every element of a piece of HTML, as a browser's parser sees it."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        # As a browser gets it: `Markup` would escape what the parser joins to it.
        self.feed(str(html))
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data


def assert_harmless(html: str) -> None:
    for tag, attributes in Reader(html).elements:
        assert tag in TAGS, html
        assert set(attributes) <= ATTRIBUTES.get(tag, set()), html
        if tag == "a":
            assert str(attributes["href"]).lower().startswith(("http:", "https:", "mailto:"))
            assert attributes["rel"] == "noopener noreferrer"
            assert attributes["target"] == "_blank"


@pytest.mark.parametrize("text", INJECTIONS)
def test_a_script_in_a_text_is_shown_and_not_obeyed(text: str) -> None:
    assert_harmless(render_markdown(text))
    assert_harmless(render_markdown("{name}", {"name": text}))


@given(st.text(alphabet="<>[]()!\"'&;:/\\`*_#- \n\tabhijkpst=x1.{}", max_size=80))
@example("<a\nhref=x>")
def test_no_text_at_all_does_harm(text: str) -> None:
    assert_harmless(render_markdown(text))


@given(st.text(alphabet="<>[]()!\"'&;:/\\`*_#-aj=x1.{}", min_size=1, max_size=40))
def test_a_value_is_shown_as_it_is(value: str) -> None:
    assert Reader(render_markdown("a {value} b", {"value": value})).text == f"a {value} b\n"


def test_html_is_readable_as_it_was_written() -> None:
    assert Reader(render_markdown("a <b>bold</b> word")).text == "a <b>bold</b> word\n"


def test_headings_leave_the_first_level_to_the_page() -> None:
    html = render_markdown("# One\n\n## Two\n\n###### Six\n\nAlso one\n===")
    assert [tag for tag, _ in Reader(html).elements] == ["h2", "h3", "h6", "h2"]
    assert "<h2>One</h2>" in html


def test_links_to_the_web_and_to_mail_addresses_open_beside_the_page() -> None:
    html = render_markdown("[a](https://x.example/?q=1&r=2) <me@x.example> [b](HTTP://x.example)")
    links = [attributes["href"] for tag, attributes in Reader(html).elements if tag == "a"]
    assert links == ["https://x.example/?q=1&r=2", "mailto:me@x.example", "HTTP://x.example"]
    assert_harmless(html)


def test_values_are_filled_in_where_the_text_names_them() -> None:
    filled = render_markdown(
        "**{questions}** pairs, {duration}, {other}", {"questions": "12", "duration": "3 min"}
    )
    assert filled == "<p><strong>12</strong> pairs, 3 min, {other}</p>\n"


def test_braces_stay_where_nothing_is_to_be_filled_in() -> None:
    assert render_markdown("{questions}") == "<p>{questions}</p>\n"


@pytest.mark.parametrize("path", sorted((STATIC / "texts").glob("*.md")), ids=lambda path: path.name)
def test_the_texts_that_ship_are_plain_markdown(path: Path) -> None:
    assert_harmless(render_markdown(path.read_text(encoding="utf-8")))

"""The page holds everything it shows, and every part of it can be told from every other."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest

from app.report.page import Illustration, Report, Section, render
from study_core.evaluation.figures.style import belongs_to, finish, new_figure


def illustration(name: str) -> Illustration:
    figure = new_figure(4.0, 2.0)
    axes = figure.subplots()
    for place, person in enumerate(("1", "2")):
        (line,) = axes.plot([0, 1], [place, place])
        (dot,) = axes.plot([0.5], [place], "o")
        belongs_to(line, person)
        belongs_to(dot, person)
    finish(axes, f"Title of {name}", "x")
    return Illustration(
        name, f"About {name}", "A caption & more.", "The paper's.", figure, ("a", "b"), [("1", 0.12345)]
    )


@pytest.fixture(scope="module")
def page() -> str:
    return render(
        Report(
            title="A <title>",
            summary=["What was found."],
            people=["1", "2"],
            sections=[
                Section(
                    "Scores",
                    ("Words.",),
                    ("predictor", "accuracy"),
                    [("best", 0.75), ("other", None)],
                    "best",
                )
            ],
            illustrations=[illustration("first"), illustration("second")],
            method=[Section("Method", ("How.",))],
            versions={"python": "3"},
        )
    )


def test_nothing_is_fetched(page: str) -> None:
    assert not re.search(r'(src|href)="(?!#)', page)
    assert not re.search(r"@import|url\((?!#)", page)
    assert "default-src 'none'" in page


def test_no_id_is_there_twice(page: str) -> None:
    ids = re.findall(r'\sid="([^"]+)"', page)
    assert len(ids) > 10
    assert len(set(ids)) == len(ids)


def test_every_reference_leads_somewhere(page: str) -> None:
    ids = set(re.findall(r'\sid="([^"]+)"', page))
    used = set(re.findall(r'href="#([^"]+)"', page)) | set(re.findall(r"url\(#([^)]+)\)", page))
    assert used
    assert used <= ids


def test_each_person_can_be_pointed_at_in_each_figure(page: str) -> None:
    for person in "12":
        assert page.count(f'data-person="{person}"') == 2 * 2 + 1  # two artists in each figure, and a button


def test_words_are_escaped_numbers_rounded_and_what_is_missing_is_empty(page: str) -> None:
    assert "A &lt;title&gt;" in page
    assert "A caption &amp; more." in page
    assert "<td>0.123</td>" in page
    assert '<tr><th scope="row">other</th><td></td></tr>' in page
    assert '<tr class="emphasised"><th scope="row">best</th><td>0.750</td></tr>' in page


def test_text_in_figures_stays_text(page: str) -> None:
    assert "Title of first" in page


def test_equal_reports_are_equal_bytes() -> None:
    reports = [Report("t", ["s"], ["1"], [], [illustration("one")], [], {}) for _ in range(2)]
    assert render(reports[0]) == render(reports[1])


def test_every_element_is_closed(page: str) -> None:
    open_elements: list[str] = []

    class Nesting(HTMLParser):
        def handle_starttag(self, tag: str, attrs: object) -> None:
            if tag not in ("meta", "br", "img", "link"):
                open_elements.append(tag)

        def handle_startendtag(self, tag: str, attrs: object) -> None:
            pass

        def handle_endtag(self, tag: str) -> None:
            assert open_elements.pop() == tag

    Nesting().feed(page)
    assert open_elements == []

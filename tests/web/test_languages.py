"""The words of the pages exist in every language, in the person's own, whoever asks at the same time."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
from babel.messages import Catalog
from babel.messages.frontend import CommandLineInterface
from babel.messages.pofile import read_po
from fastapi import Request
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import DictLoader

from app.settings import ROOT, STATIC
from app.web.languages import (
    CATALOGUES,
    choose_language,
    format_minutes,
    format_number,
    interface_languages,
    text_direction,
    translator,
)
from app.web.pages import requested_language, templates

TRANSLATIONS = [language for language in interface_languages() if language != "en"]
PLACEHOLDER = re.compile(r"%\(\w+\)\w|%%|\{\w+\}|</?\w+[^>]*>")
TEMPLATES = sorted((STATIC / "templates").glob("*.html"))
# The tags of a template, what stands in a class attribute, and what they leave of a page.
FILLED_IN = {
    r"\{#.*?#\}": "",
    r"\{% trans.*?endtrans %\}": "",
    r"\{% block \w*class %\}.*?\{% endblock %\}": "",
    r"\{%.*?%\}": "",
    r"\{\{.*?\}\}": "x ",
}
REMEDY = "Run `make messages` and translate what is new in static/locale."


def request(query: str = "", accept_language: str | None = None) -> Request:
    headers = [] if accept_language is None else [(b"accept-language", accept_language.encode())]
    return Request({"type": "http", "query_string": query.encode(), "headers": headers})


def rendered(source: str, asking: Request, **context: object) -> str:
    """What the site's own templates make of a template's source."""
    environment = templates.env.overlay(loader=DictLoader({"page.html": source}))
    for processor in templates.context_processors:
        context |= processor(asking)
    return environment.get_template("page.html").render(context)


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> Catalog:
    """Everything that the templates and the code say, extracted as `make messages` does."""
    output = tmp_path_factory.mktemp("messages") / "prefstudy.pot"
    command = ["pybabel", "-q", "extract", "--mapping", str(ROOT / "pyproject.toml"), "--output", str(output)]
    CommandLineInterface().run([*command, str(ROOT)])
    with output.open("rb") as file:
        return read_po(file)


def catalogue(language: str) -> Catalog:
    folder = language.replace("-", "_")
    with (CATALOGUES / folder / "LC_MESSAGES" / "prefstudy.po").open("rb") as file:
        return read_po(file, locale=folder, abort_invalid=True)


def test_german_ships() -> None:
    assert interface_languages() == ("en", "de")


@pytest.mark.parametrize("language", TRANSLATIONS)
def test_everything_that_is_said_is_in_the_catalogue_and_nothing_else(said: Catalog, language: str) -> None:
    translated = {message.id for message in catalogue(language) if message.id}
    assert {message.id for message in said if message.id} == translated, REMEDY


@pytest.mark.parametrize("language", TRANSLATIONS)
def test_every_message_is_translated_and_not_just_guessed(language: str) -> None:
    open_ones = [
        message.id
        for message in catalogue(language)
        if message.id and (message.fuzzy or not all(forms_of(message.string)))
    ]
    assert open_ones == [], REMEDY


@pytest.mark.parametrize("language", TRANSLATIONS)
def test_a_translation_has_the_placeholders_and_tags_of_its_original(language: str) -> None:
    for message in catalogue(language):
        if message.id:
            one, *many = forms_of(message.id)
            for form in forms_of(message.string):
                assert placeholders(form) in [placeholders(original) for original in (one, *many)], form


@pytest.mark.parametrize("language", TRANSLATIONS)
def test_a_translation_is_set_with_the_marks_of_print(language: str) -> None:
    said = [form for message in catalogue(language) if message.id for form in forms_of(message.string)]
    assert [form for form in said if re.search(r"[\"']|\.\.\.| - ", PLACEHOLDER.sub("", form))] == []


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.name)
def test_a_template_says_nothing_that_is_not_translated(template: Path) -> None:
    """What is left of a page without Jinja's tags holds no word, in its text or in what screen readers say."""
    source = template.read_text(encoding="utf-8")
    for said_by_jinja, instead in FILLED_IN.items():
        source = re.sub(said_by_jinja, instead, source, flags=re.DOTALL)
    assert Words(source).words == []


class Words(HTMLParser):
    """Collects the words of a page: its text, and the attributes that are shown or spoken."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        spoken = ("alt", "aria-label", "aria-valuetext", "aria-description", "placeholder", "title")
        for name, value in attrs:
            if name in spoken:
                self.handle_data(value or "")

    def handle_data(self, data: str) -> None:
        self.words += re.findall(r"[^\W\d_]{2,}", data)


def forms_of(text: object) -> tuple[str, ...]:
    """A message's singular and plural forms, or the only one."""
    return tuple(text) if isinstance(text, list | tuple) else (str(text),)


def placeholders(text: str) -> list[str]:
    return sorted(PLACEHOLDER.findall(text))


def test_the_catalogue_holds_no_compiled_form() -> None:
    assert [path for path in Path(CATALOGUES).rglob("*") if path.is_file() and path.suffix != ".po"] == []


def test_a_language_without_a_catalogue_speaks_english() -> None:
    assert translator("fr").gettext("Preference study") == "Preference study"
    assert translator("de").gettext("This isn’t in any catalogue") == "This isn’t in any catalogue"


def test_a_regional_language_finds_the_catalogue_of_its_language() -> None:
    assert translator("de-AT").gettext("Preference study") == translator("de").gettext("Preference study")
    assert translator("de-AT").gettext("Preference study") != "Preference study"


@pytest.mark.parametrize("language", ["ar", "he", "fa", "ur"])
def test_arabic_and_hebrew_scripts_run_from_right_to_left(language: str) -> None:
    assert text_direction(language) == "rtl"


@pytest.mark.parametrize("language", ["en", "de", "pt-BR", "zh-Hant", "xx", "not a language"])
def test_everything_else_runs_from_left_to_right(language: str) -> None:
    assert text_direction(language) == "ltr"


def test_numbers_are_written_as_the_language_writes_them() -> None:
    assert format_number(1234.5, "en") == "1,234.5"
    assert format_number(1234.5, "de") == "1.234,5"
    assert rendered("{{ n | number }}", request("lang=de"), n=1200) == "1.200"


def test_a_duration_is_said_in_words() -> None:
    assert format_minutes(12, "en") == "12 minutes"
    assert format_minutes(1, "de") == "1 Minute"


@pytest.mark.parametrize(
    ("wanted", "accepted", "chosen"),
    [
        (None, None, "en"),
        (None, "de", "de"),
        (None, "de-CH, en;q=0.5", "de"),
        (None, "en;q=0.5, de;q=0.9", "de"),
        (None, "fr, de;q=0, en;q=0.1", "en"),
        (None, "fr;q=0.9, *;q=0.5", "en"),
        ("de", "en", "de"),
        ("DE", "en", "de"),
        ("fr", "de", "de"),
        ("", "de", "de"),
    ],
)
def test_the_persons_own_choice_comes_before_the_browsers(
    wanted: str | None, accepted: str | None, chosen: str
) -> None:
    assert choose_language(wanted, accepted, ["en", "de"]) == chosen


@given(st.text(max_size=200), st.text(max_size=200))
def test_whatever_is_asked_for_an_available_language_is_chosen(wanted: str, accepted: str) -> None:
    assert choose_language(wanted, accepted, ["en", "de"]) in ("en", "de")


def test_the_studys_first_language_is_the_default() -> None:
    assert requested_language(request(accept_language="fr"), ("de", "en")) == "de"
    assert requested_language(request("lang=en", "de"), ("de", "en")) == "en"


def test_pages_in_two_languages_are_made_at_the_same_time() -> None:
    source = "{{ lang }} {{ _('Preference study') }}"
    languages = ["en", "de"] * 200
    with ThreadPoolExecutor(8) as threads:
        pages = threads.map(lambda language: rendered(source, request(f"lang={language}")), languages)
    for language, page in zip(languages, pages, strict=True):
        assert page == f"{language} {translator(language).gettext('Preference study')}"


def test_what_is_filled_into_a_message_is_escaped() -> None:
    page = rendered("{{ _('Hello %(name)s', name=name) }}", request(), name="<script>alert(1)</script>")
    assert page == "Hello &lt;script&gt;alert(1)&lt;/script&gt;"


def test_a_page_says_its_language_and_direction() -> None:
    asking = request()
    asking.state.language = "ar"
    page = templates.TemplateResponse(asking, "base.html").body.decode()
    assert '<html lang="ar" dir="rtl">' in page


def test_an_error_speaks_the_browsers_language(client: httpx.Client) -> None:
    headers = {"Accept": "text/html", "Accept-Language": "de-CH, de;q=0.9, en;q=0.8"}
    page = client.get("/nothing/here", headers=headers).text
    assert '<html lang="de" dir="ltr">' in page
    assert translator("de").gettext("There is nothing here") in page
    assert "There is nothing here" in client.get("/nothing/here", headers={"Accept": "text/html"}).text


def test_a_study_is_only_shown_in_its_own_languages(client: httpx.Client) -> None:
    page = client.get("/join/quickstart?lang=de", headers={"Accept-Language": "de"}).text
    assert '<html lang="en" dir="ltr">' in page


def test_a_label_of_somebody_elses_domain_is_shown_as_it_is() -> None:
    own = SimpleNamespace(shares={"100 % <fast>": 0.6, "Driving straight ahead": 0.4})
    result = SimpleNamespace(own=own, others=None)
    page = templates.get_template("result.html").render(
        result=result, pictures=[], translator=translator("de"), lang="de"
    )
    assert "100 % &lt;fast&gt;" in page
    assert "Geradeaus fahren" in page

"""The report's page: one HTML file without anything to fetch, its pictures as SVG that a reader can point at."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from app.settings import STATIC
from study_core.evaluation.figures.style import PERSON_PREFIX

_FOLDER = STATIC / "report"
_PIXELS_PER_INCH = 106

# Text stays text: it can be searched, read aloud and selected. One salt for all ids: equal reports are equal bytes.
_SVG_SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "prefstudy",
    "font.family": "sans-serif",
}


@dataclass(frozen=True)
class Illustration:
    """A figure with its words and the numbers behind it.

    Attributes:
        name: Unique in the report; part of the ids of what the figure shows.
        title: What it is about.
        caption: What it shows, and how.
        paper: Which of the paper's figures it stands beside and what that one is said to show; empty if none.
        figure: The drawing.
        columns: Names of the columns of the numbers behind it.
        rows: These numbers.
    """

    name: str
    title: str
    caption: str
    paper: str
    figure: Figure
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Section:
    """Part of the report in words and tables.

    Attributes:
        title: Its heading.
        paragraphs: Plain text.
        columns: Of its table.
        rows: Of its table; none if there is no table.
        emphasised: First cell of the row that matters most.
    """

    title: str
    paragraphs: Sequence[str]
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[Any]] = ()
    emphasised: str = ""


@dataclass(frozen=True)
class Report:
    """Everything on the page.

    Attributes:
        title: Of the page.
        summary: What was found, in a few sentences.
        people: Names of the people, who can be pointed at in every figure.
        sections: Before the figures.
        illustrations: In order.
        method: After the figures: how it was done, with what, from what.
        versions: Names and versions of what took part, hashes of what it was computed from.
    """

    title: str
    summary: Sequence[str]
    people: Sequence[str]
    sections: Sequence[Section]
    illustrations: Sequence[Illustration]
    method: Sequence[Section]
    versions: Mapping[str, str]


def render(report: Report) -> str:
    """Returns the page."""
    environment = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = _number
    return environment.get_template("report.html").render(
        report=report,
        pictures={one.name: Markup(svg(one.name, one.figure)) for one in report.illustrations},
        style=Markup((_FOLDER / "report.css").read_text(encoding="utf-8")),
        script=Markup((_FOLDER / "report.js").read_text(encoding="utf-8")),
    )


def svg(name: str, figure: Figure) -> str:
    """Returns a figure as an SVG element whose ids no other figure of the page has."""
    with mpl.rc_context(_SVG_SETTINGS), io.StringIO() as text:
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
        element = text.getvalue()
    element = element[element.index("<svg") :]
    # A person may have several parts of a figure, and an id may be there only once.
    element = element.replace(f'id="{PERSON_PREFIX}', 'data-person="')
    # matplotlib names its own parts anew in each file: figure_1, axes_1, m1234abcd, ...
    element = re.sub(r'(?<!-)id="', f'id="{name}--', element)
    element = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}--", element)
    # Its text as large as the page's, or smaller where the page is narrow.
    width = figure.get_figwidth() * _PIXELS_PER_INCH
    style = f'style="max-width: {width:.0f}px"'
    return re.sub(r'<svg ([^>]*?)width="[^"]*" height="[^"]*"', rf"<svg \1{style}", element, count=1)


def _number(value: Any) -> str:
    """Writes a cell: numbers to three places, everything else as it is."""
    if isinstance(value, float):
        return f"{value:.3f}"
    return "" if value is None else str(value)

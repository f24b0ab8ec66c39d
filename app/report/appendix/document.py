"""The appendix as a document: Markdown, which papers' tools read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from app.errors import AppError
from app.report.appendix.record import read_people
from app.report.appendix.tables import appendix
from app.report.page import Section
from app.store import Source, Store


class NothingToReportError(AppError):
    """A study in which nobody has taken part."""


def appendix_sections(store: Store, study_name: str, source: Source = Source.JOINED) -> list[Section]:
    """Returns the appendix of a study.

    Args:
        store: Where the answers are.
        study_name: The study, in all its versions.
        source: Whose sessions it is about.

    Raises:
        NothingToReportError: Nobody of these has taken part.
    """
    people = read_people(store, study_name, source)
    if not people:
        raise NothingToReportError(
            f"Expected {source} people in the study '{study_name}', found nobody. Check the name, and whether real or "
            "rehearsed people are meant."
        )
    return appendix(people)


def appendix_of(store: Store, study_names: Iterable[str]) -> list[Section]:
    """Returns the appendix of each of these studies in which real people took part here."""
    sections = []
    for name in study_names:
        people = read_people(store, name, Source.JOINED)
        sections += appendix(people) if people else []
    return sections


def as_markdown(title: str, sections: Sequence[Section]) -> str:
    """Returns sections as one Markdown document."""
    parts = [f"# {title}"]
    for section in sections:
        parts += [f"## {section.title}", *section.paragraphs]
        if section.rows:
            parts.append("\n".join(_row(row) for row in (section.columns, _rule(section), *section.rows)))
    return "\n\n".join(parts) + "\n"


def _rule(section: Section) -> list[str]:
    return ["---"] * len(section.columns)


def _row(cells: Sequence[object]) -> str:
    return "| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"

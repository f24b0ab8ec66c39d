"""What the monitor shows of a study: who is listed, in which order, and how numbers are spread."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from statistics import median

from markupsafe import Markup

from app.desk import charts
from app.services.monitor import Person
from app.store import Source

PEOPLE: Mapping[str, tuple[Source, ...]] = {
    "joined": (Source.JOINED,),
    "rehearsed": (Source.REHEARSED,),
    "imported": (Source.IMPORTED,),
    "all": tuple(Source),
}
"""Kinds of people, by what an address calls them; the first unless told."""

SHOWN: Mapping[str, tuple[str, Callable[[Person], bool]]] = {
    "everyone": ("Everyone", lambda person: True),
    "under-way": ("Under way", lambda person: not person.is_over),
    "completed": ("Completed", lambda person: person.has_completed),
    "left": ("Ended early", lambda person: person.is_over and not person.has_completed),
    "signs": ("With a sign of trouble", lambda person: bool(person.signs)),
    "not-counted": ("Rejected or excluded", lambda person: not person.counts),
}
"""Who is listed, by what an address calls it."""

_FEWEST_FOR_A_PICTURE = 2


@dataclass(frozen=True)
class Column:
    """A column of the table of people.

    Attributes:
        label: Its heading.
        key: What it is sorted by; people without are last.
        title: What it means, where the heading is short.
    """

    label: str
    key: Callable[[Person], float | str | None]
    title: str = ""


COLUMNS: Mapping[str, Column] = {
    "number": Column("Person", lambda person: person.number),
    "where": Column("Where", lambda person: person.where),
    "answers": Column("Answers", lambda person: person.line.n_answers),
    "accuracy": Column("Held out", lambda person: person.accuracy, "Share of test answers predicted so far"),
    "r-hat": Column("R-hat", lambda person: person.line.r_hat, "The worst of the last posterior"),
    "ess": Column("ESS", lambda person: person.line.ess, "Least effective sample size of the last posterior"),
    "response": Column("Response", lambda person: person.response_s, "Mean response time of an answer"),
    "waits": Column(
        "Waits", lambda person: person.line.waited_ms, "How often and long they waited for a question"
    ),
    "away": Column("Away", lambda person: person.line.focus_losses, "How often the page was hidden"),
    "repeats": Column(
        "Repeats",
        lambda person: (
            person.line.n_repeats_agreed / person.line.n_repeats if person.line.n_repeats else None
        ),
        "Repeated questions answered as before",
    ),
    "first": Column(
        "First", lambda person: person.first_share, "Share of answers that chose what stood first"
    ),
    "taken": Column(
        "Taken", lambda person: _seconds(person.taken), "From the beginning to the last thing that happened"
    ),
    "seen": Column(
        "Last seen", lambda person: person.line.last_at.isoformat() if person.line.last_at else None
    ),
}
"""By what an address calls them."""


@dataclass(frozen=True)
class Spread:
    """How a number is spread over people.

    Attributes:
        label: What it is.
        median: In words.
        n: Of how many people.
        picture: None for too few.
    """

    label: str
    median: str
    n: int
    picture: Markup | None


def listed(people: Iterable[Person], shown: str, find: str, order: str) -> list[Person]:
    """Returns the people that a table shows, in its order.

    Args:
        people: All.
        shown: A key of `SHOWN`; everyone for anything else.
        find: What their number or external id contains.
        order: A key of `COLUMNS`, after a minus for the largest first; by number for anything else.
    """
    _, wanted = SHOWN.get(shown, SHOWN["everyone"])
    found = [person for person in people if wanted(person) and (not find or _is_called(person, find))]
    column = COLUMNS.get(order.removeprefix("-"), COLUMNS["number"])
    keyed = [(column.key(person), person) for person in found]
    known = sorted(
        (pair for pair in keyed if pair[0] is not None),
        key=lambda pair: (pair[0], pair[1].number),
        reverse=order.startswith("-"),
    )
    return [person for _, person in known] + [person for key, person in keyed if key is None]


def spreads(people: Sequence[Person]) -> list[Spread]:
    """Returns how people's numbers are spread; who is rejected or excluded doesn't count."""
    counted = [person for person in people if person.counts]
    accuracies = [person.accuracy for person in counted if person.accuracy is not None]
    responses = [person.response_s for person in counted if person.response_s is not None]
    firsts = [person.first_share for person in counted if person.first_share is not None]
    taken = [(_seconds(person.taken) or 0.0) / 60.0 for person in counted if person.has_completed]
    return [
        _spread("Held-out accuracy so far", accuracies, charts.of_shares()),
        _spread("Mean response time", responses, charts.up_to(max(responses, default=1.0), _in_seconds)),
        _spread("Share of first choices", firsts, charts.of_shares()),
        _spread("Time taken to complete", taken, charts.up_to(max(taken, default=1.0), _in_minutes)),
    ]


def _spread(label: str, values: list[float], scale: charts.Scale) -> Spread:
    if len(values) < _FEWEST_FOR_A_PICTURE:
        return Spread(label, scale.written(values[0]) if values else "", len(values), None)
    picture = charts.histogram(values, label, scale)
    return Spread(label, scale.written(median(values)), len(values), picture)


def _is_called(person: Person, find: str) -> bool:
    external = person.line.external
    return find == str(person.number) or (external is not None and find in external.external_id)


def _seconds(length: timedelta | None) -> float | None:
    return None if length is None else length.total_seconds()


def _in_seconds(seconds: float) -> str:
    return f"{seconds:.2g} s"


def _in_minutes(minutes: float) -> str:
    return f"{minutes:.2g} min"

"""The appendix's tables, each from the people's records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from app.report.appendix.record import PersonRecord
from app.report.appendix.statistics import counts, moments, share, spread
from app.report.page import Section
from app.store import Source
from app.versions import versions_of
from study_core.events import LanguageChosen
from study_core.path import ChoiceItem, Ending, Item, TextItem, questionnaire_of
from study_core.queries import Provenance
from study_core.section import words_in
from study_core.study import Study

_PACKAGES = ("prefstudy", "numpy", "scipy", "numba", "torch", "viser")
_SIMULATED = (
    "These people are simulated: the study was rehearsed. None of this is about anybody, and nobody was paid."
)
_WORDS = {
    Ending.DECLINED: "declined consent",
    Ending.SCREENED_OUT: "screened out",
    Ending.FAILED: "failed the comprehension check",
    Ending.STOPPED: "stopped",
    Ending.TIMED_OUT: "came back too late",
    None: "have not ended",
}


def appendix(people: Sequence[PersonRecord]) -> list[Section]:
    """Returns the whole appendix.

    Args:
        people: Everybody in the study, at least one; its settings are those of the newest of them.
    """
    study = people[-1].study
    analysed = [person for person in people if person.is_analysed]
    return [
        _recruitment(study, people),
        _flow(people),
        _exclusions(people),
        *_conditions(people),
        _payment(study, people),
        *_questionnaires(study, analysed),
        _timing(analysed),
        _quality(analysed),
        _technical(analysed),
        _procedure(study, people),
    ]


def _facts(title: str, facts: Sequence[tuple[str, Any]], *paragraphs: str) -> Section:
    return Section(title, paragraphs, ("", "value"), [(name, str(value)) for name, value in facts])


def _recruitment(study: Study, people: Sequence[PersonRecord]) -> Section:
    wanted = study.file.recruitment
    begun = [person.line.session.created_at for person in people]
    with_id = sum(person.line.external is not None for person in people)
    return _facts(
        "Recruitment",
        [
            ("study", study.name),
            ("versions of the study file", len({person.study.version for person in people})),
            ("first person began", f"{min(begun):%Y-%m-%d}"),
            ("last person began", f"{max(begun):%Y-%m-%d}"),
            ("places", wanted.places or "no limit"),
            ("came with an id of the recruiting service", share(with_id, len(people))),
            ("languages", counts(_language(person) for person in people)),
        ],
        *([_SIMULATED] if people[0].line.session.source is Source.REHEARSED else []),
    )


def _language(person: PersonRecord) -> str:
    chosen = [event.language for _, event in person.log if isinstance(event, LanguageChosen)]
    return chosen[-1] if chosen else person.study.languages[0]


def _flow(people: Sequence[PersonRecord]) -> Section:
    endings = Counter(person.line.ending for person in people)
    lost = [(words, endings[ending]) for ending, words in _WORDS.items() if endings[ending]]
    verdicts = Counter(person.line.review.verdict for person in people if person.has_completed)
    return _facts(
        "Flow of participants",
        [
            ("began", len(people)),
            *lost,
            ("completed", endings[Ending.COMPLETED]),
            *((f"of these {verdict}", n) for verdict, n in verdicts.items() if verdict is not None),
            ("analysed", sum(person.is_analysed for person in people)),
        ],
        "Whoever had their data deleted isn't among them.",
    )


def _exclusions(people: Sequence[PersonRecord]) -> Section:
    reasons = Counter(
        (str(person.line.review.verdict), person.line.review.reason, person.line.review.changed_by)
        for person in people
        if person.line.review.verdict is not None
    )
    rows = [(verdict, reason, by, n) for (verdict, reason, by), n in sorted(reasons.items())]
    said = "Criteria of the study file were fixed before the first person; they are applied when somebody completes."
    if not rows:
        return Section("Exclusions", ["Nobody was rejected or excluded.", said])
    return Section("Exclusions", [said], ("verdict", "reason", "decided by", "people"), rows)


def _conditions(people: Sequence[PersonRecord]) -> list[Section]:
    names = sorted({person.study.condition for person in people if person.study.condition is not None})
    if not names:
        return []
    rows = []
    for name in names:
        here = [person for person in people if person.study.condition == name]
        completed = sum(person.has_completed for person in here)
        rows.append((name, len(here), completed, sum(person.is_analysed for person in here)))
    said = (
        "Assigned by chance to one of the conditions that then had the fewest people, completed or under way."
    )
    return [Section("Conditions", [said], ("condition", "began", "completed", "analysed"), rows)]


def _payment(study: Study, people: Sequence[PersonRecord]) -> Section:
    payment = study.file.payment
    if payment is None:
        return Section("Payment", ["The study file names no payment."])
    hours = [person.minutes / 60.0 for person in people if person.has_completed and person.minutes > 0]
    hourly = [payment.amount / hour for hour in hours]
    n_paid = sum(person.has_completed and person.line.review.verdict != "rejected" for person in people)
    return _facts(
        "Payment",
        [
            ("for completing", f"{payment.amount:.2f} {payment.currency}"),
            ("paid (completed, not rejected)", n_paid),
            ("altogether", f"{n_paid * payment.amount:.2f} {payment.currency}"),
            ("an hour, by the time taken", spread(hourly, f" {payment.currency}")),
        ],
    )


def _questionnaires(study: Study, people: Sequence[PersonRecord]) -> list[Section]:
    sections = []
    for place, step in enumerate(study.file.path):
        name = questionnaire_of(step)
        if name is None:
            continue
        rows = [
            (item.name, words_in(item.label, study.languages[0]), _responses(item, place, people))
            for item in study.file.questionnaire[name]
        ]
        sections.append(Section(f"Questionnaire: {name}", (), ("item", "question", "answers"), rows))
    return sections


def _responses(item: Item, place: int, people: Sequence[PersonRecord]) -> str:
    values = [person.responses.get((place, item.name)) for person in people]
    given = [value for value in values if value is not None]
    n_missing = len(values) - len(given)
    missing = f"; {n_missing} without an answer" if n_missing else ""
    if isinstance(item, TextItem):
        # What people wrote may say who they are.
        return f"{len(given)} wrote something{missing}"
    if isinstance(item, ChoiceItem):
        several = [one for value in given for one in (value if isinstance(value, list) else [value])]
        return counts(several) + missing
    return moments(given) + missing


def _timing(people: Sequence[PersonRecord]) -> Section:
    times = [time / 1000.0 for person in people for time in person.response_times_ms]
    waits = [person.line.n_waits for person in people]
    waited = sum(person.line.waited_ms for person in people)
    return _facts(
        "Timing",
        [
            ("whole session", spread([person.minutes for person in people], " min")),
            ("an answer, from the first frame shown", spread(times, " s")),
            ("questions that somebody waited for", share(sum(waits), sum(p.line.n_answers for p in people))),
            ("waited altogether", f"{waited / 1000.0:.1f} s"),
        ],
        "Of those who are analysed: medians, with the middle half in parentheses.",
    )


def _quality(people: Sequence[PersonRecord]) -> Section:
    def total(name: str) -> int:
        return sum(getattr(person.line, name) for person in people)

    return _facts(
        "Quality of the answers",
        [
            ("repeated queries answered alike", share(total("n_repeats_agreed"), total("n_repeats"))),
            ("checks passed", share(total("n_checks_passed"), total("n_checks"))),
            ("chose what stood first", share(total("n_first"), total("n_sided"))),
            ("looked away from the page, times a person", spread([p.line.focus_losses for p in people])),
            ("largest R-hat of the last posterior", spread([p.line.r_hat for p in people if p.line.r_hat])),
            ("smallest effective sample size", spread([p.line.ess for p in people if p.line.ess])),
        ],
    )


def _technical(people: Sequence[PersonRecord]) -> Section:
    def numbers(name: str) -> list[float]:
        values = [measured.get(name) for person in people for measured in person.measures]
        return [float(value) for value in values if isinstance(value, (int, float))]

    layouts = [
        measured["layout"] for person in people for measured in person.measures if "layout" in measured
    ]
    means = [measured["means"] for person in people for measured in person.measures if "means" in measured]
    sizes = [
        measured["viewport"]
        for person in people
        for measured in person.measures[:1]
        if "viewport" in measured
    ]
    widths = [size[0] for size in sizes if isinstance(size, list) and len(size) == 2]
    return _facts(
        "Technical conditions",
        [
            ("answers by", counts(means)),
            ("arrangement of the two on the screen", counts(layouts)),
            ("width of the window at the first answer, pixels", spread([float(width) for width in widths])),
            ("between two frames of the animation", spread(numbers("stage_frame_ms"), " ms")),
            ("pixels of the screen to one of the page", counts(numbers("device_pixel_ratio"))),
        ],
        "As browsers reported them, an entry for each answer.",
    )


def _procedure(study: Study, people: Sequence[PersonRecord]) -> Section:
    made = [query.proposed.provenance for person in people for query in person.queries]
    versions = {name for one in made if isinstance(one, Provenance) for name in one.versions}
    protocol = study.protocol
    return _facts(
        "Procedure and software",
        [
            ("path", ", ".join(step.step for step in study.file.path)),
            ("active queries, repeats, checks, test queries", _numbers(protocol)),
            ("methods that chose the queries", counts(one.method for one in made)),
            ("versions of domain, sampler, optimiser and method", ", ".join(sorted(versions))),
            (
                "computed by prefstudy",
                counts(query.code_version for person in people for query in person.queries),
            ),
            *versions_of(_PACKAGES).items(),
            *((f"study file {i}, SHA-256", v) for i, v in enumerate(_versions(people), start=1)),
        ],
    )


def _numbers(protocol: Any) -> str:
    return f"{protocol.active_queries}, {protocol.repeats}, {protocol.checks}, {protocol.test_queries}"


def _versions(people: Sequence[PersonRecord]) -> list[str]:
    return list(dict.fromkeys(person.study.version for person in people))

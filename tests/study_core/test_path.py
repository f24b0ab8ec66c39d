"""A study file's path: every section, every message with its remedy."""

import hashlib

import pytest

from study_core.errors import StudyError
from study_core.path import Ending, needed_texts
from study_core.study import parse_study
from tests.study_core.references import study_text

WHOLE = """
[[path]]
step = "consent"
[[path]]
step = "text"
text = "aims"
[[path]]
step = "instructions"
example = false
[[path]]
step = "practice"
queries = 4
check = "understood"
chances = 3
[[path]]
step = "queries"
break_every = 2
[[path]]
step = "questionnaire"
questionnaire = "about-you"
[[path]]
step = "debrief"
results = true

[[questionnaire.understood]]
name = "sum"
kind = "number"
label = { en = "1 + 1?", de = "1 + 1?" }
right = 2

[[questionnaire.about-you]]
name = "age"
kind = "number"
label = { en = "Age", de = "Alter" }
least = 18
most = 120
[[questionnaire.about-you]]
name = "liked"
kind = "likert"
label = { en = "I liked it", de = "Mir gefiel es" }
low = { en = "No", de = "Nein" }
high = { en = "Yes", de = "Ja" }
[[questionnaire.about-you]]
name = "effort"
kind = "scale"
label = { en = "Effort", de = "Anstrengung" }
low = { en = "Low", de = "Gering" }
high = { en = "High", de = "Hoch" }
[[questionnaire.about-you]]
name = "drives"
kind = "choice"
several = true
label = { en = "I drive", de = "Ich fahre" }
options = [
    { name = "car", label = { en = "a car", de = "Auto" } },
    { name = "bus", label = { en = "a bus", de = "Bus" } },
]
[[questionnaire.about-you]]
name = "remarks"
kind = "text"
required = false
label = { en = "Anything else?", de = "Noch etwas?" }

[endings.completed]
code = "C1"
redirect = "https://example.org/done?cc=C1"
[endings.declined]
text = "bye"

[recruitment]
opens = 2026-12-01T09:00:00+01:00
closes = 2026-12-02T09:00:00+01:00
places = 20
[session]
max_age_hours = 48.0
when_old = "restart"
[answering]
confidence = true
watch_once = true
take_back = true
"""
NAMES = (
    "welcome",
    "question",
    "thanks",
    "consent",
    "aims",
    "instructions",
    "practice",
    "break",
    "debrief",
    "bye",
)


def texts(names=NAMES, languages=("en", "de")):
    return "".join(
        f"[text.{name}]\n" + "".join(f'{one} = "{name} {one}"\n' for one in languages) for name in names
    )


def whole(*replacements, names=NAMES, **changes):
    """The whole path as TOML, with lines replaced."""
    plain = {f"text__{name}": None for name in ("welcome", "question", "thanks")}
    head = study_text(languages=["en", "de"], **{**plain, **changes}).replace("[text]\n", "")
    head = head.replace('title = "Small"', 'title = { en = "Small", de = "Klein" }')
    text = head + texts(names) + WHOLE
    for old, new in replacements:
        assert old in text, old
        text = text.replace(old, new)
    return text


def test_a_whole_path_says_what_it_says():
    study = parse_study(whole(protocol__repeats=1, protocol__checks=1))
    file = study.file
    kinds = ["consent", "text", "instructions", "practice", "queries", "questionnaire", "debrief"]
    assert [step.step for step in file.path] == kinds
    assert [item.kind for item in file.questionnaire["about-you"]] == [
        "number",
        "likert",
        "scale",
        "choice",
        "text",
    ]
    assert (study.n_practice, study.first_test, study.n_queries) == (4, 4 + 3 + 2, 4 + 3 + 2 + 2)
    assert (study.languages, study.text_named("aims", "de")) == (("en", "de"), "aims de")
    assert study.text_hash("aims", "de") == hashlib.sha256(b"aims de").hexdigest()
    assert file.endings["completed"].redirect == "https://example.org/done?cc=C1"
    assert file.recruitment.opens.utcoffset().total_seconds() == 3600
    assert (file.recruitment.places, file.session.max_age_hours, file.session.when_old) == (
        20,
        48.0,
        "restart",
    )
    assert (file.answering.confidence, file.answering.watch_once, file.answering.take_back) == (
        True,
        True,
        True,
    )
    assert sorted(needed_texts(file.path, file.endings)) == sorted(NAMES)


def test_a_study_file_without_a_path_has_queries_alone():
    study = parse_study(study_text())
    assert [step.step for step in study.file.path] == ["queries"]
    assert (study.n_practice, study.languages, study.n_queries) == (0, ("en",), 5)
    assert (study.title("en"), study.text_named("welcome", "en")) == ("Small", "Hello")
    assert needed_texts(study.file.path, study.file.endings) == ("welcome", "question", "thanks")


QUERIES = '[[path]]\nstep = "queries"\nbreak_every = 2\n'
REFUSED = {
    "no queries": ((QUERIES, ""), 'exactly one step "queries"'),
    "queries twice": ((QUERIES, QUERIES * 2), 'exactly one step "queries"'),
    "practice after the queries": (
        ('[[path]]\nstep = "debrief"', '[[path]]\nstep = "practice"\n[[path]]\nstep = "debrief"'),
        'one step "practice", before "queries"',
    ),
    "consent in the middle": (
        ('[[path]]\nstep = "debrief"', '[[path]]\nstep = "consent"\n[[path]]\nstep = "debrief"'),
        "and it comes first",
    ),
    "an unknown step": (
        ('step = "debrief"', 'step = "debreif"'),
        "key 'path.7': step must be consent, text, instructions, practice, queries, questionnaire or debrief",
    ),
    "a step with a key too many": (
        ("break_every = 2", "break_evry = 2"),
        "unknown key 'path.5.break_evry'; did you mean 'break_every'?",
    ),
    "a break after nothing": (
        ("break_every = 2", "break_every = 0"),
        "key 'path.5.break_every': input should be",
    ),
    "too much practice": (("queries = 4", "queries = 21"), "key 'path.4.queries': input should be less than"),
    "a text that is nowhere": (
        ('text = "aims"', 'text = "goals"'),
        "no text is called 'goals'; add [text.goals] or files such as goals.en.md in the study's folder.",
    ),
    "a questionnaire that is nowhere": (
        ('questionnaire = "about-you"', 'questionnaire = "about-me"'),
        "no questionnaire is called 'about-me'; add [[questionnaire.about-me]] or the file about-me.toml",
    ),
    "a text in one language": (
        ('de = "aims de"\n', ""),
        "'text.aims' is missing in de; add it in every language.",
    ),
    "a label in one language": (
        ('{ en = "Age", de = "Alter" }', '"Age"'),
        "'questionnaire.about-you.age.label' is missing in de",
    ),
    "an option in one language": (
        ('{ en = "a bus", de = "Bus" }', '{ en = "a bus" }'),
        "'questionnaire.about-you.drives.bus' is missing in de",
    ),
    "a check without a right answer": (
        ("right = 2\n", ""),
        "the check 'understood' needs an item with a right answer; add `right = ...` to one.",
    ),
    "an unknown kind of item": (
        ('kind = "scale"', 'kind = "slider"'),
        "key 'questionnaire.about-you.3': kind must be number, scale, likert, choice or text.",
    ),
    "an item twice": (
        ('name = "effort"', 'name = "age"'),
        "the items of 'about-you' must have different names",
    ),
    "a range the wrong way round": (("most = 120", "most = 12"), "least can't be more than most, 12"),
    "a right answer that can't be chosen": (
        ("several = true", 'right = "train"'),
        "right and screens_out must name options; train is none",
    ),
    "an option twice": (('name = "bus"', 'name = "car"'), "options must have different names"),
    "a likert item of one point": (
        ('kind = "likert"', 'kind = "likert"\npoints = 1'),
        "key 'questionnaire.about-you.2.points': input should be greater than or equal to 2, got 1.",
    ),
    "a scale without room": (
        ('kind = "scale"', 'kind = "scale"\nleast = 0\nmost = 3'),
        "most must be at least a step above least",
    ),
    "an unknown ending": (
        ("[endings.declined]", "[endings.decline]"),
        "key 'endings': no ending is called 'decline'; did you mean 'declined'?",
    ),
    "an ending like no other": (
        ("[endings.declined]", "[endings.xyz]"),
        "no ending is called 'xyz'; expected one of: completed, declined, screened-out, failed, stopped, deleted",
    ),
    "a redirect to a script": (
        ('"https://example.org/done?cc=C1"', '"javascript:alert(1)"'),
        "key 'endings.completed.redirect': redirect must be an address that begins with https:// or http://",
    ),
    "a study that closes before it opens": (
        ("2026-12-02T09:00:00+01:00", "2026-11-02T09:00:00+01:00"),
        "key 'recruitment': closes must be later than opens",
    ),
    "a time without its offset": (
        ("opens = 2026-12-01T09:00:00+01:00", "opens = 2026-12-01T09:00:00"),
        "key 'recruitment.opens': input should have timezone info",
    ),
    "no places": (
        ("places = 20", "places = 0"),
        "key 'recruitment.places': input should be greater than or equal",
    ),
    "no age": (
        ("max_age_hours = 48.0", "max_age_hours = 0.0"),
        "key 'session.max_age_hours': input should be greater",
    ),
    "an unknown fate of the old": (
        ('"restart"', '"again"'),
        "key 'session.when_old': input should be 'restart' or 'end'",
    ),
    "a language that is none": (
        ('languages = ["en", "de"]', 'languages = ["english!"]'),
        "key 'languages.1'",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_path_that_cannot_be_is_refused_in_a_line_that_says_where_and_what_to_do(case):
    replacement, message = REFUSED[case]
    with pytest.raises(StudyError) as raised:
        parse_study(whole(replacement), source="mine.toml")
    line = str(raised.value)
    assert line.startswith("mine.toml: ")
    assert message in line
    assert "\n" not in line
    assert not line.endswith(("?.", ".."))
    assert "<" not in line
    assert len(line) < 300


@pytest.mark.parametrize(("name", "most"), [("repeats", 1), ("checks", 1)])
def test_repeats_and_checks_are_at_most_half_of_the_active_queries(name, most):
    assert parse_study(study_text(**{f"protocol__{name}": most})).n_queries == 5 + most
    with pytest.raises(StudyError, match=f"{name} can be at most half of active_queries, 1; got 2"):
        parse_study(study_text(**{f"protocol__{name}": most + 1}))


def test_every_ending_can_have_a_section():
    sections = "".join(f'[endings.{ending}]\ncode = "{ending}"\n' for ending in Ending)
    study = parse_study(study_text() + sections)
    assert {name: section.code for name, section in study.file.endings.items()} == {e: str(e) for e in Ending}

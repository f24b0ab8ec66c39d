"""A study file's path: every section, every message with its remedy; and what stands beside the file."""

import hashlib
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study_core.errors import StudyError
from study_core.path import Ending, needed_texts
from study_core.study import parse_study, read_study
from study_core.study_folder import with_its_folder
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


@pytest.fixture
def place(tmp_path):
    """Where a study file, its folder and a library are; gives a function that writes a file there."""

    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode())
        return path

    return write


ASKED = """
[[path]]
step = "consent"
[[path]]
step = "queries"
[[path]]
step = "questionnaire"
questionnaire = "age"
"""
ITEM = '[[item]]\nname = "years"\nkind = "number"\nlabel = "How old are you?"\n'


def read(place, text, tmp_path):
    return read_study(place("mine.toml", text), library=tmp_path / "library")


def test_what_a_file_names_comes_from_its_folder_before_the_library(place, tmp_path):
    place("library/texts/consent.en.md", "The ready consent.")
    place("library/questionnaires/age.toml", ITEM)
    ready = read(place, study_text() + ASKED, tmp_path)
    assert ready.text_named("consent", "en") == "The ready consent."
    assert ready.file.questionnaire["age"][0].label == "How old are you?"
    place("mine/consent.en.md", "My own consent.")
    place("mine/age.toml", ITEM.replace("How old", "How young"))
    own = read(place, study_text() + ASKED, tmp_path)
    assert own.text_named("consent", "en") == "My own consent."
    assert own.file.questionnaire["age"][0].label == "How young are you?"
    written = read(place, study_text(text__consent="Here.") + ASKED, tmp_path)
    assert written.text_named("consent", "en") == "Here."
    assert len({ready.hash, own.hash, written.hash}) == 3


def test_the_hash_covers_what_was_read_beside_the_file(place, tmp_path):
    place("mine/age.toml", ITEM)
    hashes = set()
    for consent in ("One.", "One. ", "Another."):
        place("mine/consent.en.md", consent)
        study = read(place, study_text() + ASKED, tmp_path)
        # The text alone is the whole study: no file is read again.
        assert parse_study(study.text).text_named("consent", "en") == consent
        hashes.add(study.hash)
    assert len(hashes) == 3


def test_a_text_comes_from_one_place_in_all_its_languages(place, tmp_path):
    both = whole(names=[name for name in NAMES if name != "consent"])
    for language in ("en", "de"):
        place(f"library/texts/consent.{language}.md", f"Ready {language}.")
    study = read(place, both, tmp_path)
    assert [study.text_named("consent", language) for language in ("en", "de")] == ["Ready en.", "Ready de."]
    # An own English text is not completed by a ready German one, which would say something else.
    place("mine/consent.en.md", "My own.")
    with pytest.raises(StudyError, match=re.escape("'text.consent' is missing in de")):
        read(place, both, tmp_path)
    place("mine/consent.de.md", "Mein eigener.")
    assert read(place, both, tmp_path).text_named("consent", "de") == "Mein eigener."


def test_nothing_is_added_that_no_step_names(place, tmp_path):
    for name in ("break", "questionnaire", "queries", "debrief", "declined"):
        place(f"library/texts/{name}.en.md", "Ready.")
    text = study_text()
    assert read(place, text, tmp_path).text == text
    text += '\n[[path]]\nstep = "queries"\nbreak_every = 2\n'
    assert set(read(place, text, tmp_path).file.text) == {"welcome", "question", "thanks", "break"}


def test_a_file_beside_the_study_that_cannot_be_used_is_named(place, tmp_path):
    place("mine/consent.en.md", "Yes?")
    for broken, message in (
        ("[[item]\n", "not valid TOML"),
        ('title = "x"\n', r"expected \[\[item\]\] tables"),
    ):
        place("mine/age.toml", broken)
        with pytest.raises(StudyError, match=rf"age\.toml: {message}"):
            read(place, study_text() + ASKED, tmp_path)
    place("mine/age.toml", ITEM)
    (tmp_path / "mine" / "consent.en.md").write_bytes("Ü".encode("latin-1"))
    with pytest.raises(StudyError, match=r"consent\.en\.md.*UTF-8"):
        read(place, study_text() + ASKED, tmp_path)


def test_texts_in_one_line_cannot_be_added_to_and_say_so(place, tmp_path):
    place("mine/consent.en.md", "Yes?")
    place("mine/age.toml", ITEM)
    plain = {f"text__{name}": None for name in ("welcome", "question", "thanks")}
    line = 'text = { welcome = "Hello", question = "Which?", thanks = "Thanks" }\n'
    text = line + study_text(**plain).replace("[text]\n", "") + ASKED
    with pytest.raises(StudyError, match=r"\[text\] and \[questionnaire\] as sections of their own"):
        read(place, text, tmp_path)


def test_a_file_that_is_wrong_is_left_to_the_check_of_the_whole(tmp_path):
    for text in (
        "a = = 1",
        'path = 3\nlanguages = "en"',
        study_text(languages=["../../etc"]),
        'text = "all"',
    ):
        assert with_its_folder(text, tmp_path / "mine", None) == text


AWKWARD = st.text(st.characters(codec="utf-8", exclude_characters="\r"), max_size=80) | st.sampled_from(
    [
        'He said "yes"',
        '"""',
        "''' and \\ and \\u0041 and \\n",
        "\\",
        '"',
        "line\nline\n\n  indented\t\n",
        "\n\nat the beginning",
        "🙂👩‍🔬 é é",
        "\u202eabc\u202c שלום עולם مرحبا\u200f",
        "\x00\x0b\x1f\x7f\u0085\u2028",
        "# not a comment",
        "[text.other]\nen = 'x'",
        "{question} {{x}} %s",
    ]
)


@settings(max_examples=60)
@given(consent=AWKWARD, label=AWKWARD)
def test_any_text_beside_the_file_reaches_the_study_letter_by_letter(tmp_path_factory, consent, label):
    folder = tmp_path_factory.getbasetemp() / "any"
    folder.mkdir(exist_ok=True)
    (folder / "consent.en.md").write_bytes(consent.encode())
    quoted = "".join(f"\\U{ord(letter):08X}" for letter in label)
    (folder / "age.toml").write_text(ITEM.replace("How old are you?", quoted), encoding="utf-8")
    study = parse_study(with_its_folder(study_text() + ASKED, folder, None))
    assert study.text_named("consent", "en") == consent
    assert study.file.questionnaire["age"][0].label == label


def test_line_ends_of_any_system_are_one(place, tmp_path):
    place("mine/age.toml", ITEM.replace("\n", "\r\n"))
    place("mine/consent.en.md", "One.\r\n\r\nTwo.\r\n")
    windows = read(place, (study_text() + ASKED).replace("\n", "\r\n"), tmp_path)
    place("mine/age.toml", ITEM)
    place("mine/consent.en.md", "One.\n\nTwo.\n")
    assert windows.hash == read(place, study_text() + ASKED, tmp_path).hash
    assert windows.text_named("consent", "en") == "One.\n\nTwo.\n"


def test_every_ending_can_have_a_section():
    sections = "".join(f'[endings.{ending}]\ncode = "{ending}"\n' for ending in Ending)
    study = parse_study(study_text() + sections)
    assert {name: section.code for name, section in study.file.endings.items()} == {e: str(e) for e in Ending}

"""What stands beside a study file becomes part of its text."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study_core.errors import StudyError
from study_core.study import parse_study, read_study
from study_core.study_folder import with_its_folder
from tests.study_core.references import study_text
from tests.study_core.test_path import NAMES, whole


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

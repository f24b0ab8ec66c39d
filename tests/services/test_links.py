"""What a link says about a person, and who can have written it."""

from __future__ import annotations

from urllib.parse import parse_qsl, urlsplit

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.services.links import (
    IncompleteLinkError,
    WrongSignatureError,
    personal_link,
    read_invitation,
)
from app.store import ExternalPerson, Store, open_store

PROLIFIC = {"PROLIFIC_PID": "5f-pid", "STUDY_ID": "a-study", "SESSION_ID": "a-visit"}


def query_of(link: str) -> dict[str, str]:
    return dict(parse_qsl(urlsplit(link).query))


def test_a_link_of_prolific_names_the_person_and_keeps_its_other_ids(store: Store) -> None:
    invitation = read_invitation(store, "mine", PROLIFIC)
    others = {"STUDY_ID": "a-study", "SESSION_ID": "a-visit"}
    assert invitation.person == ExternalPerson("mine", "5f-pid", others)
    assert not invitation.is_signed


def test_a_link_without_an_id_is_the_same_for_everybody(store: Store) -> None:
    for query in ({}, {"utm_source": "a-forum"}, {"lang": "de"}):
        assert read_invitation(store, "mine", query).person is None


def test_the_first_of_the_known_keys_is_the_id(store: Store) -> None:
    invitation = read_invitation(store, "mine", {"id": "7", "participant": "P07", "lang": "de"})
    assert invitation.person == ExternalPerson("mine", "P07", {"id": "7"})


@pytest.mark.parametrize("value", ["", "   ", "x" * 201, "a\nb", "a\x00b", "{{%PROLIFIC_PID%}}"])
def test_an_id_that_cannot_be_one_is_refused(store: Store, value: str) -> None:
    with pytest.raises(IncompleteLinkError, match="1 to 200 printable characters"):
        read_invitation(store, "mine", {"PROLIFIC_PID": value})


@pytest.mark.parametrize(
    "others", [{"STUDY_ID": "x" * 201}, {"k" * 65: "x"}, {str(i): "x" for i in range(21)}, {"a": "b\n"}]
)
def test_what_else_a_link_says_is_bounded(store: Store, others: dict[str, str]) -> None:
    with pytest.raises(IncompleteLinkError):
        read_invitation(store, "mine", {"id": "7", **others})


def test_spaces_around_an_id_do_not_make_another_person(store: Store) -> None:
    assert read_invitation(store, "mine", {"id": " 7 "}) == read_invitation(store, "mine", {"id": "7"})


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(st.text(min_size=1, max_size=200).filter(lambda text: text.isprintable() and text == text.strip()))
def test_a_personal_link_is_known_for_its_person_whatever_the_id(store: Store, external_id: str) -> None:
    if "{{" in external_id or "}}" in external_id:
        return
    link = personal_link(store, "mine", external_id, "https://study.example/")
    assert link.startswith("https://study.example/join/mine?id=")
    invitation = read_invitation(store, "mine", query_of(link))
    assert invitation.is_signed
    assert invitation.person == ExternalPerson("mine", external_id)


def test_a_signature_holds_for_one_id_one_study_and_one_database(store: Store, tmp_path: object) -> None:
    query = query_of(personal_link(store, "mine", "P07", "https://study.example"))
    with pytest.raises(WrongSignatureError):
        read_invitation(store, "mine", {**query, "id": "P08"})
    with pytest.raises(WrongSignatureError):
        read_invitation(store, "yours", query)
    with open_store(f"sqlite:///{tmp_path}/other.db") as other, pytest.raises(WrongSignatureError):
        read_invitation(other, "mine", query)


@pytest.mark.parametrize("signature", ["", "x", "é", "A" * 22])
def test_a_made_up_signature_is_refused(store: Store, signature: str) -> None:
    with pytest.raises(WrongSignatureError):
        read_invitation(store, "mine", {"id": "P07", "signature": signature})


def test_no_personal_link_is_made_for_what_is_no_id(store: Store) -> None:
    with pytest.raises(IncompleteLinkError):
        personal_link(store, "mine", "", "https://study.example")

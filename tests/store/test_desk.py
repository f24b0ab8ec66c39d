"""What the desk keeps: who may use it, what they decided, what they did."""

from datetime import UTC, datetime, timedelta

import pytest

from app.store import (
    ExperimenterKnownError,
    Review,
    ReviewChangedError,
    Role,
    Source,
    StoreError,
    Verdict,
    open_store,
)

LONG_AGO = datetime(2000, 1, 1, tzinfo=UTC)


@pytest.fixture
def desk(store):
    store.desk.add_experimenter("ann", "hash-a", Role.OWNER)
    return store.desk


@pytest.fixture
def session_id(store):
    store.put_study("v1", "mine", "text")
    return store.create_session("v1", "token", Source.JOINED).id


def test_names_are_taken_once_and_only_one_can_be_first(desk):
    with pytest.raises(ExperimenterKnownError, match="'ann' already"):
        desk.add_experimenter("ann", "other", Role.VIEWER)
    with pytest.raises(ExperimenterKnownError, match="has an owner already"):
        desk.add_experimenter("bob", "hash-b", Role.OWNER, is_first=True)
    assert [(one.name, one.role) for one in desk.experimenters()] == [("ann", Role.OWNER)]
    assert (desk.password_hash("ann"), desk.password_hash("bob")) == ("hash-a", None)


def test_the_last_owner_stays_one(desk):
    with pytest.raises(StoreError, match="only owner"):
        desk.remove_experimenter("ann")
    with pytest.raises(StoreError, match="only owner"):
        desk.change_role("ann", Role.VIEWER)
    desk.add_experimenter("bob", "hash-b", Role.OWNER)
    desk.change_role("ann", Role.VIEWER)
    desk.remove_experimenter("ann")
    assert [one.name for one in desk.experimenters()] == ["bob"]


def test_a_login_holds_until_it_is_too_old_ended_or_the_password_is_another(desk):
    desk.begin_login("ann", "t1")
    assert desk.login("t1", LONG_AGO, LONG_AGO).name == "ann"
    later = datetime.now(UTC) + timedelta(hours=1)
    assert desk.login("t1", later, LONG_AGO) is None
    assert desk.login("t1", LONG_AGO, later) is None
    assert desk.login("t2", LONG_AGO, LONG_AGO) is None
    desk.end_login("t1")
    assert desk.login("t1", LONG_AGO, LONG_AGO) is None
    desk.begin_login("ann", "t3")
    desk.change_password("ann", "hash-2")
    assert desk.login("t3", LONG_AGO, LONG_AGO) is None
    assert desk.password_hash("ann") == "hash-2"


def test_a_program_may_do_no_more_than_whose_it_is_and_nothing_once_revoked(desk):
    desk.add_experimenter("bob", "hash-b", Role.OWNER)
    token = desk.add_api_token("bob", "script", Role.ASSISTANT, "secret-hash")
    assert desk.program("secret-hash").role is Role.ASSISTANT
    desk.change_role("bob", Role.VIEWER)
    assert (desk.program("secret-hash").name, desk.program("secret-hash").role) == ("bob", Role.VIEWER)
    desk.revoke_api_token(token.id)
    assert desk.program("secret-hash") is None
    assert desk.program("other") is None
    (kept,) = desk.api_tokens("bob")
    assert kept.revoked_at is not None
    with pytest.raises(StoreError, match="id of a token"):
        desk.revoke_api_token("nothing")


def test_roles_include_the_lesser_ones():
    allowed = {(one, other) for one in Role for other in Role if one.may_act_as(other)}
    assert len(allowed) == 6
    assert (Role.OWNER, Role.VIEWER) in allowed
    assert (Role.VIEWER, Role.ASSISTANT) not in allowed


def test_of_two_who_change_the_same_review_the_second_is_told(desk, session_id):
    seen = desk.review(session_id)
    assert seen == Review()
    first = desk.put_review(session_id, Review(Verdict.EXCLUDED, "slept", "", seen.revision), "ann")
    assert (first.revision, first.changed_by) == (1, "ann")
    with pytest.raises(ReviewChangedError, match="ann has changed"):
        desk.put_review(session_id, Review(None, "", "fine", seen.revision), "bob")
    assert desk.review(session_id) == first
    assert desk.put_review(session_id, Review(None, "", "fine", 1), "bob").revision == 2


def test_reviews_go_with_the_person_and_the_audit_stays(desk, store, session_id):
    desk.put_review(session_id, Review(Verdict.REJECTED, "no answer"), "ann")
    desk.record("ann", "person_rejected", session_id, {"reason": "no answer"})
    store.delete_session(session_id)
    with pytest.raises(StoreError):
        desk.review(session_id)
    (entry,) = desk.audit(about=session_id)
    assert (entry.who, entry.action, entry.detail) == ("ann", "person_rejected", {"reason": "no answer"})


def test_the_audit_is_read_newest_first_and_page_by_page(desk):
    for n in range(5):
        desk.record("ann", f"did_{n}")
    assert [entry.action for entry in desk.audit(2)] == ["did_4", "did_3"]
    assert [entry.action for entry in desk.audit(2, before=2)] == ["did_2", "did_1"]


def test_what_the_desk_keeps_is_there_after_a_restart(desk, database_url):
    with open_store(database_url) as other:
        assert other.desk.password_hash("ann") == "hash-a"

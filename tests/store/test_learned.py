"""Models that learned from people, and who they learned from."""

from dataclasses import replace

import pytest

from app.store import ModelRecord, SessionDeletedError, Source, StoreError, open_store

MODEL = ModelRecord("network", "key-1", b"\x00\xff weights", {"n_answers": 8, "sessions": ["one"]})


@pytest.fixture
def people(store):
    store.put_study("hash", "mine", "text")
    return [store.create_session("hash", f"token-{i}", Source.JOINED).id for i in range(3)]


def test_a_personal_model_comes_back_as_it_was_put(store, people, database_url):
    assert store.personal_model(people[0], "network") is None
    store.put_personal_model(people[0], MODEL)
    store.close()
    with open_store(database_url) as reopened:
        assert reopened.personal_model(people[0], "network") == MODEL
        assert reopened.personal_model_key(people[0], "network") == "key-1"
        assert reopened.personal_model(people[1], "network") is None
        assert reopened.personal_model_key(people[0], "another") is None


def test_a_later_model_takes_the_place_of_an_earlier_one_of_its_kind(store, people):
    later = replace(MODEL, key="key-2", content=b"later")
    for model in (MODEL, replace(MODEL, kind="other"), later):
        store.put_personal_model(people[0], model)
        store.put_shared_model("mine", model, people[:2])
    assert store.personal_model(people[0], "network") == store.shared_model("mine", "network") == later
    assert store.personal_model(people[0], "other").content == MODEL.content


def test_a_shared_model_comes_back_as_it_was_put(store, people):
    assert store.shared_model("mine", "network") is None
    store.put_shared_model("mine", MODEL, [people[1], people[0], people[1]])
    assert store.shared_model("mine", "network") == MODEL
    assert store.shared_model("another", "network") is None


def test_a_shared_model_of_nobody_is_refused(store):
    with pytest.raises(StoreError, match="got nobody"):
        store.put_shared_model("mine", MODEL, [])


def test_a_model_of_somebody_unknown_is_refused_and_the_earlier_one_stays(store, people):
    store.put_shared_model("mine", MODEL, people)
    with pytest.raises(StoreError, match="got 'nobody'"):
        store.put_shared_model("mine", replace(MODEL, key="key-2"), [people[0], "nobody"])
    assert store.shared_model("mine", "network") == MODEL
    with pytest.raises(StoreError, match="got 'nobody'"):
        store.put_personal_model("nobody", MODEL)


def test_deleting_a_person_drops_every_model_that_learned_from_them(store, people):
    for person in people:
        store.put_personal_model(person, MODEL)
    store.put_shared_model("mine", MODEL, people[:2])
    store.put_shared_model("mine", replace(MODEL, kind="other"), people[1:])
    done = store.delete_session(people[0])
    assert (done.n_personal_models, done.n_shared_models) == (1, 1)
    assert store.shared_model("mine", "network") is None
    assert store.shared_model("mine", "other") is not None
    assert store.personal_model(people[1], "network") == MODEL


def test_a_model_that_comes_after_its_person_was_deleted_is_refused(store, people):
    store.put_shared_model("mine", MODEL, people[1:])
    store.delete_session(people[0])
    with pytest.raises(SessionDeletedError, match="was deleted at 20"):
        store.put_personal_model(people[0], MODEL)
    with pytest.raises(SessionDeletedError):
        store.put_shared_model("mine", replace(MODEL, key="key-2"), people)
    assert store.shared_model("mine", "network") == MODEL

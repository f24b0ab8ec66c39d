"""What is decided about people at the desk, and what is shown of them."""

from __future__ import annotations

import io
import re
import zipfile

import httpx
import pytest

from app.services import path
from app.store import Role, UnknownError, Verdict
from study_core.comparison import Choice
from study_core.path import Ending
from tests.desk.conftest import Opener
from tests.desk.laboratory import Laboratory

CONDITIONS = """
[[condition]]
name = "heuristic"
[[condition]]
name = "random"
acquisition = { method = "random" }
"""


def decide(visitor: httpx.Client, session_id: str, revision: int, **fields: str) -> httpx.Response:
    typed = {"verdict": "", "reason": "", "note": ""} | fields | {"revision": str(revision)}
    return visitor.post(f"/desk/people/{session_id}/review", data=typed)


def actions(lab: Laboratory, about: str) -> list[tuple[str, str]]:
    return [(entry.who, entry.action) for entry in reversed(lab.store.desk.audit(about=about))]


def test_excluding_with_a_reason_and_taking_it_back_is_in_the_audit(lab: Laboratory) -> None:
    session_id = lab.under_way()
    with lab.browser(Role.ASSISTANT) as visitor:
        refused = decide(visitor, session_id, 0, verdict="excluded", note="asleep at the end")
        assert refused.status_code == 422
        assert "Expected a reason" in refused.text
        assert "asleep at the end" in refused.text
        assert decide(visitor, session_id, 0, verdict="excluded", reason="slept").status_code == 303
        assert lab.store.desk.review(session_id).verdict is Verdict.EXCLUDED
        page = visitor.get(f"/desk/people/{session_id}").text
        assert re.search(r'value="excluded" checked', page)
        assert 'name="reason" value="slept"' in page
        assert decide(visitor, session_id, 1, reason="slept", note="n").status_code == 303
    assert lab.store.desk.review(session_id).verdict is None
    assert actions(lab, session_id) == [
        ("adam", "person_excluded"),
        ("adam", "verdict_taken_back"),
        ("adam", "note_changed"),
    ]
    assert "slept" not in str(lab.store.desk.audit(about=session_id)), "the audit outlives whom it is about"


def test_the_second_of_two_who_change_the_same_sees_both_and_loses_nothing(lab: Laboratory) -> None:
    session_id = lab.under_way()
    with lab.browser(Role.ASSISTANT) as adam, lab.browser(Role.OWNER) as olga:
        assert decide(olga, session_id, 0, verdict="rejected", reason="a bot").status_code == 303
        late = decide(adam, session_id, 0, verdict="excluded", reason="slept", note="my long note")
        assert late.status_code == 409
        assert "olga has changed this" in late.text
        assert "a bot" in late.text
        assert "my long note" in late.text
        assert re.search(r'value="excluded" checked', late.text)
        assert 'name="revision" value="1"' in late.text
        assert lab.store.desk.review(session_id).reason == "a bot"
        assert decide(
            adam, session_id, 1, verdict="rejected", reason="a bot", note="my long note"
        ).is_redirect
    assert lab.store.desk.review(session_id).note == "my long note"


def test_somebody_who_was_stopped_is_reopened_and_somebody_who_goes_on_is_not(lab: Laboratory) -> None:
    session_id = lab.under_way()
    with lab.browser(Role.ASSISTANT) as visitor:
        assert visitor.post(f"/desk/people/{session_id}/reopen").status_code == 422
        path.end(lab.runtime, session_id, Ending.STOPPED)
        assert "Reopen the session" in visitor.get(f"/desk/people/{session_id}").text
        assert visitor.post(f"/desk/people/{session_id}/reopen").status_code == 303
    assert lab.store.ending(session_id) is None
    assert actions(lab, session_id) == [("adam", "person_reopened")]


def test_deleting_needs_the_words_and_removes_the_person(lab: Laboratory) -> None:
    session_id = lab.under_way()
    number = lab.store.session(session_id).ordinal
    with lab.browser(Role.OWNER) as visitor:
        unsure = visitor.post(f"/desk/people/{session_id}/delete", data={"confirmation": "delete"})
        assert unsure.status_code == 422
        assert "Nothing was deleted" in unsure.text
        assert lab.store.session(session_id).ordinal == number
        gone = visitor.post(f"/desk/people/{session_id}/delete", data={"confirmation": f"delete {number}"})
        assert gone.headers["location"] == "/desk/studies/quickstart?people=joined"
        assert visitor.get(f"/desk/people/{session_id}").status_code == 410
    with pytest.raises(UnknownError):
        lab.store.person_line("0" * 32)
    assert actions(lab, session_id) == [("olga", "person_deleted")]


def test_viewers_see_no_external_ids_and_nothing_to_press(lab: Laboratory) -> None:
    session_id = lab.participant("pid-of-alice")
    pages = {}
    for role in Role:
        with lab.browser(role) as visitor:
            pages[role] = visitor.get(f"/desk/people/{session_id}").text
            pages[role] += visitor.get("/desk/studies/quickstart").text
            found = visitor.get("/desk/studies/quickstart?find=nobody-is-called-so").text
            assert ("Nobody fits" in found) == (role is not Role.VIEWER), "viewers can't guess ids either"
    assert "pid-of-alice" in pages[Role.ASSISTANT]
    assert "signature=" in pages[Role.ASSISTANT]
    assert "pid-of-alice" not in pages[Role.VIEWER]
    assert "/review" not in pages[Role.VIEWER]
    assert "/delete" not in pages[Role.ASSISTANT]
    assert "/delete" in pages[Role.OWNER]


def test_conditions_are_told_to_owners_who_ask_and_each_look_is_in_the_audit(opened: Opener) -> None:
    with opened(CONDITIONS) as lab:
        session_id = lab.under_way()
        places = (
            "/desk/studies/quickstart",
            f"/desk/people/{session_id}",
            "/api/v1/studies/quickstart/people",
        )
        told = re.compile(r"\b(heuristic|random)\b")
        for role in Role:
            with lab.browser(role) as visitor:
                blind = [visitor.get(place).text for place in places]
                blind += [visitor.get(place).text for place in ("/desk/", "/api/v1/studies")]
                assert not any(told.search(text) for text in blind), role
                seen = [visitor.get(place, params={"conditions": "1"}) for place in (*places, *places)]
                if role is Role.OWNER:
                    assert all(told.search(answer.text) for answer in seen)
                else:
                    assert {answer.status_code for answer in seen} == {403}
        looks = [entry for entry in lab.store.desk.audit() if entry.action == "conditions_seen"]
        # The pages and the API each count looks of their own; a page that is loaded again is the same look.
        assert sorted(entry.about or "" for entry in looks) == sorted(
            ["quickstart", "quickstart", session_id]
        )


def test_the_person_page_shows_what_was_believed_and_answered(lab: Laboratory, person: str) -> None:
    with lab.browser(Role.VIEWER) as visitor:
        page = visitor.get(f"/desk/people/{person}").text
        in_full = visitor.get(f"/api/v1/people/{person}").json()
    records = lab.store.posteriors(person)
    last = records[-1]
    assert [belief["query_index"] for belief in in_full["beliefs"]] == [each.query_index for each in records]
    assert in_full["beliefs"][-1]["mean"] == last.mean.tolist()
    below = [
        sum(column <= low) for column, low in zip(last.samples.T, in_full["beliefs"][-1]["low"], strict=True)
    ]
    assert all(0.03 * len(last.samples) <= n <= 0.07 * len(last.samples) for n in below)
    for name, mean in zip(in_full["weight_names"], last.mean, strict=True):
        assert f"{name} {mean:.2f}".replace("-", "−") in page
    study = lab.parts.study
    assert [asked["choice"] for asked in in_full["asked"]] == ["a"] * study.n_queries
    assert {asked["response_s"] for asked in in_full["asked"]} == {1.5}
    assert in_full["moments"][-1]["what"] == f"Answered questions 1 to {study.n_queries}"
    assert "style=" not in page, "the content security policy forbids it"
    assert "<script>" not in page


def test_links_for_pasted_ids_let_their_people_in(lab: Laboratory) -> None:
    with lab.browser(Role.ASSISTANT) as visitor:
        page = visitor.post("/desk/studies/quickstart/links", data={"ids": "zoe\n\nyan \nzoe"}).text
        links = re.findall(r'<code id="link-\d+">([^<]+)</code>', page)
        assert len(links) == 2
        refused = visitor.post("/desk/studies/quickstart/links", data={"ids": "zoe\n{{id}}"})
        assert refused.status_code == 422
        assert "zoe\n{{id}}" in refused.text
    with lab.nobody() as zoe:
        assert zoe.get(links[0].replace("&amp;", "&")).status_code == 200
    assert lab.store.desk.audit(1)[0].detail == {"links": 2}


def test_an_export_is_one_zip_file_and_in_the_audit(lab: Laboratory, person: str) -> None:
    with lab.browser(Role.ASSISTANT) as visitor:
        answer = visitor.get("/desk/studies/quickstart/export.zip?form=jsonl&pseudonyms=true")
        assert answer.headers["content-type"] == "application/zip"
        with zipfile.ZipFile(io.BytesIO(answer.content)) as packed:
            assert packed.testzip() is None
            assert any(name.endswith("answers.jsonl") for name in packed.namelist())
        nobody = visitor.get("/desk/studies/quickstart/export.zip?people=imported")
        assert nobody.status_code == 422
        assert 'role="alert"' in nobody.text
        assert visitor.get("/desk/studies/quickstart/export.zip?form=tables").status_code == 422
    entry = next(entry for entry in lab.store.desk.audit() if entry.action == "exported")
    assert (entry.who, entry.detail["form"], entry.detail["pseudonyms"]) == ("adam", "jsonl", True)


def test_accounts_are_added_changed_and_removed_but_never_the_last_owner(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.OWNER) as olga:
        short = olga.post("/desk/accounts", data={"name": "zoe", "password": "short", "role": "viewer"})
        assert short.status_code == 422
        assert 'value="zoe"' in short.text
        assert olga.post(
            "/desk/accounts", data={"name": "zoe", "password": "long enough by far", "role": "viewer"}
        ).is_redirect
        assert olga.post("/desk/accounts/role", data={"name": "zoe", "role": "assistant"}).is_redirect
        assert olga.post("/desk/accounts/role", data={"name": "zoe", "role": "king"}).status_code == 422
        made = olga.post("/desk/accounts/reset", data={"name": "zoe"}).text
        password = re.search(r'<code id="secret">([^<]+)</code>', made)
        assert password is not None
        with lab.nobody() as zoe:
            assert zoe.post("/desk/login", data={"name": "zoe", "password": password[1]}).is_redirect
        assert olga.post("/desk/accounts/remove", data={"name": "zoe"}).is_redirect
        assert olga.post("/desk/accounts/remove", data={"name": "olga"}).status_code == 409
        assert olga.post("/desk/accounts/role", data={"name": "olga", "role": "viewer"}).status_code == 409
        done = [(entry.action, entry.about) for entry in lab.store.desk.audit(5)]
        assert ("account_removed", "zoe") in done
        assert password[1] not in olga.get("/desk/audit").text


def test_a_token_is_shown_once_works_and_can_be_revoked(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.ASSISTANT) as adam, lab.browser(Role.VIEWER) as vera:
        made = adam.post("/desk/tokens", data={"label": "my notebook", "role": "viewer"})
        secret = re.search(r'<code id="secret">([^<]+)</code>', made.text)
        assert secret is not None
        assert secret[1] not in adam.get("/desk/tokens").text
        assert adam.post("/desk/tokens", data={"label": "more", "role": "owner"}).status_code == 422
        bearer = {"Authorization": f"Bearer {secret[1]}"}
        me = httpx.get(f"{lab.url}/api/v1/me", headers=bearer)
        assert me.json() == {"name": "adam", "role": "viewer", "is_program": True}
        (token,) = lab.store.desk.api_tokens("adam")
        assert "my notebook" not in vera.get("/desk/tokens").text
        assert vera.post(f"/desk/tokens/{token.id}/revoke").status_code == 404
        assert adam.post(f"/desk/tokens/{token.id}/revoke").is_redirect
        assert httpx.get(f"{lab.url}/api/v1/me", headers=bearer).status_code == 401


def test_the_monitor_lists_sorts_filters_and_finds_people(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.ASSISTANT) as visitor:
        first, second = lab.completed(), lab.completed(Choice.B)
        waiting = lab.participant("somebody-else")

        def numbers(query: str) -> list[int]:
            page = visitor.get(f"/desk/studies/quickstart?{query}").text
            return [int(number) for number in re.findall(r'<tr id="p-(\d+)"', page)]

        ordinal = {each: lab.store.session(each).ordinal for each in (first, second, waiting)}
        assert numbers("") == sorted(ordinal.values())
        assert numbers("sort=-number") == sorted(ordinal.values(), reverse=True)
        assert numbers("show=completed") == [ordinal[first], ordinal[second]]
        assert numbers("show=under-way") == [ordinal[waiting]]
        assert numbers("find=body-el") == [ordinal[waiting]]
        assert numbers("people=rehearsed") == []
        assert numbers("show=nonsense&sort=nonsense&people=nonsense") == sorted(ordinal.values())
        accuracies = {
            person["number"]: person["held_out_accuracy"]
            for person in visitor.get("/api/v1/studies/quickstart/people").json()
        }
        by_accuracy = numbers("sort=-accuracy")
        assert by_accuracy[-1] == ordinal[waiting], "who has none is last"
        assert accuracies[by_accuracy[0]] >= accuracies[by_accuracy[1]]
        assert visitor.get("/desk/studies/unknown").status_code == 404

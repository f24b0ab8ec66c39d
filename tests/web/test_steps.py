"""Pages of the path, as a browser without scripts uses them: sent once, mended, never lost, never obeyed."""

from __future__ import annotations

import html
from collections.abc import Iterator

import httpx
import pytest

from app.services.tokens import hash_token
from app.settings import find_study
from app.store import open_store
from tests.support.server import ServerProcess, running_server
from tests.support.wayfarer import BROWSER, Wayfarer
from tests.web.test_pages import assert_safe

STUDY = find_study("full-path")
CONSENT, SCREENING, INSTRUCTIONS, PRACTICE, CLOSING, DEBRIEF = 0, 1, 2, 3, 8, 9
SCRIPT = '"><script>alert(1)</script>'


@pytest.fixture(scope="module")
def full_path(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server of the study that has every kind of step."""
    with running_server(tmp_path_factory.mktemp("steps"), STUDY.name) as started:
        yield started


@pytest.fixture
def somebody(full_path: ServerProcess) -> Iterator[Wayfarer]:
    """Somebody who has just joined."""
    with httpx.Client(base_url=full_path.url, timeout=60.0) as client:
        yield Wayfarer(client, STUDY)


@pytest.fixture(scope="module")
def finisher(full_path: ServerProcess) -> Iterator[Wayfarer]:
    """Somebody at the last questionnaire."""
    with httpx.Client(base_url=full_path.url, timeout=60.0) as client:
        person = Wayfarer(client, STUDY)
        person.go_to_step(CLOSING)
        yield person


def steps_taken(server: ServerProcess, person: Wayfarer) -> list[dict[str, object]]:
    with open_store(server.database) as store:
        record = store.session_by_token(hash_token(person.token))
        assert record is not None
        return [event.payload for event in store.events(record.id) if event.kind == "step_taken"]


def test_a_page_that_is_whole_leads_to_the_next(somebody: Wayfarer) -> None:
    taken = somebody.send(somebody.form())
    assert (taken.status_code, taken.headers["location"]) == (303, somebody.home)
    assert somebody.screen()["step"] == SCREENING


def test_every_page_has_safe_headers_and_sends_its_forms_with_their_origin(somebody: Wayfarer) -> None:
    for _ in range(3):
        shown = somebody.client.get(somebody.home, headers=BROWSER)
        assert_safe(shown)
        assert shown.headers["referrer-policy"] == "same-origin"
        somebody.go_on()


def test_a_page_that_is_sent_twice_is_taken_once(full_path: ServerProcess, somebody: Wayfarer) -> None:
    form = somebody.form()
    assert [somebody.send(form).status_code for _ in range(3)] == [303, 303, 303]
    assert [step["step"] for step in steps_taken(full_path, somebody)] == [CONSENT]


@pytest.mark.parametrize("step", ["5", "-1", "", "nonsense", "99999999999999999999", "²"])
def test_a_page_that_is_not_the_current_one_changes_nothing(
    full_path: ServerProcess, somebody: Wayfarer, step: str
) -> None:
    response = somebody.send({**somebody.form(), "_step": step})
    assert (response.status_code, response.headers["location"]) == (303, somebody.home)
    assert steps_taken(full_path, somebody) == []


def test_a_check_that_is_sent_twice_is_one_try(somebody: Wayfarer) -> None:
    somebody.go_to_step(PRACTICE)
    wrong = somebody.form(**{"which-car": "orange"})
    somebody.send(wrong)
    somebody.send(wrong)
    page = somebody.page()
    assert "Not quite yet" in page
    # The instructions can be read again, above the questions.
    assert page.index("short drives at the same time") < page.index("which-car")
    assert somebody.send({**somebody.form(), "_tries": "1"}).status_code == 303
    assert somebody.screen()["kind"] in ("question", "preparing")


def test_what_has_to_be_mended_is_said_and_nothing_typed_is_lost(finisher: Wayfarer) -> None:
    form = finisher.form(
        enjoyed="8", remarks=f"First line\nsecond {SCRIPT}", **{"cared-for": ["speed", "lane"]}
    )
    answered = finisher.send(form)
    assert answered.status_code == 422
    assert 'role="alert"' in answered.text
    assert "autofocus" in answered.text
    assert "Please choose one of the answers shown." in answered.text
    assert SCRIPT not in answered.text
    assert f"First line\nsecond {SCRIPT}</textarea>" in html.unescape(answered.text)
    for option, is_chosen in (("speed", True), ("distance", False), ("lane", True)):
        assert (f'value="{option}" checked' in answered.text) is is_chosen
    assert finisher.screen()["step"] == CLOSING


def test_free_text_is_stored_as_typed_and_never_obeyed(full_path: ServerProcess, somebody: Wayfarer) -> None:
    somebody.go_to_step(CLOSING)
    remark = f" {SCRIPT}\n\n<b>„ありがとう“</b> & more "
    refused = somebody.send(somebody.form(enjoyed="", remarks=remark))
    assert refused.status_code == 422
    assert "<script>alert" not in refused.text
    assert somebody.send(somebody.form(remarks=remark)).status_code == 303
    assert steps_taken(full_path, somebody)[-1]["content"]["answers"]["remarks"] == remark


def test_the_address_of_a_sent_form_leads_back_to_the_page(somebody: Wayfarer) -> None:
    stray = somebody.client.get(f"{somebody.home}step", headers=BROWSER)
    assert (stray.status_code, stray.headers["location"]) == (303, somebody.home)


def test_a_file_cannot_be_uploaded(full_path: ServerProcess, somebody: Wayfarer) -> None:
    sent = somebody.client.post(f"{somebody.home}step", files={"remarks": b"content"}, headers=BROWSER)
    assert sent.status_code == 415
    assert steps_taken(full_path, somebody) == []


def test_a_form_from_another_site_is_refused(full_path: ServerProcess, somebody: Wayfarer) -> None:
    foreign = {**BROWSER, "Origin": "https://elsewhere.example"}
    sent = somebody.client.post(f"{somebody.home}step", data=somebody.form(), headers=foreign)
    assert sent.status_code == 403
    assert steps_taken(full_path, somebody) == []


def test_a_page_of_long_answers_in_any_script_fits_and_more_is_refused(finisher: Wayfarer) -> None:
    within = finisher.send(finisher.form(enjoyed="", remarks="猫" * 5000))
    assert within.status_code == 422
    assert "at most" not in within.text
    too_long = finisher.send(finisher.form(remarks="猫" * 5001))
    assert too_long.status_code == 422
    assert "at most 5,000 characters" in too_long.text
    assert finisher.send(finisher.form(remarks="x" * 600_000)).status_code == 413


def test_the_language_can_be_changed_and_lasts(somebody: Wayfarer) -> None:
    assert '<html lang="en" dir="ltr">' in somebody.page()
    changed = somebody.client.post(f"{somebody.home}language", data={"language": "de"})
    assert (changed.status_code, changed.headers["location"]) == (303, somebody.home)
    assert '<html lang="de" dir="ltr">' in somebody.page()
    assert "Wie sollte ein Auto fahren?" in somebody.page()
    somebody.client.post(f"{somebody.home}language", data={"language": "xx"})
    assert '<html lang="de" dir="ltr">' in somebody.page()


def test_declining_ends_it_with_a_code_of_its_own(somebody: Wayfarer) -> None:
    somebody.send(somebody.form(accept="no"))
    assert somebody.screen()["kind"] == "finished"
    assert "FULLPATH-DECLINED" in somebody.page()


def test_the_debrief_shows_the_own_result_and_the_last_page_its_code(somebody: Wayfarer) -> None:
    somebody.go_to_step(DEBRIEF)
    page = somebody.page()
    assert "Keeping clear of the other car" in page
    # Fewer than five others have been through it.
    assert page.count('<svg class="drive"') == 1
    assert "average" not in page
    somebody.go_on()
    last = somebody.page()
    assert "FULLPATH-DONE" in last
    assert 'href="https://app.prolific.com/submissions/complete?cc=FULLPATH-DONE"' in last

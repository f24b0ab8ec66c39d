"""The JSON API: what the desk's pages can do, for programs. Its description is at `/api/v1/openapi.json`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, FastAPI, Query, Request, Security
from fastapi.responses import FileResponse, StreamingResponse
from fastapi.security import APIKeyCookie, HTTPBearer

from app.desk import api_shapes as shapes
from app.desk.admission import COOKIE, Here, admit
from app.desk.api_errors import add_api_errors
from app.desk.backups import SQLITE, backup_file
from app.desk.conditions import ConditionLooks, blinded
from app.desk.exports import ZIP, Wished, archive
from app.desk.links import open_link, personal_links, prolific_link
from app.desk.monitor_page import PEOPLE
from app.desk.parts import DeskParts
from app.desk.reports import REPORT_FILES, ReportWish, begin_report, report_file
from app.desk.tokens import make_api_token, revoke_api_token
from app.services import desk_people
from app.services.history import history_of
from app.services.monitor import overview, person_of, study_summaries, study_summary
from app.services.reports import ReportKind
from app.store import Review

_DESCRIPTION = """
Send `Authorization: Bearer TOKEN`; tokens are made at the desk, under *Programs*, and can be revoked there.
The desk's own cookie works too. Who is in which condition is given to owners alone who ask for it with
`conditions=true`, and each look is in the audit.
"""
_TOKEN = HTTPBearer(auto_error=False, description="A token that was made at the desk.")
_LOGIN = APIKeyCookie(name=COOKIE, auto_error=False, description="The desk's own login.")

Conditions = Annotated[bool, Query(description="Whether to say who is in which condition; for owners.")]
Kind = Annotated[
    Literal["joined", "rehearsed", "imported", "all"], Query(description="Which kind of people.")
]


def create_api(parts: DeskParts) -> FastAPI:
    """Returns the API as an application of its own, below `/api/v1` of the site."""
    api = FastAPI(
        title="prefstudy",
        version="1",
        description=_DESCRIPTION,
        dependencies=[Depends(admit), Security(_TOKEN), Security(_LOGIN)],
        docs_url=None,
        redoc_url=None,
        responses=_errors(400, 401, 403, 422),
    )
    api.state.parts = parts
    add_api_errors(api)
    looks = ConditionLooks(parts.runtime.store)
    for routes in (_studies(parts, looks), _reports(parts), _people(parts, looks), _accounts(parts)):
        api.include_router(routes)
    return api


def _errors(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Returns how a description says which errors there may be; all have one shape."""
    return {status: {"model": shapes.ErrorShape, "description": _MEANINGS[status]} for status in statuses}


_MEANINGS = {
    400: "The request can't be read.",
    401: "Nobody, or a token or login that doesn't hold.",
    403: "The role doesn't reach, or a browser's page isn't ours.",
    404: "There is no such thing.",
    409: "It was changed meanwhile, or can't be in the state it is in.",
    410: "The person was deleted.",
    411: "The request doesn't say how long it is.",
    413: "The request is too long.",
    422: "What was sent can't be taken; the message says what was expected.",
}
_WRITES = _errors(411, 413)


def _studies(parts: DeskParts, looks: ConditionLooks) -> APIRouter:
    router = APIRouter(tags=["studies"])
    runtime = parts.runtime

    @router.get("/me")
    def me(here: Here) -> shapes.Me:
        """Whose request it is."""
        return shapes.Me(name=here.name, role=here.experimenter.role, is_program=here.is_program)

    @router.get("/studies")
    def studies() -> list[shapes.Study]:
        """Every study of the database, the one that is served first."""
        return [shapes.Study.of(summary) for summary in study_summaries(runtime, parts.study)]

    @router.get("/studies/{name}", responses=_errors(404))
    def study(
        here: Here, name: shapes.StudyName, people: Kind = "joined", conditions: Conditions = False
    ) -> shapes.StudyMonitor:
        """One study: its progress, the balance of its conditions, and signs of trouble."""
        if conditions:
            looks.look(here, name)
        found = overview(runtime, parts.study, name, PEOPLE[people])
        arms = found.arms if conditions else blinded(found.arms)
        return shapes.StudyMonitor(
            **shapes.Study.of(found.summary).model_dump(),
            conditions=[shapes.ArmShape.of(arm) for arm in arms],
            troubles=[shapes.TroubleShape.of(trouble) for trouble in found.troubles],
        )

    @router.get("/studies/{name}/people", responses=_errors(404))
    def people(
        here: Here, name: shapes.StudyName, people: Kind = "joined", conditions: Conditions = False
    ) -> list[shapes.Person]:
        """Everybody in a study, oldest first."""
        if conditions:
            looks.look(here, name)
        found = overview(runtime, parts.study, name, PEOPLE[people])
        return [shapes.Person.of(person, here.is_assistant, conditions) for person in found.people]

    @router.get(
        "/studies/{name}/export",
        response_class=StreamingResponse,
        responses=_errors(404) | {200: {"content": {ZIP: {}}, "description": "A zip file."}},
    )
    def export(here: Here, name: shapes.StudyName, wish: Wished) -> StreamingResponse:
        """Everything that was recorded, as tidy tables that describe themselves, in one zip file."""
        return archive(parts, here, name, wish)

    @router.get("/studies/{name}/links", responses=_errors(404))
    def links(request: Request, name: shapes.StudyName) -> shapes.Links:
        """The links that are the same for everybody."""
        base = parts.base_url(request)
        study_summary(runtime, parts.study, name)
        return shapes.Links(open=open_link(name, base), prolific=prolific_link(name, base))

    @router.post("/studies/{name}/links", responses=_errors(404) | _WRITES)
    def make_links(
        request: Request, here: Here, name: shapes.StudyName, wanted: shapes.NewLinks
    ) -> list[shapes.PersonalLink]:
        """Personal links: each lets one person in, and back in, from any browser."""
        study_summary(runtime, parts.study, name)
        made = personal_links(runtime.store, name, wanted.ids, parts.base_url(request))
        runtime.store.desk.record(here.name, "links_made", name, {"links": len(made)})
        return [shapes.PersonalLink(id=each, link=link) for each, link in made.items()]

    return router


def _reports(parts: DeskParts) -> APIRouter:
    router = APIRouter(prefix="/studies/{name}/reports/{kind}", tags=["reports"], responses=_errors(404))

    @router.get("")
    def state(name: shapes.StudyName, kind: ReportKind) -> shapes.Report:
        """How far a report is."""
        return shapes.Report.of(parts.reports.state(name, kind))

    @router.post("", status_code=202, responses=_WRITES)
    def begin(here: Here, name: shapes.StudyName, kind: ReportKind, wish: ReportWish) -> shapes.Report:
        """Has a report written, in the place of an older one; one that is being written goes on."""
        return shapes.Report.of(begin_report(parts, here, name, kind, wish.people))

    @router.get(
        "/file",
        response_class=FileResponse,
        responses={200: {"content": REPORT_FILES, "description": "A file."}},
    )
    def download(name: shapes.StudyName, kind: ReportKind) -> FileResponse:
        """A report that is ready."""
        return report_file(parts, name, kind)

    return router


def _people(parts: DeskParts, looks: ConditionLooks) -> APIRouter:
    router = APIRouter(prefix="/people/{session_id}", tags=["people"], responses=_errors(404, 410))
    runtime = parts.runtime

    @router.get("")
    def person(
        here: Here, session_id: shapes.SessionId, conditions: Conditions = False
    ) -> shapes.PersonInFull:
        """One person, with their session as it went."""
        if conditions:
            looks.look(here, session_id)
        found, history = person_of(runtime, session_id), history_of(runtime, session_id)
        return shapes.PersonInFull.of_history(found, history, here.is_assistant, conditions)

    @router.put("/review", responses=_errors(409) | _WRITES)
    def review(here: Here, session_id: shapes.SessionId, wanted: shapes.NewReview) -> shapes.Review:
        """Rejects or excludes a person with a reason, takes that back, or notes something."""
        changed = Review(wanted.verdict, wanted.reason, wanted.note, wanted.revision)
        return shapes.Review.of(desk_people.review(runtime, here.name, session_id, changed))

    @router.post("/reopen", responses=_errors(409) | _WRITES)
    def reopen(here: Here, session_id: shapes.SessionId) -> shapes.Person:
        """Lets a person go on whose session has ended before its time."""
        desk_people.reopen(runtime, here.name, session_id)
        return shapes.Person.of(person_of(runtime, session_id), here.is_assistant, False)

    @router.delete("", responses=_WRITES)
    def delete(here: Here, session_id: shapes.SessionId) -> shapes.Deleted:
        """Deletes a person, with everything that was learned from them. There is no way back."""
        deleted = desk_people.delete(runtime, here.name, session_id)
        return shapes.Deleted(**vars(deleted) | {"session_ids": list(deleted.session_ids)})

    return router


def _accounts(parts: DeskParts) -> APIRouter:
    router = APIRouter(tags=["accounts"])
    accounts, kept = parts.accounts, parts.runtime.store.desk

    @router.get("/accounts")
    def list_accounts() -> list[shapes.Account]:
        """Everybody who may use the desk."""
        return [shapes.Account.of(experimenter) for experimenter in kept.experimenters()]

    @router.post("/accounts", status_code=201, responses=_errors(409) | _WRITES)
    def add_account(here: Here, wanted: shapes.NewAccount) -> shapes.Account:
        """Lets somebody use the desk."""
        return shapes.Account.of(accounts.add(here.name, wanted.name, wanted.password, wanted.role))

    @router.patch("/accounts/{name}", responses=_errors(404, 409) | _WRITES)
    def change_account(here: Here, name: shapes.AccountName, change: shapes.AccountChange) -> shapes.Account:
        """Changes what somebody may do."""
        accounts.change_role(here.name, name, change.role)
        return next(shapes.Account.of(each) for each in kept.experimenters() if each.name == name)

    @router.delete("/accounts/{name}", status_code=204, responses=_errors(404, 409) | _WRITES)
    def remove_account(here: Here, name: shapes.AccountName) -> None:
        """Takes the desk from somebody."""
        accounts.remove(here.name, name)

    @router.get("/tokens")
    def list_tokens(here: Here) -> list[shapes.Token]:
        """One's own tokens; all of them for owners."""
        return [shapes.Token.of(token) for token in kept.api_tokens(None if here.is_owner else here.name)]

    @router.post("/tokens", status_code=201, responses=_WRITES)
    def make_token(here: Here, wanted: shapes.NewToken) -> shapes.MadeToken:
        """Lets a program in; refused to programs."""
        token, secret = make_api_token(accounts, here, wanted.label, wanted.role)
        return shapes.MadeToken(**shapes.Token.of(token).model_dump(), secret=secret)

    @router.delete("/tokens/{token_id}", status_code=204, responses=_errors(404) | _WRITES)
    def revoke_token(here: Here, token_id: shapes.TokenId) -> None:
        """Shuts a program out."""
        revoke_api_token(parts, here, token_id)

    @router.get("/audit", tags=["audit"])
    def audit(
        n: Annotated[int, Query(ge=1, le=1000, description="At most so many.")] = 100,
        skip: Annotated[int, Query(ge=0, le=2**31 - 1, description="So many of the newest.")] = 0,
        about: Annotated[
            str, Query(max_length=255, description="Only what was about this; all if empty.")
        ] = "",
    ) -> list[shapes.Entry]:
        """What experimenters did, newest first."""
        return [shapes.Entry.of(entry) for entry in kept.audit(n, skip, about or None)]

    @router.get(
        "/backup",
        tags=["audit"],
        response_class=FileResponse,
        responses={200: {"content": {SQLITE: {}}, "description": "A SQLite database."}},
    )
    def backup(here: Here) -> FileResponse:
        """A copy of the whole database, read back."""
        return backup_file(parts, here)

    return router

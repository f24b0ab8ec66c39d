"""The web application: participant pages and their JSON API."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, FastAPI, HTTPException, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import RedirectResponse, Response, StreamingResponse
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException as StarletteHTTPException

from app.services import study as services
from app.services.runtime import Runtime
from app.settings import STATIC
from app.store import SessionDeletedError, SessionRecord
from app.web.changes import Changes
from app.web.guard import Guard, JoinLimit, protect
from app.web.pages import error_json, error_response, templates
from app.web.screens import screen_events
from study_core.comparison import Choice
from study_core.study import Study

_SECONDS_PER_QUERY = 14
_OTHER_ANSWERS = {
    Choice.SAME: "About the same",
    Choice.UNSURE: "Can’t tell",
    Choice.SKIP: "Skip this pair",
}
_COOKIE = "prefstudy-session"
_COOKIE_AGE_S = 30 * 24 * 3600
_UNKNOWN_LINK = (
    "This link doesn’t open a session here",
    "Check that the whole link was copied, or ask the person who sent it to you for a new one.",
)

_UNKNOWN_PAGE = ("There is nothing here", "Check that the whole address was copied.")


@dataclass(frozen=True)
class SiteParts:
    """What the site is made of.

    Attributes:
        runtime: The services' resources.
        stage: Routes of the participants' stages.
        n_viewers: Tells how many browser pages watch a session's stage.
        changes: Wakes the streams of screens.
        study: The study that people can join.
        public_url: Address that participants use, if it isn't the one the server listens on.
        on_shutdown: Called when the server has stopped accepting.
    """

    runtime: Runtime
    stage: APIRouter
    n_viewers: Callable[[str], int]
    changes: Changes
    study: Study
    public_url: str | None
    on_shutdown: Callable[[], None]


class AnswerBody(BaseModel):
    """An answer as the page sends it; `client` is what the browser measured."""

    model_config = ConfigDict(extra="forbid", strict=True)

    query_index: int
    choice: str
    response_time_ms: int
    client: dict[str, Any] | None = None


def create_site(parts: SiteParts) -> FastAPI:
    """Returns the application, ready to be served."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        parts.changes.start()
        yield
        await run_in_threadpool(parts.on_shutdown)

    site = FastAPI(title="prefstudy", lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)
    site.state.parts = parts
    site.add_middleware(Guard, public_url=parts.public_url)
    site.mount("/static", StaticFiles(directory=STATIC), name="static")
    _add_error_pages(site)
    _add_join_pages(site, parts)
    _add_participant_pages(site, parts)
    site.include_router(parts.stage)
    return site


def _add_error_pages(site: FastAPI) -> None:
    """Every error is a page for people and one JSON shape for programs; neither shows an exception's text."""

    @site.exception_handler(StarletteHTTPException)
    async def http_error(request: Request, error: StarletteHTTPException) -> Response:
        detail: Any = error.detail
        title, text = _UNKNOWN_PAGE if isinstance(detail, str) else detail
        return error_response(request, error.status_code, f"http-{error.status_code}", title, text)

    @site.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        problem = error.errors()[0]
        where = ".".join(str(part) for part in problem["loc"] if part != "body")
        return error_json(422, "invalid-request", f"{where or 'body'}: {problem['msg']}.")

    @site.exception_handler(services.InvalidAnswerError)
    async def invalid_answer(request: Request, error: services.InvalidAnswerError) -> Response:
        return error_json(422, "invalid-answer", str(error))

    @site.exception_handler(SessionDeletedError)
    async def deleted(request: Request, error: SessionDeletedError) -> Response:
        title, text = "This session was deleted", "Nothing of it is kept. You can close this page."
        return error_response(request, 410, "deleted", title, text)

    @site.exception_handler(Exception)
    async def failure(request: Request, error: Exception) -> Response:
        text = "Your answers so far are saved. Please try again in a moment."
        response = error_response(request, 500, "internal", "Something went wrong on our side", text)
        # This runs outside the guard, and outside everything else.
        protect(request.url.path, response.headers)
        return response


def _add_join_pages(site: FastAPI, parts: SiteParts) -> None:
    limit = JoinLimit()

    def joinable(name: str) -> Study:
        if name != parts.study.name:
            raise HTTPException(404, _UNKNOWN_LINK)
        return parts.study

    @site.get("/healthz")
    def health() -> dict[str, str]:
        return {"status": "ok", "study": parts.study.name}

    @site.get("/join/{name}")
    def welcome(request: Request, name: str) -> Response:
        study = joinable(name)
        token = request.cookies.get(_COOKIE)
        if token is not None and _is_unfinished(parts.runtime, token):
            return RedirectResponse(f"/s/{token}/", status_code=303)
        return _welcome(request, study)

    @site.post("/join/{name}")
    def join(request: Request, name: str) -> Response:
        study = joinable(name)
        if not limit.allows(request.client.host if request.client else ""):
            raise HTTPException(429, ("Many people are joining just now", "Please try again in a minute."))
        token, _ = services.join(parts.runtime, study)
        response = RedirectResponse(f"/s/{token}/", status_code=303)
        is_secure = (parts.public_url or "").startswith("https://")
        # Whoever closes the tab and opens the join link again comes back to their own session.
        response.set_cookie(
            _COOKIE,
            token,
            _COOKIE_AGE_S,
            path=f"/join/{name}",
            secure=is_secure,
            httponly=True,
            samesite="lax",
        )
        return response


def _is_unfinished(runtime: Runtime, token: str) -> bool:
    record = services.find(runtime, token)
    return record is not None and services.screen(runtime, record.id).kind != "finished"


def _welcome(request: Request, study: Study) -> Response:
    n_queries = study.protocol.n_queries
    context = {
        "title": study.file.title,
        "about": study.file.text.welcome.strip(),
        "n_questions": n_queries,
        "minutes": max(1, round(n_queries * _SECONDS_PER_QUERY / 60)),
    }
    response = templates.TemplateResponse(request, "welcome.html", context)
    # Under `no-referrer`, browsers send the form with the origin "null", which the guard refuses.
    response.headers["Referrer-Policy"] = "same-origin"
    return response


async def _session_of(request: Request, token: str) -> SessionRecord:
    runtime: Runtime = request.app.state.parts.runtime
    # Almost every request is of a session that is known; only the first has to ask the store, in a thread.
    found = services.find_known(runtime, token) or await run_in_threadpool(services.find, runtime, token)
    if found is None:
        raise HTTPException(404, _UNKNOWN_LINK)
    return found


ThisSession = Annotated[SessionRecord, Depends(_session_of)]


def _add_participant_pages(site: FastAPI, parts: SiteParts) -> None:
    runtime = parts.runtime

    @site.get("/s/{token}/")
    def page(request: Request, session: ThisSession) -> Response:
        screen = services.screen(runtime, session.id)
        study = runtime.live(session.id).study
        if screen.kind == "welcome":
            return _welcome(request, study)
        text = study.file.text
        context = {
            "title": study.file.title,
            "question": text.question,
            "thanks": text.thanks,
            "screen": asdict(screen),
            "other_answers": {c.value: _OTHER_ANSWERS[c] for c in study.answers if c in _OTHER_ANSWERS},
        }
        return templates.TemplateResponse(request, "participant.html", context)

    @site.post("/s/{token}/")
    def begin(token: str, session: ThisSession) -> Response:
        services.begin(runtime, session.id)
        return RedirectResponse(f"/s/{token}/", status_code=303)

    @site.get("/s/{token}/screens")
    async def screens(session: ThisSession) -> Response:
        events = screen_events(runtime, session.id, parts.changes, parts.n_viewers)
        # A proxy in front must pass each event on at once.
        headers = {"X-Accel-Buffering": "no"}
        return StreamingResponse(events, headers=headers, media_type="text/event-stream")

    @site.post("/s/{token}/answer")
    def answer(session: ThisSession, body: AnswerBody) -> dict[str, Any]:
        receipt = services.answer(
            runtime, session.id, body.query_index, body.choice, body.response_time_ms, body.client
        )
        return {"outcome": receipt.outcome.value, "screen": asdict(receipt.screen)}

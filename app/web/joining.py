"""The way in: from a study's link to a session's own address."""

from __future__ import annotations

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import RedirectResponse, Response

from app.services.joining import Arrival, Door, Visit, Welcome
from app.services.links import Invitation, read_farewell, read_invitation
from app.services.tokens import is_token, new_token
from app.web.access import UNKNOWN_LINK
from app.web.cookie import keep_token, kept_token
from app.web.ending import farewell_page
from app.web.forms import Fields, SentForm
from app.web.guard import RateLimit
from app.web.languages import N_, format_moment, translator
from app.web.pages import error_response, form_page, page_language, requested_language
from app.web.parts import SiteParts
from app.web.welcome import welcome_page
from study_core.study import Study, parse_study

# A lab of thirty may sit down behind one address; a code has 60 bits, which nobody guesses at this rate.
_CODES_PER_MINUTE = 30
_JOINS_PER_MINUTE = 120

TICKET, CODE = "ticket", "code"
"""Fields of the forms."""

_TOO_MANY_JOINS = (N_("Many people are joining just now"), N_("Please try again in a minute."))
_TOO_MANY_CODES = (N_("Many codes have been tried just now"), N_("Please try again in a minute."))
_REFUSALS = {
    Arrival.NOT_YET: (
        403,
        N_("This study has not opened yet"),
        N_("It opens on {opens}. Please open this same link again then."),
    ),
    Arrival.CLOSED: (
        410,
        N_("This study is closed"),
        N_(
            "It doesn’t take new people any more. Thank you for wanting to take part.\n\n"
            "If you have begun it before, open this link in the browser that you used then, or your personal link."
        ),
    ),
    Arrival.FULL: (
        403,
        N_("All places in this study are taken"),
        N_(
            "Thank you for wanting to take part. A place may become free when somebody stops, so you can try this "
            "same link again later.\n\n"
            "If you have begun it before, open this link in the browser that you used then, or your personal link."
        ),
    ),
}


def join_routes(parts: SiteParts, door: Door) -> APIRouter:
    """Returns the routes below `/join/{name}`."""
    router = APIRouter(prefix="/join/{name}")
    store = parts.runtime.store
    joins, codes = RateLimit(_JOINS_PER_MINUTE), RateLimit(_CODES_PER_MINUTE)

    def open_for(request: Request, name: str) -> Study:
        if name != parts.study.name:
            raise HTTPException(404, UNKNOWN_LINK)
        request.state.language = requested_language(request, parts.study.languages)
        return parts.study

    def invitation_of(request: Request, name: str) -> Invitation:
        return read_invitation(store, name, request.query_params)

    @router.api_route("", methods=["GET", "HEAD"])
    def arrive(request: Request, name: str) -> Response:
        study, invitation = open_for(request, name), invitation_of(request, name)
        kept = kept_token(request, invitation.person)
        found = door.arrive(Visit(invitation, kept))
        if found.arrival is Arrival.RESUMED:
            return RedirectResponse(f"/s/{found.token}/", status_code=303)
        # A link that is loaded again offers the same ticket again: so whoever never heard that they are in, is.
        ticket = kept if kept and is_token(kept) and found.token is None else new_token()
        response = _page(request, study, found, ticket)
        if kept is None:
            keep_token(response, parts, invitation.person, ticket)
        return response

    @router.post("")
    def join(request: Request, name: str, form: SentForm) -> Response:
        study, invitation = open_for(request, name), invitation_of(request, name)
        _count(request, joins, _TOO_MANY_JOINS)
        kept = kept_token(request, invitation.person)
        ticket = _ticket(form)
        # A ticket is kept where it was offered; so a browser that brings one and has nothing keeps no cookies.
        keeps_nothing = ticket is not None and kept is None
        visit = Visit(invitation, kept)
        found = door.join(visit, ticket or new_token(), page_language(request))
        if found.arrival is not Arrival.RESUMED or found.token is None:
            return _page(request, study, found, new_token())
        needs_way_back = keeps_nothing and not invitation.is_signed
        return _let_in(found.token, "device?begin=1" if needs_way_back else "")

    @router.get("/resume")
    def ask_for_code(request: Request, name: str) -> Response:
        return _code_page(request, open_for(request, name))

    @router.post("/resume")
    def resume(request: Request, name: str, form: SentForm) -> Response:
        study = open_for(request, name)
        _count(request, codes, _TOO_MANY_CODES)
        token = door.resume("".join(form.get(CODE, [])[:1]), new_token())
        return _code_page(request, study, is_wrong=True) if token is None else _let_in(token)

    @router.get("/deleted")
    def farewell(request: Request, name: str) -> Response:
        open_for(request, name)
        deleted = parse_study(store.study_text(read_farewell(store, request.query_params)))
        return farewell_page(request, deleted)

    def _let_in(token: str, page: str = "") -> Response:
        response = RedirectResponse(f"/s/{token}/{page}", status_code=303)
        keep_token(response, parts, door.person_of(token), token)
        return response

    return router


def _page(request: Request, study: Study, found: Welcome, ticket: str) -> Response:
    """Returns what somebody sees who isn't in a session yet, or not in this browser."""
    if found.arrival in _REFUSALS:
        return refusal(request, study, found.arrival)
    if found.arrival is Arrival.KNOWN_ELSEWHERE:
        return _code_page(request, study)
    if found.arrival is Arrival.INVITED_BACK:
        context = {"title": study.title(page_language(request)), "ticket": ticket}
        return form_page(request, "invited.html", context)
    return welcome_page(request, study, ticket, f"/s/{found.token}/" if found.token else None)


def refusal(request: Request, study: Study, arrival: Arrival) -> Response:
    """Returns the page for somebody new whom a study can't take now."""
    status, title, text = _REFUSALS[arrival]
    language, opens = page_language(request), study.file.recruitment.opens
    said = translator(language).gettext(text)
    if opens is not None:
        said = said.format(opens=format_moment(opens, language))
    return error_response(request, status, arrival.value, title, said)


def _code_page(request: Request, study: Study, is_wrong: bool = False) -> Response:
    """Returns the page that asks for a resume code; it says nothing about any session."""
    context = {
        "title": study.title(page_language(request)),
        "action": f"/join/{study.name}/resume",
        "is_wrong": is_wrong,
        "has_id": not request.url.path.endswith("/resume"),
    }
    return form_page(request, "resume.html", context, 403 if is_wrong else 200)


def _ticket(form: Fields) -> str | None:
    """Returns the ticket that a page of ours has offered; anything else is none."""
    sent = form.get(TICKET, [])
    return sent[0] if len(sent) == 1 and is_token(sent[0]) else None


def _count(request: Request, limit: RateLimit, refusal: tuple[str, str]) -> None:
    if not limit.allows(request.client.host if request.client else ""):
        raise HTTPException(429, refusal)

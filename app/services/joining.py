"""Who comes in to a study, and who comes back: nobody twice, nobody as somebody else.

What opens a session is a secret token, and nothing else. A page that offers to begin carries a fresh one, its ticket,
which becomes the session's token: so sending the page twice makes one session. Whoever has only an external id, which
is no secret, is told nothing but that it has begun; they get a token by the session's resume code, or by a link that
was signed for them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum

from app.services import path
from app.services import study as services
from app.services.links import Invitation
from app.services.runtime import LiveSession, Runtime
from app.services.tokens import hash_code, hash_token, new_token, next_token, resume_code
from app.store import (
    ExternalPerson,
    PersonKnownError,
    SessionDeletedError,
    SessionRecord,
    Source,
    TokenTakenError,
)
from study_core.conditions import choose
from study_core.path import Ending
from study_core.streams import stream
from study_core.study import Study


class Arrival(StrEnum):
    """What somebody finds who opens a study's link."""

    NEW = "new"
    """They can begin."""
    RESUMED = "resumed"
    """They are in a session, and can go on at once."""
    INVITED_BACK = "invited-back"
    """Their own link may open their session in this browser too."""
    KNOWN_ELSEWHERE = "known-elsewhere"
    """The id has a session, and this browser has nothing that opens it."""
    NOT_YET = "not-yet"
    CLOSED = "closed"
    FULL = "full"


@dataclass(frozen=True)
class Visit:
    """Somebody at the door.

    Attributes:
        invitation: What the link says of them.
        token: What this browser has kept from before, if anything.
    """

    invitation: Invitation
    token: str | None


@dataclass(frozen=True)
class Welcome:
    """What is to be done with somebody at the door.

    Attributes:
        arrival: What they find.
        token: Of the session that they are in now; with `new`, of one that has ended in this browser.
    """

    arrival: Arrival
    token: str | None = None


class Door:
    """The way in to one study. Fit for many threads."""

    def __init__(self, runtime: Runtime, study: Study) -> None:
        """Opens nothing yet.

        Args:
            runtime: The services' resources.
            study: The study, in the version that new people get.
        """
        self._runtime = runtime
        self._study = study
        # Of two people, one gets the last place.
        self._one_at_a_time = threading.Lock()

    def arrive(self, visit: Visit) -> Welcome:
        """Returns what somebody finds; changes nothing."""
        return _settled(lambda: self._arrive(visit))

    def _arrive(self, visit: Visit) -> Welcome:
        person = visit.invitation.person
        kept = None if visit.token is None else self._session_of(visit.token)
        if kept is not None and self._is_of(kept, visit.invitation):
            is_over = self._runtime.live(kept.id).state.ending is not None
            if person is not None or not is_over:
                return Welcome(Arrival.RESUMED, visit.token)
            # Several people may sit down at one browser, one after another, with the same link.
            place = self._place()
            return Welcome(place if place is Arrival.NEW else Arrival.RESUMED, visit.token)
        if person is not None and self._runtime.store.session_of_person(self._study.name, person.external_id):
            is_theirs = visit.invitation.is_signed
            return Welcome(Arrival.INVITED_BACK if is_theirs else Arrival.KNOWN_ELSEWHERE)
        return Welcome(self._place())

    def join(self, visit: Visit, ticket: str, language: str | None = None) -> Welcome:
        """Lets somebody in, or back in.

        Args:
            visit: Who it is.
            ticket: The token that the page offered; whoever sends it again comes to the same session.
            language: In which they want to read.

        Returns:
            With a token, if they are in.
        """
        return _settled(lambda: self._join(visit, ticket, language))

    def resume(self, code: str, token: str) -> str | None:
        """Lets a fresh token open the session that a code belongs to.

        Returns:
            The token; None if no session of the study has that code.
        """
        session = self._runtime.store.session_by_code(hash_code(code))
        if session is None or not self._is_of_study(session):
            return None
        self._add_token(session.id, token)
        return token

    def person_of(self, token: str) -> ExternalPerson | None:
        """Returns who the person of a token's session is to whoever sent them, if anybody did."""
        session = self._session_of(token)
        return None if session is None else self._runtime.store.external_person(session.id)

    def begin_again(self, token: str) -> Welcome:
        """Lets somebody whose session has become too old begin a new one, or go on with one that they have begun.

        Args:
            token: Of the old session. It leads to the same new token each time.
        """
        return _settled(lambda: self._begin_again(token))

    def _join(self, visit: Visit, ticket: str, language: str | None) -> Welcome:
        ticketed = self._session_of(ticket)
        if ticketed is not None and self._is_of(ticketed, visit.invitation):
            # The same page again, perhaps because nobody heard the answer to it.
            return self._begin(ticket, ticketed, language)
        welcome = self.arrive(visit)
        if welcome.arrival is Arrival.NEW:
            return self._let_in(visit.invitation, new_token() if ticketed else ticket, language)
        if welcome.arrival is Arrival.INVITED_BACK:
            return self._let_back_in(visit.invitation, new_token() if ticketed else ticket)
        return welcome

    def _begin_again(self, token: str) -> Welcome:
        store = self._runtime.store
        old, following = self._session_of(token), next_token(token)
        if following_token(self._runtime, token) is not None:
            return Welcome(Arrival.RESUMED, following)
        if old is None or not can_begin_again(self._runtime.live(old.id)):
            return Welcome(Arrival.RESUMED, token)
        person = store.external_person(old.id)
        newest = None if person is None else store.session_of_person(person.study_name, person.external_id)
        if newest is not None and newest.id != old.id:
            self._add_token(newest.id, following)
            return Welcome(Arrival.RESUMED, following)
        return self._let_in(Invitation(person, is_signed=False), following, None, after=old.id)

    def _let_in(
        self, invitation: Invitation, token: str, language: str | None, after: str | None = None
    ) -> Welcome:
        with self._one_at_a_time:
            place = self._place()
            if place is not Arrival.NEW:
                return Welcome(place)
            study_hash = self._runtime.open_study(self._arm()).study.hash
            code_hash = hash_code(resume_code(token))
            session = self._runtime.store.create_session(
                study_hash, hash_token(token), Source.JOINED, code_hash, invitation.person, after
            )
        return self._begin(token, session, language)

    def _begin(self, token: str, session: SessionRecord, language: str | None) -> Welcome:
        is_new = self._runtime.live(session.id).state.participant is None
        services.begin(self._runtime, session.id)
        if is_new and language is not None:
            path.choose_language(self._runtime, session.id, language)
        return Welcome(Arrival.RESUMED, token)

    def _let_back_in(self, invitation: Invitation, token: str) -> Welcome:
        assert invitation.person is not None, "only a person's own link is signed"
        session = self._runtime.store.session_of_person(self._study.name, invitation.person.external_id)
        if session is None:
            # Deleted in this moment.
            return Welcome(self._place())
        self._add_token(session.id, token)
        return Welcome(Arrival.RESUMED, token)

    def _add_token(self, session_id: str, token: str) -> None:
        self._runtime.store.add_token(session_id, hash_token(token), hash_code(resume_code(token)))

    def _place(self) -> Arrival:
        """Returns whether somebody new can begin now."""
        wanted, now = self._study.file.recruitment, datetime.now(UTC)
        if wanted.opens is not None and now < wanted.opens:
            return Arrival.NOT_YET
        if wanted.closes is not None and now >= wanted.closes:
            return Arrival.CLOSED
        if wanted.places is not None and sum(self._people().values()) >= wanted.places:
            return Arrival.FULL
        return Arrival.NEW

    def _arm(self) -> Study:
        """Returns the arm of somebody new: all conditions get as many people who complete them."""
        arms = {arm.condition: arm for arm in self._study.arms}
        people = self._people()
        rng = stream(self._study.seed, "condition", sum(people.values()))
        return arms[choose(rng, list(arms), [people.get(condition, 0) for condition in arms])]

    def _people(self) -> dict[str | None, int]:
        """Returns how many in each condition have completed it, or may still: of whom something was heard lately."""
        heard_since = datetime.now(UTC) - timedelta(hours=self._study.file.recruitment.hold_hours)
        arms = self._runtime.store.arms(self._study.name, heard_since)
        return {arm.condition: arm.n_completed + arm.n_under_way for arm in arms}

    def _session_of(self, token: str) -> SessionRecord | None:
        session = services.find(self._runtime, token)
        return session if session is not None and self._is_of_study(session) else None

    def _is_of_study(self, session: SessionRecord) -> bool:
        return self._runtime.store.study_name(session.study_hash) == self._study.name

    def _is_of(self, session: SessionRecord, invitation: Invitation) -> bool:
        """Returns whether a session may be that of whoever has the link: the id is theirs, or the link says none."""
        if invitation.person is None:
            return True
        theirs = self._runtime.store.external_person(session.id)
        return theirs is not None and theirs.external_id == invitation.person.external_id


def _settled(attempt: Callable[[], Welcome]) -> Welcome:
    """Tries once more when somebody has come in, or was deleted, at the same moment: by then it is known."""
    try:
        return attempt()
    except (TokenTakenError, PersonKnownError, SessionDeletedError):
        return attempt()


def end_if_too_old(runtime: Runtime, session_id: str) -> None:
    """Ends a session as timed out if it was begun too long ago; for whoever comes back to it."""
    live = runtime.live(session_id)
    max_age = None if live.state.is_reopened else _max_age(live.study)
    is_open = live.state.ending is None
    if is_open and max_age is not None and datetime.now(UTC) > live.record.created_at + max_age:
        path.end(runtime, session_id, Ending.TIMED_OUT)


def can_begin_again(live: LiveSession) -> bool:
    """Returns whether a session has timed out in a study that lets people begin again then."""
    return live.state.ending is Ending.TIMED_OUT and live.study.file.session.when_old == "restart"


def following_token(runtime: Runtime, token: str) -> str | None:
    """Returns the token of the session that was begun in the place of a token's own, if one was."""
    following = next_token(token)
    return None if services.find(runtime, following) is None else following


def code_of(runtime: Runtime, token: str) -> str | None:
    """Returns the code by which a token's session is resumed elsewhere; None for a token from before there were any."""
    code = resume_code(token)
    return None if runtime.store.session_by_code(hash_code(code)) is None else code


def _max_age(study: Study) -> timedelta | None:
    hours = study.file.session.max_age_hours
    return None if hours is None else timedelta(hours=hours)

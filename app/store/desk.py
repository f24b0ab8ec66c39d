"""What the desk keeps: experimenters, what lets them and their programs in, their decisions, and what they did."""

from __future__ import annotations

from datetime import datetime, timedelta
from secrets import token_hex
from typing import Any

from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session

from app.store import reviews
from app.store.codec import decode_json, encode_json
from app.store.desk_records import ApiToken, AuditEntry, Experimenter, Review, Role
from app.store.engine import Database
from app.store.errors import ExperimenterKnownError, LastOwnerError, UnknownError
from app.store.models import ApiTokenRow, AuditRow, DeskSessionRow, ExperimenterRow
from app.store.utc import now

_A_MINUTE = timedelta(minutes=1)


class DeskStore:
    """What the desk keeps, for any number of threads. Every method is one transaction."""

    def __init__(self, database: Database) -> None:
        """Uses an open database; `Store.desk` is one."""
        self._database = database

    def add_experimenter(
        self, name: str, password_hash: str, role: Role, is_first: bool = False
    ) -> Experimenter:
        """Lets somebody use the desk.

        Args:
            name: What they log in with.
            password_hash: The password itself never comes here.
            role: What they may do.
            is_first: Whether it is refused when there is anybody already.

        Raises:
            ExperimenterKnownError: When there is somebody of that name, or anybody where nobody may be.
        """
        with self._database.writing() as rows:
            if is_first and rows.scalar(select(func.count()).select_from(ExperimenterRow)):
                raise ExperimenterKnownError(
                    "The desk has an owner already. Log in, or ask them for an account."
                )
            if rows.get(ExperimenterRow, name) is not None:
                raise ExperimenterKnownError(
                    f"There is an experimenter '{name}' already. Choose another name."
                )
            row = ExperimenterRow(name=name, password_hash=password_hash, role=role.value, created_at=now())
            rows.add(row)
            return _experimenter(row)

    def experimenters(self) -> list[Experimenter]:
        """Everybody who may use the desk, oldest first."""
        with self._database.reading() as rows:
            return [
                _experimenter(row) for row in rows.scalars(select(ExperimenterRow).order_by("created_at"))
            ]

    def password_hash(self, name: str) -> str | None:
        """The hash of somebody's password; None for nobody."""
        with self._database.reading() as rows:
            row = rows.get(ExperimenterRow, name)
            return None if row is None else row.password_hash

    def change_password(self, name: str, password_hash: str) -> None:
        """Changes somebody's password, and logs them out everywhere.

        Raises:
            UnknownError: When there is nobody of that name.
        """
        with self._database.writing() as rows:
            _known(rows, name).password_hash = password_hash
            rows.execute(delete(DeskSessionRow).where(DeskSessionRow.experimenter == name))

    def change_role(self, name: str, role: Role) -> None:
        """Changes what somebody may do.

        Raises:
            UnknownError: When there is nobody of that name.
            LastOwnerError: When there is no other owner.
        """
        with self._database.writing() as rows:
            row = _known(rows, name)
            if role is not Role.OWNER:
                _require_other_owner(rows, name)
            row.role = role.value

    def remove_experimenter(self, name: str) -> None:
        """Takes the desk from somebody, with their logins and tokens; what they did stays in the audit.

        Raises:
            UnknownError: When there is nobody of that name.
            LastOwnerError: When there is no other owner.
        """
        with self._database.writing() as rows:
            row = _known(rows, name)
            _require_other_owner(rows, name)
            rows.delete(row)

    def begin_login(self, name: str, token_hash: str) -> None:
        """Keeps that a browser's secret logs somebody in."""
        with self._database.writing() as rows:
            _known(rows, name)
            at = now()
            rows.add(DeskSessionRow(token_hash=token_hash, experimenter=name, created_at=at, last_seen_at=at))

    def login(
        self, token_hash: str, seen_since: datetime, begun_since: datetime, is_seen: bool = True
    ) -> Experimenter | None:
        """Who is logged in with a browser's secret, if it was seen and begun lately enough.

        Args:
            token_hash: Hash of the secret.
            seen_since: When it must have been seen last.
            begun_since: When it must have been begun.
            is_seen: Whether it is seen by this; that is kept once a minute, so that looking rarely writes.
        """
        with self._database.reading() as rows:
            row = rows.get(DeskSessionRow, token_hash)
            if row is None or row.last_seen_at < seen_since or row.created_at < begun_since:
                return None
            found, is_stale = (
                _experimenter(_known(rows, row.experimenter)),
                now() - row.last_seen_at > _A_MINUTE,
            )
        if is_seen and is_stale:
            self._see(token_hash)
        return found

    def _see(self, token_hash: str) -> None:
        with self._database.writing() as rows:
            its_own = DeskSessionRow.token_hash == token_hash
            rows.execute(update(DeskSessionRow).where(its_own).values(last_seen_at=now()))

    def end_login(self, token_hash: str) -> None:
        """Logs a browser out."""
        with self._database.writing() as rows:
            rows.execute(delete(DeskSessionRow).where(DeskSessionRow.token_hash == token_hash))

    def add_api_token(self, name: str, label: str, role: Role, token_hash: str) -> ApiToken:
        """Lets a program of somebody's in."""
        with self._database.writing() as rows:
            _known(rows, name)
            row = ApiTokenRow(
                id=token_hex(8),
                token_hash=token_hash,
                experimenter=name,
                label=label,
                role=role.value,
                created_at=now(),
            )
            rows.add(row)
            return _api_token(row)

    def api_tokens(self, name: str | None = None) -> list[ApiToken]:
        """All tokens, or somebody's, oldest first, revoked ones among them."""
        query = select(ApiTokenRow).order_by(ApiTokenRow.created_at)
        if name is not None:
            query = query.where(ApiTokenRow.experimenter == name)
        with self._database.reading() as rows:
            return [_api_token(row) for row in rows.scalars(query)]

    def program(self, token_hash: str) -> Experimenter | None:
        """For whom a program acts that has this secret, with the less of both roles; None if it was revoked."""
        with self._database.reading() as rows:
            row = rows.scalar(select(ApiTokenRow).where(ApiTokenRow.token_hash == token_hash))
            if row is None or row.revoked_at is not None:
                return None
            owner = _experimenter(_known(rows, row.experimenter))
            role = Role(row.role) if owner.role.may_act_as(Role(row.role)) else owner.role
            return Experimenter(owner.name, role, owner.created_at)

    def revoke_api_token(self, token_id: str) -> None:
        """Shuts a program out; doing it twice changes nothing.

        Raises:
            UnknownError: When there is no such token.
        """
        with self._database.writing() as rows:
            row = rows.get(ApiTokenRow, token_id)
            if row is None:
                raise UnknownError(
                    f"Expected the id of a token, got '{token_id}'. The list of tokens has them."
                )
            row.revoked_at = row.revoked_at or now()

    def review(self, session_id: str) -> Review:
        """What experimenters have decided about a session."""
        with self._database.reading() as rows:
            return reviews.of_session(rows, session_id)

    def put_review(self, session_id: str, review: Review, who: str) -> Review:
        """Changes what is decided about a session.

        Args:
            session_id: Which.
            review: What is to be; its revision is the one that whoever changes it has seen.
            who: Name of the experimenter.

        Raises:
            ReviewChangedError: When somebody else has changed it since.
            SessionDeletedError: When the session was deleted.
        """
        with self._database.writing() as rows:
            return reviews.put(rows, session_id, review, who)

    def record(
        self, who: str, action: str, about: str | None = None, detail: dict[str, Any] | None = None
    ) -> None:
        """Adds to what experimenters did."""
        with self._database.writing() as rows:
            rows.add(
                AuditRow(at=now(), who=who, action=action, about=about, detail=encode_json(detail or {}))
            )

    def audit(self, n: int = 200, before: int | None = None, about: str | None = None) -> list[AuditEntry]:
        """What experimenters did, newest first.

        Args:
            n: At most so many.
            before: Only what came before so many of the newest.
            about: Only what was about this session, study or experimenter.
        """
        query = select(AuditRow).order_by(AuditRow.id.desc()).limit(n).offset(before or 0)
        if about is not None:
            query = query.where(AuditRow.about == about)
        with self._database.reading() as rows:
            return [
                AuditEntry(row.at, row.who, row.action, row.about, decode_json(row.detail))
                for row in rows.scalars(query)
            ]


def _known(rows: Session, name: str) -> ExperimenterRow:
    row = rows.get(ExperimenterRow, name)
    if row is None:
        raise UnknownError(f"Expected the name of an experimenter, got '{name}'. The desk lists them.")
    return row


def _require_other_owner(rows: Session, name: str) -> None:
    others = select(func.count()).where(
        ExperimenterRow.role == Role.OWNER.value, ExperimenterRow.name != name
    )
    if not rows.scalar(others):
        raise LastOwnerError(f"'{name}' is the only owner of the desk. Make somebody else an owner first.")


def _experimenter(row: ExperimenterRow) -> Experimenter:
    return Experimenter(row.name, Role(row.role), row.created_at)


def _api_token(row: ApiTokenRow) -> ApiToken:
    return ApiToken(row.id, row.experimenter, row.label, Role(row.role), row.created_at, row.revoked_at)

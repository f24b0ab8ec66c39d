"""The way from a participant's page to their stage: viser's client, its websocket, and what the page asks of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict

from fastapi import APIRouter, Depends, HTTPException, Request, WebSocket
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, ConfigDict
from starlette.concurrency import run_in_threadpool

from app.origin import is_same_origin
from app.stage import proxy
from app.stage.keeper import Action, InvalidActionError, StageKeeper
from app.stage.stage import StageBusyError

_REFUSED = 1008
_TRY_AGAIN_LATER = 1013


class StageRequest(BaseModel):
    """What the page asks of its stage."""

    model_config = ConfigDict(extra="forbid")

    action: Action
    value: float | None = None


def stage_routes(
    keeper: StageKeeper, session_of: Callable[[str], str | None], public_url: str | None
) -> APIRouter:
    """Returns the routes below `/s/{token}/stage`.

    Args:
        keeper: The stages.
        session_of: Gives the id of the session that a secret token opens, or None.
        public_url: Address that participants use, if it isn't the one the server listens on.
    """
    router = APIRouter()

    def known(token: str) -> str:
        session_id = session_of(token)
        if session_id is None:
            raise HTTPException(404)
        return session_id

    @router.post("/s/{token}/stage")
    def act(token: str, body: StageRequest) -> Response:
        session_id = known(token)
        try:
            is_done = keeper.perform(session_id, body.action, body.value)
        except InvalidActionError as error:
            return _refusal(422, "invalid-action", str(error))
        if not keeper.has_room(session_id):
            return _refusal(409, "stage-busy", "All stages are in use; try again in a moment.")
        if not is_done:
            return _refusal(409, "no-stage", "There is no stage to do this on; load it again.")
        return _how_it_plays(keeper, session_id)

    @router.get("/s/{token}/stage")
    def playing(token: str) -> Response:
        return _how_it_plays(keeper, known(token))

    @router.get("/s/{token}/stage/", dependencies=[Depends(known)])
    def client(request: Request) -> Response:
        if proxy.has_forbidden_query(request.url.query):
            raise HTTPException(400)
        page, headers = proxy.client_page()
        if headers["ETag"] in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=dict(headers))
        return Response(page, headers=dict(headers))

    @router.websocket("/s/{token}/stage")
    async def stage(websocket: WebSocket, token: str) -> None:
        headers = websocket.headers
        is_ours = is_same_origin(headers.get("origin"), headers.get("host"), public_url)
        session_id = await run_in_threadpool(session_of, token) if is_ours else None
        if session_id is None:
            # Refused before it is accepted: nobody learns whether the token or the origin was wrong.
            await websocket.close(_REFUSED)
            return
        try:
            async with keeper.visit(session_id) as visited:
                await proxy.relay(websocket, visited.port)
        except StageBusyError:
            await websocket.close(_TRY_AGAIN_LATER)

    return router


def _how_it_plays(keeper: StageKeeper, session_id: str) -> JSONResponse:
    """What the page needs to draw the time line; null while nothing is on the stage."""
    playing = keeper.playing(session_id)
    return JSONResponse(None if playing is None else asdict(playing))


def _refusal(status: int, code: str, message: str) -> JSONResponse:
    return JSONResponse({"error": {"code": code, "message": message}}, status_code=status)

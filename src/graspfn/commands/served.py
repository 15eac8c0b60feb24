"""What `graspfn serve` does: an image and its options come in by HTTP, the answer of `graspfn plan --json` goes out.

One model, loaded before anything is listened for; any number of requests at once, of which as many are planned on as
there are cores. The planner holds nothing that changes, so that they cannot meet.
"""

from __future__ import annotations

import importlib.metadata
import io
import re
import socket
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any

import anyio
import numpy as np
import typer
import uvicorn
from fastapi import FastAPI, HTTPException, Query, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException as HTTPError
from starlette.requests import ClientDisconnect

from graspfn.commands import query
from graspfn.commands.answers import answer
from graspfn.commands.depth_files import depth_of
from graspfn.commands.depth_pixels import read_pixels
from graspfn.commands.ending import InputError
from graspfn.commands.planned import plan_one
from graspfn.planning.planner import GraspPlanner
from graspfn.workflow.cores import cores

Model = tuple[Path, GraspPlanner]
TYPES = {"image/png": ".png", "application/x-npy": ".npy"}
IMAGE = "body"  # what the request's image is called in answers, where `graspfn plan` has a file's name
MOST_BYTES = 32 << 20  # a camera's 5 million pixels as float32 are 20
READ_ON = 4  # times as much of what is too large, so that who sends it gets to hear so
SECONDS = 30.0  # for a request to arrive in full
AT_ONCE = 32  # connections; further ones are turned away with 503
BODY = {
    "requestBody": {
        "required": True,
        "description": f"Depth image (height, width) of at most {MOST_BYTES >> 20} MiB: PNG of 16 bits, or .npy.",
        "content": {kind: {"schema": {"type": "string", "format": "binary"}} for kind in TYPES},
    }
}
REFUSALS: dict[int | str, dict[str, Any]] = {
    400: {"description": "An option or the image is wrong: `error` names it and says what it takes."},
    408: {"description": f"It did not arrive within {SECONDS:g} s."},
    413: {"description": "It is too large."},
    415: {"description": "Its Content-Type is none of the two."},
}


def app(model: Model) -> FastAPI:
    """The application; without a server of its own, for whoever has one."""
    version = importlib.metadata.version("graspfn")
    served = FastAPI(title="graspfn", summary="Robust grasps from depth images", version=version, redoc_url=None)
    turns = anyio.CapacityLimiter(cores())

    @served.get("/health", summary="Ready: it answers once the model is loaded")
    def health() -> dict[str, str]:
        return {"status": "ready", "model": str(model[0]), "version": version}

    @served.post("/plan", summary="A grasp, or no_grasp with the reason", openapi_extra=BODY, responses=REFUSALS)
    async def plan(request: Request, options: Annotated[query.Query, Query()]) -> JSONResponse:
        suffix = _suffix(request)
        _check_once(request)
        body = await _body(request)
        told = await anyio.to_thread.run_sync(_planned, body, suffix, options, model, limiter=turns)
        return JSONResponse(told)

    @served.exception_handler(InputError)
    def wrong(_: Request, error: InputError) -> JSONResponse:
        return _refused(HTTPStatus.BAD_REQUEST, in_http(str(error)))

    @served.exception_handler(RequestValidationError)
    def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        says = "no such option" if first["type"] == "extra_forbidden" else first["msg"]
        return _refused(HTTPStatus.BAD_REQUEST, f"{first['loc'][-1]}: {says[:1].lower()}{says[1:]}")

    @served.exception_handler(HTTPError)
    def other(_: Request, error: HTTPError) -> JSONResponse:
        return _refused(error.status_code, error.detail, error.headers)

    @served.exception_handler(Exception)
    def fault(_: Request, error: Exception) -> JSONResponse:  # which the server's own standard error shows in full
        return _refused(HTTPStatus.INTERNAL_SERVER_ERROR, f"a fault of graspfn: {type(error).__name__}")

    return served


def in_http(line: str) -> str:
    """An error of `graspfn plan` with its options named as in a query: sigma_uv_mm, not --sigma-uv-mm."""
    return re.sub(r"--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), line)


def _refused(status: int, line: str, headers: Any = None) -> JSONResponse:
    return JSONResponse({"image": IMAGE, "error": line}, status, headers)


def _suffix(request: Request) -> str:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind not in TYPES:
        raise HTTPException(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"Content-Type {kind or 'missing'}: takes one of {', '.join(TYPES)}"
        )
    return TYPES[kind]


def _check_once(request: Request) -> None:
    names = [name for name, _ in request.query_params.multi_items()]
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        raise InputError(f"{twice[0]}: is given {names.count(twice[0])} times; it takes one")


async def _body(request: Request) -> bytes:
    body, size = bytearray(), 0
    try:
        with anyio.fail_after(SECONDS):
            async for part in request.stream():
                size += len(part)
                if size <= MOST_BYTES:
                    body += part
                elif size > READ_ON * MOST_BYTES:
                    break
    except TimeoutError:
        raise HTTPException(HTTPStatus.REQUEST_TIMEOUT, f"the image did not arrive within {SECONDS:g} s") from None
    except ClientDisconnect:
        raise HTTPException(HTTPStatus.BAD_REQUEST, "the connection ended before the image did") from None
    if size > MOST_BYTES:
        raise HTTPException(
            HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"{IMAGE}: is larger than the {MOST_BYTES} bytes that are taken"
        )
    return bytes(body)


def _planned(body: bytes, suffix: str, options: query.Query, model: Model) -> dict[str, Any]:
    request = options.request(model)
    depth = depth_of(read_pixels(io.BytesIO(body), suffix, IMAGE), request.unit, IMAGE)
    return answer(IMAGE, plan_one(IMAGE, depth, None, request), str(model[0]))


def warm(model: Model) -> None:
    """Plans on a block on a table once: what is compiled on first use is compiled before anyone waits for it."""
    depth = np.full((480, 640), 0.5, dtype=np.float32)
    depth[220:260, 300:340] = 0.45
    options = query.Query(fx=570, fy=570, cx=319.5, cy=239.5, covariance="1e-4 1e-5 0 1e-5 1e-4 0 0 0 0.1")
    for chosen in (options, options.model_copy(update={"covariance": None, "sigma_uv_mm": 5, "sigma_theta_deg": 10})):
        plan_one(IMAGE, depth, None, chosen.request(model))


def run(model: Model, host: str, port: int) -> None:
    """Until it is interrupted or terminated. InputError where the address cannot be had."""
    warm(model)
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listening = socket.create_server(address[:2], family=family)
    except OSError as error:
        raise InputError(f"--host {host} --port {port}: cannot be listened on: {error.strerror or error}") from None
    shown = f"[{host}]" if ":" in host else host
    url = f"http://{shown}:{listening.getsockname()[1]}"
    typer.echo(f"{model[0]}: ready at {url}/plan; {url}/docs says what it takes")
    config = uvicorn.Config(
        app(model), log_level="warning", access_log=False, server_header=False, ws="none", limit_concurrency=AT_ONCE
    )
    uvicorn.Server(config).run(sockets=[listening])

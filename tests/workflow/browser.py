"""A headless Chromium, asked over its DevTools protocol."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.request import ProxyHandler, build_opener

import pytest
from tornado.websocket import WebSocketClientConnection, websocket_connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SECONDS = 60


def find() -> str:
    """Return the browser; skip where there is none, but not in continuous integration."""
    for name in NAMES:
        if path := shutil.which(name):
            return path
    if "CI" in os.environ:
        pytest.fail(f"CI is set, and there is no browser: {', '.join(NAMES)}")
    pytest.skip("no Chromium is installed; .ci/run installs it")


@dataclass
class Page:
    """What a page did.

    Attributes
    ----------
    requested
        Every address that it asked for, from the browser's own network log.
    value
        What the expression came to.
    """

    requested: list[str]
    value: Any


def visit(pages: list[Path], expression: str, profile: Path) -> list[Page]:
    """Open files one after the other and evaluate an expression in each.

    No name resolves in this browser, so nothing reaches the network even where a page asks for it.
    """
    command = [
        find(), "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        "--no-first-run", "--disable-background-networking", "--disable-component-update",
        "--host-resolver-rules=MAP * ~NOTFOUND", "--remote-debugging-port=0",
        f"--user-data-dir={profile}", "about:blank",
    ]  # fmt: skip
    browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        return asyncio.run(_visit(_address(profile), pages, expression))
    finally:
        browser.terminate()
        browser.wait(SECONDS)


def _address(profile: Path) -> str:
    """Return where the browser's first tab is spoken to."""
    port = profile / "DevToolsActivePort"
    end = time.monotonic() + SECONDS
    opener = build_opener(ProxyHandler({}))
    while time.monotonic() < end:
        if port.is_file() and port.read_text().strip():
            number = port.read_text().split()[0]
            with opener.open(f"http://127.0.0.1:{number}/json/list") as answer:
                for tab in json.load(answer):
                    if tab["type"] == "page":
                        return str(tab["webSocketDebuggerUrl"])
        time.sleep(0.05)
    raise TimeoutError(f"the browser did not start within {SECONDS} s")


async def _visit(address: str, pages: list[Path], expression: str) -> list[Page]:
    socket = await websocket_connect(address, max_message_size=2**28)
    try:
        return await _converse(socket, pages, expression)
    finally:
        socket.close()
        # The connection ends when the browser has agreed; until then its descriptor stays open.
        while await asyncio.wait_for(socket.read_message(), SECONDS) is not None:
            pass


async def _converse(
    socket: WebSocketClientConnection, pages: list[Path], expression: str
) -> list[Page]:
    number = 0
    events: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        message = await asyncio.wait_for(asyncio.ensure_future(socket.read_message()), SECONDS)
        assert message is not None, "the browser hung up"
        return dict(json.loads(message))

    async def ask(method: str, **parameters: Any) -> dict[str, Any]:
        nonlocal number
        number += 1
        asked = {"id": number, "method": method, "params": parameters}
        await socket.write_message(json.dumps(asked))
        while True:
            message = await receive()
            if message.get("id") == number:
                assert "error" not in message, message
                return dict(message["result"])
            events.append(message)

    visited = []
    for domain in ("Page", "Network"):
        await ask(f"{domain}.enable")
    for page in pages:
        events.clear()
        await ask("Page.navigate", url=page.as_uri())
        while not any(event.get("method") == "Page.loadEventFired" for event in events):
            events.append(await receive())
        result = await ask(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result
        requested = [
            event["params"]["request"]["url"]
            for event in events
            if event.get("method") == "Network.requestWillBeSent"
        ]
        visited.append(Page(requested, result["result"]["value"]))
    return visited

"""A headless Chromium, driven over WebDriver (https://www.w3.org/TR/webdriver2/) without further packages."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

OPTIONS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--window-size=1280,800", "--hide-scrollbars",
]  # fmt: skip

ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
"""Key of an element in the answers of the driver."""


def programs() -> tuple[str, str] | None:
    """Paths of Chromium and its driver; None if one is missing."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    return (browser, driver) if browser and driver else None


class Chromium:
    """A browser with one page.

    profile  empty folder for its files
    """

    def __init__(self, profile: Path) -> None:
        found = programs()
        assert found is not None
        self._driver = subprocess.Popen(
            [found[1], "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        port = self._port()
        self._address = f"http://127.0.0.1:{port}"
        options = {"binary": found[0], "args": [*OPTIONS, f"--user-data-dir={profile}"]}
        wanted = {
            "alwaysMatch": {
                "goog:chromeOptions": options,
                "goog:loggingPrefs": {"performance": "ALL", "browser": "ALL"},
            }
        }
        self._address += f"/session/{self._call('POST', '/session', {'capabilities': wanted})['sessionId']}"

    def close(self) -> None:
        """End the browser and its driver."""
        try:
            self._call("DELETE", "")
        finally:
            self._driver.terminate()
            self._driver.wait(20)

    def open(self, address: str) -> None:
        """Go to a page."""
        self._call("POST", "/url", {"url": address})

    def script(self, text: str) -> Any:
        """The result of JavaScript in the page."""
        return self._call("POST", "/execute/sync", {"script": text, "args": []})

    def click(self, selector: str) -> None:
        """Click the element of a CSS selector."""
        element = self._call("POST", "/element", {"using": "css selector", "value": selector})[ELEMENT]
        self._call("POST", f"/element/{element}/click", {})

    def keys(self, selector: str, text: str) -> None:
        """Press keys in the element of a CSS selector."""
        element = self._call("POST", "/element", {"using": "css selector", "value": selector})[ELEMENT]
        self._call("POST", f"/element/{element}/value", {"text": text})

    def screenshot(self, path: Path) -> None:
        """Write the page as PNG."""
        path.write_bytes(base64.b64decode(self._call("GET", "/screenshot")))

    def requests(self) -> list[str]:
        """Addresses that the page has asked for since the last call."""
        rows = self._call("POST", "/se/log", {"type": "performance"})
        messages = [json.loads(row["message"])["message"] for row in rows]
        return [each["params"]["request"]["url"] for each in messages if each["method"] == "Network.requestWillBeSent"]

    def complaints(self) -> list[str]:
        """Errors that the page has printed since the last call."""
        return [
            row["message"] for row in self._call("POST", "/se/log", {"type": "browser"}) if row["level"] == "SEVERE"
        ]

    def wait(self, text: str, seconds: float = 30.0) -> Any:
        """The first result of JavaScript that is true."""
        return until(lambda: self.script(text), seconds, text)

    def _port(self) -> int:
        """The port of the driver, from what it prints."""
        assert self._driver.stdout is not None
        for line in self._driver.stdout:
            if "started successfully on port" in line:
                return int(line.rstrip().rstrip(".").split()[-1])
        raise AssertionError("the driver of Chromium did not start")

    def _call(self, method: str, path: str, body: dict[str, Any] | None = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self._address + path, data, {"Content-Type": "application/json"}, method=method
        )
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.loads(answer.read())["value"]
        except urllib.error.HTTPError as failure:
            raise AssertionError(failure.read().decode()) from None


def until(found: Callable[[], Any], seconds: float, what: str) -> Any:
    """The first result that is true.

    errors  AssertionError after some seconds
    """
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if result := found():
            return result
        time.sleep(0.1)
    raise AssertionError(f"not in {seconds:g} s: {what}")

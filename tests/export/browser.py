"""A headless Chromium, driven by its DevTools protocol through a pipe: clicks and key strokes as a user makes them."""

import base64
import contextlib
import itertools
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

import pytest


NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
OPTIONS = "--headless=new --no-sandbox --disable-gpu --no-first-run --disable-dev-shm-usage --remote-debugging-pipe"
PATIENCE = 60.0  # s


class Browser:
    """One page of a browser."""

    def __init__(self, process, sent, received):
        self.process, self.sent, self.received = process, sent, received
        self.numbers, self.session, self.rest, self.events = itertools.count(1), None, b"", []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log", "DOM"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        number = next(self.numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.sent, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def _read(self):
        while b"\0" not in self.rest:
            ready, _, _ = select.select([self.received], [], [], PATIENCE)
            assert ready, "the browser does not answer"
            self.rest += os.read(self.received, 1 << 20)
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def open(self, file, width=1400, height=1000, dark=False):
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=scheme)
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.events.clear()
        begin = time.perf_counter()
        self.call("Page.navigate", url=file.resolve().as_uri())
        self.wait("document.documentElement?.dataset.ready === ''")
        return time.perf_counter() - begin

    def evaluate(self, expression):
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression):
        end = time.monotonic() + PATIENCE
        while not self.evaluate(expression):
            assert time.monotonic() < end, expression
            time.sleep(0.02)

    def settle(self):
        """Until two frames have been drawn, so that the page has followed what was done."""
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")

    def click(self, selector):
        """A click of the mouse on the middle of an element."""
        self.evaluate(f"document.querySelector({selector!r}).scrollIntoView({{block: 'center'}})")
        box = f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
        x, y = self.evaluate(box + " return [b.x + b.width / 2, b.y + b.height / 2]; })()")
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        self.settle()

    def press(self, key, code, times=1):
        for _ in range(times):
            for kind in ("rawKeyDown", "keyUp"):
                self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)
        self.settle()

    def type(self, selector, text):
        """Replace the text of an input by key strokes."""
        self.click(selector)
        self.evaluate(f"document.querySelector({selector!r}).select()")
        self.call("Input.insertText", text=text)
        self.settle()

    def choose(self, selector, value):
        change = f"const s = document.querySelector({selector!r}); s.value = {value!r};"
        self.evaluate(f"(() => {{ {change} s.dispatchEvent(new Event('input', {{bubbles: true}})); }})()")
        self.settle()

    def give_file(self, selector, file):
        """A file, as the dialog of an input of files gives it."""
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", nodeId=node, files=[str(file)])

    def drop(self, file):
        """Drop a file onto the page."""
        data = {"items": [], "files": [str(file)], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.call("Input.dispatchDragEvent", type=kind, x=300, y=300, data=data)
        self.settle()

    def screenshot(self, file, whole=False):
        picture = self.call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]
        file.write_bytes(base64.b64decode(picture))

    def troubles(self):
        """Errors of scripts and requests other than for the page itself, since it was opened."""
        found = []
        for event in self.events:
            kind, about = event.get("method"), event.get("params", {})
            if kind in ("Runtime.exceptionThrown", "Log.entryAdded"):
                found.append(about)
            elif kind == "Network.requestWillBeSent" and not about["request"]["url"].startswith(("file:", "blob:")):
                found.append(about["request"]["url"])
        return found


@contextlib.contextmanager
def started():
    """A browser; the test is skipped without one."""
    command = next(filter(None, map(shutil.which, NAMES)), None)
    if command is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)}")
    to_browser, from_browser = os.pipe(), os.pipe()

    # by a shell, since a function between fork and exec does not go with the threads of JAX
    pipes = f'exec "$0" "$@" 3<&{to_browser[0]} 4>&{from_browser[1]}'
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            ["bash", "-c", pipes, command, *OPTIONS.split(), f"--user-data-dir={profile}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(to_browser[0], from_browser[1]),
        )
        browser = Browser(process, to_browser[1], from_browser[0])
        try:
            yield browser
        finally:
            browser.session = None
            with contextlib.suppress(OSError, AssertionError):
                browser.call("Browser.close")
            process.wait(PATIENCE)
            for end in (*to_browser, *from_browser):
                os.close(end)


def is_played_and_set(browser, time: str, shown: str) -> None:
    """A film plays by itself, is stopped, and is set to a time, which it says."""
    browser.wait("film.time > 0.02")
    browser.click("#filmPlay")
    stopped = browser.evaluate("film.time")
    browser.settle()
    assert browser.evaluate("film.time") == stopped
    browser.choose("#filmTime", time)
    assert browser.evaluate("film.controls.now.textContent") == shown

"""A headless Chromium driven by the DevTools protocol over a pipe: the standard library is all that is needed."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
from itertools import count
from pathlib import Path

#: without these it talks to its maker's servers, or needs a screen
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--remote-debugging-pipe",
]  # fmt: skip
PATHS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def found() -> str | None:
    """The program, where there is one."""
    return next(filter(None, map(shutil.which, PATHS)), None)


class Page:
    """One page of a browser of its own: `script` evaluates, `click` and `press` act as a reader does.

    `errors`: what its scripts complained of; `requests`: the addresses that it asked for.
    """

    def __init__(self, folder: Path, width: int = 1280, height: int = 900) -> None:
        pipes = os.pipe(), os.pipe()
        (to_browser, from_here), (from_browser, to_here) = pipes
        # the browser reads from 3 and writes to 4: ours must be neither while these are made
        far = [fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in (to_browser, to_here)]
        command = ["bash", "-c", f'exec "$0" "$@" 3<&{far[0]} 4>&{far[1]}', found() or "", *FLAGS]
        command += [f"--user-data-dir={folder}", f"--window-size={width},{height}", "about:blank"]
        quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        self._process = subprocess.Popen(command, pass_fds=far, **quiet)
        for end in (to_browser, to_here, *far):
            os.close(end)
        self._to, self._from = from_here, from_browser
        self._numbers, self._text = count(1), b""
        self.errors, self.requests, self._session = [], [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method, **params):
        """The answer to a command; events that come before it are looked at."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]

    def _read(self):
        while b"\0" not in self._text:
            more = os.read(self._from, 1 << 16)
            assert more, "the browser has gone"
            self._text += more
        line, self._text = self._text.split(b"\0", 1)
        message = json.loads(line)
        method, params = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(params["exceptionDetails"].get("exception", {}).get("description", "?"))
        elif method == "Runtime.consoleAPICalled" and params["type"] == "error":
            self.errors.append(str([one.get("value", one.get("description")) for one in params["args"]]))
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        return message

    def script(self, text):
        """The value of an expression, of a promise when it is kept."""
        answer = self.call("Runtime.evaluate", expression=text, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def open(self, address):
        """Go there and wait until its figures can be used."""
        self.call("Page.navigate", url=address)
        while self._read().get("method") != "Page.loadEventFired":
            pass
        self.wait("document.documentElement.dataset.ready !== undefined")

    def wait(self, condition):
        """Until an expression is true."""
        text = f"""new Promise((done, fail) => {{
            const began = Date.now();
            const look = () => {{
                if ({condition}) {{ done(true); }}
                else if (Date.now() - began > 20000) {{ fail(new Error("waited in vain")); }}
                else {{ setTimeout(look, 20); }}
            }};
            look();
        }})"""
        assert self.script(text)

    def click(self, x, y):
        """Move the pointer there and click."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            pressed = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **pressed)

    def click_on(self, selector):
        """Click into the middle of an element."""
        self.click(
            *self.script(f"""(() => {{
            const element = document.querySelector({json.dumps(selector)});
            element.scrollIntoView({{ block: "center", behavior: "instant" }});
            const box = element.getBoundingClientRect();
            return [box.x + box.width / 2, box.y + box.height / 2];
        }})()""")
        )

    def press(self, key, text=""):
        """Press a key and let it go."""
        for kind in ("keyDown", "keyUp"):
            own = {"text": text} if text and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, **own)

    def close(self):
        """End the browser."""
        self._process.terminate()
        self._process.wait(10)
        os.close(self._to)
        os.close(self._from)

"""Headless Chromium for tests, driven over pipes by the DevTools protocol, and a web server for a folder. Standard library only.

    with serve(folder) as server, Browser() as browser:
        page = browser.open(server.url + "index.html")
        level = page.evaluate("(async () => await measure())()")
        page.click(120, 80)
        assert page.find_strangers(server.url) == []
"""

import contextlib
import functools
import http.server
import json
import os
import pathlib
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time

CHROMIUM = "/usr/bin/chromium"
# The browser makes no requests of its own and never prompts.
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-sync",
    "--metrics-recording-only",
    "--autoplay-policy=no-user-gesture-required",
    "--window-size=1024,768",
]


class BrowserError(Exception):
    """A refusal of the browser, or an exception of a script in the page."""


class Browser:
    """One Chromium with a temporary profile."""

    # Prefixes of the names of audio worklet threads, real-time and offline; the system keeps 15 characters.
    AUDIO_THREADS = ("AudioWorklet", "Realtime Audio", "Offline Audio")

    def __init__(self, flags=(), timeout_s=60):
        self.timeout_s = timeout_s
        self.profile = tempfile.mkdtemp(prefix="carillon-browser-")
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()
        self.log = open(os.path.join(self.profile, "browser.log"), "w+b")
        # The protocol's pipes are descriptors 3 and 4, connected by a shell.
        command = ["/bin/sh", "-c", f'exec "$@" 3<&{to_browser} 4>&{from_browser}', "sh", CHROMIUM, *FLAGS, *flags]
        command += [f"--user-data-dir={self.profile}", "--remote-debugging-pipe", "about:blank"]
        self._process = subprocess.Popen(
            command, pass_fds=(to_browser, from_browser), stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log, start_new_session=True
        )
        os.close(to_browser)
        os.close(from_browser)
        self._answers, self._pages, self._number, self._lock = {}, {}, 0, threading.Lock()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.call("Browser.getVersion")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        with contextlib.suppress(BrowserError, OSError):
            self.call("Browser.close", timeout_s=5)
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            pass
        with contextlib.suppress(ProcessLookupError):  # remaining processes of its group
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self._out)
        self._reader.join(10)
        os.close(self._in)
        self.log.close()
        shutil.rmtree(self.profile, ignore_errors=True)

    def read_log(self):
        self.log.flush()
        return pathlib.Path(self.log.name).read_text(errors="replace")

    def list_processes(self):
        """Process ids of this browser."""
        listing = subprocess.run(["ps", "-o", "pid=", "--sid", str(self._process.pid)], capture_output=True, text=True)
        return [int(word) for word in listing.stdout.split()]

    def read_cpu_s(self, names=("",)):
        """CPU time of its live threads with one of these name prefixes."""
        spent_s = 0.0
        for process in self.list_processes():
            for thread in pathlib.Path(f"/proc/{process}/task").glob("*"):
                try:
                    if not (thread / "comm").read_text().startswith(tuple(names)):
                        continue
                    if (thread / "schedstat").exists():  # nanoseconds; stat has steps of 10 ms
                        spent_s += int((thread / "schedstat").read_text().split()[0]) * 1e-9
                    else:
                        words = (thread / "stat").read_text().rsplit(")", 1)[1].split()
                        spent_s += (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
                except OSError:  # it has ended
                    continue
        return spent_s

    def call(self, method, params=None, session=None, timeout_s=None):
        """Runs a command of the protocol; returns its result."""
        waiting = queue.Queue()
        with self._lock:
            self._number += 1
            number = self._number
            self._answers[number] = waiting
            message = {"id": number, "method": method, "params": params or {}}
            if session:
                message["sessionId"] = session
            data = json.dumps(message).encode() + b"\0"
            while data:
                data = data[os.write(self._out, data) :]
        try:
            answer = waiting.get(timeout=timeout_s or self.timeout_s)
        except queue.Empty:
            raise BrowserError(f"{method}: no answer within {timeout_s or self.timeout_s} s") from None
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error'].get('message')}")
        return answer["result"]

    def open(self, url, wait=True):
        """Opens a page. `wait`: until it has loaded."""
        target = self.call("Target.createTarget", {"url": "about:blank"})["targetId"]
        session = self.call("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        page = Page(self, target, session)
        self._pages[session] = page
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.call(f"{domain}.enable")
        # Reports requests of workers and worklets, too.
        page.call("Target.setAutoAttach", {"autoAttach": True, "waitForDebuggerOnStart": False, "flatten": True})
        page.go(url, wait)
        return page

    def _read(self):
        rest = b""
        while True:
            try:
                data = os.read(self._in, 1 << 20)
            except OSError:
                data = b""
            if not data:
                break
            *messages, rest = (rest + data).split(b"\0")
            for message in messages:
                self._take(json.loads(message))
        for waiting in list(self._answers.values()):
            waiting.put({"error": {"message": "the browser has ended: " + self.read_log()[-2000:]}})

    def _take(self, message):
        if "id" in message:
            waiting = self._answers.pop(message["id"], None)
            if waiting:
                waiting.put(message)
            return
        page = self._pages.get(message.get("sessionId"))
        if page:
            page.take(message["method"], message["params"])


class Page:
    """A page: runs scripts, sends mouse and keys; records requests, console and errors."""

    def __init__(self, browser, target, session):
        self.browser, self.target, self.session = browser, target, session
        self.requests = []  # URLs, of the page, its workers and its worklets
        self.console = []  # lines
        self.errors = []  # uncaught exceptions and failed loads
        self._loaded = threading.Event()

    def call(self, method, params=None, timeout_s=None):
        return self.browser.call(method, params, self.session, timeout_s)

    def take(self, method, params):
        if method == "Target.attachedToTarget":
            session = params["sessionId"]
            self.browser._pages[session] = self
            threading.Thread(target=self._watch, args=(session,), daemon=True).start()
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(params["url"])
        elif method == "Page.loadEventFired":
            self._loaded.set()
        elif method == "Runtime.consoleAPICalled":
            self.console.append(" ".join(str(arg.get("value", arg.get("description", ""))) for arg in params["args"]))
        elif method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description") or details["text"])
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")

    def _watch(self, session):
        for domain in ("Network", "Runtime", "Log"):
            with contextlib.suppress(BrowserError):  # worklets have no network domain
                self.browser.call(f"{domain}.enable", session=session)

    def go(self, url, wait=True):
        self._loaded.clear()
        answer = self.call("Page.navigate", {"url": url})
        if answer.get("errorText"):
            raise BrowserError(f"{url}: {answer['errorText']}")
        if wait and not self._loaded.wait(self.browser.timeout_s):
            raise BrowserError(f"{url}: not loaded within {self.browser.timeout_s} s")

    def evaluate(self, script, timeout_s=None):
        """The value of an expression or its promise, as JSON. Raises BrowserError for an exception."""
        params = {"expression": script, "awaitPromise": True, "returnByValue": True, "userGesture": True}
        answer = self.call("Runtime.evaluate", params, timeout_s)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserError(
                details.get("exception", {}).get("description") or details.get("exception", {}).get("value") or details["text"]
            )
        return answer["result"].get("value")

    def wait_for(self, script, timeout_s=30, every_s=0.05):
        """Waits until an expression is true; returns its value."""
        end = time.monotonic() + timeout_s
        while True:
            value = self.evaluate(script)
            if value:
                return value
            if time.monotonic() > end:
                raise BrowserError(f"not true within {timeout_s} s: {script}; console: {self.console[-5:]}; errors: {self.errors[-5:]}")
            time.sleep(every_s)

    def mouse(self, kind, x, y, button="none", **more):
        """kind: "mousePressed", "mouseReleased", "mouseMoved" or "mouseWheel"; position in pixels of the page."""
        self.call("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, "button": button, **more})

    def click(self, x, y, hold_s=0.0, button="left"):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, button, clickCount=1, buttons=1)
        time.sleep(hold_s)
        self.mouse("mouseReleased", x, y, button, clickCount=1)

    def press(self, key, code=None, key_code=0, modifiers=0):
        """Presses a key by its DOM name: "Enter", "Tab", "a"."""
        text = {"Enter": "\r"}.get(key, key if len(key) == 1 else "")
        key_code = key_code or {"Enter": 13, "Tab": 9, "Escape": 27, " ": 32}.get(key, ord(key.upper()) if len(key) == 1 else 0)
        of_key = {"key": key, "code": code or key, "windowsVirtualKeyCode": key_code, "modifiers": modifiers}
        self.call("Input.dispatchKeyEvent", {"type": "keyDown", "text": text, **of_key} if text else {"type": "rawKeyDown", **of_key})
        self.call("Input.dispatchKeyEvent", {"type": "keyUp", **of_key})

    def resize(self, width, height):
        """Sets the size of the screen in CSS pixels."""
        self.call("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})

    def find_strangers(self, origin):
        """Requests to other origins than ("http://127.0.0.1:8000/")."""
        inside = ("data:", "blob:", "about:")
        return [url for url in self.requests if not url.startswith(origin) and not url.startswith(inside)]

    def close(self):
        self.browser.call("Target.closeTarget", {"targetId": self.target})


class Server:
    """Serves the files of folders under /; `requests` lists the requested paths."""

    def __init__(self, *folders):
        self.requests = requests = []

        class Handler(http.server.SimpleHTTPRequestHandler):
            extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".js": "text/javascript", ".wasm": "application/wasm"}
            protocol_version = "HTTP/1.1"

            def translate_path(self, path):
                for folder in folders:  # the first that has it
                    self.directory = str(folder)
                    found = super().translate_path(path)
                    if os.path.exists(found):
                        break
                return found

            def send_head(self):
                requests.append(self.path)
                return super().send_head()

            def log_message(self, *_):
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=str(folders[0])))
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._server.shutdown()
        self._server.server_close()


def serve(*folders):
    return Server(*folders)

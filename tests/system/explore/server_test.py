#!/usr/bin/python3
"""The server of carillon explore under hostile requests: bounded memory, responses to other clients.

Finds the programs in $CARILLON_BIN_DIR.
"""
import http.client
import json
import os
import pathlib
import re
import resource
import signal
import socket
import tempfile
import time
import unittest

import serving

LARGE = 8 << 20  # bytes of the requested file
MEMORY = 64 << 20  # limit of the server's memory in bytes
WAIT_S = 60  # for one response, on a busy machine


class Served(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)  # for the clients' sockets
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, 4096)), hard))
        cls.scratch = tempfile.TemporaryDirectory(prefix="carillon-server-")
        cls.folder = pathlib.Path(cls.scratch.name)
        (cls.folder / "index.html").write_text("the page")
        (cls.folder / "explore.json").write_text("{}")
        cls.large = os.urandom(1 << 20) * (LARGE >> 20)
        (cls.folder / "large.wasm").write_bytes(cls.large)
        (cls.folder / "empty.js").touch()
        os.mkfifo(cls.folder / "pipe")

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def setUp(self):
        self.server, said = serving.start(self.folder, preexec_fn=lambda: limit_files(1024))
        self.port = int(re.search(r":(\d+)/$", said["address"])[1])
        self.held = []

    def tearDown(self):
        # Ends at once with open connections.
        self.server.send_signal(signal.SIGINT)
        self.assertEqual(self.server.wait(timeout=WAIT_S), 0)
        self.server.stdout.close()
        for connection in self.held:
            connection.close()

    def connect(self, data=b""):
        connection = socket.create_connection(("127.0.0.1", self.port), timeout=WAIT_S)
        self.held.append(connection)
        try:
            connection.sendall(data)
        except OSError:  # closed by the server
            pass
        return connection

    def ask(self, path="/", method="GET", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        connection.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        response = connection.getresponse()
        body = response.read()
        connection.close()
        return response, body

    def send(self, text, body=b""):
        """HTTP status of the answer to a raw request."""
        connection = self.connect(text.replace("HOST", f"Host: 127.0.0.1:{self.port}").encode() + body)
        response = http.client.HTTPResponse(connection)
        response.begin()
        response.read()
        return response.status

    def read_memory(self):
        """Peak resident memory of the server [bytes]."""
        status = pathlib.Path(f"/proc/{self.server.pid}/status").read_text()
        return 1024 * int(re.search(r"VmHWM:\s+(\d+)", status)[1])

    def assert_well(self):
        response, body = self.ask()
        self.assertEqual((response.status, body), (200, b"the page"))
        self.assertLess(self.read_memory(), MEMORY)

    def test_a_request_gets_one_range_or_the_whole_file(self):
        for range_, first, last in (("bytes=0-9", 0, 9), ("bytes=100-", 100, LARGE - 1), ("bytes=-5", LARGE - 5, LARGE - 1)):
            response, body = self.ask("/large.wasm", Range=range_)
            self.assertEqual((response.status, body == self.large[first : last + 1]), (206, True), range_)
            self.assertEqual(response.getheader("Content-Range"), f"bytes {first}-{last}/{LARGE}")
        for range_ in (f"bytes={'0-,' * 1500}0-", "bytes=0-0,2-2", "bytes=9-0", "words=1-2", "bytes=-"):
            response, body = self.ask("/large.wasm", Range=range_)
            self.assertEqual((response.status, body == self.large), (200, True), range_[:30])
        for path, range_ in (("/large.wasm", f"bytes={LARGE}-"), ("/large.wasm", "bytes=-0"), ("/empty.js", "bytes=0-")):
            self.assertEqual(self.ask(path, Range=range_)[0].status, 416, range_)
        response, body = self.ask("/large.wasm", method="HEAD")
        self.assertEqual((response.status, response.getheader("Content-Length"), body), (200, str(LARGE), b""))
        self.assertEqual(self.ask("/empty.js")[1], b"")
        self.assert_well()

    def test_files_that_are_not_read_take_no_memory(self):
        request = f"GET /large.wasm HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nRange: bytes={'0-,' * 1500}0-\r\n\r\n".encode()
        for _ in range(400):  # more than the server's limit
            self.connect(request * 3)
        self.assert_well()

    def test_a_visitor_is_answered_while_hundreds_of_connections_wait(self):
        for k in range(600):
            self.connect((b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: ", b"GET / HTTP/1.1\r\nX: y\r\n")[k % 4])
        self.assert_well()
        for connection in self.held[-60::6]:  # slow requests, byte by byte
            try:
                connection.sendall(b"x")
            except OSError:
                pass
        self.assert_well()

    def test_one_connection_carries_many_requests(self):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        for path in ("/", "/large.wasm", "/none", "/empty.js", "/"):
            connection.request("GET", path)
            response = connection.getresponse()
            response.read()
            self.assertEqual(response.status, 404 if path == "/none" else 200)
            self.assertIsNone(response.getheader("Connection"))
        connection.close()
        # Pipelined requests, and one in single bytes.
        request = f"GET / HTTP/1.1\r\nHost: localhost:{self.port}\r\n\r\n".encode()
        both = self.connect(request * 2)
        for byte in request:
            both.sendall(bytes([byte]))
        got = b""
        while got.count(b"the page") < 3:
            data = both.recv(65536)
            self.assertTrue(data, got)
            got += data

    def test_what_is_no_request_for_a_file_is_refused(self):
        long = "x" * 100_000
        cases = {
            "POST / HTTP/1.1\r\nHOST\r\nContent-Length: 9\r\n\r\n": 405,
            "DELETE / HTTP/1.1\r\nHOST\r\n\r\n": 405,
            "PUT /recut HTTP/1.1\r\nHOST\r\nContent-Length: 2\r\n\r\n{}": 405,
            "POST /recut HTTP/1.1\r\nHOST\r\n\r\n": 411,
            "POST /recut HTTP/1.1\r\nHOST\r\nContent-Length: -1\r\n\r\n": 411,
            "POST /recut HTTP/1.1\r\nHOST\r\nContent-Length: 999999999\r\n\r\n": 413,
            # Forms of other origins can send these without asking first.
            "POST /recut HTTP/1.1\r\nHOST\r\nContent-Length: 2\r\n\r\n{}": 415,
            "POST /recut HTTP/1.1\r\nHOST\r\nContent-Type: text/plain; application/json\r\nContent-Length: 2\r\n\r\n{}": 415,
            "POST /recut HTTP/1.1\r\nHost: evil.example\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}": 421,
            "GET / HTTP/1.1\r\nHOST\r\nHOST\r\n\r\n": 400,
            "GET / HTTP/1.1\r\n\r\n": 421,
            "GET / HTTP/3\r\nHOST\r\n\r\n": 505,
            "GET / HTTP/1.1\r\nHOST\r\nno colon\r\n\r\n": 400,
            "GET /pipe HTTP/1.1\r\nHOST\r\n\r\n": 404,
            "GET /%2e%2e/%2e%2e/etc/passwd HTTP/1.1\r\nHOST\r\n\r\n": 404,
            "GET /%00 HTTP/1.1\r\nHOST\r\n\r\n": 400,
            "\x16\x03\x01 TLS\r\n\r\n": 400,
            f"GET /{long} HTTP/1.1\r\nHOST\r\n\r\n": 431,
            f"GET / HTTP/1.1\r\nHOST\r\nX: {long}\r\n\r\n": 431,
            "GET / HTTP/1.1\r\nHOST\r\n" + "X: y\r\n" * 20000 + "\r\n": 431,
            f"GET /{'a/' * 3000} HTTP/1.1\r\nHOST\r\n\r\n": 404,
        }
        for text, status in cases.items():
            self.assertEqual(self.send(text), status, text[:60])
        self.assert_well()

    def ask_recut(self, text):
        """(status, document) of a request to compute a body again."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        connection.request("POST", "/recut", text, {"Content-Type": "application/json"})
        response = connection.getresponse()
        document = json.loads(response.read())
        connection.close()
        return response.status, document

    def test_cuts_of_what_is_no_bank_are_refused(self):
        for text in (
            "",
            "[" * 5000,
            "{}",
            '{"bank": 1, "cuts": []}',
            '{"bank": "../outside.hdf", "cuts": []}',
            '{"bank": "/etc/passwd", "cuts": []}',
            '{"bank": "index.html", "cuts": []}',
            '{"bank": "none.hdf", "cuts": []}',
        ):
            status, document = self.ask_recut(text)
            self.assertEqual((status, list(document)), (400, ["error"]), text[:40])
        # A file that only looks like a bank: the program says what is wrong, in the file of the result.
        (self.folder / "false.hdf").write_bytes(b"CARILLON BANK 1.0\n")
        status, document = self.ask_recut('{"bank": "false.hdf", "cuts": [[0, 0, 0, 0.01, 1e-4]]}')
        self.assertEqual(status, 202)
        until = time.monotonic() + WAIT_S
        result = {"is_running": True}
        while result.get("is_running") and time.monotonic() < until:
            time.sleep(0.1)
            result = json.loads(self.ask("/" + document["result"])[1])
        self.assertIn("false.hdf", result["error"])
        self.assert_well()

    def test_large_requests_take_no_memory(self):
        body = b"y" * (16 << 20)
        self.assertEqual(self.send(f"POST / HTTP/1.1\r\nHOST\r\nContent-Length: {len(body)}\r\n\r\n", body), 405)
        self.assertEqual(self.send("PUT /x HTTP/1.1\r\nHOST\r\nTransfer-Encoding: chunked\r\n\r\n", b"1000000\r\n" + body), 405)
        self.assertEqual(self.send(f"GET / HTTP/1.1\r\nHOST\r\nContent-Length: {len(body)}\r\n\r\n", body), 200)
        self.connect(b"G" * (16 << 20))  # an endless line
        self.assert_well()


def limit_files(count):
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (count, hard))


if __name__ == "__main__":
    unittest.main(verbosity=2)

#!/usr/bin/env python3
"""Ask the server of neupig view --live for what it must give, and for what it must not.

    ask_server.py PORT INDEX      INDEX: of a frame that is there
"""

import json
import socket
import struct
import sys

port, index = int(sys.argv[1]), sys.argv[2]
own = f"127.0.0.1:{port}"


def ask(text):
    """The code and the body of the answer; code 0: the connection was closed without one."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as line:
        try:
            line.sendall(text.encode("latin-1"))
            answer = b""
            while True:
                more = line.recv(65536)
                if not more:
                    break
                answer += more
        except ConnectionError:
            pass
    head, _, body = answer.partition(b"\r\n\r\n")
    return (int(head.split()[1]) if head else 0), body


def get(path, host=own, more=""):
    return ask(f"GET {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n")


def expect(code, text, host=own):
    got = get(text, host)[0] if text.startswith("/") else ask(text)[0]
    if got != code:
        sys.exit(f"{text[:60]!r}: {got}, not {code}")


code, page = get("/")
assert code == 200 and page.startswith(b"<!DOCTYPE html>") and b'"live":true' in page, code
code, body = get("/state")
state = json.loads(body)
part = state["results"][0]["parts"][0]
assert code == 200 and state["phase"] == "solving" and len(part["frames"]) == 2 and part["frame_count"] == 6, state
code, body = get("/part-0")
assert code == 200 and struct.unpack_from("<I", body)[0] == part["vertices"]
code, body = get(f"/frame-0-{index}")
assert code == 200 and len(body) > part["vertices"]

for path in ("/frame-0-99", "/frame-1-0", "/part-7", "/part-0x", "/frame-0", "/frame-0-0-0", "/state/",
             "/report.json", "/job/job.json", "/../done.json", "/frame-0-99999999999999999999", "//", "/part-", "/frame--1-0"):
    expect(404, path)
for path in ("/%2e%2e/done.json", "/state?x=1", "/\\..", "/\xe9"):
    expect(400, path)
expect(414, "/" + "a" * 200)
for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS", "get", "CONNECT"):
    expect(405, f"{method} /state HTTP/1.1\r\nHost: {own}\r\n\r\n")
for host in ("example.org", f"example.org:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}", f"[::1]:{port}", ""):
    expect(403, "/state", host)
expect(400, "GET /state HTTP/1.1\r\n\r\n")
expect(400, f"GET /state HTTP/1.1\r\nHost: {own}\r\nHost: {own}\r\n\r\n")
expect(400, "nonsense\r\n\r\n")
expect(505, "/a b")
expect(505, f"GET /state HTTP/2.0\r\nHost: {own}\r\n\r\n")
expect(431, f"GET /state HTTP/1.1\r\nHost: {own}\r\nX: " + "a" * 9000)
expect(200, f"GET /state HTTP/1.0\r\nHost: localhost:{port}\r\n\r\n")

# Those that say nothing keep nobody else from an answer.
idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(20)]
expect(200, "/state")
for line in idle:
    line.close()
print("asked")

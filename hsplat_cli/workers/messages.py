"""Messages between the pool and its workers: plain data and runs of bytes, over a pair of sockets.

    length of the text, uint32 little-endian | text, JSON: [content, lengths of the runs] | the runs

Whoever reads them checks nothing: both ends are of one version, and nobody else has them.
"""

from __future__ import annotations

import json
import socket
import struct
from dataclasses import dataclass
from typing import Any

from renderer.errors import HsplatError, InputError, RenderError

_LENGTH = struct.Struct("<I")

Plain = dict[str, Any]


@dataclass(frozen=True)
class Message:
    """content: plain data for JSON. runs: what is too long for it, or not text."""

    content: Plain
    runs: tuple[bytes, ...] = ()


def send(end: socket.socket, message: Message) -> None:
    """Send a message, however long it takes until there is room. Raises OSError when nobody reads any more."""
    text = json.dumps([message.content, [len(run) for run in message.runs]]).encode("ascii")
    end.sendall(_LENGTH.pack(len(text)) + text)
    for run in message.runs:
        end.sendall(run)


def receive(end: socket.socket) -> Message:
    """Wait for the next message. Raises EOFError, or OSError, when there will be none."""
    (length,) = _LENGTH.unpack(_exactly(end, _LENGTH.size))
    content, lengths = json.loads(_exactly(end, length))
    return Message(content, tuple(_exactly(end, length) for length in lengths))


def _exactly(end: socket.socket, num_bytes: int) -> bytes:
    content = b""
    while len(content) < num_bytes:  # one turn, unless a signal comes in between
        more = end.recv(num_bytes - len(content), socket.MSG_WAITALL)
        if not more:
            raise EOFError
        content = content + more if content else more
    return content


_KINDS: dict[str, type[HsplatError]] = {kind.__name__: kind for kind in (InputError, RenderError)}


def error_to_plain(error: HsplatError) -> Plain:
    """An error as plain data. One of many complaints at once becomes one of a single text."""
    kind = "InputError" if isinstance(error, InputError) else "RenderError"
    parts = {name: getattr(error, name) for name in ("what", "where", "got", "expected", "hint")}
    return {"kind": kind} | parts


def error_from_plain(plain: Plain) -> HsplatError:
    """The error again, without its traceback."""
    return _KINDS[plain["kind"]](**{name: text for name, text in plain.items() if name != "kind"})

"""Messages arrive whole, in order, and errors as what they were."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest

from hsplat_cli.executors.workers.messages import (
    Message,
    error_from_plain,
    error_to_plain,
    receive,
    receive_available,
    send,
)
from renderer.errors import ContextLostError, HsplatError, InputError, Problem, RenderError, SceneError

Ends = tuple[socket.socket, socket.socket]


@pytest.fixture
def ends() -> Iterator[Ends]:
    one, other = socket.socketpair()
    with one, other:
        yield one, other


MESSAGES = [
    Message({}),
    Message({"text": "ü\udcff", "numbers": [0.1, -0.0, 1e-300], "none": None}),
    Message({"drawn": {}}, (b"", b"\0" * 3_000_000, b"x")),  # more than a socket holds
]


def test_one_after_the_other(ends: Ends) -> None:
    def send_all() -> None:
        for message in MESSAGES:
            send(ends[0], message)

    sender = threading.Thread(target=send_all)
    sender.start()
    assert [receive(ends[1]) for _ in MESSAGES] == MESSAGES
    sender.join()


def test_nobody_waits_for_what_is_missing(ends: Ends) -> None:
    messages, message = receive_available(ends[1]), Message({"drawn": {}}, (b"x" * 100, b"", b"y"))
    send(ends[0], message)
    send(ends[0], message)
    content = ends[1].recv(1000)
    for number, byte in enumerate(content, 1):
        assert next(messages) is None
        ends[0].sendall(bytes([byte]))
        if number in (len(content) // 2, len(content)):
            assert next(messages) == message
    ends[0].sendall(content)
    assert [next(messages) for _ in range(3)] == [message, message, None]
    ends[0].close()
    with pytest.raises(EOFError):
        next(messages)


@pytest.mark.parametrize("num_bytes", [0, 2, 5, 30])
def test_the_end_in_the_midst_of_one(ends: Ends, num_bytes: int) -> None:
    """A sender that dies leaves part of a message, or nothing."""
    send(ends[0], Message({"drawn": {}}, (b"x" * 100,)))
    part = ends[1].recv(num_bytes) if num_bytes else b""
    ends[1].recv(1000)
    ends[0].sendall(part)
    ends[0].close()
    with pytest.raises(EOFError):
        receive(ends[1])


def test_nobody_reads(ends: Ends) -> None:
    ends[1].close()
    with pytest.raises(OSError, match="Broken pipe"):
        send(ends[0], Message({}))


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (InputError("a", where="b", got="c", expected="d", hint="e"), InputError),
        (RenderError("a"), RenderError),
        (ContextLostError("a", got="b"), RenderError),
        (SceneError([Problem("a.b", "wrong"), Problem("c", "wrong, too", got="x")]), InputError),
    ],
)
def test_errors(error: HsplatError, kind: type[HsplatError]) -> None:
    back = error_from_plain(error_to_plain(error))
    assert (type(back), str(back)) == (kind, str(error))

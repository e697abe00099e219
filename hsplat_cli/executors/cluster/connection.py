"""Connects to a Dask cluster."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import ssl
import warnings
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from hsplat_cli.executors.drawing_options import ADDRESSES
from renderer.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

# Seconds in which the scheduler must answer.
_CONNECT_TIMEOUT_S = 6.0
_START_HINT = "`dask scheduler` starts one, and says its address"
_NOBODY = "nobody answers at this address"
_NO_SCHEDULER = "the server at this address is not a Dask scheduler"
_CERTIFICATES = "distributed.comm.tls.ca-file and distributed.comm.tls.client.cert, and .key if it is a file of its own"
_TLS_HINT = "set DASK_DISTRIBUTED__COMM__TLS__CA_FILE and DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT (docs/security.md)"
# Seconds in which a client of Dask must close by itself.
_CLOSE_TIMEOUT_S = 2.0


@contextlib.contextmanager
def connect(address: str) -> Iterator[Client]:
    """Connect to the scheduler at an address. Raises InputError where none answers within some ten seconds."""
    from distributed import Client

    with _silent_libraries():
        _require_scheduler(address)
        client = Client(address, timeout=_CONNECT_TIMEOUT_S, set_as_default=False, name="hsplat")
        # Dask drops tasks that failed; asyncio would print their tracebacks later, even after this context.
        client.loop.asyncio_loop.set_exception_handler(lambda *_: None)
        try:
            yield client
        finally:
            client.close(timeout=_CLOSE_TIMEOUT_S)


@contextlib.contextmanager
def _silent_libraries() -> Iterator[None]:
    """Silence logs and warnings of libraries: hsplat reports the problems that matter to users by errors and notes."""
    with warnings.catch_warnings(), contextlib.ExitStack() as stack:
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable(logging.CRITICAL)
        warnings.simplefilter("ignore")
        yield


def _require_scheduler(address: str) -> None:
    """Raise InputError unless a Dask scheduler answers; a Client would wait for a silent server without end."""
    from distributed.comm import CommClosedError

    fails = partial(InputError, where=f"--scheduler {address}", expected=ADDRESSES, hint=_START_HINT)
    settings = _connection_settings(address)
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(address, settings), _CONNECT_TIMEOUT_S))
    except CommClosedError as error:  # the server has closed the connection after TCP had connected
        if not address.startswith("tls://"):
            hint = f"{_START_HINT}; the address of a scheduler with TLS begins with tls://"
            raise fails("the server at this address hangs up", hint=hint) from error
        is_refused_here = isinstance(error.__cause__, ssl.SSLCertVerificationError)
        got = error.__cause__.verify_message if is_refused_here else "it does not accept our certificate, or has none"
        expected = "certificates of the same authority on both sides"
        raise fails("no TLS connection to this address", got=got, expected=expected, hint=_TLS_HINT) from error
    except Exception as error:  # Dask fails in many ways on the answer of another kind of server
        is_silent = isinstance(error, (OSError, asyncio.TimeoutError))
        raise fails(_NOBODY if is_silent else _NO_SCHEDULER) from error
    if kind != "Scheduler":
        raise fails(_NO_SCHEDULER, got=f"a {kind}")


def _connection_settings(address: str) -> dict[str, object]:
    """Return the arguments for connections, such as certificates, from Dask's configuration.

    Raises InputError where the configuration's certificates cannot be read, are missing for TLS, or are required and
    not used.
    """
    from distributed import Security

    security = Security()
    fails = partial(InputError, where=f"--scheduler {address}", expected=_CERTIFICATES, hint=_TLS_HINT)
    try:
        settings: dict[str, object] = security.get_connection_args("client")
    except OSError as error:
        files = dict.fromkeys([security.tls_ca_file, security.tls_client_cert, security.tls_client_key])
        reason = "no certificate, or no key that fits" if isinstance(error, ssl.SSLError) else error.strerror
        got = f"{reason}: {', '.join(filter(None, files))}"
        raise fails("the certificates of Dask's configuration cannot be read", got=got) from error
    is_tls = address.startswith("tls://")
    if is_tls and settings["ssl_context"] is None:
        raise fails("TLS needs certificates, and Dask's configuration has none")
    if security.require_encryption and not is_tls:
        raise fails(
            "Dask's configuration requires encryption", expected="an address that begins with tls://", hint=None
        )
    return settings


async def _kind_of_server(address: str, settings: dict[str, object]) -> str:
    """Return the kind of Dask server at an address: `Scheduler`, `Worker` or `Nanny`."""
    from distributed.comm import connect
    from distributed.core import send_recv

    comm = await connect(address, timeout=_CONNECT_TIMEOUT_S, **settings)
    try:
        return str((await send_recv(comm, op="identity"))["type"])
    finally:
        comm.abort()

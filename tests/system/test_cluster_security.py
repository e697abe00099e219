"""Nobody but this process can use the processes of `--workers`, nor give it modules to import."""

from __future__ import annotations

import asyncio
import importlib
import os
import pickle
import ssl
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dask.config
import psutil
import pytest
from distributed import Client, Security
from distributed.comm import connect as connect_comm
from distributed.core import send_recv

from hsplat_cli.executors.cluster import connection
from hsplat_cli.executors.cluster.connection import connect_locally
from renderer.errors import InputError

# What a stranger puts where Dask makes its folders unless it is given another place.
PLANTED = "planted_by_a_stranger"


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Replace the folder for temporary files by one in which another user has made Dask's."""
    folder = tmp_path_factory.mktemp("scratch")
    (folder / "dask-scratch-space").mkdir()
    (folder / "dask-scratch-space").chmod(0o777)
    (folder / "dask-scratch-space" / f"{PLANTED}.py").touch()
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    yield folder
    tempfile.tempdir = before


@pytest.fixture(scope="module")
def ports_before() -> set[int]:
    return listening_ports()


@pytest.fixture(scope="module")
def client(scratch: Path, ports_before: set[int]) -> Iterator[Client]:
    with connect_locally(1) as client:
        yield client
    assert list(scratch.iterdir()) == [scratch / "dask-scratch-space"]


def listening_ports() -> set[int]:
    """Return the ports of this process and its children at which anybody can connect."""
    this = psutil.Process()
    connections = [each for process in (this, *this.children(recursive=True)) for each in process.net_connections()]
    return {connection.laddr.port for connection in connections if connection.status == psutil.CONN_LISTEN}


def addresses(client: Client) -> list[str]:
    """Return the addresses of the scheduler and the worker."""
    info = client.scheduler_info()
    return [info["address"], *info["workers"]]


async def run_function(address: str, operation: str, settings: dict[str, Any]) -> object:
    """Have a server run a function, as every client may. settings: of the connection."""
    comm = await connect_comm(address, timeout=3, **settings)
    try:
        return (await send_recv(comm, op=operation, function=pickle.dumps(os.getpid)))["status"]
    finally:
        comm.abort()


def with_certificate(security: Security) -> dict[str, Any]:
    """Return the settings of a client that has this certificate and takes that of any server."""
    settings: dict[str, Any] = security.get_connection_args("client")
    settings["ssl_context"].verify_mode = ssl.CERT_NONE
    return settings


def test_no_other_port_is_open(client: Client, ports_before: set[int]) -> None:
    """Neither a page nor a metric that strangers could read: Dask has an HTTP server in each process by default."""
    ports = {int(address.rpartition(":")[2]) for address in addresses(client)}
    assert len(ports) == 2
    assert listening_ports() - ports_before == ports


def test_a_stranger_cannot_run_functions(client: Client) -> None:
    ours, theirs = with_certificate(client.security), with_certificate(Security.temporary())
    for address, operation in zip(addresses(client), ("run_function", "run"), strict=True):
        assert asyncio.run(run_function(address, operation, ours)) == "OK"
        place = address.partition("://")[2]
        for scheme, settings in (("tcp", {}), ("tls", theirs)):
            with pytest.raises(OSError):  # noqa: PT011  its text is Dask's
                asyncio.run(run_function(f"{scheme}://{place}", operation, settings))


def test_modules_of_strangers_are_not_imported(client: Client, scratch: Path) -> None:
    """Dask looks for modules in its folder first, which anybody could have made in /tmp."""

    def finds(name: str) -> bool:
        import importlib.util

        return importlib.util.find_spec(name) is not None

    importlib.invalidate_caches()
    assert not finds(PLANTED)
    assert set(client.run(finds, PLANTED).values()) == {False}
    (private,) = scratch.glob("hsplat-*")
    assert private.stat().st_mode & 0o777 == 0o700
    assert not any(folder.startswith(str(scratch)) for folder in sys.path)
    for folders in client.run(lambda: sys.path).values():
        assert all(folder.startswith(str(private)) for folder in folders if folder.startswith(str(scratch)))


def test_what_is_wrong_with_certificates_is_said(client: Client, tmp_path: Path) -> None:
    """With those of the cluster there is a connection; see also `scheduler.txt` of the messages."""
    address = client.scheduler_info()["address"]

    def message(security: Security, **other: str) -> str:
        """Return what is wrong with certificates in Dask's configuration."""
        file = tmp_path / "certificate.pem"
        file.write_text(security.tls_client_key + security.tls_client_cert)
        tls = {"ca-file": str(file), "client.cert": str(file)} | other
        with dask.config.set({f"distributed.comm.tls.{name}": value for name, value in tls.items()}):
            try:
                connection._require_scheduler(address)
            except InputError as error:
                return str(error).removeprefix(f"--scheduler {address}: ").partition("\n  expected")[0]
        return ""

    other = Security.temporary()
    assert message(client.security) == ""
    assert message(other) == "no TLS connection to this address\n  got: self-signed certificate"
    with tempfile.NamedTemporaryFile("w") as ours:
        ours.write(client.security.tls_ca_file)
        ours.flush()
        assert message(other, **{"ca-file": ours.name}) == (
            "no TLS connection to this address\n  got: it does not accept our certificate, or has none"
        )
    unreadable = "the certificates of Dask's configuration cannot be read\n  got: "
    assert message(other, **{"ca-file": "no.pem"}).startswith(f"{unreadable}No such file or directory: no.pem, ")
    assert message(other, **{"client.cert": __file__}).startswith(f"{unreadable}no certificate, or no key that fits: ")


def test_a_scheduler_with_tls_at_an_address_without(client: Client) -> None:
    address = client.scheduler_info()["address"].replace("tls://", "tcp://")
    with pytest.raises(InputError, match=r"address hangs up\n.*\n.*; that of one with TLS begins with tls://"):
        connection._require_scheduler(address)
    with (
        dask.config.set({"distributed.comm.require-encryption": True}),
        pytest.raises(InputError, match="requires enc"),
    ):
        connection._require_scheduler(address)

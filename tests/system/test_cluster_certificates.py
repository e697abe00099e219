"""A connection to a scheduler says what is wrong with its certificates; see also `scheduler.txt` of the messages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import dask.config
import pytest
from clusters import running_cluster
from distributed import LocalCluster, Security

from hsplat_cli.executors import connect
from renderer.errors import InputError


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    """Start a scheduler with TLS, without workers."""
    with running_cluster(0, security=Security.temporary()) as cluster:
        yield cluster


def test_certificates(cluster: LocalCluster, tmp_path: Path) -> None:
    address = cluster.scheduler_address

    def message(security: Security, **other: str) -> str:
        """Return what is wrong with certificates in Dask's configuration."""
        file = tmp_path / "certificate.pem"
        file.write_text(security.tls_client_key + security.tls_client_cert)
        tls = {"ca-file": str(file), "client.cert": str(file)} | other
        with dask.config.set({f"distributed.comm.tls.{name}": value for name, value in tls.items()}):
            try:
                with connect(address):
                    return ""
            except InputError as error:
                return str(error).removeprefix(f"--scheduler {address}: ").partition("\n  expected")[0]

    other, ours = Security.temporary(), tmp_path / "ours.pem"
    assert message(cluster.security) == ""
    assert message(other) == "no TLS connection to this address\n  got: self-signed certificate"
    ours.write_text(cluster.security.tls_ca_file)
    assert message(other, **{"ca-file": str(ours)}) == (
        "no TLS connection to this address\n  got: it does not accept our certificate, or has none"
    )
    unreadable = "the certificates of Dask's configuration cannot be read\n  got: "
    assert message(other, **{"ca-file": "no.pem"}).startswith(f"{unreadable}No such file or directory: no.pem, ")
    assert message(other, **{"client.cert": __file__}).startswith(f"{unreadable}no certificate, or no key that fits: ")


def test_a_scheduler_with_tls_at_an_address_without(cluster: LocalCluster) -> None:
    address = cluster.scheduler_address.replace("tls://", "tcp://")
    with (
        pytest.raises(
            InputError, match=r"address hangs up\n.*\n.*; the address of a scheduler with TLS begins with tls://"
        ),
        connect(address),
    ):
        pass
    with (
        dask.config.set({"distributed.comm.require-encryption": True}),
        pytest.raises(InputError, match="requires enc"),
        connect(address),
    ):
        pass

"""Modbus over TLS: who comes in, what a role lets it do, and what is wrong with a certificate."""

import asyncio
import datetime as dt
import gc
import ipaddress
import re
import socket
import ssl
import subprocess
from asyncio.sslproto import SSLProtocol
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from plc_interface.registers.map import BY_NAME
from plc_interface.server.exceptions import Trouble
from plc_interface.server.tls import ROLE_EXTENSION
from station.errors import StationError
from station.settings.modbus import ModbusTlsSettings
from tests.ports import free_port
from tests.tools import required

REFERENCE = BY_NAME["reference_u16"].address
DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "plc" / "server.md"
NOW = dt.datetime.now(dt.UTC)
YEAR = dt.timedelta(days=365)


class Authority:
    """Signs certificates."""

    def __init__(self, folder, name="authority"):
        self.folder, self.name = folder, name
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        certificate = self._built(self._subject, self._key.public_key(), NOW + YEAR, None)
        self.file = folder / f"{name}.pem"
        self.file.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))

    def issue(self, name, role=None, until=NOW + YEAR, passphrase=None):
        """The files of a certificate and its key; the role as the extension's raw bytes, or as a text."""
        key = ec.generate_private_key(ec.SECP256R1())
        raw = bytes([0x0C, len(role)]) + role.encode() if isinstance(role, str) else role
        subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        certificate = self._built(subject, key.public_key(), until, raw)
        files = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        files[0].write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        locked = serialization.BestAvailableEncryption(passphrase) if passphrase else serialization.NoEncryption()
        files[1].write_bytes(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, locked))
        return files

    def _built(self, subject, public_key, until, role):
        builder = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self._subject)
            .public_key(public_key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(NOW - 2 * YEAR)
            .not_valid_after(until)
            .add_extension(x509.BasicConstraints(ca=subject == self._subject, path_length=None), critical=True)
            .add_extension(
                x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), critical=False
            )
        )
        if role is not None:
            builder = builder.add_extension(x509.UnrecognizedExtension(ROLE_EXTENSION, role), critical=False)
        return builder.sign(self._key, hashes.SHA256())


@pytest.fixture
def authority(tmp_path):
    return Authority(tmp_path)


@pytest.fixture
def tls_port():
    return free_port()


@pytest.fixture
def settings():
    """Modbus settings beside those of TLS."""
    return {}


@pytest.fixture
def serving(serve, authority, tls_port, settings):
    certificate, key = authority.issue("station")
    files = {"certificate": certificate, "key": key, "client_authority": authority.file}
    return serve(tls={"enabled": True, "port": tls_port, **files}, **settings)


@pytest.fixture
def dial(connect, serving, authority):
    """Connect to the TLS port with a certificate, and put TLS around a plain connection's socket."""

    def dial_(certificate=None, key=None, version=ssl.TLSVersion.TLSv1_3, source="127.0.0.1"):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(authority.file)
        context.minimum_version = context.maximum_version = version
        if certificate is not None:
            context.load_cert_chain(certificate, key)
        wire = connect(serving, source, serving.settings.tls.port)
        wire.socket = context.wrap_socket(wire.socket, server_hostname="127.0.0.1")
        return wire

    return dial_


def is_parted_from(wire):
    """With TLS 1.3 a refusal comes with the first bytes behind the client's handshake."""
    try:
        return wire.is_closed()
    except ssl.SSLError:
        return True


class TestRoles:
    def test_a_writer_reads_and_writes(self, serving, dial, authority, caplog):
        plc = dial(*authority.issue("line-plc", "writer"))
        assert plc.read(REFERENCE, 1) == b"\x12\x34"
        plc.claim()
        assert str(serving.server.writer).endswith("(CN=line-plc)")
        assert [line for line in caplog.messages if "(CN=line-plc): it has connected" in line]

    def test_a_reader_reads_only(self, serving, dial, authority):
        scada = dial(*authority.issue("scada", "reader"))
        assert scada.read(REFERENCE, 1) == b"\x12\x34"
        assert scada.write(BY_NAME["write_key"].address, 0x5AFE) == bytes([0x90, 1])
        assert serving.server.statistics.troubles[Trouble.NO_RIGHT] == 1

    @pytest.mark.parametrize(
        "role",
        [
            None,
            "operator",
            b"",
            b"\x0c",
            b"\x0c\x06write",
            b"\x13\x06writer",
            b"\x0c\x06writer!",
            b"\x0c\x81\x06writer",
        ],
    )
    def test_another_role_or_none_lets_nobody_in(self, serving, dial, authority, role):
        assert is_parted_from(dial(*authority.issue("somebody", role)))
        assert serving.server.statistics.troubles[Trouble.NOT_ALLOWED] == 1

    def test_one_that_closes_while_the_server_ends_does_not_keep_it(self, serving, dial, authority):
        """Its TLS connection, closed once, would wait for the client's own goodbye."""
        plc = dial(*authority.issue("line-plc", "writer"))
        plc.read(REFERENCE, 1)
        (member,) = serving.server._manager._members.values()
        sock = serving.call(member._transport.get_extra_info, "socket")
        serving.call(lambda: (member._transport.close(), serving.server._manager.close()))
        assert serving.call(sock.fileno) == -1
        assert is_parted_from(plc)
        assert serving.server.connections == 0

    def test_pipelined_requests_over_tls(self, dial, authority):
        plc = dial(*authority.issue("line-plc", "writer"))
        requests = [plc.request(bytes([3, 0, REFERENCE, 0, 1])) for _ in range(200)]
        plc.send(b"".join(requests))
        assert [plc.receive()[0] for _ in requests] == list(range(1, 201))


class TestStrangers:
    def test_without_a_certificate(self, serving, dial):
        assert is_parted_from(dial())
        assert serving.server.connections == 0

    def test_from_another_authority(self, dial, tmp_path):
        (tmp_path / "other").mkdir()
        assert is_parted_from(dial(*Authority(tmp_path / "other", "other").issue("line-plc", "writer")))

    def test_with_a_certificate_that_has_expired(self, dial, authority):
        assert is_parted_from(dial(*authority.issue("line-plc", "writer", until=NOW - YEAR)))

    def test_with_tls_1_2(self, dial, authority):
        with pytest.raises(ssl.SSLError):
            dial(*authority.issue("line-plc", "writer"), version=ssl.TLSVersion.TLSv1_2)

    def test_without_tls(self, connect, serving):
        wire = connect(serving, "127.0.0.1", serving.settings.tls.port)
        wire.send(wire.request(bytes([3, 0, REFERENCE, 0, 1])))
        assert wire.socket.recv(3)[:1] != b"\0"  # a TLS alert, or the end

    def test_the_plain_port_stays_beside_it(self, connect, serving):
        assert connect(serving).read(REFERENCE, 1) == b"\x12\x34"


def is_ended(client):
    """Return whether the server has closed a connection from which no byte is to come."""
    try:
        return client.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


class TestSilentCrowds:
    @pytest.fixture
    def settings(self):
        return {"readers": ("127.0.0.1", "127.0.0.9"), "frame_timeout_s": 60.0}

    def test_they_get_the_places_of_one_address_and_keep_nobody_out(self, serving, connect, dial, crowd, authority):
        plc, plain = dial(*authority.issue("line-plc", "writer")), connect(serving)
        plc.claim()
        troubles = serving.server.statistics.troubles
        strangers = crowd(serving.settings.tls.port, 100, "127.0.0.66")
        serving.wait(lambda: troubles[Trouble.NOT_ALLOWED] == 100)
        silent = crowd(serving.settings.tls.port, 100, "127.0.0.9")
        serving.wait(lambda: troubles[Trouble.TOO_MANY] == 100 - serving.settings.max_per_address)
        serving.wait(lambda: sum(map(is_ended, strangers)) == 100)
        serving.wait(lambda: sum(map(is_ended, silent)) == 100 - serving.settings.max_per_address)
        assert serving.server.statistics.refused_connections == 200 - serving.settings.max_per_address
        assert plc.write(BY_NAME["trigger_id"].address, 7)[0] == 16
        assert plain.read(REFERENCE, 1) == b"\x12\x34"
        assert dial(*authority.issue("scada", "reader")).read(REFERENCE, 1) == b"\x12\x34"
        assert connect(serving).read(REFERENCE, 1) == b"\x12\x34"

    def test_they_are_in_the_log_as_on_the_plain_port(self, serving, crowd, caplog):
        crowd(serving.settings.tls.port, 1, "127.0.0.66")
        crowd(serving.settings.tls.port, 9, "127.0.0.9")
        serving.wait(lambda: serving.server.statistics.refused_connections == 2)
        assert [line for line in caplog.messages if line.startswith("127.0.0.66:") and "modbus.readers" in line]
        assert [line for line in caplog.messages if line.startswith("127.0.0.9:") and "8 of its address" in line]


class TestHandshakes:
    """One place for all."""

    @pytest.fixture
    def settings(self):
        return {"max_connections": 1, "writers": (), "frame_timeout_s": 60.0}

    @pytest.fixture
    def failed(self, serving):
        """Wait for one handshake to have failed."""
        return lambda: serving.wait(lambda: serving.server.statistics.troubles[Trouble.NO_HANDSHAKE] == 1)

    def test_one_under_way_has_a_place_on_both_ports(self, serving, connect, dial, authority, failed):
        half = connect(serving, port=serving.settings.tls.port)
        serving.wait(lambda: serving.server._manager._handshakes)
        assert connect(serving).is_closed()
        assert is_parted_from(connect(serving, port=serving.settings.tls.port))
        assert serving.server.statistics.troubles[Trouble.TOO_MANY] == 2
        half.close()
        failed()
        assert dial(*authority.issue("scada", "reader")).read(REFERENCE, 1) == b"\x12\x34"

    def test_clear_text(self, serving, connect, failed, caplog):
        wire = connect(serving, port=serving.settings.tls.port)
        wire.send(wire.request(bytes([3, 0, REFERENCE, 0, 1])))
        failed()
        assert wire.is_closed()
        assert [line for line in caplog.messages if "its TLS handshake failed" in line and "[SSL" in line]

    @pytest.mark.parametrize("source", ["other authority", "expired", "none"])
    def test_a_bad_certificate(self, dial, authority, tmp_path, failed, caplog, source):
        (tmp_path / "other").mkdir()
        files = {
            "other authority": lambda: Authority(tmp_path / "other", "other").issue("line-plc", "writer"),
            "expired": lambda: authority.issue("line-plc", "writer", until=NOW - YEAR),
            "none": lambda: (),
        }[source]()
        assert is_parted_from(dial(*files))
        failed()
        why = {"other authority": "unable to get local issuer", "expired": "has expired", "none": "did not return a"}
        (line,) = [line for line in caplog.messages if "its TLS handshake failed" in line]
        assert why[source] in line

    def test_one_that_goes(self, serving, connect, failed, caplog):
        connect(serving, port=serving.settings.tls.port).close()
        failed()
        assert [line for line in caplog.messages if "its TLS handshake failed (the client has ended it)" in line]

    def test_those_that_fail_leave_no_buffers_to_the_collector(self, serving, connect):
        gc.collect()
        gc.disable()
        try:
            for count in range(1, 6):
                wire = connect(serving, port=serving.settings.tls.port)
                wire.send(wire.request(bytes([3, 0, REFERENCE, 0, 1])))
                assert wire.is_closed()
                serving.wait(lambda count=count: serving.server.statistics.troubles[Trouble.NO_HANDSHAKE] == count)
            serving.wait(lambda: not asyncio.all_tasks(serving.loop))
            assert not [one for one in gc.get_objects() if isinstance(one, SSLProtocol)]
        finally:
            gc.enable()

    def test_the_end_of_the_server_ends_them(self, serving, connect, caplog):
        half = connect(serving, port=serving.settings.tls.port)
        serving.wait(lambda: serving.server._manager._handshakes)
        serving.stop_server()
        assert half.is_closed()
        assert not serving.call(asyncio.all_tasks, serving.loop)
        assert not serving.server.statistics.troubles
        assert not [record for record in caplog.records if record.name == "asyncio"]


class TestTime:
    @pytest.fixture
    def settings(self):
        return {"frame_timeout_s": 0.5}

    def test_a_handshake_that_is_not_finished_ends(self, serving, connect, caplog):
        half = connect(serving, port=serving.settings.tls.port)
        half.send(b"\x16\x03\x01\x02\x00\x01")
        assert half.is_closed()
        serving.wait(lambda: serving.server.statistics.troubles[Trouble.NO_HANDSHAKE] == 1)
        assert [line for line in caplog.messages if "its TLS handshake failed" in line and "longer than 0.5" in line]
        assert not serving.server._manager._handshakes


class TestReserve:
    @pytest.fixture
    def settings(self):
        return {"max_connections": 1}

    def test_it_is_for_a_certificate_that_may_write(self, serving, connect, dial, authority):
        """Until the certificate is known, an address that may write is enough."""
        connect(serving).claim()
        assert is_parted_from(dial(*authority.issue("scada", "reader")))
        assert serving.server.statistics.troubles[Trouble.TOO_MANY] == 1
        assert dial(*authority.issue("line-plc", "writer")).read(REFERENCE, 1) == b"\x12\x34"


class TestBadFiles:
    @pytest.fixture
    def refusal(self, serve, authority, tls_port):
        """The sentence with which a server with these files is refused."""

        def refused(**files):
            certificate, key = authority.issue("station")
            tls = {"certificate": certificate, "key": key, "client_authority": authority.file, **files}
            with pytest.raises(StationError) as caught:
                serve(tls={"enabled": True, "port": tls_port, **tls})
            return str(caught.value)

        return refused

    @pytest.mark.parametrize("name", ["certificate", "key", "client_authority"])
    def test_missing(self, refusal, tmp_path, name):
        missing = tmp_path / "no-such.pem"
        assert refusal(**{name: missing}).startswith(f"modbus.tls.{name}: {missing} cannot be read (No such file")

    @pytest.mark.parametrize("name", ["certificate", "key", "client_authority"])
    def test_no_pem(self, refusal, tmp_path, name):
        wrong = tmp_path / "wrong.pem"
        wrong.write_text("nothing of the kind")
        text = refusal(**{name: wrong})
        assert text.startswith(f"modbus.tls.{name}: {wrong} ")
        assert "give the PEM file" in text

    def test_a_key_of_another_certificate(self, refusal, authority):
        _, key = authority.issue("other")
        assert f"{key} is not the private key of" in refusal(key=key)

    def test_a_key_with_a_passphrase(self, refusal, authority):
        _, key = authority.issue("locked", passphrase=b"secret")
        assert "without one" in refusal(key=key)

    def test_a_certificate_that_has_expired(self, refusal, authority):
        certificate, key = authority.issue("old", until=NOW - YEAR)
        assert "renew it, or set the clock" in refusal(certificate=certificate, key=key)

    def test_the_port_in_use_leaves_the_plain_one_free(self, refusal, tls_port, serve):
        with socket.socket() as other:
            other.bind(("127.0.0.1", tls_port))
            other.listen()
            assert "modbus.tls.port" in refusal()
        assert serve().server.connections == 0


def test_the_commands_in_the_document_make_a_writer(connect, serve, tls_port, tmp_path):
    required("openssl")  # comes with postgresql
    (commands,) = re.findall(r"```\n(new=.*?)```", DOCUMENT.read_text("utf-8"), re.DOTALL)
    done = subprocess.run(["bash", "-ec", commands], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    files = {name: tmp_path / f"{name}.pem" for name in ("station", "authority")}
    tls = {"certificate": files["station"], "key": tmp_path / "station.key", "client_authority": files["authority"]}
    serving = serve(tls={"enabled": True, "port": tls_port, **tls})
    context = ssl.create_default_context(cafile=files["authority"])
    context.load_cert_chain(tmp_path / "plc.pem", tmp_path / "plc.key")
    plc = connect(serving, "127.0.0.1", tls_port)
    plc.socket = context.wrap_socket(plc.socket, server_hostname="127.0.0.1")
    plc.claim()
    assert str(serving.server.writer).endswith("(CN=plc)")


def test_the_settings_want_the_files():
    with pytest.raises(ValueError, match="without key, client_authority"):
        ModbusTlsSettings(enabled=True, certificate=Path("station.pem"))

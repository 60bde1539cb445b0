"""TLS for Modbus: our certificate, the clients' authority, and a client's rights from its certificate.

Source: Modbus/TCP Security Protocol Specification v2.1: mutual TLS, and the role in the extension
1.3.6.1.4.1.50316.802.1, an ASN.1 UTF8String. TLS 1.2, which the specification allows, is refused.
"""

import ssl
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path

from cryptography import x509

from station.errors import StationError
from station.settings.modbus import ModbusTlsSettings

ROLE_EXTENSION = x509.ObjectIdentifier("1.3.6.1.4.1.50316.802.1")
_UTF8_STRING = 0x0C
_LONGEST_ROLE = 127


class Right(Enum):
    """Rights of a client."""

    NONE = "none"
    READ = "reader"
    WRITE = "writer"


class TlsError(StationError):
    """Modbus over TLS cannot be served."""


def server_context(settings: ModbusTlsSettings) -> ssl.SSLContext:
    """Make a TLS server context: TLS 1.3 with client certificates, from the three files named in the settings.

    Raises:
        TlsError: a file that is missing, unreadable or no PEM, a key that is not the certificate's, a certificate that
            is not valid now.
    """
    paths = (settings.certificate, settings.key, settings.client_authority)
    names = ("certificate", "key", "client_authority")
    for name, path in zip(names, paths, strict=True):
        _readable(name, path)
    certificate, key, authority = (Path(path or "") for path in paths)
    _valid_now(certificate)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.verify_mode = ssl.CERT_REQUIRED
    try:
        context.load_cert_chain(certificate, key, password=_no_passphrase)
    except (ssl.SSLError, TlsError, ValueError) as error:
        raise TlsError(
            f"modbus.tls.key: {key} is not the private key of {certificate}, or has a passphrase: "
            "give the PEM file with that certificate's key, without one"
        ) from error
    try:
        context.load_verify_locations(authority)
    except ssl.SSLError as error:
        raise TlsError(
            f"modbus.tls.client_authority: {authority} holds no certificate: give the PEM file of the authority that "
            "signs the clients' certificates"
        ) from error
    return context


def identity_of(connection: ssl.SSLObject | None) -> tuple[str, Right]:
    """Return a client's subject and right by its certificate; without TLS no name and the right to write."""
    if connection is None:
        return "", Right.WRITE
    raw = connection.getpeercert(binary_form=True)
    if not raw:
        return "", Right.NONE
    certificate = x509.load_der_x509_certificate(raw)
    subject = certificate.subject.rfc4514_string()
    return subject if subject.isprintable() else ascii(subject), _right_of(certificate)


def _right_of(certificate: x509.Certificate) -> Right:
    """Return the right by the role; none for a role that is missing, malformed or unknown."""
    try:
        extension = certificate.extensions.get_extension_for_oid(ROLE_EXTENSION).value
    except (x509.ExtensionNotFound, x509.DuplicateExtension, ValueError):
        return Right.NONE
    raw = extension.value if isinstance(extension, x509.UnrecognizedExtension) else b""
    if len(raw) < 2 or raw[0] != _UTF8_STRING or raw[1] > _LONGEST_ROLE or len(raw) != 2 + raw[1]:
        return Right.NONE
    role = raw[2:].decode("utf-8", "replace")
    return {Right.READ.value: Right.READ, Right.WRITE.value: Right.WRITE}.get(role, Right.NONE)


def _readable(name: str, path: Path | None) -> None:
    try:
        Path(path or "").read_bytes()
    except OSError as error:
        raise TlsError(
            f"modbus.tls.{name}: {path} cannot be read ({error.strerror}): give a PEM file that the station may read"
        ) from error


def _valid_now(path: Path) -> None:
    try:
        certificate = x509.load_pem_x509_certificate(path.read_bytes())
    except ValueError as error:
        raise TlsError(
            f"modbus.tls.certificate: {path} holds no certificate: give the PEM file of the station's certificate"
        ) from error
    now = datetime.now(UTC)
    if not certificate.not_valid_before_utc <= now <= certificate.not_valid_after_utc:
        raise TlsError(
            f"modbus.tls.certificate: {path} is valid from {certificate.not_valid_before_utc:%Y-%m-%d} to "
            f"{certificate.not_valid_after_utc:%Y-%m-%d}, and today is {now:%Y-%m-%d}: renew it, or set the clock"
        )


def _no_passphrase() -> str:
    """Replace OpenSSL's prompt on the terminal, which blocks without a user."""
    raise TlsError("the key has a passphrase")

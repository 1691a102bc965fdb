"""Certificates made for a test: an authority, and what it vouches for; or one that vouches for itself."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

LOCALHOST = "127.0.0.1"


@cache
def _key(name: str) -> rsa.RSAPrivateKey:
    """One key for each name in a run of tests: making one takes longer than the rest of a test."""
    return rsa.generate_private_key(public_exponent=65537, key_size=2048)


@dataclass(frozen=True)
class Certificate:
    """A certificate and its private key, as files: NAME.pem, NAME.der and NAME.key.pem."""

    certificate: x509.Certificate
    private_key: rsa.RSAPrivateKey
    pem: Path
    der: Path
    key: Path


def certificate(
    directory: Path,
    name: str,
    issuer: Certificate | None = None,
    host: str = LOCALHOST,
    uri: str | None = None,
    age_days: float = 1.0,
) -> Certificate:
    """Make one that is valid for thirty days from `age_days` ago.

    issuer : None for one that vouches for itself, and for others. host : IP address. uri : of an OPC UA application.
    """
    private_key = _key(name)
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    names: list[x509.GeneralName] = [x509.IPAddress(ipaddress.ip_address(host))]
    if uri is not None:
        names.append(x509.UniformResourceIdentifier(uri))
    begins = datetime.now(UTC) - timedelta(days=age_days)
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject if issuer is None else issuer.certificate.subject)
        .public_key(private_key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begins)
        .not_valid_after(begins + timedelta(days=30))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=issuer is None, path_length=None), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(private_key.public_key()), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(
                (private_key if issuer is None else issuer.private_key).public_key()
            ),
            critical=False,
        )
        .add_extension(
            x509.KeyUsage(
                digital_signature=True,
                content_commitment=True,
                key_encipherment=True,
                data_encipherment=True,
                key_agreement=False,
                key_cert_sign=issuer is None,
                crl_sign=issuer is None,
                encipher_only=False,
                decipher_only=False,
            ),
            critical=True,
        )
        .add_extension(
            x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False
        )
        .sign(private_key if issuer is None else issuer.private_key, hashes.SHA256())
    )
    pem, der, key = (directory / f"{name}.{ending}" for ending in ("pem", "der", "key.pem"))
    pem.write_bytes(made.public_bytes(Encoding.PEM))
    der.write_bytes(made.public_bytes(Encoding.DER))
    key.write_bytes(private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    key.chmod(0o600)
    return Certificate(made, private_key, pem, der, key)

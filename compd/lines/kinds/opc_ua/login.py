"""The log-in to an OPC UA server: certificates for a signed or encrypted channel, user and password.

The name of the application that compd tells the server is the one in its own certificate, as servers compare the two.

Source: OPC 10000-4 1.05, 5.6.2 (OpenSecureChannel), 5.7.2 (CreateSession: ApplicationUri), 7.40.4 (user and password).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from asyncua import ua
from asyncua.client.client import Client
from asyncua.crypto import security_policies
from asyncua.ua.status_codes import StatusCodes
from asyncua.ua.uaerrors import UaError, UaStatusCodeError
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_der_private_key,
    load_pem_private_key,
)
from cryptography.x509 import (
    Certificate,
    ExtensionNotFound,
    SubjectAlternativeName,
    UniformResourceIdentifier,
    load_der_x509_certificate,
    load_pem_x509_certificate,
)

from compd.lines.kinds.opc_ua.settings import OpcUaLine, OpcUaSecurity

_PEM = b"-----BEGIN "
_TRUST = "let the server trust `certificate`"
_USER = "`user` and `password_file` are not what the server knows"
_HINTS: Mapping[int, str] = {
    StatusCodes.BadCertificateUntrusted: _TRUST,
    StatusCodes.BadSecurityChecksFailed: _TRUST,
    StatusCodes.BadCertificateTimeInvalid: "`certificate` has expired, or a clock is wrong",
    StatusCodes.BadUserAccessDenied: _USER,
    StatusCodes.BadIdentityTokenInvalid: _USER,
    StatusCodes.BadIdentityTokenRejected: _USER,
}


async def log_in(client: Client, settings: OpcUaLine) -> None:
    """Connect, with the channel and the user of the settings.

    Raises what asyncua raises; OSError and ValueError for files that cannot be used, and for a server that offers no
    such channel or has another certificate.
    """
    if settings.security is not None:
        await _secure(client, settings.security)
    if settings.user is not None:
        client.set_user(settings.user)
        if settings.password_file is not None:
            client.set_password(Path(settings.password_file).read_text(encoding="utf-8").rstrip("\r\n"))
    try:
        await client.connect()
    except UaStatusCodeError:
        raise
    except UaError as error:
        if settings.security is None:
            raise ValueError(f"{error}; where a server offers secure channels alone, write `security`") from error
        raise


def refusal(error: UaStatusCodeError) -> str:
    """The name of a status with which a server has refused, and what to do where that is known."""
    hint = _HINTS.get(error.code)
    return f"refuses: {ua.StatusCode(error.code).name}{'' if hint is None else f'; {hint}'}"


async def _secure(client: Client, security: OpcUaSecurity) -> None:
    """Raises OSError or ValueError."""
    own = _certificate("certificate", security.certificate)
    server = _certificate("server_certificate", security.server_certificate)
    key = _private_key(security.private_key)
    if key.public_key() != own.public_key():
        raise ValueError(f"`private_key` {security.private_key} is not that of `certificate` {security.certificate}")
    client.application_uri = _application_uri(own)
    policy = getattr(security_policies, f"SecurityPolicy{security.policy}")
    mode = ua.MessageSecurityMode[security.mode]
    # A server that cannot read a message of a secure channel may just be silent: ask first what it offers.
    _check_offer(await client.connect_and_get_server_endpoints(), policy.URI, mode, server)
    await client.set_security(
        policy,
        own.public_bytes(Encoding.DER),
        key.private_bytes(Encoding.DER, PrivateFormat.PKCS8, NoEncryption()),
        server_certificate=server.public_bytes(Encoding.DER),
        mode=mode,
    )


def _check_offer(
    endpoints: Sequence[ua.EndpointDescription], policy_uri: str, mode: ua.MessageSecurityMode, server: Certificate
) -> None:
    """Raises ValueError if the server offers no such channel, or has another certificate."""
    offered = {(each.SecurityPolicyUri, each.SecurityMode) for each in endpoints}
    if (policy_uri, mode) not in offered:
        names = sorted(f"{uri.partition('#')[2]} {each.name.rstrip('_')}" for uri, each in offered)
        wanted = f"{policy_uri.partition('#')[2]} {mode.name}"
        raise ValueError(f"it does not offer {wanted}, but {', '.join(names)}")
    expected = server.public_bytes(Encoding.DER)
    if not any((each.ServerCertificate or b"").startswith(expected) for each in endpoints):
        raise ValueError("its certificate is not `server_certificate`: another server, or it has a new one")


def _certificate(key: str, path: str) -> Certificate:
    """A certificate, PEM or DER as its content says. Raises OSError, and ValueError with the configuration's `key`."""
    content = Path(path).read_bytes()
    try:
        return load_pem_x509_certificate(content) if _PEM in content else load_der_x509_certificate(content)
    except ValueError as error:
        raise ValueError(f"`{key}` {path} is no certificate, .der or .pem") from error


def _private_key(path: str) -> RSAPrivateKey:
    """A private key, PEM or DER as its content says. Raises OSError, ValueError."""
    content = Path(path).read_bytes()
    try:
        key = (load_pem_private_key if _PEM in content else load_der_private_key)(content, password=None)
    except (ValueError, TypeError) as error:  # TypeError: it has a password
        raise ValueError(f"`private_key` {path} is no private key without a password, .der or .pem") from error
    if not isinstance(key, RSAPrivateKey):
        raise ValueError(f"`private_key` {path} is not of RSA, as these policies ask")
    return key


def _application_uri(own: Certificate) -> str:
    """The name of the application in its certificate. Raises ValueError if it has none."""
    try:
        names = own.extensions.get_extension_for_class(SubjectAlternativeName).value
        return names.get_values_for_type(UniformResourceIdentifier)[0]
    except (ExtensionNotFound, IndexError) as error:
        raise ValueError("`certificate` has no URI among its subject alternative names: servers refuse it") from error

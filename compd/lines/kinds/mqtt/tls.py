"""TLS to an MQTT broker: the context with the certificates of the configuration, and why a handshake has failed.

The broker's certificate must be vouched for and have the `host` of the line among its names. There is no way round.

Source: OpenSSL, `X509_V_ERR_*` in x509_vfy.h, for the codes of a certificate that is refused.
"""

from __future__ import annotations

import ssl
from collections.abc import Mapping

from compd.lines.kinds.mqtt.settings import MqttTls

_NOT_VOUCHED_FOR = "`ca_file` has to have the certificate that vouches for it"
_OTHER_HOST = "`host` has to be a name in it"
_CLOCK = "it, or this computer's clock, is wrong"
_HINTS: Mapping[int, str] = {
    9: _CLOCK,  # not yet valid
    10: _CLOCK,  # expired
    18: _NOT_VOUCHED_FOR,  # self-signed
    19: _NOT_VOUCHED_FOR,  # self-signed in its chain
    20: _NOT_VOUCHED_FOR,  # no issuer
    62: _OTHER_HOST,  # host name
    64: _OTHER_HOST,  # IP address
}


class _ClosingSocket(ssl.SSLSocket):
    """Closed where the handshake fails: paho leaves it open."""

    def do_handshake(self, block: bool = False) -> None:
        try:
            super().do_handshake(block)
        except OSError:
            self.close()
            raise


def tls_context(settings: MqttTls) -> ssl.SSLContext:
    """The context of a connection. Raises ValueError for files that cannot be used."""
    try:
        context = ssl.create_default_context(cafile=settings.ca_file)
    except OSError as error:
        raise ValueError(f"`ca_file` {settings.ca_file} cannot be used: {error}") from error
    context.sslsocket_class = _ClosingSocket
    if settings.certificate is not None:
        try:
            # without a password, OpenSSL would ask for one on the terminal
            context.load_cert_chain(settings.certificate, settings.private_key, password="")
        except OSError as error:
            files = f"`certificate` {settings.certificate} and `private_key` {settings.private_key}"
            raise ValueError(f"{files} cannot be used, .pem without a password: {error}") from error
    return context


def handshake_failure(error: Exception) -> str:
    """Why there is no connection, and what to do."""
    if isinstance(error, ssl.SSLCertVerificationError):
        hint = _HINTS.get(error.verify_code)
        reason = error.verify_message.rstrip(".")
        return f"the broker's certificate is refused: {reason}{'' if hint is None else f'; {hint}'}"
    if isinstance(error, ssl.SSLError | ConnectionResetError):
        return f"{error}; does this port speak TLS? It is usually 8883"
    return str(error)

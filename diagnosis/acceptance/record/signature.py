"""Signatures of records: Ed25519 (RFC 8032) over the bytes of the file, with a key of the user."""

from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.command import missing_extra


def public_key(private: str | Path) -> str:
    """The public key of a private one, PEM.

    Raises:
        InputError: the file holds no private Ed25519 key without a password.
    """
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

    found = _private(Path(private)).public_key()
    return found.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo).decode()


def sign(content: bytes, private: str | Path) -> bytes:
    """The signature (64 bytes) of some bytes.

    Raises:
        InputError: as :func:`public_key`.
    """
    return _private(Path(private)).sign(content)


def is_signed(content: bytes, signature: bytes, public: bytes, where: str) -> bool:
    """Whether a signature is that of some bytes by the key of a public one, PEM.

    Raises:
        InputError: it is no public Ed25519 key; says where.
    """
    _needed()
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    try:
        key = load_pem_public_key(public)
    except Exception:  # of several kinds, of which the library promises none
        raise InputError(f"{where} is not a public key (PEM)") from None
    if not isinstance(key, Ed25519PublicKey):
        raise InputError(f"{where} is a public key of another kind; Ed25519 is needed")
    try:
        key.verify(signature, content)
    except InvalidSignature:
        return False
    return True


def _private(path: Path) -> Any:
    _needed()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(path.read_bytes(), None)
    except OSError as error:
        raise InputError(f"the key '{path}' cannot be read: {error.strerror or error}") from None
    except TypeError:
        raise InputError(f"the key '{path}' has a password; give a key without one") from None
    except Exception:  # of several kinds, of which the library promises none
        raise InputError(f"'{path}' is not a private key (PEM)") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"'{path}' is a key of another kind; Ed25519 is needed")
    return key


def _needed() -> None:
    """Raise InputError where the library is not installed."""
    try:
        import cryptography  # noqa: F401
    except ModuleNotFoundError as error:
        raise InputError(missing_extra(error)) from None

"""The key of a contest: a secret beside a dataset, from which published numbers of test frames and their salts follow."""

from __future__ import annotations

import hashlib
import hmac
import json
import re
import secrets
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar.errors import DatasetError
from rso_lidar.files import read_text, write_text

KEY_FILE = "contest_key.json"
CONTEST_SPLIT = "test"
HASHES = "labels.sha256"  # of hidden labels, in the folder of a contest
_MOST_BYTES = 4096
_SECRET_BYTES = 32


@dataclass(frozen=True)
class ContestKey:
    """A secret of 32 bytes, as hexadecimal digits."""

    secret: str

    def digest(self, text: str) -> str:
        """Return the HMAC-SHA256 of a text under the secret (RFC 2104), as hexadecimal digits."""
        return hmac.new(bytes.fromhex(self.secret), text.encode(), hashlib.sha256).hexdigest()

    def number_frames(self, sample: np.ndarray, draw: np.ndarray) -> np.ndarray:
        """Return the numbers (frame) under which a contest publishes frames.

        Each noise draw of a sample has a number of its own, so that a number does not tell which frames share a pose. The
        numbers are 0 to n - 1 in the order of digests, which nobody knows without the secret.

        Parameters
        ----------
        sample, draw : (frame) of all frames of the split
        """
        pairs = np.stack([sample, draw], axis=1)
        known, place = np.unique(pairs, axis=0, return_inverse=True)
        digests = [self.digest(f"frame,{number},{noise}") for number, noise in known.tolist()]
        rank = np.empty(len(known), np.int64)
        rank[sorted(range(len(known)), key=digests.__getitem__)] = np.arange(len(known))
        numbers: np.ndarray = rank[place.ravel()]
        return numbers


def read_key(folder: Path) -> ContestKey:
    """Read the key of a contest from the folder of its dataset.

    Raises
    ------
    DatasetError
        If there is none, or it is damaged.
    """
    place = folder / KEY_FILE
    if not place.is_file():
        raise DatasetError(
            f"{folder}: has no {KEY_FILE}; begin a contest with `rso-lidar dataset publish {folder} --hidden-labels FOLDER`"
        )
    try:
        secret = json.loads(read_text(place, _MOST_BYTES, DatasetError, "key"))["secret"]
        if not re.fullmatch(rf"[0-9a-f]{{{2 * _SECRET_BYTES}}}", secret):
            raise ValueError(secret)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(f"{place}: is damaged; restore it, because submissions are numbered by it") from None
    return ContestKey(secret)


def find_key(folder: Path) -> ContestKey:
    """Return the key of the contest of a dataset; make one, which only its owner may read, where there is none."""
    place = folder / KEY_FILE
    if not place.exists():
        write_text(place, json.dumps({"secret": secrets.token_hex(_SECRET_BYTES)}) + "\n", overwrite=False)
        place.chmod(0o600)
    return read_key(folder)

"""glTF: the description of a file, and the arrays that its accessors name, within bounds of memory."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.files import read_bytes

# Of a mesh file and of the data beside it: ten million facets as STL; a reader takes some eight times as much memory.
MOST_BYTES = 2**29
_MOST_COMMAS = 5_000_000  # a list of empty lists takes twenty times its size in memory
_MAGIC, _JSON, _BIN = b"glTF", 0x4E4F534A, 0x004E4942  # glTF 2.0, section 4.4
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_KIND = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


class GltfFile:
    """A glTF file: its description, and the arrays in its buffers, which are read when they are asked for.

    Attributes
    ----------
    where : name of the file, for messages
    tree : the description
    """

    def __init__(self, path: Path, blob: bytes) -> None:
        self.where = path.name
        self._path = path
        self.tree, self._binary = self._parse(blob)
        self._check_version()
        self._views, self._buffers = self.list_of(self.tree, "bufferViews"), self.list_of(self.tree, "buffers")
        self._accessors = self.list_of(self.tree, "accessors")
        self._loaded: dict[int, bytes] = {}

    @property
    def has_data_beside(self) -> bool:
        """Whether other files hold a part of the geometry."""
        return any("uri" in buffer and not str(buffer["uri"]).startswith("data:") for buffer in self._buffers)

    def refuse(self, text: str) -> MeshError:
        """Return an error about this file, in one line whatever its names hold."""
        return MeshError(f"{self.where}: {''.join(sign if sign.isprintable() else '?' for sign in text)}")

    def _parse(self, blob: bytes) -> tuple[Mapping[str, Any], bytes | None]:
        """Return the description of a file, and the binary part of a GLB."""
        text, binary = blob, None
        if blob[:4] == _MAGIC:
            if len(blob) < 20:
                raise self.refuse("is cut short in its header; export it again")
            _, version, whole, length, kind = struct.unpack_from("<4sIIII", blob)
            if version != 2:
                raise self.refuse(f"is GLB of version {version}, which is not read; export it again as glTF 2.0")
            if kind != _JSON or length > len(blob) - 20 or whole > len(blob):
                raise self.refuse("is not a whole GLB: it is cut short or damaged; export it again")
            text, rest = blob[20 : 20 + length], 20 + length
            if len(blob) >= rest + 8:
                length, kind = struct.unpack_from("<II", blob, rest)
                binary = blob[rest + 8 : rest + 8 + length] if kind == _BIN else None
        if text.count(b",") > _MOST_COMMAS:
            raise self.refuse(f"its description has over {_MOST_COMMAS:,} entries; join its pieces and export it again")
        try:
            tree = json.loads(text)
        except (ValueError, RecursionError):
            raise self.refuse("its description is not readable as JSON; export it again") from None
        if not isinstance(tree, dict):
            raise self.refuse("its description is not glTF; export it again")
        return tree, binary

    def _check_version(self) -> None:
        """Raise `MeshError` unless the file is glTF of version 2."""
        asset = self.tree.get("asset")
        table = asset if isinstance(asset, dict) else {}
        version = str(table.get("version", "2.0"))[:20]
        if "version" not in table and isinstance(self.tree.get("meshes"), dict):
            version = "1.0"  # which lists by name what 2.0 numbers
        least = str(table.get("minVersion", "2.0"))[:20]
        wrong = version if version.partition(".")[0] != "2" else least
        if wrong != "2.0":
            raise self.refuse(f"is glTF of version {wrong}, which is not read; export it again as glTF 2.0")

    def list_of(self, table: Mapping[str, Any], key: str, of: type = dict) -> list[Any]:
        """Return a list of a glTF table, empty if it is absent; raise `MeshError` if the value is not such a list."""
        entries = table.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, of) for entry in entries):
            raise self.refuse(f"'{key}' is not a list as glTF defines it; export it again")
        return entries

    def table_of(self, table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
        """Return a table inside a glTF table, empty if it is absent."""
        inner_table = table.get(key, {})
        if not isinstance(inner_table, dict):
            raise self.refuse(f"'{key}' is not a table as glTF defines it; export it again")
        return inner_table

    def count_of(self, table: Mapping[str, Any], key: str, default: int | None = None) -> int:
        """Return a count or an index of a glTF table; raise `MeshError` if the value is not an integer from 0 up.

        Parameters
        ----------
        default : value if the key is absent; None for an error
        """
        count = table.get(key, default)
        if type(count) is not int or count < 0:
            raise self.refuse(f"'{key}' is {str(count)[:20]} and not a count; export it again")
        return count

    def numbers_of(self, table: Mapping[str, Any], key: str, length: int | None, default: list[float]) -> np.ndarray:
        """Return the finite numbers of a list of a glTF table.

        Parameters
        ----------
        length : how many there are; None for any
        default : values if the key is absent
        """
        numbers = table.get(key, default)
        try:
            values = np.array(numbers if isinstance(numbers, list) else None, dtype=float)
        except (TypeError, ValueError, OverflowError):
            values = np.array(np.nan)
        if values.ndim != 1 or (length is not None and len(values) != length) or not np.isfinite(values).all():
            raise self.refuse(f"'{key}' is {str(numbers)[:40]} and not numbers as glTF defines them; export it again")
        return values

    def entry(self, entries: list[Any], number: int, what: str) -> Any:
        """Return the entry of a list that another part of the file refers to.

        Parameters
        ----------
        number : index of the entry

        Raises
        ------
        MeshError
            If the list is too short.
        """
        if number >= len(entries):
            raise self.refuse(f"names {what} {number} of {len(entries)}; export it again")
        return entries[number]

    def count_values(self, number: int) -> int:
        """Return how many values an accessor has, after checking that its data hold them."""
        accessor = self.entry(self._accessors, number, "accessor")
        count = self.count_of(accessor, "count")
        size = _WIDTH.get(str(accessor.get("type")), 0) * self._kind(accessor).itemsize
        if not size:
            raise self.refuse("has geometry of a type that glTF does not have; export it again")
        if "bufferView" in accessor:
            self._locate(accessor, count, size)
            return count
        sparse = self.table_of(accessor, "sparse")
        if not sparse:
            used = [name for name in COMPRESSIONS if name in map(str, self.list_of(self.tree, "extensionsUsed", str))]
            if used:
                raise self.refuse(f"is compressed with {used[0]}, which is not read; export it without compression")
            raise self.refuse("has geometry without data; export it again")
        if count > sum(self.count_of(buffer, "byteLength") for buffer in self._buffers):
            raise self._too_few(count)  # all but a few values are zero, so no array of the file bounds their number
        return count

    def read(self, number: int, kind: str, what: str, rows: np.ndarray | None = None) -> np.ndarray:
        """Read the values of an accessor: (value, component), normalised integers as floats.

        Parameters
        ----------
        kind : glTF type that the accessor must have, such as "VEC3"; names separated by | where several do
        what : noun for the message where it has another
        rows : numbers of the values to return; None for all

        Raises
        ------
        MeshError
            If the data are of another type or not complete.
        """
        count = self.count_values(number)
        accessor = self._accessors[number]
        width, dtype = _WIDTH[str(accessor["type"])], self._kind(accessor)
        if accessor["type"] not in kind.split("|"):
            raise self.refuse(f"has {what}; export it again")
        if "bufferView" in accessor:
            values = self._array(accessor, count, width, dtype)
        else:
            if count > sum(len(self._buffer(k)) for k in range(len(self._buffers))):
                raise self._too_few(count)
            values = np.zeros((count, width), dtype=dtype)
        if sparse := self.table_of(accessor, "sparse"):
            changes = self.count_of(sparse, "count")
            indices = self.table_of(sparse, "indices")
            places = self._array(indices, changes, 1, self._kind(indices)).reshape(-1)
            if places.dtype.kind != "u" or (len(places) and places.max() >= count):
                raise self.refuse("has sparse data for values that it does not have; export it again")
            values = values.copy()
            values[places] = self._array(self.table_of(sparse, "values"), changes, width, dtype)
        if rows is not None:
            if len(rows) and rows.max() >= count:
                raise self.refuse(f"has {count:,} values for more vertices; export it again")
            values = values[rows]
        if accessor.get("normalized") is True and dtype.kind in "iu":
            # Signed ones are symmetric about zero, and the lowest counts as -1 (glTF 2.0, section 3.6.2.2).
            values = np.maximum(values.astype(float) / np.iinfo(dtype).max, -1.0)
        return values

    def _kind(self, table: Mapping[str, Any]) -> np.dtype:
        kind = _KIND.get(self.count_of(table, "componentType"))
        if kind is None:
            raise self.refuse("has geometry of a type that glTF does not have; export it again")
        return np.dtype(kind)

    def _too_few(self, count: int) -> MeshError:
        return self.refuse(f"states {count:,} values, more than its data hold; export it again")

    def _locate(self, table: Mapping[str, Any], count: int, size: int) -> tuple[int, int, int]:
        """Return buffer, first byte and step of values in a buffer view, after checking that it holds them.

        Parameters
        ----------
        table : what names the `bufferView`: an accessor, or a part of a sparse one
        count : number of values, 0 or more
        size : of a value [bytes]
        """
        view = self.entry(self._views, self.count_of(table, "bufferView"), "bufferView")
        number = self.count_of(view, "buffer")
        buffer = self.entry(self._buffers, number, "buffer")
        start, length = self.count_of(view, "byteOffset", 0), self.count_of(view, "byteLength")
        offset, step = self.count_of(table, "byteOffset", 0), self.count_of(view, "byteStride", size) or size
        needed = offset + max(count - 1, 0) * step + min(count, 1) * size
        if step < size or needed > length or start + length > self.count_of(buffer, "byteLength"):
            raise self._too_few(count)
        return number, start + offset, step

    def _array(self, table: Mapping[str, Any], count: int, width: int, dtype: np.dtype) -> np.ndarray:
        """Return the values (count, width) of a table that names a buffer view.

        Parameters
        ----------
        table : what names the `bufferView`
        count : number of values, 0 or more
        width : components of a value, 1 to 16
        dtype : `numpy` type of a component
        """
        number, start, step = self._locate(table, count, width * dtype.itemsize)
        if not count:
            return np.zeros((0, width), dtype=dtype)
        return np.ndarray((count, width), dtype, self._buffer(number), start, (step, dtype.itemsize))

    def _buffer(self, number: int) -> bytes:
        """Return the bytes of a buffer, read once."""
        if number in self._loaded:
            return self._loaded[number]
        buffer = self._buffers[number]
        for name in COMPRESSIONS:
            # A fallback buffer without a place holds nothing; with one, it holds the data without compression.
            if "uri" not in buffer and self.table_of(self.table_of(buffer, "extensions"), name).get("fallback"):
                raise self.refuse(f"is compressed with {name}, which is not read; export it without compression")
        uri, needed = buffer.get("uri"), self.count_of(buffer, "byteLength")
        if uri is None:
            data = (self._binary or b"") if number == 0 else b""
        elif isinstance(uri, str) and uri.startswith("data:"):
            head, _, text = uri.partition(",")
            try:
                data = base64.b64decode(text) if head.endswith(";base64") else unquote_to_bytes(text)
            except (binascii.Error, ValueError):
                raise self.refuse("has data that are not readable as base64; export it again") from None
        else:
            left = MOST_BYTES - sum(map(len, self._loaded.values()))
            data = read_bytes(self._find_beside(uri), left, MeshError, "data file of a glTF")
        if len(data) < needed:
            raise self.refuse(f"has {len(data):,} of the {needed:,} bytes that it states; export it again")
        self._loaded[number] = data
        return data

    def _find_beside(self, uri: Any) -> Path:
        """Return the path of a data file, or raise `MeshError` unless it is a plain file in the same folder."""
        cure = "export it as one .glb"
        try:
            folder = self._path.resolve().parent
            places = [(folder / name).resolve() for name in (str(uri), unquote(str(uri)))]
            inside = isinstance(uri, str) and ":" not in uri and all(folder in place.parents for place in places)
            plain = [place for place in places if inside and place.is_file()]
        except (OSError, ValueError):
            inside, plain = False, []
        if not inside:
            raise self.refuse(f"names data outside its folder ({str(uri)[:60]}), which is not fetched; {cure}")
        if not plain:
            raise self.refuse(f"its data file {str(uri)[:60]} is not there; put it beside, or {cure}")
        return plain[0]

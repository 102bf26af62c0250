"""Particle files: VTK PolyData with appended data, an XML head that names types and offsets, then the arrays.

The arrays follow as they stand in memory, or compressed with zlib in blocks, as VTK does it. ParaView and PyVista read both.
"""

from __future__ import annotations

import xml.etree.ElementTree as xml
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from warpsph.errors import OutputError
from warpsph.files.whole_files import whole_file
from warpsph.snapshot import FLUID, OPTIONAL_FIELDS, WALL, Snapshot

DEFAULT_FIELDS = ("velocity", "density", "pressure", "mass", "phase")
PARTICLE_FIELDS = ("velocity", "density", "pressure", "mass", "volume", "phase", *OPTIONAL_FIELDS)
ALWAYS_WRITTEN = ("particle_spacing", "particle_id")

_INTEGER_FIELDS = {"phase": "<i4", "particle_id": "<i8"}
_VTK_TYPES = {"<f4": "Float32", "<f8": "Float64", "<i4": "Int32", "<i8": "Int64"}
_NUMPY_TYPES = {name: dtype for dtype, name in _VTK_TYPES.items()}
_COMPRESSOR = "vtkZLibDataCompressor"
_BLOCK = 1 << 20  # bytes that are compressed at a time
_LEVEL = 1  # of zlib: higher ones take up to four times as long for 1 % of the size


@dataclass(frozen=True)
class _Array:
    """An array of the file; it is made when it is written, so that no second copy of the whole state is held."""

    name: str
    dtype: str
    components: int
    rows: int
    make: Callable[[], np.ndarray]

    @property
    def size(self) -> int:
        """Bytes in memory."""
        return self.rows * self.components * np.dtype(self.dtype).itemsize

    def data(self) -> memoryview:
        """Its bytes; raises ValueError unless they are as many as declared."""
        with np.errstate(over="ignore"):  # a runaway value becomes inf in float32
            array = np.ascontiguousarray(self.make())
        if array.nbytes != self.size:
            raise ValueError(f"{self.name}: has {array.nbytes} bytes instead of {self.size}")
        return array.data.cast("B") if self.size else memoryview(b"")

    def packed(self) -> bytes:
        """Compressed, with the sizes of the blocks before it."""
        data = self.data()
        blocks = [zlib.compress(data[start : start + _BLOCK], _LEVEL) for start in range(0, self.size, _BLOCK)]
        sizes = [len(blocks), _BLOCK, self.size % _BLOCK, *map(len, blocks)]
        return b"".join([np.array(sizes, "<u8").tobytes(), *blocks])

    def element(self, offset: int) -> str:
        """Its line in the head; `offset` is its place in the appended data."""
        tuples = ' NumberOfTuples="1"' if self.name == "TimeValue" else ""
        return (
            f'<DataArray type="{_VTK_TYPES[self.dtype]}" Name="{self.name}" NumberOfComponents="{self.components}"'
            f'{tuples} format="appended" offset="{offset}"/>'
        )


def write_vtp(
    path: Path,
    snapshot: Snapshot,
    fields: Sequence[str] = DEFAULT_FIELDS,
    precision: str = "float32",
    compress: bool = False,
) -> int:
    """Write particles as a binary VTK PolyData file with one vertex a particle; returns its size [bytes].

    `fields` are names of PARTICLE_FIELDS; those that this snapshot does not have are left out.
    `particle_spacing` and `particle_id` are always written. Vectors get three components, in 2-D with z =
    0. `precision` is the type of all real numbers, positions included; with `compress` the arrays are compressed
    without loss. Raises OutputError if the file cannot be written, ValueError for unknown names.
    """
    if precision not in ("float32", "float64"):
        raise ValueError(f"precision must be float32 or float64, not {precision!r}")
    fields = [name for name in dict.fromkeys(fields) if name not in ALWAYS_WRITTEN]
    unknown = [name for name in fields if name not in PARTICLE_FIELDS]
    if unknown:
        raise ValueError(f"unknown particle field {unknown[0]!r}; known are {', '.join(PARTICLE_FIELDS)}")
    names = [name for name in fields if getattr(snapshot, name) is not None]
    sections = _sections(snapshot, names, "<f4" if precision == "float32" else "<f8")
    arrays = [array for section in sections for array in section]
    packed = [array.packed() for array in arrays] if compress else None
    lengths = [len(block) for block in packed] if packed is not None else [8 + array.size for array in arrays]
    head = _head(sections, lengths, names, len(snapshot), compress)
    tail = b"\n</AppendedData>\n</VTKFile>\n"
    needed = len(head) + sum(lengths) + len(tail)
    with whole_file(path, needed=needed) as temporary, open(temporary, "wb") as file:
        file.write(head)
        if packed is not None:
            for block in packed:
                file.write(block)
        else:
            for array in arrays:
                file.write(array.size.to_bytes(8, "little"))
                file.write(array.data())
        file.write(tail)
    return needed


def _sections(snapshot: Snapshot, names: Sequence[str], real: str) -> tuple[list[_Array], ...]:
    """The arrays of FieldData, PointData, Points and Verts."""
    count = len(snapshot)
    point_data = []
    for name in names:
        values = np.asarray(getattr(snapshot, name))
        dtype = _INTEGER_FIELDS.get(name, real)
        if values.ndim == 2:
            point_data.append(_Array(name, dtype, 3, count, _make(three_components, values, dtype)))
        else:
            point_data.append(_Array(name, dtype, 1, count, _make(np.asarray, values, dtype)))
    spacing = _make(np.full, count, snapshot.particle_spacing, real)
    point_data.append(_Array("particle_spacing", real, 1, count, spacing))
    point_data.append(_Array("particle_id", "<i8", 1, count, _make(np.asarray, snapshot.particle_id, "<i8")))
    index = "<i4" if count < 2**31 - 1 else "<i8"
    return (
        [_Array("TimeValue", "<f8", 1, 1, _make(np.full, 1, snapshot.time, "<f8"))],
        point_data,
        [_Array("Points", real, 3, count, _make(three_components, snapshot.position, real))],
        [
            _Array("connectivity", index, 1, count, _make(np.arange, 0, count, 1, index)),
            _Array("offsets", index, 1, count, _make(np.arange, 1, count + 1, 1, index)),
        ],
    )


def _head(
    sections: tuple[list[_Array], ...], lengths: Sequence[int], names: Sequence[str], count: int, compress: bool
) -> bytes:
    """The XML before the appended data; `lengths` are the bytes of each array there."""
    offsets = iter(np.cumsum([0, *lengths]).tolist())
    field_data, point_data, points, verts = ([array.element(next(offsets)) for array in section] for section in sections)
    scalars = next((name for name in ("pressure", "density") if name in names), "particle_spacing")
    vectors = ' Vectors="velocity"' if "velocity" in names else ""
    compressor = f' compressor="{_COMPRESSOR}"' if compress else ""
    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64"{compressor}>',
        "<PolyData>",
        "<FieldData>",
        *field_data,
        "</FieldData>",
        f'<Piece NumberOfPoints="{count}" NumberOfVerts="{count}" NumberOfLines="0" NumberOfStrips="0"'
        ' NumberOfPolys="0">',
        f'<PointData Scalars="{scalars}"{vectors}>',
        *point_data,
        "</PointData>",
        "<Points>",
        *points,
        "</Points>",
        "<Verts>",
        *verts,
        "</Verts>",
        "</Piece>",
        "</PolyData>",
        '<AppendedData encoding="raw">',
        "_",
    ]
    return "\n".join(lines).encode()


def _make(function: Callable[..., np.ndarray], *arguments: object) -> Callable[[], np.ndarray]:
    return lambda: function(*arguments)


def three_components(values: np.ndarray, dtype: str) -> np.ndarray:
    """Vectors (n, d) as they are in the files, (n, 3)."""
    padded = np.zeros((len(values), 3), dtype)
    padded[:, : values.shape[1]] = values
    return padded


def read_vtp(path: Path, dimension: int = 3) -> Snapshot:
    """Read a particle file written by `write_vtp` (no other) without VTK.

    `dimension` cuts vectors to their first components. A field that the file lacks is filled with NaN,
    `phase` with -1; `volume` follows from mass and density if it was not written. Raises OutputError if the
    file cannot be read.
    """
    try:
        with open(path, "rb") as file:
            head, arrays_start = _read_head(file)
            root = xml.fromstring(head + b"\n</AppendedData></VTKFile>")
            piece = root.find("PolyData/Piece")
            compressor = root.get("compressor")
            if root.get("header_type") != "UInt64" or piece is None or compressor not in (None, _COMPRESSOR):
                raise ValueError("it was not written by warpsph")
            read = _read_raw if compressor is None else _read_packed
            count = int(piece.attrib["NumberOfPoints"])
            arrays: dict[str, np.ndarray] = {}
            for element in root.iter("DataArray"):
                file.seek(arrays_start + int(element.attrib["offset"]))
                array = np.frombuffer(read(file), _NUMPY_TYPES[element.attrib["type"]])
                if element.attrib["NumberOfComponents"] == "3":
                    array = array.reshape(-1, 3)[:, :dimension]
                arrays[element.attrib["Name"]] = array
            time, position, particle_id = arrays["TimeValue"][0], arrays["Points"], arrays["particle_id"]
            spacing = arrays["particle_spacing"]
    except (OSError, ValueError, KeyError, xml.ParseError, zlib.error) as error:
        raise OutputError(f"{path}: cannot be read as a particle file: {error}") from error

    def get(name: str, *shape: int) -> np.ndarray:
        return arrays[name] if name in arrays else np.full((count, *shape), np.nan)

    return Snapshot(
        time=float(time),
        step=0,
        dt=0.0,
        dimension=dimension,
        position=position.astype(np.float64),
        velocity=get("velocity", dimension),
        density=get("density"),
        pressure=get("pressure"),
        mass=get("mass"),
        volume=arrays["volume"] if "volume" in arrays else get("mass") / get("density"),
        phase=arrays.get("phase", np.full(count, -1, np.int32)),
        particle_id=particle_id,
        kind=np.full(count, WALL if path.name.startswith("wall") else FLUID, np.uint8),
        particle_spacing=float(spacing[0]) if count else 0.0,
        normal=arrays.get("normal"),
        curvature=arrays.get("curvature"),
        acceleration=arrays.get("acceleration"),
        vorticity=arrays.get("vorticity"),
        q_criterion=arrays.get("q_criterion"),
        ftle_backward=arrays.get("ftle_backward"),
        ftle_forward=arrays.get("ftle_forward"),
        ftle_age=arrays.get("ftle_age"),
        ftle_way=arrays.get("ftle_way"),
    )


def _exactly(file: IO[bytes], size: int) -> bytes:
    """The next `size` bytes; raises ValueError if there are fewer."""
    data = file.read(size)
    if len(data) != size:
        raise ValueError("it ends too early")
    return data


def _read_raw(file: IO[bytes]) -> bytes:
    """An array as `_Array.data` gave it."""
    return _exactly(file, int.from_bytes(_exactly(file, 8), "little"))


def _read_packed(file: IO[bytes]) -> bytes:
    """An array as `_Array.packed` gave it."""
    count, block, rest = np.frombuffer(_exactly(file, 24), "<u8").tolist()
    sizes = np.frombuffer(_exactly(file, 8 * count), "<u8").tolist()
    data = b"".join([zlib.decompress(_exactly(file, size)) for size in sizes])
    if len(data) != (count - 1) * block + (rest or block) if count else len(data) != 0:
        raise ValueError("it is not whole")
    return data


def _read_head(file: IO[bytes]) -> tuple[bytes, int]:
    """The XML before the binary part, and where the latter starts in the file."""
    head = b""
    mark = b'<AppendedData encoding="raw">\n_'
    while mark not in head:
        chunk = file.read(4096)
        if not chunk or len(head) > 1 << 20:
            raise ValueError("it has no appended data")
        head += chunk
    end = head.index(mark) + len(mark)
    return head[: end - 1], end

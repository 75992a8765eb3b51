"""PLY: elements of typed properties, as text or binary in either byte order."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from surfsup.sdf.mesh.readers.polygons import strip_triangles, triangulate
from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError
from surfsup.sdf.mesh.readers.text import decode, numbers

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
Columns = dict[str, "np.ndarray | Lists"]


@dataclass(frozen=True)
class Property:
    """A property of an element: its name, type, and for a list the type of its length."""

    name: str
    type: str
    length_type: str | None = None


@dataclass(frozen=True)
class Element:
    """A kind of record: name, number, properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class Lists:
    """The lists of one property: the length of each, and all values in order."""

    sizes: np.ndarray
    values: np.ndarray


def read_ply(content: bytes) -> RawMesh:
    """The polygons and triangle strips of a PLY file, as triangles.

    Raises:
        UnreadableMeshError: the file is damaged or cut off, or has no positions.
    """
    try:
        elements = read_elements(content)
        vertices = np.stack([scalars(elements.get("vertex", {}), name) for name in "xyz"], axis=1)
        faces = [np.empty((0, 3), np.int64)]
        if (polygons := first_list(elements.get("face", {}))) is not None:
            faces.append(triangulate(vertices, polygons.sizes, polygons.values.astype(np.int64)))
        if (strips := first_list(elements.get("tristrips", {}))) is not None:
            pieces = np.split(strips.values.astype(np.int64), np.cumsum(strips.sizes)[:-1])
            faces += [strip_triangles(piece) for piece in pieces]
    except (ValueError, KeyError, IndexError, OverflowError, MemoryError) as error:
        reason = " ".join(str(error).split())[:120]
        raise UnreadableMeshError(f"is damaged or not a PLY file ({reason}); export it again") from None
    return RawMesh(vertices, np.concatenate(faces))


def first_list(columns: Columns) -> Lists | None:
    """The list of indices among the properties of an element; its usual name comes first."""
    named = [columns[name] for name in ("vertex_indices", "vertex_index") if name in columns]
    lists = [column for column in [*named, *columns.values()] if isinstance(column, Lists)]
    return lists[0] if lists else None


def scalars(columns: Columns, name: str) -> np.ndarray:
    """A property that is no list, float64.

    Raises:
        ValueError: there is none.
    """
    column = columns.get(name)
    if not isinstance(column, np.ndarray):
        raise ValueError(f"its vertices have no property {name}")
    return column.astype(np.float64)


def read_elements(content: bytes) -> dict[str, Columns]:
    """The properties of every element by name.

    Raises:
        ValueError: the file does not hold what its header announces.
    """
    end = content.find(b"end_header")
    start = content.find(b"\n", end) + 1
    if end < 0:
        raise ValueError("its header has no end")
    # A header with carriage returns alone ends with one.
    if content[end + 10 : end + 11] == b"\r" and content[end + 11 : end + 12] != b"\n":
        start = end + 11
    order, elements = read_header(decode(content[:end]))
    if not order:
        return read_text(text_words(decode(content[start:]) if start else "", elements), elements)
    return read_binary(content, start, order, elements)


def read_header(text: str) -> tuple[str, list[Element]]:
    """Byte order (empty for text) and elements.

    Raises:
        ValueError: a line is not known.
    """
    order, elements = None, []
    for words in map(str.split, text.split("\n")):
        if words[:1] == ["format"] and len(words) > 1:
            order = ORDERS.get(words[1])
        elif words[:1] == ["element"] and len(words) == 3:
            elements.append(Element(words[1], int(words[2])))
        elif words[:2] == ["property", "list"] and len(words) == 5 and elements:
            elements[-1].properties.append(Property(words[4], TYPES[words[3]], TYPES[words[2]]))
        elif words[:1] == ["property"] and len(words) == 3 and elements:
            elements[-1].properties.append(Property(words[2], TYPES[words[1]]))
    if order is None:
        raise ValueError("its header names no known format")
    if any(element.count < 0 for element in elements):
        raise ValueError("it announces a negative number of elements")
    return order, elements


def text_words(text: str, elements: list[Element]) -> list[str]:
    """The words of a text file; where every record has a line, without those beyond its properties.

    Some programs write more colors into a face than their header declares.
    """
    rows = [row for row in map(str.split, text.split("\n")) if row]
    if len(rows) != sum(element.count for element in elements):
        return [word for row in rows for word in row]
    words, at = [], 0
    for element in elements:
        for row in rows[at : at + element.count]:
            end = 0
            for one in element.properties:
                end += 1 + int(row[end]) if one.length_type and end < len(row) else 1
            if end > len(row):  # a record is not a line after all
                return text.split()
            words += row[:end]
        at += element.count
    return words


def read_text(words: list[str], elements: list[Element]) -> dict[str, Columns]:
    """The elements of a text file, from its words.

    Raises:
        ValueError: there are too few words, or one is not a number.
    """
    found: dict[str, Columns] = {}
    at = 0
    for element in elements:
        width = len(element.properties)
        if element.count * width > len(words) - at:
            raise ValueError(f"it ends within its {element.count} elements '{element.name}'")
        if not any(one.length_type for one in element.properties):
            block = numbers(words[at : at + element.count * width]).reshape(element.count, width)
            found[element.name] = {one.name: block[:, k] for k, one in enumerate(element.properties)}
            at += element.count * width
            continue
        values: list[list[str]] = [[] for _ in element.properties]
        sizes: list[list[int]] = [[] for _ in element.properties]
        for _ in range(element.count):
            for k, one in enumerate(element.properties):
                size = int(words[at]) if one.length_type else 1
                at += one.length_type is not None
                if size < 0 or at + size > len(words):
                    raise ValueError(f"it ends within its {element.count} elements '{element.name}'")
                values[k] += words[at : at + size]
                sizes[k].append(size)
                at += size
        found[element.name] = {
            one.name: Lists(np.array(sizes[k], np.int64), numbers(values[k])) if one.length_type else numbers(values[k])
            for k, one in enumerate(element.properties)
        }
    return found


def read_binary(content: bytes, at: int, order: str, elements: list[Element]) -> dict[str, Columns]:
    """The elements of a binary file that begin at byte ``at``.

    Raises:
        ValueError: the file is too short.
    """
    found = {}
    for element in elements:
        if not element.properties:
            continue
        columns, at = read_records(content, at, order, element)
        found[element.name] = columns
    return found


def read_records(content: bytes, at: int, order: str, element: Element) -> tuple[Columns, int]:
    """The properties of one element, and the byte after it.

    Raises:
        ValueError: the file is too short.
    """
    lengths = first_lengths(content, at, order, element)
    record = record_type(order, element, lengths)
    if element.count * record.itemsize <= len(content) - at:
        records = np.frombuffer(content, record, element.count, at)
        listed = [k for k, one in enumerate(element.properties) if one.length_type]
        if all((records[f"n{k}"] == lengths[k]).all() for k in listed):
            columns: Columns = {}
            for k, one in enumerate(element.properties):
                sizes = np.full(element.count, lengths[k], np.int64)
                columns[one.name] = Lists(sizes, records[f"p{k}"].ravel()) if k in listed else records[f"p{k}"]
            return columns, at + element.count * record.itemsize
    elif not any(one.length_type for one in element.properties):
        raise ValueError(f"it ends within its {element.count} elements '{element.name}'")
    return read_varying_records(content, at, order, element)


def first_lengths(content: bytes, at: int, order: str, element: Element) -> list[int]:
    """The length of each list in the first record; 0 for properties that are no lists."""
    lengths = []
    for one in element.properties:
        size = 1
        if one.length_type:
            kind = np.dtype(order + one.length_type)
            whole = at + kind.itemsize <= len(content) and element.count > 0
            size = int(np.frombuffer(content, kind, 1, at)[0]) if whole else 0
            size = min(max(size, 0), len(content))
            at += kind.itemsize
        lengths.append(size if one.length_type else 0)
        at += size * np.dtype(one.type).itemsize
    return lengths


def record_type(order: str, element: Element, lengths: list[int]) -> np.dtype:
    """The type of a record whose lists have ``lengths``: values in p0, p1, ..., lengths in n0, n1, ..."""
    fields: list[tuple] = []
    for k, (one, length) in enumerate(zip(element.properties, lengths, strict=True)):
        if one.length_type:
            fields += [(f"n{k}", order + one.length_type), (f"p{k}", order + one.type, (length,))]
        else:
            fields.append((f"p{k}", order + one.type))
    return np.dtype(fields)


def read_varying_records(content: bytes, at: int, order: str, element: Element) -> tuple[Columns, int]:
    """The same where lists differ in length, one record after the other.

    Raises:
        ValueError: the file is too short.
    """
    kinds = [
        (np.dtype(order + one.length_type) if one.length_type else None, np.dtype(order + one.type))
        for one in element.properties
    ]
    sizes: list[list[int]] = [[] for _ in kinds]
    values: list[list[bytes]] = [[] for _ in kinds]
    byte_order: Literal["little", "big"] = "little" if order == "<" else "big"
    for _ in range(element.count):
        for k, (length_kind, kind) in enumerate(kinds):
            size = 1
            if length_kind is not None:
                width = length_kind.itemsize
                size = int.from_bytes(content[at : at + width], byte_order, signed=length_kind.kind == "i")
                at += width
            after = at + size * kind.itemsize
            if size < 0 or after > len(content):
                raise ValueError(f"it ends within its {element.count} elements '{element.name}'")
            sizes[k].append(size)
            values[k].append(content[at:after])
            at = after
    columns: Columns = {}
    for k, (one, (length_kind, kind)) in enumerate(zip(element.properties, kinds, strict=True)):
        joined = np.frombuffer(b"".join(values[k]), kind)
        columns[one.name] = joined if length_kind is None else Lists(np.array(sizes[k], np.int64), joined)
    return columns, at

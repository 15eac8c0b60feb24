"""What files hold, by how they start: the formats that are read, and what lies about under their names."""

from __future__ import annotations

import codecs
import json
import re

SUFFIXES = (".off", ".obj", ".stl", ".ply", ".glb", ".gltf")
BOMS = (  # byte-order marks; that of UTF-16 is the start of one of UTF-32
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
STARTS = (  # what a file is that starts so, and what to do about it
    (rb"version https://git-lfs", "a Git LFS pointer, not the file that it points to; `git lfs pull` fetches that"),
    (rb"\s*(<!--.*?-->\s*)*<(!doctype\s+)?html", "an HTML page, not the file that it may be about; download that"),
    (rb"\x1f\x8b", "gzip data; unpack it"),
    (rb"PK(\x03\x04|\x05\x06)", "a zip archive; unpack it"),
    (rb"BZh\d", "bzip2 data; unpack it"),
    (rb"\xfd7zXZ\0", "xz data; unpack it"),
    (rb"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it"),
    (rb"Rar!", "a rar archive; unpack it"),
    (rb"\x28\xb5\x2f\xfd", "zstandard data; unpack it"),
    (rb"%PDF", "a PDF document"),
    (rb"\x89PNG|\xff\xd8\xff|GIF8", "a picture"),
    (rb"\s*ply\s*\n", "a PLY file; name it .ply"),
    (rb"glTF", "a GLB file; name it .glb"),
    (rb"(ST)?C?N?OFF\s", "an OFF file; name it .off"),
    (rb"solid\b.*?\bfacet\b", "an STL file; name it .stl"),
    (rb"Kaydara FBX", "an FBX file"),
    (rb"BLENDER", "a Blender file"),
    (rb"ISO-10303-21", "a STEP file"),
    (rb"\s*(<\?xml|<)", "an XML file"),
)
PATTERNS = tuple((re.compile(start, re.IGNORECASE | re.DOTALL), told) for start, told in STARTS)


def plain(data: bytes) -> bytes:
    """The bytes of a text file without a byte-order mark, in UTF-8; others as they are."""
    for mark, encoding in BOMS:
        if data.startswith(mark):
            return data.removeprefix(mark) if encoding == "utf-8" else data.decode(encoding, "replace").encode()
    return data


def known(data: bytes, suffix: str) -> str:
    """What the bytes of a file are that hold no mesh of the format of its suffix; "" where that is not known."""
    start = data[:1000]
    for pattern, told in PATTERNS:
        if pattern.match(start):
            return "" if f" {suffix[1:].upper()} file" in told else told
    if not re.match(rb"\s*[{[]", start):
        return ""
    try:
        is_gltf = "asset" in json.loads(data)
    except (ValueError, TypeError):
        is_gltf = suffix == ".gltf"  # a damaged one
    if is_gltf:
        return "" if suffix == ".gltf" else "a glTF file; name it .gltf"
    return f"JSON, as a server answers: {start[:60].decode('utf-8', 'replace')}"

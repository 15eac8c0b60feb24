"""The numbers in a depth image, as .png .tiff or .npy: whoever wrote it, it is checked before it is believed."""

from __future__ import annotations

import re
from typing import BinaryIO

import numpy as np
from PIL import Image, UnidentifiedImageError

from graspfn.commands.ending import InputError

FORMATS = {".png": ["PNG"], ".tif": ["TIFF"], ".tiff": ["TIFF"]}
MOST_PIXELS = 1 << 23  # cameras have up to 5 million; a few bytes of a PNG can claim a thousand times as many
HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_pixels(stream: BinaryIO, suffix: str, name: str) -> np.ndarray:
    """(height, width) of whole or floating-point numbers; suffix: a key of FORMATS, or .npy. InputError names it."""
    try:
        return _array(stream, name) if suffix == ".npy" else _picture(stream, suffix, name)
    except InputError:
        raise
    except UnidentifiedImageError:  # whose message shows where the stream lies in memory
        raise InputError(f"{name}: cannot be read as {suffix}: it is none") from None
    except Exception as error:  # what reads foreign bytes raises what it likes: struct.error, SyntaxError, MemoryError
        why = re.sub(r" at 0x\w+", "", " ".join(str(error).split())) or type(error).__name__
        raise InputError(f"{name}: cannot be read as {suffix}: {why}") from None


def _array(stream: BinaryIO, name: str) -> np.ndarray:
    """As numpy.load, which believes a header: whatever size it claims is allocated first."""
    version = np.lib.format.read_magic(stream)
    if version not in HEADERS:
        raise ValueError(f"format {version[0]}.{version[1]}; it takes {' or '.join(f'{a}.{b}' for a, b in HEADERS)}")
    shape, fortran, dtype = HEADERS[version](stream)
    _check(shape, dtype, name)
    height, width = shape
    data = stream.read(height * width * dtype.itemsize)
    if len(data) < height * width * dtype.itemsize:
        raise ValueError(f"it ends after {len(data)} of {height * width * dtype.itemsize} bytes")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")


def _picture(stream: BinaryIO, suffix: str, name: str) -> np.ndarray:
    with Image.open(stream, formats=FORMATS[suffix]) as image:
        _check_size(image.height, image.width, name)
        pixels = np.asarray(image)
    _check(pixels.shape, pixels.dtype, name)
    return pixels


def _check(shape: tuple[int, ...], dtype: np.dtype, name: str) -> None:
    if len(shape) != 2 or min(shape) < 1:
        raise InputError(f"{name}: has the shape {shape}; it takes one depth per pixel, (height, width)")
    _check_size(*shape, name)
    if dtype.kind not in "fiu" or dtype.itemsize == 1:
        raise InputError(f"{name}: is of {dtype}; it takes depths of 16 bits or floating-point numbers")


def _check_size(height: int, width: int, name: str) -> None:
    if height * width > MOST_PIXELS:
        raise InputError(f"{name}: has {width} x {height} pixels; it takes up to {MOST_PIXELS}")

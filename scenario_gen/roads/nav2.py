# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of nav2's map_server: a YAML file and an image."""

from collections.abc import Iterator
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any
import warnings

import numpy as np
from PIL import Image

from scenario_gen.base.documents import read_yaml, shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.numerics import Bools, Floats
from scenario_gen.roads.config import RoadConfig
from scenario_gen.types import MAX_CELL_M, MAX_ORIGIN_M, MIN_CELL_M, Road

_MODES = ("trinary", "scale", "raw")
_PILLOW_FORMATS = ("PPM", "PNG", "BMP", "JPEG")  # PPM stands for PGM, PBM and PPM
_CHUNK_PX = 1 << 20  # converted at a time, so that a large map needs little more than its cells


@dataclass(frozen=True)
class _Image:
    """The image of a map and how its pixels are read, as in nav2's map_io."""

    path: Path
    mode: str
    negate: bool
    free_threshold: float


def read_map(path: Path, config: RoadConfig) -> Road:
    """Read the YAML file of a map and its image; free cells are drivable.

    Occupied and unknown cells are not drivable.

    Source: map_io of nav2_map_server, with its modes and thresholds.

    Raises:
        InputError: a file is missing, broken or too large, a key is missing or has a value that
            cannot be used, or the image lies outside the folder of the YAML file.
    """
    content = read_yaml(path, f"map {path}")
    if not isinstance(content, dict):
        raise InputError(
            f"map {path}: expected keys image, resolution, origin, negate, occupied_thresh, "
            "free_thresh"
        )
    resolution = float(np.float32(_number(path, content, "resolution", MIN_CELL_M, MAX_CELL_M)))
    origin = _origin(path, content)
    mode = content.get("mode", "trinary")
    if mode not in _MODES:
        modes = ", ".join(_MODES)
        raise InputError(f"map {path}: key mode is {shown(mode)!r}; choose one of {modes}")
    negate = content.get("negate", 0)
    if negate not in (0, 1):  # True and False, too
        raise InputError(f"map {path}: key negate is {shown(negate)}; it must be 0 or 1")
    occupied = _number(path, content, "occupied_thresh", 0.0, 1.0, default=0.65)
    free = _number(path, content, "free_thresh", 0.0, 1.0, default=0.25)
    if free >= occupied:
        raise InputError(
            f"map {path}: key free_thresh ({free}) must be below occupied_thresh ({occupied})"
        )
    file = _image_file(path, content.get("image"), config)
    drivable = _free_cells(path, _Image(file, mode, bool(negate), free), config.max_cells)
    if not drivable.any():
        raise InputError(
            f"map {path}: no cell of {file.name} is free with free_thresh {free} and negate "
            f"{negate}"
        )
    return Road(path.stem, drivable, resolution, origin)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _number(
    path: Path,
    content: dict[Any, Any],
    key: str,
    low: float,
    high: float,
    default: float | None = None,
) -> float:
    value: Any = content.get(key, default)
    if not _is_number(value):
        raise InputError(f"map {path}: key {key} is {shown(value)}; a number is needed")
    if not low <= value <= high:
        raise InputError(
            f"map {path}: key {key} is {value}; it must be at least {low:g}, at most {high:g}"
        )
    return float(value)


def _origin(path: Path, content: dict[Any, Any]) -> Floats:
    value = content.get("origin")
    where = f"map {path}: key origin"
    if not (isinstance(value, list) and len(value) in (2, 3) and all(map(_is_number, value))):
        raise InputError(f"{where} is {shown(value)}; a list of x, y and yaw is needed")
    if max(abs(v) for v in value) > MAX_ORIGIN_M:
        raise InputError(
            f"{where} is {shown(value)}; at most {MAX_ORIGIN_M:g} m from the frame's origin "
            "are read"
        )
    if len(value) == 3 and value[2] != 0.0:
        raise InputError(
            f"{where} has yaw {value[2]}; rotated maps are not supported, export it with yaw 0"
        )
    return np.array(value[:2], dtype=np.float64)


def _image_file(path: Path, name: Any, config: RoadConfig) -> Path:
    """Return the image that the key `image` names.

    Raises:
        InputError: the key is not a file name, there is no such file, or it lies outside the
            folder of the YAML file and this is not allowed.
    """
    if not isinstance(name, str) or not name.strip() or "\0" in name:
        raise InputError(f"map {path}: key image is missing or not a file name")
    image = path.parent / name
    where = f"map {path}: key image is {shown(name)!r}"
    with guarded(where, OSError, RuntimeError):  # a name that is too long, or circular links
        real = image.resolve()
        folders = (path.parent.resolve(), path.resolve().parent)
        is_inside = any(real.is_relative_to(folder) for folder in folders)
        is_file = real.is_file()
    leaves_folder = Path(name).is_absolute() or ".." in Path(name).parts
    if (leaves_folder or not is_inside) and not config.image_outside_folder:
        raise InputError(
            f"{where}, outside the folder of the map; move it there, or set "
            "road.image_outside_folder=true"
        )
    if not is_file:
        raise InputError(f"{where}, which does not exist or is not a file")
    return image


def _free_cells(path: Path, image: _Image, max_cells: int) -> Bools:
    """Return (H, W) the free cells; row 0 is the lowest y.

    Raises:
        InputError: the image cannot be read, has another format, or has more than `max_cells`
            pixels.
    """
    where = f"map {path}: image {image.path.name} cannot be read"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # from Pillow, on large or odd images
        with guarded(where, remedy="give PGM, PPM, PBM, PNG, BMP or JPEG"):
            opened = Image.open(image.path, formats=_PILLOW_FORMATS)
        with opened:
            width, height = opened.size
            if width * height > max_cells:
                raise InputError(
                    f"map {path}: image {image.path.name} has {width} x {height} pixels, more "
                    f"than road.max_cells ({max_cells}); crop it or make it coarser, or set "
                    "road.max_cells"
                )
            with guarded(where):
                opened.load()
                rows = np.concatenate([_is_free(chunk, image) for chunk in _chunks(opened)])
    return np.ascontiguousarray(rows[::-1])


def _chunks(opened: Image.Image) -> Iterator[Floats]:
    """Yield the pixels (H, W, 3 or 4), 0 to 255, of some rows of an image at a time."""
    width, height = opened.size
    transparent = "A" in opened.getbands() or "transparency" in opened.info
    rows = max(1, _CHUNK_PX // width)
    for top in range(0, height, rows):
        part = opened.crop((0, top, width, min(top + rows, height)))
        yield np.asarray(part.convert("RGBA" if transparent else "RGB"), dtype=np.float64)


def _is_free(pixels: Floats, image: _Image) -> Bools:
    """Return (H, W) the free cells of pixels (H, W, 3 or 4), 0 to 255."""
    transparent = pixels.shape[-1] == 4
    colour = pixels[..., :3].mean(axis=-1)
    if image.mode == "raw":
        value = 255.0 - colour if image.negate else colour
        return np.asarray((value <= 100.0) & (value < 100.0 * image.free_threshold))
    if transparent and image.mode == "trinary":  # map_server averages alpha, too
        colour = pixels.mean(axis=-1)
    occupancy = colour / 255.0 if image.negate else 1.0 - colour / 255.0
    free = occupancy < image.free_threshold
    if transparent and image.mode == "scale":
        free &= pixels[..., 3] > 0.0
    return np.asarray(free)

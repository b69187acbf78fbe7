# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of nav2's map_server: a YAML file and an image."""

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
from scenario_gen.roads.openings import find_openings
from scenario_gen.types import COARSEST, FARTHEST, FINEST, Road

_MODES = ("trinary", "scale", "raw")
_FORMATS = ("PPM", "PNG", "BMP", "JPEG")  # by Pillow's names; PPM is PGM, PBM and PPM
_FORMAT_NAMES = "PGM, PPM, PBM, PNG, BMP or JPEG"
_BLOCK = (
    1 << 20
)  # pixels worked on at a time, so that a large map takes little more memory than its cells


def read_map(path: Path, config: RoadConfig) -> Road:
    """Read a map_server YAML and its image; what is free there is drivable, what is occupied or unknown is not.

    Source: map_io of nav2_map_server, whose modes and thresholds these are.

    Raises:
        InputError: a file is missing, broken or too large, a key is missing or has a value that cannot be used, or the image
            lies outside the folder of the YAML file.
    """
    content = read_yaml(path, f"map {path}")
    if not isinstance(content, dict):
        raise InputError(
            f"map {path}: expected keys image, resolution, origin, negate, occupied_thresh, free_thresh"
        )
    resolution = _number(path, content, "resolution", FINEST, COARSEST)
    origin = _origin(path, content)
    mode = content.get("mode", "trinary")
    if mode not in _MODES:
        raise InputError(
            f"map {path}: key mode is {shown(mode)!r}; choose one of {', '.join(_MODES)}"
        )
    negate = content.get("negate", 0)
    if negate not in (0, 1):  # True and False too
        raise InputError(f"map {path}: key negate is {shown(negate)}; it must be 0 or 1")
    occupied = _number(path, content, "occupied_thresh", 0.0, 1.0, default=0.65)
    free = _number(path, content, "free_thresh", 0.0, 1.0, default=0.25)
    if free >= occupied:
        raise InputError(
            f"map {path}: key free_thresh ({free}) must be below occupied_thresh ({occupied})"
        )
    image = _image_file(path, content.get("image"), config)
    drivable = _free_cells(path, image, mode, bool(negate), free, config.max_cells)
    if not drivable.any():
        raise InputError(
            f"map {path}: no cell of {image.name} is free with free_thresh {free} and negate {negate}"
        )
    resolution = float(np.float32(resolution))
    entries, exits = find_openings(drivable, resolution, origin, config)
    return Road(path.stem, drivable, resolution, origin, entries, exits)


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
    if not (isinstance(value, list) and len(value) in (2, 3) and all(map(_is_number, value))):
        raise InputError(
            f"map {path}: key origin is {shown(value)}; a list of x, y and yaw is needed"
        )
    if max(abs(v) for v in value) > FARTHEST:
        raise InputError(
            f"map {path}: key origin is {shown(value)}; at most {FARTHEST:g} m from the frame's origin are read"
        )
    if len(value) == 3 and value[2] != 0.0:
        raise InputError(
            f"map {path}: key origin has yaw {value[2]}; rotated maps are not supported, export it with yaw 0"
        )
    return np.array(value[:2], dtype=np.float64)


def _image_file(path: Path, name: Any, config: RoadConfig) -> Path:
    """Return the image that the key `image` names.

    Raises:
        InputError: the key is no file name, there is no such file, or it lies outside the YAML's folder without being allowed to.
    """
    if not isinstance(name, str) or not name.strip() or "\0" in name:
        raise InputError(f"map {path}: key image is missing or not a file name")
    image = path.parent / name
    where = f"map {path}: key image is {shown(name)!r}"
    with guarded(where, OSError, RuntimeError):  # a name that is too long; links in a circle
        real = image.resolve()
        inside = any(
            real.is_relative_to(folder.resolve())
            for folder in (path.parent, path.resolve().parent)
        )
        is_file = real.is_file()
    lexical = Path(name).is_absolute() or ".." in Path(name).parts
    if (lexical or not inside) and not config.image_outside_folder:
        raise InputError(
            f"{where}, outside the folder of the map; put it there, or set road.image_outside_folder=true"
        )
    if not is_file:
        raise InputError(f"{where}, which is not there or no file")
    return image


def _free_cells(
    path: Path, image_path: Path, mode: str, negate: bool, free: float, max_cells: int
) -> Bools:
    """(H, W) free cells, row 0 the lowest y; as map_server's map_io reads them.

    Raises:
        InputError: the image cannot be read, is of another format, or has more pixels than `max_cells`.
    """
    where = f"map {path}: image {image_path.name} cannot be read"
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # Pillow's, of large or odd images: what is too large is refused here
        with guarded(where, remedy=f"give {_FORMAT_NAMES}"):
            opened = Image.open(image_path, formats=_FORMATS)
        with opened as image:
            width, height = image.size
            if width * height > max_cells:
                raise InputError(
                    f"map {path}: image {image_path.name} has {width} x {height} pixels, more than road.max_cells ({max_cells}); "
                    "crop it or make it coarser, or set road.max_cells"
                )
            with guarded(where):
                image.load()
            bands = image.getbands()
            transparent = "A" in bands or "transparency" in image.info
            rows = max(1, _BLOCK // width)
            blocks = []
            for top in range(0, height, rows):
                with guarded(where):
                    block = image.crop((0, top, width, min(top + rows, height))).convert(
                        "RGBA" if transparent else "RGB"
                    )
                    pixels = np.asarray(block, dtype=np.float64)
                blocks.append(_free(pixels, mode, negate, free, transparent=transparent))
    return np.ascontiguousarray(np.concatenate(blocks)[::-1])


def _free(pixels: Floats, mode: str, negate: bool, free: float, *, transparent: bool) -> Bools:
    """(H, W) free cells of pixels (H, W, 3 or 4), 0 to 255."""
    colour = pixels[..., :3].mean(axis=-1)
    if mode == "raw":
        value = 255.0 - colour if negate else colour
        return np.asarray((value <= 100.0) & (value < 100.0 * free))
    if transparent and mode == "trinary":  # map_server averages alpha in
        colour = pixels.mean(axis=-1)
    occupancy = colour / 255.0 if negate else 1.0 - colour / 255.0
    cells = occupancy < free
    if transparent and mode == "scale":
        cells &= pixels[..., 3] > 0.0
    return np.asarray(cells)

# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Maps of nav2's map_server: a YAML file and an image."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError
import yaml

from scenario_gen.arrays import Bools, Floats
from scenario_gen.errors import InputError
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.openings import find_openings
from scenario_gen.roads.road import Road

_MODES = ("trinary", "scale", "raw")


def read_map(path: Path, config: RoadConfig) -> Road:
    """Read a map_server YAML and its image; what is free there is drivable, what is occupied or unknown is not.

    Raises:
        InputError: a file is missing or broken, or a key is missing or has a value that cannot be used.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"map {path}: cannot be read ({error.strerror or error})") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"map {path}: not a YAML file ({str(error).splitlines()[0]})") from error
    if not isinstance(content, dict):
        raise InputError(f"map {path}: expected keys image, resolution, origin, negate, occupied_thresh, free_thresh")
    resolution = _number(path, content, "resolution", low=1e-6)
    origin = _origin(path, content)
    mode = content.get("mode", "trinary")
    if mode not in _MODES:
        raise InputError(f"map {path}: key mode is {mode!r}; choose one of {', '.join(_MODES)}")
    negate = content.get("negate", 0)
    if negate not in (0, 1):  # True and False too
        raise InputError(f"map {path}: key negate is {negate!r}; it must be 0 or 1")
    occupied = _number(path, content, "occupied_thresh", low=0.0, high=1.0, default=0.65)
    free = _number(path, content, "free_thresh", low=0.0, high=1.0, default=0.25)
    if free >= occupied:
        raise InputError(f"map {path}: key free_thresh ({free}) must be below occupied_thresh ({occupied})")
    image_name = content.get("image")
    if not isinstance(image_name, str):
        raise InputError(f"map {path}: key image is missing or not a file name")
    drivable = _free_cells(path, path.parent / image_name, mode, bool(negate), free)
    if not drivable.any():
        raise InputError(f"map {path}: no cell of {image_name} is free with free_thresh {free} and negate {negate}")
    resolution = float(np.float32(resolution))
    entries, exits = find_openings(drivable, resolution, origin, config)
    return Road(
        name=path.stem, drivable=drivable, resolution=resolution, origin=origin, entries=entries, exits=exits, frame_id="map"
    )


def _number(
    path: Path, content: dict[Any, Any], key: str, *, low: float, high: float = math.inf, default: float | None = None
) -> float:
    value = content.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"map {path}: key {key} is {value!r}; a number is needed")
    if not low <= value <= high:
        raise InputError(
            f"map {path}: key {key} is {value}; it must be at least {low:g}" + (f", at most {high:g}" if high < math.inf else "")
        )
    return float(value)


def _origin(path: Path, content: dict[Any, Any]) -> Floats:
    value = content.get("origin")
    numbers = isinstance(value, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    if not isinstance(value, list) or len(value) not in (2, 3) or not numbers or not all(math.isfinite(v) for v in value):
        raise InputError(f"map {path}: key origin is {value!r}; a list of x, y and yaw is needed")
    if len(value) == 3 and value[2] != 0.0:
        raise InputError(f"map {path}: key origin has yaw {value[2]}; rotated maps are not supported, export it with yaw 0")
    return np.array(value[:2], dtype=np.float64)


def _free_cells(path: Path, image_path: Path, mode: str, negate: bool, free: float) -> Bools:
    """(H, W) free cells, row 0 the lowest y; as map_server's map_io reads them."""
    try:
        with Image.open(image_path) as image:
            bands = image.getbands()
            transparent = "A" in bands or "transparency" in image.info
            pixels = np.asarray(image.convert("RGBA" if transparent else "RGB"), dtype=np.float64)
    except FileNotFoundError as error:
        raise InputError(f"map {path}: key image names {image_path.name}, which is not there") from error
    except (UnidentifiedImageError, OSError, ValueError) as error:
        raise InputError(f"map {path}: image {image_path.name} cannot be read ({error})") from error
    colour = pixels[..., :3].mean(axis=-1)
    if mode == "raw":
        value = 255.0 - colour if negate else colour
        cells = (value <= 100.0) & (value < 100.0 * free)
    else:
        if transparent and mode == "trinary":  # map_server averages alpha in
            colour = pixels.mean(axis=-1)
        occupancy = colour / 255.0 if negate else 1.0 - colour / 255.0
        cells = occupancy < free
        if transparent and mode == "scale":
            cells &= pixels[..., 3] > 0.0
    return np.ascontiguousarray(cells[::-1])

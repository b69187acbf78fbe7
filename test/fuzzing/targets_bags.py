# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The readers of bags, maps, parameters and JSON as targets."""

from collections.abc import Callable, Sequence
from functools import partial
import io
import json
from pathlib import Path
import random

from fuzzing.broken import small
from fuzzing.harness import Target
from fuzzing.mutators import BYTES, TEXT
from fuzzing.targets_logs import bags
import numpy as np
from PIL import Image
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_typestore, Stores
from support.bag_examples import bag_topics, hand_made_run

from msg_conventions.topics import topic_entry
from scenario_gen.bags.recordings.read import load, read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.base.parameters import loaded
from scenario_gen.closed_loop.comparison import read_drives, refuse_others
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road

CONFIG = PipelineConfig(evaluation=EvaluationConfig(resamples=10))
PARTED = b"\n# ---- image ----\n"  # a map as one input: its TEXT, this, and its image


def runs(folder: Path) -> list[bytes]:
    """Bags of the conventions, with chunks and without compression."""
    found = []
    for k, options in enumerate(({}, {"compress": False, "chunk_bytes": 3000})):
        whole = write_recording(folder / "whole", hand_made_run())
        with BagWriter(folder / f"bag{k}", **options) as bag:
            for message in read_messages(whole):
                bag.add_topic(message.topic, message.type, topic_entry(message.topic)[1])
                bag.write(message.topic, message.data, message.stamp_ns)
        found.append((folder / f"bag{k}" / f"bag{k}_0.mcap").read_bytes())
    return found


def ros1(folder: Path) -> list[bytes]:
    """Bags of ROS 1, with and without compression."""
    types = get_typestore(Stores.ROS1_NOETIC)
    for compression in (None, *Writer.CompressionFormat):
        writer = Writer(folder / f"{compression}.bag")
        if compression:
            writer.set_compression(compression)
        with writer:
            text = writer.add_connection("/a", "std_msgs/msg/String", typestore=types)
            head = writer.add_connection("/b", "std_msgs/msg/Header", typestore=types)
            for k in range(40):
                writer.write(text, k, b"\x01\x00\x00\x00a")
                writer.write(head, k, bytes(16))
    return [path.read_bytes() for path in sorted(folder.glob("*.bag"))]


def in_file(name: str, read: Callable[[Path], object]) -> Callable[[bytes, Path], None]:
    """Return a target's `run` that reads the input as a file of this name."""

    def run(data: bytes, folder: Path) -> None:
        (folder / name).write_bytes(data)
        read(folder / name)

    return run


def read_bag(path: Path) -> None:
    """Read all that a bag has."""
    for each in (
        lambda: bag_topics(path),
        lambda: list(read_messages(path)),
        lambda: read_recording(path).provenance,
    ):
        with_errors(each)
    load(path)


def with_errors(call: Callable[[], object]) -> None:
    """Call; an error of ours is not the end."""
    try:
        call()
    except ScenarioGenError as error:
        assert 0 < len(str(error)) <= 500


def measure(path: Path) -> None:
    """Evaluate a bag, down to the text."""
    for each in evaluate_bag(path, CONFIG):
        if each.result is not None:
            each.result.evaluation.to_markdown()
            each.result.evaluation.to_json()


def metadata(folder: Path) -> list[bytes]:
    """metadata.yaml of a bag."""
    return [(write_recording(folder / "bag", hand_made_run()) / "metadata.yaml").read_bytes()]


def read_folder(path: Path) -> None:
    """Read a bag whose metadata.yaml is the input."""
    for name in ("bag_0.mcap", "synthetic_b.mcap", "streams_b_0.mcap"):
        (path.parent / name).write_bytes(small(compress=True))
    list(read_messages(path.parent))


def maps(_folder: Path) -> list[bytes]:
    """Maps with images of several formats."""
    rng = np.random.default_rng(1)
    pixels = np.where(rng.random((48, 60)) < 0.2, 0, 254).astype(np.uint8)
    pixels[20:30] = 254
    found = []
    grey = Image.fromarray(pixels)
    alpha = Image.merge("LA", (grey, Image.fromarray(np.full_like(pixels, 255))))
    pictures = (
        *[(f"map.{kind}", grey) for kind in ("pgm", "png", "bmp", "jpg")],
        *[("map.png", alpha), ("map.png", grey.convert("P")), ("map.ppm", grey.convert("RGB"))],
    )
    for name, image in pictures:
        text = f"image: {name}\nresolution: 0.2\norigin: [-5.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
        file = io.BytesIO()
        image.save(file, {".jpg": "JPEG", ".png": "PNG", ".bmp": "BMP"}.get(name[-4:], "PPM"))
        found.append(text.encode() + PARTED + file.getvalue())
    return found


def read_map(data: bytes, folder: Path) -> None:
    """Read a map from its two parts."""
    text, _, image = data.partition(PARTED)
    (folder / "map.yaml").write_bytes(text)
    for suffix in ("pgm", "png", "bmp", "jpg", "pbm", "ppm"):
        (folder / f"map.{suffix}").write_bytes(image)
    build_road(str(folder / "map.yaml"), None)


def parameter_files(_folder: Path) -> list[bytes]:
    """The parameters of all stages, and a few of them."""
    whole = Path(__file__).resolve().parents[2] / "config" / "default.yaml"
    few = b"/**:\n  ros__parameters:\n    log: {start: 1.5, strict: true}\n    sampling:\n      attempts: 5\n"
    return [whole.read_bytes(), few]


def drives(folder: Path) -> list[bytes]:
    """A drives.json of two drives."""
    found = [{"name": str(k), "scenario": "0f" * 8, "passed": k == 1} for k in range(2)]
    return [json.dumps({"planner": "a:B", "parameters": {"step": 0.1}, "drives": found}).encode()]


def refuse_other_drives(path: Path) -> None:
    """Read drives, and compare with none."""
    earlier = read_drives(path)
    refuse_others(
        {name: digest for name, (digest, _) in earlier.drives.items()}, ClosedLoopConfig(), earlier
    )


EXTREMES = '[0, -1, 1, 9007199254740992, 9223372036854775808, 1e308, -1e308, 1e-320, 0.5, null, true, "", "x", [], {}, [[]]]'


def values(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Change a value anywhere in a JSON document: another kind, an extreme, shorter, longer, deeper, gone."""
    try:
        document = json.loads(data)
        holder, place = None, None
        node = document
        while isinstance(node, dict | list) and node and (holder is None or rng.random() < 0.85):
            keys = list(node) if isinstance(node, dict) else range(len(node))
            holder, place = node, rng.choice(keys)
            node = node[place]
        if holder is None:
            return rng.choice(BYTES)(rng, data, seeds)
        extremes = [*json.loads(EXTREMES), 10**400, "é" * 500, float("nan"), float("inf")]
        more = [[node], {"a": node}, [node] * 3, node[:-1] if isinstance(node, list) else node]
        if rng.random() < 0.15:
            del holder[place]
        else:
            holder[place] = rng.choice(extremes + more)
        return json.dumps(document).encode()
    except (ValueError, RecursionError, TypeError):
        return rng.choice(BYTES)(rng, data, seeds)


JSON = (*BYTES, *[values] * 6)
SQLITE = partial(bags, StoragePlugin.SQLITE3)
TARGETS = (
    Target(
        "mcap_reader",
        runs,
        in_file("a.mcap", read_bag),
        BYTES,
        ("mcap_reader/*", "mcap_zstd*", "reindex/*", "reindex_*"),
        "a.mcap",
    ),
    Target(
        "sqlite_reader",
        SQLITE,
        in_file("a.db3", read_bag),
        BYTES,
        ("sqlite/*",),
        "a.db3",
    ),
    Target("ros1_reader", ros1, in_file("a.bag", read_bag), BYTES, named="a.bag"),
    Target("evaluate", runs, in_file("a.mcap", measure), BYTES, ("validate/*", "mcap_reader/*")),
    Target(
        "metadata",
        metadata,
        in_file("metadata.yaml", read_folder),
        TEXT,
        ("meta/*",),
        "metadata.yaml",
    ),
    Target("map", maps, read_map, BYTES, ("map/*.yaml", "*.yaml")),
    Target(
        "parameters",
        parameter_files,
        in_file("p.yaml", lambda path: loaded(PipelineConfig(), path)),
        TEXT,
        ("params/*",),
    ),
    Target("drives_json", drives, in_file("drives.json", refuse_other_drives), JSON),
)

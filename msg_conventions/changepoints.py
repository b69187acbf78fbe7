# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""(Encounter, Segmentation) ⇄ `changepoints` and `posterior`.

`changepoints` (conventions: trajectory.py) has one point per changepoint: the state of every
vehicle there, in the template's frame. It is all that the stages after the segmenter need, so
another segmenter may publish it too. `posterior` (sensor_msgs/PointCloud2, frame as tracks) has
one row per vehicle and one column per sample: x, y, z [m, float32], vehicle, primitive [uint16], t
[s since the stamp, float64], p [posterior probability of a changepoint, float64]. Both bear the
stamp of their tracks. QoS: reliable, transient_local, depth 1.
"""

import math

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import decode, encode
from msg_conventions.diagnostics import Level, Status
from msg_conventions.layouts import CLOUD
from msg_conventions.tracks import encode_samples, FRAME
from scenario_gen.base.errors import InputError
from scenario_gen.types import describe_segments, Encounter, Segmentation

POSTERIOR_TYPE = "sensor_msgs/msg/PointCloud2"
POINT = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("vehicle", "<u2"),
        ("primitive", "<u2"),
        ("t", "<f8"),
        ("p", "<f8"),
    ]
)
DATATYPES = {"<f4": 7, "<u2": 4, "<f8": 8}  # of sensor_msgs/PointField


def encode_changepoints(encounter: Encounter, segmentation: Segmentation) -> bytes:
    """Return the states at the changepoints as CDR bytes."""
    return encode_samples(encounter, segmentation.changepoints)


def decode_changepoints(
    data: bytes, encounter: Encounter, source: str = "changepoints"
) -> Segmentation:
    """Return the segmentation of a message and its tracks, with a new primitive for every segment.

    Shared labels and probabilities are in `posterior`; no later stage needs them.

    Raises:
        InputError: the message is damaged, bears another stamp, or has a changepoint off the
            template's clock.
    """
    message = trajectory.decode(data, source)
    if message.stamp_ns != encounter.start_ns:
        raise InputError(
            f"{source}: stamp {message.stamp_ns} ns is not that of the tracks "
            f"({encounter.start_ns} ns)"
        )
    index, rest = np.divmod(message.time_ns, encounter.dt_ns)
    samples = encounter.speed.shape[1]
    if rest.any() or (np.diff(index) <= 0).any() or (index < 1).any() or (index >= samples).any():
        raise InputError(
            f"{source}: times must increase and be those of samples 1 to {samples - 1} of the "
            "tracks"
        )
    marks = np.zeros(samples)
    marks[index] = 1.0
    descriptions = describe_segments(encounter, index)
    return Segmentation(np.cumsum(marks).astype(np.int64), index, marks, descriptions)


def encode_posterior(encounter: Encounter, segmentation: Segmentation) -> bytes:
    """Return labels and changepoint probabilities as CDR bytes of a PointCloud2."""
    n, samples = encounter.speed.shape
    cloud = np.zeros((n, samples), dtype=POINT)
    cloud["x"], cloud["y"] = np.moveaxis(encounter.position, -1, 0)
    cloud["vehicle"] = np.arange(n)[:, None]
    cloud["primitive"] = segmentation.labels
    cloud["t"] = encounter.time
    cloud["p"] = segmentation.changepoint_probability
    columns = (POINT.fields or {}).items()
    fields = [
        {"name": name, "offset": at, "datatype": DATATYPES[kind.str], "count": 1}
        for name, (kind, at, *_) in columns
    ]
    steps = (POINT.itemsize, POINT.itemsize * samples)
    data = np.frombuffer(cloud, dtype=np.uint8)
    return encode(
        CLOUD,
        stamp=encounter.start_ns,
        frame_id=FRAME,
        size=(n, samples),
        fields=fields,
        steps=steps,
        data=data,
        is_dense=1,
    )


def decode_posterior(
    data: bytes, descriptions: tuple[str, ...] = (), source: str = "posterior"
) -> Segmentation:
    """Return the segmentation with these sentences for people.

    Raises:
        InputError: the message is damaged or not of this convention.
    """
    message = decode(CLOUD, data, source)
    n, samples = message.size.tolist()
    size = n * samples * POINT.itemsize
    names = tuple(field.name for field in message.fields)
    is_cloud = names == POINT.names and message.steps[0] == POINT.itemsize
    if not is_cloud or len(message.data) != size or size == 0:
        raise InputError(
            f"{source}: expected a cloud of vehicles by samples with the fields "
            f"{', '.join(POINT.names or ())}"
        )
    cloud = message.data.view(POINT).reshape(n, samples)
    labels = cloud["primitive"][0].astype(np.int64)
    return Segmentation(
        labels, 1 + np.flatnonzero(np.diff(labels)), cloud["p"][0].astype(np.float64), descriptions
    )


def segmentation_status(segmentation: Segmentation, node: str, duration: float) -> Status:
    """Return the segmenter's report on an encounter of `duration` s; `node` is its full name."""
    values = {f"segment.{k}": text for k, text in enumerate(segmentation.descriptions)}
    message = (
        f"{len(segmentation.changepoints)} changepoints, {segmentation.n_primitives} primitives"
    )
    remark = segmentation.remark(duration)
    values |= {} if math.isnan(segmentation.r_hat) else {"r_hat": f"{segmentation.r_hat:.3g}"}
    return Status(
        f"{node}: segmentation", Level.WARN if remark else Level.OK, remark or message, values
    )

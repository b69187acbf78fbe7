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

"""One published scenario again, bit for bit, from what its bag says: template, road, parameters, seed and index."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from msg_conventions.belonging import decode_belonging, hash_of, MAP_HASH, TEMPLATE_HASH
from msg_conventions.cdr import CdrReader
from msg_conventions.diagnostics import count_in, decode_diagnostics, encode_diagnostics, Status, text_in
from msg_conventions.names import tokens
from msg_conventions.scenarios import digest, encode_scenario
from msg_conventions.topics import topic_entry, vehicle_topic
from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.bags.metadata import qos_yaml
from scenario_gen.bags.provenance import Config, read_parameters, sha256_of, versions
from scenario_gen.bags.reader import BagMessage, DEFAULT, read_messages, within
from scenario_gen.bags.template import read_template
from scenario_gen.bags.writer import AtomicBag
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError, ScenarioGenError
from scenario_gen.fitting import FittingConfig
from scenario_gen.folders import Kind
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.planning import PlanningConfig
from scenario_gen.requests import Chain, Request
from scenario_gen.sampling import SamplingConfig
from scenario_gen.scenario import Scenario
from scenario_gen.segmentation import segment, Segmentation, SegmentationConfig
from scenario_gen.storage import BagConfig

TEMPLATE = ("tracks", "changepoints", "map", "fit")
ROAD_ENDS = ("road/entries", "road/exits")


@dataclass(frozen=True, eq=False)
class Regenerated:
    """A scenario made again.

    Attributes:
        scenario: the same as in the bag; data: its CDR bytes, whose SHA-256 is that in `scenarios/info`.
        messages: those of the bag that belong to it (template, road, routes, its own and its account), for a bag of its own.
        sha256: of `data`.
    """

    scenario: Scenario
    data: bytes
    messages: tuple[BagMessage, ...]
    sha256: str


def regenerate_scenario(
    bag: Path,
    index: int,
    *,
    namespace: str | None = None,
    request: str | None = None,
    log: Path | None = None,
    config: BagConfig = DEFAULT,
) -> Regenerated:
    """Make scenario `index` of a bag again and compare it with the recorded SHA-256.

    Everything is taken from the bag; where `log` is given, tracks and changepoints are made from that file instead, so that
    the whole chain is repeated.

    Args:
        bag: its folder.
        index: as in `scenarios/info`.
        namespace: where several hold such an index.
        request: id, likewise.
        log: the raw log.
        config: what is read of the bag at most.

    Raises:
        InputError: the bag, the index, or something that is needed is not there or ambiguous; the log is another one.
        ScenarioGenError: it comes out differently (another version); the message names what differs.
    """
    with within(bag):
        return _regenerate(bag, _find(bag, index, namespace, request, config), index, log)


def _regenerate(bag: Path, found: "_Found", index: int, log: Path | None) -> Regenerated:
    """Make the scenario that was found.

    Raises:
        InputError, ScenarioGenError: as `regenerate_scenario`.
    """
    what = f"{bag}: request {found.entry.values['request']}"
    account, seed = found.account.values, int(found.entry.values["seed"])
    asked = Request(**{name: account.get(name, "") for name in ("ego", "starts", "goals")})
    template = read_template(found.template(what))
    encounter, segmentation, routes, states = template.encounter, template.segmentation, template.routes, template.asked
    if log is not None:
        encounter, segmentation = _from_log(log, encounter, account, seed, what)
    chain = Chain(encounter, segmentation, template.road, seed, sampling=_read(SamplingConfig(), "sampling.", account, what))
    if asked.moves or log is not None:  # what the bag has on `fit` need not be this request's
        fitting = _read(FittingConfig(), "fitting.", account, what)
        planning = _read(PlanningConfig(), "planning.", account, what)
        fit, routes = replace(chain, fitting=fitting, planning=planning).place(asked)
        states = fit.asked
    scenario = chain.scenario(asked, routes, states, index)
    data = b"" if scenario is None else encode_scenario(scenario, encounter.start_ns)
    if scenario is None or digest(data) != found.entry.values["sha256"]:
        now = versions()
        other = [f"{name} {account[name]} there, {now[name]} here" for name in now if account.get(name, now[name]) != now[name]]
        why = ", ".join(other) or "the versions agree, so the bag was changed"
        raise ScenarioGenError(f"{what}: scenario {index} comes out differently: {why}")
    return Regenerated(scenario, data, found.messages, digest(data))


def write_regenerated(made: Regenerated, folder: Path, inputs: Sequence[Path] = ()) -> Path:
    """Write the scenario, its account and its template to a bag of its own; return `folder`.

    Args:
        made: the scenario.
        folder: of the bag; one that this function wrote there earlier is replaced.
        inputs: the bag, and the log, it was made from.

    Raises:
        InputError: the folder is there and is something else, holds an input, or cannot be written.
    """
    with AtomicBag(folder, REGENERATED, inputs) as bag:
        for message in made.messages:
            bag.add_topic(message.topic, message.type, qos_yaml(topic_entry(message.topic.lstrip("/"))[1]))
            bag.write(message.topic, message.data, message.stamp_ns)
    return folder


def _is_regenerated(folder: Path) -> bool:
    """Say whether a bag without a marker was written by `write_regenerated`.

    Nothing is there but one file; every topic is one of the template's with one message, but for the two accounts, which were
    logged at the same instant: those of a recording never are.
    """
    if {path.name for path in folder.iterdir()} != {"metadata.yaml", f"{folder.name}_0.mcap"}:
        return False
    try:
        messages = list(read_messages(folder))
        (info,) = {message.topic for message in messages if message.topic.endswith("/scenarios/info")}
        where = info.removesuffix("/scenarios/info")
        one, closing = (message for message in messages if message.topic == info)
        account = decode_diagnostics(closing.data)[1][0].values
    except (InputError, ValueError, IndexError):
        return False
    topics = [message.topic.removeprefix(f"{where}/") for message in messages if message.topic != info]
    known = all(_is_kept(topic) or topic == "scenarios" for topic in topics) and len(set(topics)) == len(topics)
    whole = {"scenarios", *TEMPLATE} <= set(topics) and account.get("published") == "1"
    return known and whole and one.stamp_ns == closing.stamp_ns


REGENERATED = Kind("regenerated bag", _is_regenerated)


def _is_kept(topic: str) -> bool:
    """Say whether what is on the topic belongs to the template."""
    return topic in (*TEMPLATE, *ROAD_ENDS) or fnmatchcase(topic, "vehicle_*/route") or topic.startswith("ego/")


@dataclass(frozen=True, eq=False)
class _Found:
    """A scenario's account in a bag, that of its request, and the messages that belong to it, its own among them."""

    namespace: str
    entry: Status
    account: Status
    messages: tuple[BagMessage, ...]

    def template(self, what: str) -> dict[str, bytes]:
        """The newest message of each topic of the template.

        Raises:
            InputError: one that is needed is not in the bag.
        """
        newest = {message.topic.removeprefix(f"{self.namespace}/"): message.data for message in self.messages}
        needed = [topic for topic in TEMPLATE if topic not in newest]
        if "tracks" in newest:
            names = tokens(vehicle.id for vehicle in decode_tracks(newest["tracks"]).vehicles)
            needed += [topic for name in names if (topic := vehicle_topic(name, "route")) not in newest]
        if needed:
            raise InputError(f"{what} cannot be made again: the bag has no {', '.join(needed)} with the scenario's stamp")
        return newest


def _find(bag: Path, index: int, namespace: str | None, request: str | None, config: BagConfig) -> _Found:
    """Find the one scenario of that index.

    Raises:
        InputError: there is none, several, or its request was not closed.
    """
    entries, accounts = [], {}
    for message in read_messages(bag, lambda topic: topic.endswith("/scenarios/info"), config):
        where = message.topic.removesuffix("/scenarios/info")
        for status in decode_diagnostics(message.data, message.topic)[1]:
            if "published" in status.values:
                accounts[where, status.values.get("request", "")] = status
            elif "sha256" in status.values:
                for key in ("index", "seed"):
                    count_in(status.values, key, f"{bag}: {message.topic}, {status.message}")
                entries.append((where, status, message))
    if not entries:
        raise InputError(
            f"{bag}: no scenario has an account on `scenarios/info`; only what this suite published can be made again"
        )
    own = [e for e in entries if namespace in (None, e[0]) and request in (None, e[1].values.get("request"))]
    same = [e for e in own if e[1].values["index"] == str(index)]
    if not same:
        known = sorted({int(status.values["index"]) for _, status, _ in own})
        some = ", ".join(map(str, known[:20])) + (", …" if len(known) > 20 else "")
        raise InputError(f"{bag}: no scenario of index {index}; there are: {some or 'none in that namespace and request'}")
    if len(same) > 1:
        places = "; ".join(f"--namespace '{where}' --request {status.values.get('request')}" for where, status, _ in same)
        raise InputError(f"{bag}: {len(same)} scenarios have index {index}; choose one: {places}")
    where, entry, info = same[0]
    name = text_in(entry.values, "request", f"{bag}: {where}/scenarios/info, {entry.message}")
    account = accounts.get((where, name))
    if account is None:
        raise InputError(f"{bag}: request {name} was not closed on {where}/scenarios/info: its parameters are missing")
    return _Found(where, entry, account, tuple(_belonging(bag, where, entry, info, account, config)))


def _belonging(
    bag: Path, where: str, entry: Status, info: BagMessage, account: Status, config: BagConfig
) -> Iterator[BagMessage]:
    """What bears the scenario's stamp in its namespace, then the scenario and the two accounts.

    Of each topic that is the newest, or, where `fit/info` says what belongs to the scenario's map and template, that one.

    Raises:
        InputError: the scenario itself is not in the bag.
    """
    stamp = CdrReader(info.data, info.topic).stamp()
    newest: dict[str, BagMessage] = {}
    scenario = None
    together: dict[str, str] = {}
    for message in read_messages(bag, lambda topic: topic == f"{where}/fit/info", config):
        told = decode_belonging(message.data, message.topic)
        if all(told.get(topic) == entry.values.get(key) for topic, key in (("map", MAP_HASH), ("tracks", TEMPLATE_HASH))):
            together = told
    for message in read_messages(bag, lambda topic: topic.startswith(f"{where}/"), config):
        topic = message.topic.removeprefix(f"{where}/")
        if topic in together and hash_of(topic, message.data) != together[topic]:
            continue
        if topic == "scenarios" and digest(message.data) == entry.values["sha256"]:
            scenario = message
        if _is_kept(topic) and (topic == "map" or CdrReader(message.data, message.topic).stamp() == stamp):
            if topic == "map" and topic in newest and CdrReader(message.data, message.topic).stamp() != stamp:
                continue
            newest[topic] = message
    if scenario is None:
        raise InputError(f"{bag}: the scenario with SHA-256 {entry.values['sha256']} is not on {where}/scenarios")
    yield from newest.values()
    yield scenario
    yield info
    closing = replace(account, values={**account.values, "published": "1", "requested": "1"})
    yield replace(info, data=encode_diagnostics([closing], stamp))


def _from_log(log: Path, recorded: Encounter, account: Mapping[str, str], seed: int, what: str) -> tuple[Encounter, Segmentation]:
    """The template and its changepoints from the raw log.

    Raises:
        InputError: it is not the log that the bag was made from, or the bag does not say which that was.
    """
    known = {name: text.removeprefix("sha256 ") for name, text in account.items() if name.startswith("log ")}
    if not known:
        raise InputError(f"{what}: the bag does not say which log it was made from (nodes do not know it); leave --log out")
    own = sha256_of(log) if log.exists() else ""
    if own not in known.values():
        there = ", ".join(f"{name.removeprefix('log ')} (sha256 {text})" for name, text in known.items())
        is_missing = "is not there" if not own else f"has sha256 {own}: it is another file, or was changed"
        raise InputError(f"{log} {is_missing}; the bag was made from {there}")
    found = [e for e in read_log(log, _read(LogConfig(), "log.", account, what)).encounters if e.start_ns == recorded.start_ns]
    same = [e for e in found if encode_tracks(e) == encode_tracks(recorded)]
    if not same:
        raise InputError(f"{log}: no encounter in it is the one on the bag's tracks, though the file is the same")
    return same[0], segment(same[0], _read(SegmentationConfig(), "segmentation.", account, what), seed)


def _read(config: Config, prefix: str, account: Mapping[str, str], what: str) -> Config:
    return read_parameters(config, account, prefix, what)

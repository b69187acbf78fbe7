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

"""What `scenarios/info` accounts for, and what a scenario's account says of the template and the map it was made for."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from msg_conventions.belonging import hash_of, MAP_HASH, TEMPLATE_HASH
from msg_conventions.cdr import CdrReader
from msg_conventions.diagnostics import decode_diagnostics
from msg_conventions.roads import decode_map
from msg_conventions.scenarios import digest
from scenario_gen.errors import InputError

UNTOLD = "scenarios/info does not tell of them (lost with the end of a recording?)"  # of scenarios without an account
Account = Mapping[str, str]
Counted = tuple[str, int]  # a SHA-256, and the how manieth of its kind


def accounts_of(messages: Sequence[bytes], what: str, *, lenient: bool = False) -> tuple[Account, ...]:
    """Return the account of every scenario, in the order of the bag; `lenient` leaves damaged messages out.

    Raises:
        InputError: a message, named by `what`, is damaged.
    """
    found: list[Account] = []
    for data in messages:
        try:
            found += [status.values for status in decode_diagnostics(data, what)[1] if "sha256" in status.values]
        except InputError:
            if not lenient:
                raise
    return tuple(found)


def unknown_scenarios(scenarios: Sequence[bytes], accounts: Sequence[Account]) -> dict[int, Account | None]:
    """Return the places of scenarios whose SHA-256 no account has, each with the account that stands in its place.

    Such a scenario was altered if there is an account, between those of its neighbours, whose own scenario is not in the bag.
    Else it has none (it was lost, e.g. with the last chunk of a recording that was killed): that says nothing against it.
    """
    told = list(_counted(account["sha256"] for account in accounts))
    place = {key: k for k, key in enumerate(told)}
    seen = list(_counted(map(digest, scenarios)))
    there = set(seen)
    lost = [k for k, key in enumerate(told) if key not in there]
    known = [(-1, -1), *((k, place[key]) for k, key in enumerate(seen) if key in place), (len(seen), len(told))]
    everything = {account["sha256"] for account in accounts}
    found: dict[int, Account | None] = {}
    for (first, after), (last, before) in pairwise(known):
        between = iter([accounts[k] for k in lost if after < k < before])
        found |= {k: next(between, None) for k in range(first + 1, last) if seen[k][0] not in everything}
    return found


def _counted(texts: Iterable[str]) -> Iterable[Counted]:
    """Number equal texts: a set that was published twice has accounts for both."""
    count: Counter[str] = Counter()
    for text in texts:
        count[text] += 1
        yield text, count[text]


def tracks_of(account: Account | None, tracks: Sequence[bytes], stamp_ns: int, what: str) -> bytes | None:
    """Return the tracks that an account names, else the newest ones of the stamp.

    Raises:
        InputError: a message, named by `what`, is damaged.
    """
    own = (account or {}).get(TEMPLATE_HASH)
    return next((data for data in tracks if hash_of("tracks", data) == own), None) or newest(tracks, stamp_ns, what)


def map_of(account: Account | None, maps: Sequence[bytes], stamp_ns: int, what: str) -> bytes | None:
    """Return the map that an account names; where accounts name none, the newest one of the stamp, or of all.

    Raises:
        InputError: a message, named by `what`, is damaged.
    """
    if own := (account or {}).get(MAP_HASH):
        found = next((data for data in maps if hash_of("map", data) == own), None)
        for data in maps if found is None else ():
            decode_map(data, name=what)  # it may be the one that is damaged
        return found
    return newest(maps, stamp_ns, what) or (maps[-1] if maps else None)


def newest(messages: Sequence[bytes], stamp_ns: int, what: str) -> bytes | None:
    """Return the last message that bears the stamp.

    Raises:
        InputError: a message, named by `what`, is damaged.
    """
    return next((data for data in reversed(messages) if CdrReader(data, what).stamp() == stamp_ns), None)


def is_ambiguous(maps: Sequence[bytes], accounts: Sequence[Account]) -> bool:
    """Say whether it is not known which of several maps a scenario without an account is of, while accounts know theirs."""
    return any(MAP_HASH in account for account in accounts) and len({hash_of("map", data) for data in maps}) > 1

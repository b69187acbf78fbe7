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

"""Accounts held against scenarios: `scenarios/info` tells of each one and, at a request's end, how many were published.

Both topics come in any order; what is told or comes twice (by a sampler that was started again, or to a subscriber that was
found again) counts once.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
import heapq

from msg_conventions.diagnostics import count_in, decode_diagnostics, Status, text_in
from msg_conventions.scenarios import digest
from scenario_gen.errors import InputError

INFO = "scenarios/info"
MOST_TOLD = 300_000  # entries that are remembered; beyond, the oldest requests are forgotten
MOST_UNTOLD = 10_000  # scenarios that wait for their entry; beyond, the oldest are forgotten
Entry = Mapping[str, str]


@dataclass
class Account:
    """One request: what was told of it, and how much of it came.

    Attributes:
        request, seed: its id and seed.
        told: SHA-256 of its scenarios by index, in the order in which they were told.
        awaited: entries of the scenarios that have not come, by SHA-256.
        came: how many have.
        closing: its closing entry, once there is one.
        kept: scenarios, of who calls `keep`.
    """

    request: str
    seed: str = ""
    told: dict[str, str] = field(default_factory=dict)
    awaited: dict[str, Entry] = field(default_factory=dict)
    came: int = 0
    closing: Status | None = None
    kept: list[tuple[str, str, Entry, bytes]] = field(default_factory=list)

    @property
    def published(self) -> int | None:
        """How many scenarios were published; None until the request is closed."""
        return None if self.closing is None else int(self.closing.values["published"])

    @property
    def whole(self) -> bool:
        """Whether it is closed and nothing is missing."""
        return self.closing is not None and not self.missing

    @property
    def missing(self) -> int:
        """How many scenarios that were published are not there."""
        return max(0, (len(self.told) if self.published is None else self.published) - self.came)

    def keep(self, entry: Entry, data: bytes, seed: int, most: int) -> None:
        """Keep a scenario, or one less of more than `most`: the same ones of the same seed, in whatever order they come."""
        lot = digest(f"{seed} {entry['sha256']}".encode())
        heapq.heappush(self.kept, (lot, entry["index"], entry, data))
        if len(self.kept) > most:
            heapq.heappop(self.kept)

    def in_order(self) -> list[tuple[bytes, Entry]]:
        """Return what is kept, in the order in which it was told."""
        kept = {entry["index"]: (data, entry) for _, _, entry, data in self.kept}
        return [kept[index] for index in self.told if index in kept]

    def sentence(self) -> str:
        """Say what is missing."""
        if self.published is None:
            return f"request {self.request} was not closed: {self.came} scenarios are there, {self.missing} more are told of"
        return f"request {self.request}: {self.came} of {self.published} scenarios are there, {self.missing} are missing"


Match = tuple[Account, Entry, bytes]  # a request, one of its entries, and what came with the scenario


class Accounts:
    """The accounts of one namespace."""

    def __init__(self, most_untold: int = MOST_UNTOLD) -> None:
        self.open: dict[str, Account] = {}  # by request
        self._awaited: dict[str, list[str]] = {}  # SHA-256 -> requests
        self._untold: dict[str, list[bytes]] = {}  # SHA-256 -> what came with scenarios that came before their entry
        self._whole: dict[str, tuple[str, int]] = {}  # request -> seed and number of scenarios
        self._most_untold = most_untold
        self._told = 0  # entries of all open requests

    def scenario(self, sha256: str, data: bytes = b"") -> Match | None:
        """Take a scenario, with what is to be given back with its entry: now, if that was there."""
        requests = self._awaited.get(sha256)
        if not requests:
            self._untold.setdefault(sha256, []).append(data)
            while len(self._untold) > self._most_untold:
                self._untold.pop(next(iter(self._untold)))
            return None
        account = self.open[requests[0]]
        self._await_no_more(sha256, account.request)
        account.came += 1
        return account, account.awaited.pop(sha256), data

    def tell(self, status: Status, place: str = INFO) -> Match | None:
        """Take an entry or a closing; return the entry with its scenario, if that had come.

        Raises:
            InputError: naming `place`, something is missing in it or no number.
        """
        values = status.values
        if "published" in values:
            request = text_in(values, "request", place)
            count_in(values, "published", place)
            self.open.setdefault(request, Account(request)).closing = status
        return self._tell_entry(values, place) if "sha256" in values else None

    def _tell_entry(self, values: Entry, place: str) -> Match | None:
        entry = {key: text_in(values, key, place) for key in ("request", "index", "seed", "sha256")}
        request, sha256 = entry["request"], entry["sha256"]
        account = self.open.setdefault(request, Account(request, entry["seed"]))
        account.seed = account.seed or entry["seed"]
        if entry["seed"] != account.seed or account.told.get(entry["index"], sha256) != sha256:
            self.forget(request)  # another sampler, which counts its requests from 1 again
            account = self.open[request] = Account(request, entry["seed"])
        repeated = entry["index"] in account.told
        if not repeated:
            account.told[entry["index"]] = sha256
            self._told += 1
            while self._told > MOST_TOLD and len(self.open) > 1:
                self.forget(next(iter(self.open)))
        data = self._take_untold(sha256)
        if repeated:
            return None
        if data is None and sha256 not in account.awaited:
            account.awaited[sha256] = entry
            self._awaited.setdefault(sha256, []).append(request)
            return None
        account.came += 1  # a second one of the same bytes counts with the first
        return account, entry, data or b""

    def _take_untold(self, sha256: str) -> bytes | None:
        waiting = self._untold.get(sha256)
        if not waiting:
            return None
        data = waiting.pop()
        if not waiting:
            del self._untold[sha256]
        return data

    def _await_no_more(self, sha256: str, request: str) -> None:
        waiting = self._awaited.get(sha256, [])
        if request in waiting:
            waiting.remove(request)
        if not waiting:
            self._awaited.pop(sha256, None)

    def forget(self, request: str) -> None:
        """Wait for no scenario of a request any more."""
        account = self.open.pop(request, None)
        if account is not None:
            self._told -= len(account.told)
            for sha256 in account.awaited:
                self._await_no_more(sha256, request)

    def settle(self) -> None:
        """Forget the requests that are whole."""
        for request, account in list(self.open.items()):
            if account.whole or (account.closing and self._whole.get(request) == _key(account)):
                self._whole[request] = _key(account)
                self.forget(request)
        while len(self._whole) > 1000:
            self._whole.pop(next(iter(self._whole)))

    def incomplete(self, *, closed: bool) -> Iterator[Account]:
        """Yield the requests of which something is missing; with `closed`, only of those that are closed."""
        for account in self.open.values():
            if account.missing and (account.closing is not None or not closed):
                yield account


def _key(account: Account) -> tuple[str, int]:
    return account.seed, account.published or 0


def missing_sentences(scenarios: Sequence[bytes], infos: Iterable[bytes]) -> tuple[str, ...]:
    """Say which requests that `scenarios/info` tells of are not there whole, of one namespace."""
    accounts = Accounts(most_untold=len(scenarios))
    for data in scenarios:
        accounts.scenario(digest(data))
    for data in infos:
        take_info(accounts, data)
    return tuple(account.sentence() for account in accounts.incomplete(closed=False))


def take_info(accounts: Accounts, data: bytes) -> None:
    """Take a message of `scenarios/info`; one that is damaged is passed over."""
    try:
        for status in decode_diagnostics(data)[1]:
            accounts.tell(status)
    except InputError:
        return

"""What a bag says of the conventions' topics, by namespace; for all that reads whole bags."""

from collections import defaultdict
from collections.abc import Collection
from pathlib import Path

from scenario_gen.bags.reader import read_messages

Contents = dict[str, list[bytes]]  # topic without its namespace -> messages, in order


def read_namespaces(path: Path, topics: Collection[str]) -> dict[str, Contents]:
    """Return the messages of `topics` (names without a slash) of every namespace, by namespace, sorted.

    Raises:
        InputError: the bag is missing or damaged.
    """
    found: dict[str, Contents] = defaultdict(lambda: {topic: [] for topic in topics})
    for message in read_messages(path, lambda topic: topic.rpartition("/")[2] in topics):
        namespace, _, topic = message.topic.rpartition("/")
        found[namespace][topic].append(message.data)
    return dict(sorted(found.items()))

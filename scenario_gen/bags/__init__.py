"""Bags as rosbag2 writes them (MCAP, metadata version 9), in and out, without ROS."""

from scenario_gen.bags.reader import BagMessage, BagTopic, bag_topics, read_messages
from scenario_gen.bags.reindex import reindex
from scenario_gen.bags.run import Run, read_scenario_set, run_messages, write_run
from scenario_gen.bags.writer import AtomicBag, BagWriter, Split

__all__ = [
    "AtomicBag",
    "BagMessage",
    "BagTopic",
    "BagWriter",
    "Run",
    "Split",
    "bag_topics",
    "read_messages",
    "read_scenario_set",
    "reindex",
    "run_messages",
    "write_run",
]

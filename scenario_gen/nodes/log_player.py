"""log_player: a log in, one of its encounters out as latched `tracks`; `~/play` reads it again."""

import sys
from dataclasses import dataclass, field
from pathlib import Path

from std_srvs.srv import Trigger

from msg_conventions.diagnostics import Level
from msg_conventions.tracks import encode_tracks
from scenario_gen.errors import InputError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.nodes.base import StageNode, run_nodes
from scenario_gen.parameters import check, parameter


@dataclass(frozen=True)
class Config:
    """The log player's parameters."""

    log_path: str = parameter("", "log to read: a file, a bag or a folder of files")
    encounter: int = parameter(0, "which encounter of the log, from 0", low=0)
    log: LogConfig = field(default_factory=LogConfig)

    def __post_init__(self) -> None:
        check(self)


class LogPlayer(StageNode):
    """Reads a log and publishes the encounter that is asked for."""

    OUTPUTS = ("tracks",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("log_player", Config(), namespace)
        self.serve(Trigger, "~/play", self._play_again)

    def started(self) -> None:
        """Read the log, if one is named."""
        if self.config.log_path:
            self.work("play", lambda cancelled: None if cancelled() else self._play())

    def _play(self) -> None:
        config = self.config
        result = read_log(Path(config.log_path), config.log)
        if config.encounter >= len(result.encounters):
            raise InputError(
                f"parameter encounter is {config.encounter}; {config.log_path} holds {len(result.encounters)}, counted from 0"
            )
        encounter = result.encounters[config.encounter]
        self.send("tracks", encode_tracks(encounter))
        n, samples = encounter.speed.shape
        message = f"{encounter.name}: {n} vehicles, {samples} samples over {encounter.duration:.1f} s"
        notes = {f"note.{k}": note for k, note in enumerate(result.quality.notes)}
        self.status(Level.OK, message, "encounter", encounter.start_ns, **notes)

    def _play_again(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.active and bool(self.config.log_path)
        response.message = "started" if response.success else "parameter log_path is empty, or the node is not active"
        self.started()
        return response


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(LogPlayer))

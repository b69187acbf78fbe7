# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The hooks before a commit are checks of `make test`, and `make counts`, run from the same environment; none is downloaded."""

import re

from source_files import ROOT
import yaml


def test_hooks_are_local_and_checks_of_make_test():
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    assert [repository["repo"] for repository in config["repos"]] == ["local"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipes = [makefile.partition(f"\n{target}:")[2].partition("\n\n")[0] for target in ("test", "counts")]
    checks = set(re.findall(r"\$\(BIN\)/((?:ruff|mypy|python test/)(?:[-\w /.]*\w)?)", "\n".join(recipes)))
    hooks = [hook for repository in config["repos"] for hook in repository["hooks"]]
    assert {hook["entry"].removeprefix(".venv/bin/").removesuffix(" --force-exclude") for hook in hooks} == checks
    assert all(hook["language"] == "system" for hook in hooks)

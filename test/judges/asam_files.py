# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Judge OpenSCENARIO and OpenDRIVE files by ASAM's checkers, in the environment of requirements/judges-asam.lock.

`python asam_files.py FOLDER`; one JSON object on the last line: files, rules that were run, issues by file.
"""

import json
from pathlib import Path
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from xml.sax.saxutils import quoteattr

PROGRAMS = {".xodr": ("qc_opendrive", "xodrBundle"), ".xosc": ("qc_openscenario", "xoscBundle")}


def judge(path, folder):
    """Return how many rules one file was held against, and the issues found."""
    program, bundle = PROGRAMS[path.suffix]
    config, result = folder / "config.xml", folder / "result.xqar"
    result.unlink(missing_ok=True)
    config.write_text(
        f'<Config><Param name="InputFile" value={quoteattr(str(path.resolve()))}/><CheckerBundle application="{bundle}">'
        f'<Param name="resultFile" value={quoteattr(str(result))}/></CheckerBundle></Config>'
    )
    run = subprocess.run(
        [Path(sys.executable).parent / program, "-c", config],
        capture_output=True,
        text=True,
        check=False,
    )
    if not result.is_file():
        return 0, [f"no result: {run.stderr[-300:]}"]
    root = ET.parse(result).getroot()
    rules = [
        checker for checker in root.iter("Checker") if checker.attrib.get("status") == "completed"
    ]
    broken = [
        checker.attrib["checkerId"]
        for checker in root.iter("Checker")
        if checker.attrib.get("status") == "error"
    ]
    return len(rules), [
        issue.attrib.get("description", "") for issue in root.iter("Issue")
    ] + broken


def main(folder):
    found = {"xosc": 0, "xodr": 0, "rules": {}, "issues": {}}
    with tempfile.TemporaryDirectory() as scratch:
        for path in sorted(p for p in folder.rglob("*") if p.suffix in PROGRAMS):
            rules, issues = judge(path, Path(scratch))
            kind = path.suffix[1:]
            found[kind] += 1
            found["rules"][kind] = min(found["rules"].get(kind, rules), rules)
            if issues:
                found["issues"][str(path.relative_to(folder))] = issues[:5]
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Licences of every locked package, from the metadata of what is installed: `make licences` writes docs/licences.csv."""

from collections.abc import Iterator, Mapping, Sequence
import csv
from importlib.metadata import Distribution, distributions, PackageNotFoundError
from pathlib import Path
import re
import tomllib
import xml.etree.ElementTree as ET

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
REQUIREMENTS = ROOT / "requirements"
LOCKS = tuple(
    REQUIREMENTS / f"{name}.lock" for name in ("core", "run", "extras", "test", "ros", "ros-test")
)
TABLE = ROOT / "docs" / "licences.csv"
TOLD = {  # what metadata does not say, or says only on Windows; looked up in the projects themselves
    "colorama": "BSD-3-Clause",
    "coloredlogs": "MIT",
    "humanfriendly": "MIT",
    "pyclothoids": "MIT",
    "pyreadline3": "BSD-3-Clause",
    "pywin32": "PSF-2.0",
    "tzdata": "Apache-2.0",
    "axe-playwright-python": "MIT; axe-core MPL-2.0",
    "apsw": "any OSI-approved licence",
    "empy": "BSD",
    "setuptools": "MIT",
    "docutils": "public domain, BSD-2-Clause; one file GPL-3.0",
    "protobuf-py-ext": "Apache-2.0",
    "ros-fastcdr": "Apache-2.0",
    "ros-fastrtps": "Apache-2.0",
}
SHORT = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD",
    "MIT License": "MIT",
    "Python Software Foundation License": "PSF-2.0",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "ISC License (ISCL)": "ISC",
    "GNU General Public License v2 (GPLv2)": "GPL-2.0",
    "Apache License 2.0": "Apache-2.0",
    "Apache License, Version 2.0": "Apache-2.0",
    "GNU GENERAL PUBLIC LICENSE": "GPL",
}
COPYLEFT = re.compile(r"\bA?GPL")


def locked() -> dict[str, str]:
    """Return {name: version} of the locks; versions that differ by Python version are joined."""
    found: dict[str, list[str]] = {}
    text = "".join(lock.read_text(encoding="utf-8") for lock in LOCKS)
    for name, version in re.findall(r"^([\w.\-]+)==([^\s;\\]+)", text, re.MULTILINE):
        found.setdefault(canonicalize_name(name), []).append(version)
    return {name: ", ".join(dict.fromkeys(versions)) for name, versions in sorted(found.items())}


def installed() -> dict[str, Distribution]:
    """Return what is installed, by name."""
    return {canonicalize_name(found.metadata["Name"]): found for found in distributions()}


def licence(name: str, found: Distribution | None) -> str:
    """Return the licence of a package, "" if it cannot be told."""
    if name in TOLD or found is None:
        return TOLD.get(name, "")
    stated = found.metadata.get("License-Expression")
    classified = [
        text.rpartition(" :: ")[2]
        for text in found.metadata.get_all("Classifier") or ()
        if text.startswith("License ::")
    ]
    text = stated or " and ".join(
        SHORT.get(one, one) for one in classified if one != "OSI Approved"
    )
    text = (
        text
        or (found.metadata.get("License") or "").strip().partition("\n")[0]
        or " and ".join(_of_manifests(found))
    )
    return SHORT.get(text, text)


def _of_manifests(found: Distribution) -> Iterator[str]:
    """Licences in the package.xml files that a ROS package installs; a package of packages has none, and says ROS's own."""
    manifests = [file for file in found.files or () if file.name == "package.xml"]
    said = {
        entry.text or ""
        for file in manifests
        for entry in ET.parse(Path(str(file.locate()))).getroot().findall("license")
    }
    yield from sorted(SHORT.get(text.strip(), text.strip()) for text in said)
    if not manifests and found.metadata["Name"].startswith("ros-"):
        yield "Apache-2.0"


def extras() -> dict[str, list[Requirement]]:
    """Return the requirements in pyproject.toml by extra, the core's as "core"; included extras are left out."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {"core": project["dependencies"]} | project["optional-dependencies"]
    return {
        name: [wanted for wanted in map(Requirement, texts) if wanted.name != project["name"]]
        for name, texts in listed.items()
    }


def run_time() -> list[Requirement]:
    """Return the requirements of the core and of all extras but the test's."""
    return [wanted for name, listed in extras().items() if name != "test" for wanted in listed]


def needed_at_run_time(
    known: Mapping[str, Distribution], wanted: Sequence[Requirement] | None = None
) -> set[str]:
    """Return the names of all that requirements (by default all of pyproject.toml) lead to on this platform."""
    open_ = run_time() if wanted is None else list(wanted)
    found: set[str] = set()
    seen: set[tuple[str, str]] = set()
    while open_:
        wanted = open_.pop()
        name = canonicalize_name(wanted.name)
        if name not in known:
            raise PackageNotFoundError(f"{name}: not installed; run `make install`")
        found.add(name)
        for extra in sorted({"", *wanted.extras} - {extra for one, extra in seen if one == name}):
            seen.add((name, extra))
            for text in known[name].requires or ():
                required = Requirement(text)
                if required.marker is None or required.marker.evaluate({"extra": extra}):
                    open_.append(required)
    return found


def write() -> None:
    """Write the table."""
    known = installed()
    needed = needed_at_run_time(known)
    rows = [("package", "version", "licence", "needed")]
    for name, version in locked().items():
        stated, need = (
            licence(name, known.get(name)) or "unknown",
            "run time" if name in needed else "to test",
        )
        rows.append((name, version, stated, need))
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    write()

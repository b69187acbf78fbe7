# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ament_xmllint on package.xml. The schema that it names is looked up in a catalogue, so that no network is needed."""

from pathlib import Path
import shutil

from catkin_pkg.package import parse_package
import pytest
from source_files import ROOT

HERE = Path(__file__).resolve().parent
CATALOGUE = """\
<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
  <uri name="http://download.ros.org/schema/package_format3.xsd" uri="{0}"/>
  <system systemId="http://download.ros.org/schema/package_format3.xsd" uri="{0}"/>
</catalog>
"""


@pytest.fixture
def xmllint(tmp_path, monkeypatch):
    """ament_xmllint's main, on a machine that has xmllint."""
    linter = pytest.importorskip("ament_xmllint.main")
    if shutil.which("xmllint") is None:
        pytest.skip("xmllint is not installed (Debian: libxml2-utils)")
    catalogue = tmp_path / "catalogue.xml"
    catalogue.write_text(CATALOGUE.format((HERE / "manifest.xsd").as_uri()))
    monkeypatch.setenv("XML_CATALOG_FILES", str(catalogue))
    return linter.main


@pytest.mark.xmllint
@pytest.mark.linter
def test_package_xml_is_valid(xmllint, capfd):
    assert xmllint([str(ROOT / "package.xml")]) == 0, capfd.readouterr().err


@pytest.mark.linter
def test_catkin_pkg_reads_package_xml_without_a_warning():
    warnings: list[str] = []
    assert parse_package(ROOT, warnings=warnings).name == "scenario_gen"
    assert not warnings

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Headless Chromium, and a tab that keeps a record of what went wrong and what was asked of the network."""

from contextlib import contextmanager
import shutil

import pytest

DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}
FLAGS = [
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@contextmanager
def chromium():
    """Chromium as long as it is needed; the test skips where it is not installed."""
    driving = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed (pip install playwright)"
    )
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if not found:
        pytest.skip("chromium is not installed (apt-get install chromium)")
    with driving.sync_playwright() as driver:
        instance = driver.chromium.launch(
            executable_path=found, args=FLAGS, chromium_sandbox=False
        )
        yield instance
        instance.close()


class Tab:
    """A page with a record of what went wrong and what was asked of the network."""

    def __init__(self, browser, file, size):
        self.page = browser.new_page(
            viewport=size, accept_downloads=False
        )  # they are told, and nothing waits for their end
        self.troubles, self.requests = [], []
        self.page.on(
            "console",
            lambda message: (
                self.troubles.append(message.text)
                if message.type in ("error", "warning")
                else None
            ),
        )
        self.page.on("pageerror", lambda error: self.troubles.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())

    def asked(self):
        """What was asked of file system and network."""
        return [url for url in self.requests if not url.startswith(("data:", "blob:"))]

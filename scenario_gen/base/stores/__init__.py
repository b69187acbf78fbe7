# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Object stores (s3, gs, abfs) and the web, by URL: what is there, fetched to files, and files written to objects."""

from scenario_gen.base.stores.remote import local, Place, place, Remote, url_of
from scenario_gen.base.stores.transfer import (
    below,
    create,
    download,
    each_fetched,
    fetched,
    naming_objects,
    Part,
    read,
    renamed,
    size_of,
    temporary,
    upload,
    workplace,
)

__all__ = [
    "Part", "Place", "Remote", "below", "create", "download", "each_fetched", "fetched",
    "local", "naming_objects", "place", "read", "renamed", "size_of", "temporary", "upload", "url_of", "workplace",
]  # fmt: skip

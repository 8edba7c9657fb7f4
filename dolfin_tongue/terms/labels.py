"""Names of terms and supports: in tables, messages and memories."""

from __future__ import annotations

from collections.abc import Sequence


def labels_of(terms: Sequence[object]) -> list[str]:
    """Class names of the terms in small letters, numbered where one occurs twice."""
    return numbered([_words(type(term).__name__) for term in terms])


def numbered(names: Sequence[str]) -> list[str]:
    """Names, with a number behind those that occur twice."""
    labels = []
    for i, name in enumerate(names):
        suffix = f"_{names[: i + 1].count(name)}" if names.count(name) > 1 else ""
        labels.append(name + suffix)
    return labels


def _words(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")

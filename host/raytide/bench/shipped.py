"""Whether raytide runs as it was shipped: its kernels and its Python text against what git or the installer knows."""

from __future__ import annotations

import base64
import hashlib
import subprocess
from importlib import metadata
from pathlib import Path

import raytide
from raytide.errors import few_of

ROOT = Path(__file__).resolve().parents[3]  # of a checkout
_CODE = (".py", ".cl", ".json", ".npz")


def edited_reasons() -> list[str]:
    """Why a run is not of the closed class: files that were edited; empty where there are none."""
    edited = edited_files()
    if edited is None:
        return ["nothing tells whether files were edited: no git, no record of an installer"]
    return [f"edited: {few_of(edited)}"] if edited else []


def edited_files() -> list[str] | None:
    """Names of the files that are not as they were shipped; None where nothing can tell."""
    return against_git(ROOT) if (ROOT / ".git").exists() else against_record("raytide")


def against_git(root: Path) -> list[str] | None:
    """Against the last commit; new files in these folders count."""
    words = ["git", "-C", str(root), "status", "--porcelain", "--untracked-files=all", "--", "cl", "host/raytide"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return [line[3:] for line in done.stdout.splitlines()] if done.returncode == 0 else None


def against_record(name: str) -> list[str] | None:
    """Against the hashes that the installer of the package `name` kept, where this is that package."""
    try:
        package = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None
    files = [one for one in package.files or () if one.suffix in _CODE and one.hash and one.hash.mode == "sha256"]
    own = Path(raytide.__file__).resolve()
    if not any(Path(str(one.locate())).resolve() == own for one in files):
        return None
    return [str(one) for one in files if one.hash and sha256_of(Path(str(one.locate()))) != one.hash.value]


def sha256_of(path: Path) -> str | None:
    """As a record writes it: URL-safe base64 without padding; None where the file is gone."""
    try:
        digest = hashlib.sha256(path.read_bytes()).digest()
    except OSError:
        return None
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode()

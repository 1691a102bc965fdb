"""What the package has besides the environment in /usr/lib/compd, made from what defines it: `debian/contents.py`.

Run by that environment's Python in the source, before debhelper, which reads these files in debian/.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
import textwrap
from datetime import UTC, datetime
from email.utils import format_datetime
from importlib.metadata import Distribution, distributions
from pathlib import Path

from compd.installation import own_program, shipped_file
from compd.release import __version__
from docs.generate.manual_pages import manual_pages

DEBIAN = Path(__file__).parent
# The file of each of systemd/ by the name that debhelper knows it by.
SYSTEM_FILES = {
    "compd.service": "compd.service",
    "compd-page.service": "compd.compd-page.service",
    "compd.rules": "compd.udev",
    "compd.sysusers": "compd.sysusers",
}
COMPLETIONS = {
    "bash": "usr/share/bash-completion/completions/compd",
    "zsh": "usr/share/zsh/vendor-completions/_compd",
    "fish": "usr/share/fish/vendor_completions.d/compd.fish",
}
CONFIGURATION = "/etc/compd"
UNRELEASED = "Unreleased"


def main() -> None:
    """Write the files."""
    for name, written in SYSTEM_FILES.items():
        (DEBIAN / written).write_text(shipped_file(name, own_program()))
    (DEBIAN / "compd.dirs").write_text(f"{CONFIGURATION}\n")
    (DEBIAN / "directories").write_text(" ".join(removed_directories()))
    for name, text in manual_pages().items():
        (DEBIAN / name).write_text(text)
    (DEBIAN / "compd.manpages").write_text("debian/*.1\n")
    for shell, path in COMPLETIONS.items():
        staged = DEBIAN / "completions" / path
        staged.parent.mkdir(parents=True, exist_ok=True)
        staged.write_text(completion(shell))
    (DEBIAN / "compd.install").write_text("debian/completions/* /\n")
    built = datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), UTC)
    (DEBIAN / "changelog").write_text(changelog(Path("CHANGELOG.md").read_text(), built))
    (DEBIAN / "copyright").write_text(copyright_text(Path("LICENSE").read_text()))
    (DEBIAN / "python-dependency").write_text(python_dependency())


def completion(shell: str) -> str:
    """The script that a shell reads when it first completes a command line of compd."""
    environment = os.environ | {"_COMPD_COMPLETE": f"source_{shell}"}
    done = subprocess.run([own_program()], env=environment, check=True, capture_output=True, text=True)
    script = done.stdout.lstrip()
    # zsh looks at the first line alone for what a file completes, and calls the file in place of the function once
    return f'{script}_compd_completion "$@"\n' if shell == "zsh" else script


def removed_directories() -> list[str]:
    """The directories that the units name, and the configuration: what a purge removes."""
    units = "".join(shipped_file(name, own_program()) for name in SYSTEM_FILES if name.endswith(".service"))
    return [CONFIGURATION] + [
        f"{above}/{name}"
        for setting, above in (("StateDirectory", "/var/lib"), ("CacheDirectory", "/var/cache"))
        for names in re.findall(rf"(?m)^{setting}=(.+)$", units)
        for name in names.split()
        if "/" not in name
    ]


def python_dependency() -> str:
    """The Python that the environment was made for, and no other."""
    major, minor = sys.version_info[:2]
    return f"python3 (>= {major}.{minor}~), python3 (<< {major}.{minor + 1}~)"


def changelog(text: str, built: datetime) -> str:
    """The sections of CHANGELOG.md in the form of deb-changelog(5). built : the time of what is not released yet."""
    system = platform.freedesktop_os_release()
    maintainer = re.search(r"(?m)^Maintainer: (.+)$", (DEBIAN / "control").read_text())
    sections = re.findall(r"(?ms)^## (\S+)(?: \((\S+)\))?\n(.*?)(?=^## |\Z)", text)
    released = [version for version, _, _ in sections]
    entries = []
    for title, date, body in sections:
        when = datetime.fromisoformat(date).replace(tzinfo=UTC) if date else built
        coming = f"{__version__}{'+' if __version__ in released else '~'}{built:%Y%m%d%H%M}"
        version = coming if title == UNRELEASED else title
        items = [
            textwrap.fill(" ".join(item.split()), 76, initial_indent="  * ", subsequent_indent="    ")
            for item in re.findall(r"(?ms)^- (.*?)(?=^- |\Z)", body)
        ]
        head = f"compd ({version}-1+deb{system['VERSION_ID']}) {system['VERSION_CODENAME']}; urgency=medium"
        entries += [head, "\n".join(items), f" -- {maintainer[1]}  {format_datetime(when)}"]
    return "\n\n".join(entries) + "\n"


def copyright_text(license_text: str) -> str:
    """The licence of compd, and the names of those of the packages beside it, in the form of DEP 5."""
    title, notice, *paragraphs = license_text.strip().split("\n\n")
    bundled = sorted(f" {other.name} {other.version}: {license_of(other)}" for other in distributions())
    return "\n".join(
        [
            "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/",
            "Upstream-Name: compd",
            "Comment: The environment in /usr/lib/compd has these packages besides. Each keeps its",
            " licence in its directory NAME-VERSION.dist-info there.",
            *(line for line in bundled if not line.startswith(" compd ")),
            "",
            "Files: *",
            f"Copyright: {notice.removeprefix('Copyright (c) ')}",
            f"License: {title}",
            *(f" {line}" if line else " ." for line in "\n\n".join(paragraphs).split("\n")),
            "",
        ]
    )


def license_of(package: Distribution) -> str:
    """The name of the licence that a package states."""
    stated = package.metadata
    classified = [text.split(" :: ")[-1] for text in stated.get_all("Classifier", []) if text.startswith("License ::")]
    name = stated.get("License-Expression") or ", ".join(classified) or stated.get("License") or "see there"
    return name.split("\n")[0]


if __name__ == "__main__":
    main()

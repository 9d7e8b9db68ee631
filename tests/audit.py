"""Known vulnerabilities in what users install: ``python -m tests.audit [--required] [OPTION ...]`` (``make audit``).

pip-audit reports "No known vulnerabilities found" and exits with 0 when its service has heard of none of the packages,
as a mirror of the index may not have. So the service is first asked about a release whose vulnerabilities are known
everywhere: what does not know those clears nobody, and the audit says that it was skipped, and why (with
``--required`` it fails).

What is audited is chefbotd's own closure of dependencies, with every extra that users install, as installed here.
Further options go to pip-audit.
"""

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from rich.console import Console

DEVELOPERS = frozenset({"dev", "docs", "fuzz", "release"})
"""Extras that nobody installs on a robot; every other one is audited."""

KNOWN_BAD = {"jinja2": "2.10"}
"""Its sandbox can be left (CVE-2019-10906)."""

PATIENCE_S = 300.0


@dataclass(frozen=True, slots=True)
class Answer:
    """What pip-audit made of these packages: its report by name, and the last that it said if there is none."""

    asked: Mapping[str, str]
    report: Mapping[str, Mapping[str, Any]]
    said: str

    def findings(self) -> Iterator[str]:
        """What is wrong with them, or keeps us from knowing: a line each."""
        for name, version in self.asked.items():
            told = self.report.get(name)
            if told is None:
                yield f"{name} {version}: no answer ({self.said})"
            elif "skip_reason" in told:
                yield f"{name} {version}: {told['skip_reason']}"
            else:
                yield from (_tell(name, version, each) for each in told["vulns"])

    @property
    def knows_vulnerabilities(self) -> bool:
        """Whether at least one was named."""
        return any(told.get("vulns") for told in self.report.values())


def _tell(name: str, version: str, vulnerability: Mapping[str, Any]) -> str:
    names = ", ".join([vulnerability["id"], *vulnerability.get("aliases", ())])
    fixed = ", ".join(vulnerability["fix_versions"]) or "no version yet"
    return f"{name} {version}: {names}, fixed in {fixed}"


def users_extras(name: str = "chefbotd") -> tuple[str, ...]:
    """Every extra that users may install."""
    return tuple(sorted(set(metadata.metadata(name).get_all("Provides-Extra") or ()) - DEVELOPERS))


def closure(name: str = "chefbotd", extras: Sequence[str] | None = None) -> dict[str, str]:
    """Name and version of all that ``name`` with these extras (None: every one of users) needs here, without itself.

    It is the installed version; the oldest that is allowed of what is not installed here.
    """
    extras = users_extras(name) if extras is None else extras
    found: dict[str, str] = {}
    waiting = [(name, tuple(extras))]
    seen = set(waiting)
    while waiting:
        parent, chosen = waiting.pop()
        for text in metadata.requires(parent) or ():
            need = Requirement(text)
            if need.marker and not any(need.marker.evaluate({"extra": extra}) for extra in ("", *chosen)):
                continue
            child = (canonicalize_name(need.name), tuple(sorted(need.extras)))
            installed = _installed(need.name)
            found[child[0]] = installed or _oldest(need)
            if installed is not None and child not in seen:
                seen.add(child)
                waiting.append(child)
    return dict(sorted(found.items()))


def _installed(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _oldest(need: Requirement) -> str:
    versions = [each.version for each in need.specifier if each.operator in (">=", "==", "~=")]
    if not versions:
        raise ValueError(f"{need} is not installed, and no version of it can be looked up")
    return versions[0]


def ask(packages: Mapping[str, str], options: Sequence[str] = ()) -> Answer:
    """Let pip-audit look these releases up, without what it remembers from before."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-audit-") as folder:
        pins = Path(folder) / "requirements.txt"
        pins.write_text("".join(f"{name}=={version}\n" for name, version in packages.items()))
        command = [sys.executable, "-m", "pip_audit", "--no-deps", "--disable-pip", "--format", "json"]
        command += ["--progress-spinner", "off", "--desc", "off", "--aliases", "on", "--cache-dir", folder]
        command += ["--requirement", str(pins), *options]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    if done.returncode not in (0, 1):
        raise ValueError(f"pip-audit ended with {done.returncode}: {done.stderr.strip()}")
    told = json.loads(done.stdout)["dependencies"] if done.stdout.strip() else ()
    last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
    return Answer(packages, {canonicalize_name(each["name"]): each for each in told}, last)


def main(arguments: Sequence[str]) -> int:
    """0: nothing known against any package, or nobody to ask; 1: something is, or must have been asked."""
    console = Console(soft_wrap=True, highlight=False, markup=False)
    if importlib.util.find_spec("pip_audit") is None:
        console.print("pip-audit is not installed: pip install 'chefbotd[dev]'")
        return 1
    options = [argument for argument in arguments if argument != "--required"]
    known = ask(KNOWN_BAD, options)
    if not known.knows_vulnerabilities:
        console.print(
            "skipped: nobody can be asked for vulnerabilities here: " + next(known.findings(), "none known")
        )
        return int(options != list(arguments))
    answer = ask(closure(), options)
    findings = list(answer.findings())
    for line in (*findings, f"{len(answer.asked)} packages looked up, {len(findings)} findings"):
        console.print(line)
    return int(bool(findings))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

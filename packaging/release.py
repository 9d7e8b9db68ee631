"""Builds and checks every distribution, and writes the release's notes: python packaging/release.py [OPTION ...].

    --repository URL   where the sources are published: links and pictures of the READMEs lead there
    --email ADDRESS    the authors' address in the metadata
    --quick            install the core alone, without its extras and the add-ons

What is published is in dist/release. Nothing is uploaded.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
import tomllib
import zipfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from email.parser import Parser
from pathlib import Path, PurePosixPath

TREE, OUT = Path("build/release/tree"), Path("dist/release")
ADD_ONS = tuple(f"addons/chefbot-{name}" for name in ("vda5050", "fleet", "ros2", "speech", "devtools"))
PYTHONS = ("3.11", "3.12", "3.13")
METADATA_VERSION = "2.4"
FOR_DEVELOPERS = {"dev", "docs", "fuzz", "release"}
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:|#)([^)\s]+)\)")
WANTED = ("Author-Email", "Keywords", "License-Expression", "License-File", "Requires-Python", "Summary")
"""What each distribution's metadata has to say."""


def main(arguments: Sequence[str]) -> int:
    """Build, check, install, and write the notes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repository", default="")
    parser.add_argument("--email", required=True)
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args(arguments)
    copy_sources()
    version = re.findall(
        r'__version__ = "(.+)"', (TREE / "chefbotd/__init__.py").read_text(encoding="utf-8")
    )[0]
    shutil.rmtree(OUT, ignore_errors=True)
    for folder in (".", *ADD_ONS):
        prepare(TREE / folder, folder, asked.repository.rstrip("/"), version, asked.email)
        print(f"building {folder}", flush=True)
        run(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(OUT), str(TREE / folder))
    built = sorted(path for path in OUT.iterdir() if path.suffix in (".whl", ".gz"))
    problems = [f"{path.name}: {problem}" for path in built for problem in check(path, version)]
    if len(built) != 2 * (1 + len(ADD_ONS)):
        problems.append(f"{len(built)} files were built")
    if problems:
        print("\n".join(problems))
        return 1
    run(sys.executable, "-m", "twine", "check", "--strict", *map(str, built))
    for path in built:
        if path.suffix == ".gz":
            run(sys.executable, "-m", "pyroma", "--min", "9", str(path))
    install_everywhere(version, quick=asked.quick)
    notes = changes(Path("CHANGELOG.md").read_text(encoding="utf-8"), version)
    (OUT / "NOTES.md").write_text(notes, encoding="utf-8")
    print(
        f"{len(built)} files and NOTES.md in {OUT}. To publish them: twine upload {OUT}/*.whl {OUT}/*.tar.gz"
    )
    if not asked.repository:
        print(
            "Not ready to publish: without REPOSITORY=https://... the READMEs have no links and no pictures."
        )
    return 0


def run(*words: str) -> None:
    """Run a program; what it prints is shown if it fails, and ends this one."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(words)}\n{done.stdout}{done.stderr}")


def copy_sources() -> None:
    """Every file that git knows, as it is now, so that nothing else can get into what is built."""
    shutil.rmtree(TREE, ignore_errors=True)
    for name in subprocess.run(
        ["git", "ls-files", "-z"], capture_output=True, text=True, check=True
    ).stdout.split("\0"):
        if name and Path(name).is_file():
            (TREE / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(name, TREE / name)


def prepare(tree: Path, folder: str, repository: str, version: str, email: str) -> None:
    """Give a distribution the README that an index can show, and the addresses that are known."""
    page = tree / "README.md"
    page.write_text(
        for_index(page.read_text(encoding="utf-8"), folder, repository, version), encoding="utf-8"
    )
    project = tree / "pyproject.toml"
    text = with_email(project.read_text(encoding="utf-8"), email)
    if repository:
        urls = {"Repository": "", "Changelog": f"/blob/v{version}/CHANGELOG.md", "Issues": "/issues"}
        rows = [f'{name} = "{repository}{path}"' for name, path in urls.items()]
        text = "\n".join([text, "[project.urls]", *rows, ""])
    project.write_text(text, encoding="utf-8")


def with_email(project: str, email: str) -> str:
    """The text of a pyproject.toml whose only author has this address."""
    text, count = re.subn(
        r'^authors = \[\{ name = "([^"]+)" \}\]$',
        lambda match: f'authors = [{{ name = "{match[1]}", email = "{email}" }}]',
        project,
        flags=re.MULTILINE,
    )
    if count != 1:
        sys.exit(f"expected a line with one author and no address in pyproject.toml, found {count}")
    return text


def for_index(text: str, folder: str, repository: str, version: str) -> str:
    """A README whose relative links and pictures lead into the repository; without one, links are plain words."""

    def replaced(match: re.Match[str]) -> str:
        is_picture, words, target = match.groups()
        inner = LINK.sub(replaced, words)
        if not repository:
            return "" if is_picture else inner
        path, _, heading = target.partition("#")
        parts: list[str] = []
        for part in PurePosixPath(folder, path).parts:
            parts = parts[:-1] if part == ".." else [*parts, part]
        kind = "raw" if is_picture else "blob"
        anchor = f"#{heading}" if heading else ""
        return f"{is_picture}[{inner}]({repository}/{kind}/v{version}/{'/'.join(parts)}{anchor})"

    return LINK.sub(replaced, text)


def check(path: Path, version: str) -> Iterator[str]:
    """What is wrong with a file that was built: its contents and its metadata."""
    names, metadata = contents(path)
    tops = {PurePosixPath(name).parts[0] for name in names}
    for name in names:
        if re.search(r"__pycache__|\.py[co]$|(^|/)(build|\.venv|\.git)/|\.so$", name):
            yield f"{name} does not belong there"
    if "addons" in tops:
        yield "it has add-ons, which are distributions of their own"
    said = Parser().parsestr(metadata)
    if (said["Version"], said["Metadata-Version"]) != (version, METADATA_VERSION):
        yield f"version {said['Version']}, metadata {said['Metadata-Version']}: expected {version}, {METADATA_VERSION}"
    yield from (f"its metadata has no {key}" for key in WANTED if not said[key])
    classifiers = said.get_all("Classifier") or []
    for python in PYTHONS:
        if f"Programming Language :: Python :: {python}" not in classifiers:
            yield f"its metadata does not name Python {python}"
    if dead := [match[3] for match in LINK.finditer(str(said.get_payload()))]:
        yield f"links that an index cannot follow: {', '.join(dead)}"
    if not any(PurePosixPath(name).name == "LICENSE" for name in names):
        yield "it has no LICENSE"


def contents(path: Path) -> tuple[list[str], str]:
    """The names of the files, below an sdist's own folder, and the metadata."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as wheel:
            (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
            return wheel.namelist(), wheel.read(name).decode()
    with tarfile.open(path) as sdist:
        names = [member.name.partition("/")[2] for member in sdist.getmembers() if member.isfile()]
        file = sdist.extractfile(f"{path.name.removesuffix('.tar.gz')}/PKG-INFO")
        assert file is not None
        return names, file.read().decode()


def install_everywhere(version: str, *, quick: bool) -> None:
    """Install the core, the core with each extra, and each add-on into an environment of its own, for each Python."""
    extras = tomllib.loads((TREE / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    whats = ["chefbotd"]
    if not quick:
        whats += [f"chefbotd[{extra}]" for extra in sorted(extras.keys() - FOR_DEVELOPERS)]
        whats += [Path(add_on).name for add_on in ADD_ONS]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for python in PYTHONS:
            program = shutil.which(f"python{python}") or ""
            if (
                not program
                or subprocess.run([program, "--version"], capture_output=True, check=False).returncode
            ):
                print(f"Python {python} is not here: nothing was installed with it")
                continue
            for done in [pool.submit(install, program, what, version) for what in whats]:
                done.result()


def install(python: str, what: str, version: str) -> None:
    """Into a clean environment; its packages fit together, and the programs start."""
    began_s = time.monotonic()
    venv = Path("build/release/venvs", f"{Path(python).name}-{what}")
    shutil.rmtree(venv, ignore_errors=True)
    run(python, "-m", "venv", "--without-pip", str(venv))
    pip = (sys.executable, "-m", "pip", "--python", str(venv / "bin" / "python"))
    name, _, extra = what.partition("[")
    need = f"{name}{'[' * bool(extra)}{extra}=={version}"
    found = ("--find-links", str(OUT), "--constraint", "build/constraints.txt")
    run(*pip, "install", "--quiet", "--no-compile", *found, need)
    run(*pip, "check")
    run(str(venv / "bin" / "chefbotd"), "--version")
    run(str(venv / "bin" / "chefbotctl"), "--help")
    if what == "chefbotd":
        lines = subprocess.run(
            [str(venv / "bin" / "python"), "-P", "tests/core_install.py"],
            capture_output=True,
            text=True,
            check=False,
        )
        if lines.returncode:
            sys.exit(f"a command fails where no extra is installed:\n{lines.stdout[-2000:]}{lines.stderr}")
    shutil.rmtree(venv)
    print(f"installed {what} with {Path(python).name} in {time.monotonic() - began_s:.0f} s", flush=True)


def changes(changelog: str, version: str) -> str:
    """The section of this version; that of what is unreleased where it has none yet.

    Raises:
        SystemExit: it has neither.
    """
    sections = dict(re.findall(r"^## (\S+)[^\n]*\n(.*?)(?=^## |\Z)", changelog, re.MULTILINE | re.DOTALL))
    for name in (version, "Unreleased"):
        if name in sections:
            return f"# chefbotd {version}\n\n{sections[name].strip()}\n"
    sys.exit(f"CHANGELOG.md has neither '## {version}' nor '## Unreleased'")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

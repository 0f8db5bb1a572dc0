# SPDX-License-Identifier: Apache-2.0
"""README and docs/: their code runs, their links are valid, and their printed parts are current."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from markdown.extensions.toc import slugify

from benchmarks.markdown import replace_tables
from docs.scripts.generate import pages, texts
from gdfe_ros.cli import COMMANDS
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.terms.term import Term

ROOT = Path(__file__).resolve().parents[1]
PAGES = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in pages()}


def blocks(language: str) -> list[pytest.param]:
    """Return the code blocks of a language, each with its page and number as name."""
    found = []
    for name, text in PAGES.items():
        code = re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.S | re.M)
        found += [pytest.param(item, id=f"{name}-{number}") for number, item in enumerate(code)]
    return found


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings."""
    plain = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    return {slugify(head.replace("`", ""), "-") for head in re.findall(r"^#+ (.*)$", plain, flags=re.M)}


def links(text: str) -> list[str]:
    """Return the targets of a page's links and pictures."""
    plain = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    return re.findall(r"\]\(([^)\s]+)\)", plain)


@pytest.mark.parametrize("code", blocks("python"))
def test_python_code_runs(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every Python block and its tests run without an exception, and each block binds at least one name."""
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(compile(code, "page", "exec"), names)
    assert len(names) > len({"__builtins__"}), code
    for name in [name for name in names if name.startswith("test_")]:
        names[name]()


@pytest.mark.parametrize("text", [item for item in blocks("yaml") if item.values[0].startswith("name:")])
def test_whole_scenes_are_valid(text: str) -> None:
    """Every complete scene on a page is valid."""
    assert scene_from_text(text).mesh.n_cells > 0


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    """Every link inside of the repository leads to an existing file and heading."""
    for link in links(PAGES[name]):
        if link.startswith(("http://", "https://")):
            continue
        path, _, anchor = link.partition("#")
        target = ((ROOT / name).parent / path).resolve() if path else ROOT / name
        assert target.is_file(), link
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), link


@pytest.mark.parametrize("name", ["docs/architecture.md", "docs/contributing.md"])
def test_what_is_to_be_found_in_a_file_is_there(name: str) -> None:
    """In a table with the columns `file` and `symbol`, every file defines the symbol beside it."""
    rows = re.findall(r"\| `(\S+\.py)` \| `(\w+)` \|$", PAGES[name], flags=re.M)
    assert len(rows) >= 10
    for file, symbol in rows:
        text = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"^\s*((class|def) {symbol}\b|{symbol}(:.*)? = )", text, flags=re.M), (file, symbol)


@pytest.mark.parametrize("name", PAGES)
def test_commands_exist(name: str) -> None:
    """Every subcommand, make target and module on the pages exists."""
    text, makefile = PAGES[name], (ROOT / "Makefile").read_text()
    assert set(re.findall(r"(?:`|^|/)gdfe ([a-z]+)", text, flags=re.M)) <= set(COMMANDS)
    for target in re.findall(r"`make ([a-z-]+)", text) + re.findall(r"^make ([a-z-]+)", text, flags=re.M):
        assert re.search(rf"^{target}:", makefile, flags=re.M), target
    for module in re.findall(r"python -m ((?:benchmarks|docs|gdfe_ros)[\w.]*)", text):
        path = ROOT / module.replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file(), module


def test_what_is_printed_is_up_to_date() -> None:
    """Tables and references printed from the code and the kept reports are those on the pages (remedy: make docs)."""
    printed = texts()
    assert [name for name, text in PAGES.items() if replace_tables(text, printed) != text] == []
    shown = "".join(PAGES.values())
    assert [name for name in printed if f"<!-- end {name} -->" not in shown] == []


def test_the_whole_contract_of_a_term_is_on_its_page() -> None:
    """Every public member of `Term` is in the tables of docs/terms.md."""
    page = (ROOT / "docs" / "terms.md").read_text(encoding="utf-8")
    assert [name for name in vars(Term) if name[0] != "_" and f"`{name}" not in page] == []


def test_readme_is_a_page() -> None:
    """README has at most 150 lines, with shell commands, code, a scene, and one table of measurements."""
    readme = PAGES["README.md"]
    assert len(readme.splitlines()) <= 150
    assert readme.count("<!-- end ") == 1
    assert all(f"```{language}" in readme for language in ("sh", "python", "yaml"))


@pytest.mark.parametrize("text", blocks("sh"))
def test_shell_code_calls_what_is_there(text: str) -> None:
    """Every command in shell code is one of ours, of ROS or of every machine."""
    lines = (shlex.split(line, comments=True) for line in text.replace("\\\n", " ").splitlines())
    programs = {words[0].removeprefix(".venv/bin/") for words in lines if words and "=" not in words[0]}
    assert programs <= {".", "make", "gdfe", "sim_node", "python", "ros2", "git"}


def test_no_file_of_somewhere_else_is_cited() -> None:
    """Outside of the solver, no source file cites the document DESIGN, which is not in this repository."""
    sources = [path for room in ("gdfe_ros", "benchmarks", "docs") for path in (ROOT / room).rglob("*.py")]
    citing = [path for path in sources if re.search(r"\bDESIGN\b", path.read_text(encoding="utf-8"))]
    assert [path for path in citing if "solver" not in path.parts] == []


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    """The site builds without a warning, and every formula becomes MathML."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    html = (tmp_path / "theory" / "solve" / "index.html").read_text(encoding="utf-8")
    assert html.count("<math") > 50
    for page in tmp_path.rglob("*.html"):
        text = re.sub(r"<(pre|code|math).*?</\1>", "", page.read_text(encoding="utf-8"), flags=re.S)
        assert "$" not in re.sub(r"<[^>]*>", "", text.partition("<body")[2]), page

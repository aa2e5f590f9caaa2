"""What the documentation names is there, and its examples run."""

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

import der

CLONE = Path(__file__).parent.parent
PAGES = [*CLONE.glob("*.md"), *CLONE.glob("docs/**/*.md"), *CLONE.glob("validation/*.md")]
NAMES = {str(page.relative_to(CLONE)): page for page in PAGES}
NOW = {
    name: page for name, page in NAMES.items() if name != "CHANGELOG.md"
}  # of today's code alone
EXAMPLES = [name for name, page in NAMES.items() if "```python" in page.read_text()]
ROOTS = "der|validation|scenarios|tests"


def found(pattern, page):
    """What a pattern finds in a page, each once."""
    return sorted(set(re.findall(pattern, page.read_text(), re.DOTALL)))


@pytest.mark.parametrize("name", NAMES)
def test_links_lead_somewhere(name):
    """Every relative link, of pictures too."""
    links = found(r"\]\(([^)\s#]+)[^)]*\)", NAMES[name])
    local = [link for link in links if "://" not in link]
    assert [link for link in local if not (NAMES[name].parent / link).exists()] == []


@pytest.mark.parametrize("name", NOW)
def test_paths_exist(name):
    """Files and folders by their path in the repository; a star stands for any letters."""
    paths = found(rf"\b((?:{ROOTS})/[\w/.*-]*[\w*/])", NOW[name])
    assert [path for path in paths if not list(CLONE.glob(path))] == []


@pytest.mark.parametrize("name", NOW)
def test_modules_that_are_run_exist(name):
    """`python -m NAME`."""
    modules = found(r"python -m ((?:validation|scenarios|der)[\w.]*)", NOW[name])
    modules = [module for module in modules if module != "scenarios.NAME"]
    assert [module for module in modules if find_spec(module) is None] == []


@pytest.mark.parametrize("name", NOW)
def test_public_names_exist(name):
    """`der.fold` and its like, where they stand in code."""
    names = found(r"\bder\.([A-Za-z_]+)\b(?!/)", NOW[name])
    assert [one for one in names if not hasattr(der, one) and find_spec(f"der.{one}") is None] == []


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name, tmp_path, monkeypatch):
    """Every block of Python in its page, in a namespace of its own."""
    monkeypatch.chdir(tmp_path)
    for block in re.findall(r"```python\n(.*?)```", NAMES[name].read_text(), re.DOTALL):
        exec(compile(block, name, "exec"), {"__name__": "example"})  # a page of this repository


def test_the_readme_is_short():
    """At most 120 lines and 1,000 words; everything else is in docs/."""
    text = (CLONE / "README.md").read_text()
    assert len(text.splitlines()) <= 120
    assert len(text.split()) <= 1000

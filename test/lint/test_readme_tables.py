"""READMEs of the packages: every parameter, topic and service that a program of the package has is in them."""

import ast
import re

import documents
import pytest
import sources

PACKAGES = sources.list_packages()
MAKERS = ("Publisher", "Subscriber", "Service")


def calls_in(package, names):
    """Calls of functions or classes of these names in the package's modules, as (path, call)."""
    for path in sources.list_source_modules().values():
        if sources.package_of(path) == package:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call):
                    called = getattr(node.func, "attr", getattr(node.func, "id", ""))
                    if called in names:
                        yield path, node


def texts_of(node):
    """Text constants of an expression: of "/hero_%d" % number, and of namespace + "/odom"."""
    return [
        part.value
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    ]


def read_words(package):
    """Everything between backticks in the README of a package."""
    lines = documents.read_lines(sources.ROOT / package / "README.md")
    return {word for line in lines for word in documents.INLINE.findall(line.text)}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_parameter_of_a_program_is_in_the_readme(package):
    words = read_words(package)
    for path, call in calls_in(package, ("read_parameters",)):
        keys = [key.value for key in getattr(call.args[0], "keys", []) if isinstance(key, ast.Constant)]
        for key in keys:
            assert key in words or f"~{key}" in words, (
                f"{path.name}: parameter {key} is not in the README of {package}"
            )


@pytest.mark.parametrize("package", PACKAGES)
def test_every_topic_and_service_of_a_program_is_in_the_readme(package):
    words = read_words(package)
    for path, call in calls_in(package, MAKERS):
        # The last part of the name; what stands before it (a namespace) is often a variable.
        for text in texts_of(call.args[0])[-1:] if call.args else []:
            last = re.split(r"[/~]", text)[-1]
            if re.match(r"^\w+$", last):
                found = any(re.split(r"[/~]", word)[-1] == last for word in words)
                assert found, f"{path.name}:{call.lineno}: {text} is not in the README of {package}"


def test_parameters_and_topics_are_found_at_all():
    assert len(list(calls_in("hero_examples", ("read_parameters",)))) >= 5
    assert len([call for package in PACKAGES for call in calls_in(package, MAKERS)]) >= 15

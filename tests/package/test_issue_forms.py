"""The forms for issues: what they ask for exists, and a report of a fault has what is needed to repeat it."""

from __future__ import annotations

import re
from typing import Any

import pytest
from command_line import HOME, call, commands

yaml = pytest.importorskip("yaml", reason="comes with the documentation")

FORMS = sorted((HOME / ".github/ISSUE_TEMPLATE").glob("[!c]*.yml"))


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_a_form_has_what_the_tracker_needs(path: Any) -> None:
    form = yaml.safe_load(path.read_text())
    assert {"name", "description", "title", "labels", "body"} == set(form)
    fields = [each for each in form["body"] if each["type"] != "markdown"]
    names = [each["id"] for each in fields]
    assert len(set(names)) == len(names) and all(each["attributes"]["label"] for each in fields)
    assert any(each.get("validations", {}).get("required") for each in fields)


def test_the_commands_that_forms_name_exist() -> None:
    assert [each.stem for each in FORMS] == ["bug", "feature", "law"]
    for path in FORMS:
        for name, option in re.findall(r"`cfddem (\w+)( --\w+)?`", path.read_text()):
            assert name in commands() and option.strip() in call(name, "--help").out
    bug = yaml.safe_load((HOME / ".github/ISSUE_TEMPLATE/bug.yml").read_text())
    required = {each["id"] for each in bug["body"] if each.get("validations", {}).get("required")}
    assert required == {"what", "how", "doctor"}
